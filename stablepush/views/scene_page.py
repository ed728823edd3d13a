"""A page to try pushes on: a scene whose parts can be moved, and what the load of a push does in the cone of its contact."""

from __future__ import annotations

from typing import Any

import numpy as np

from stablepush.core import FloatArray, InputError
from stablepush.geometry import cor_from_twist, transform_points
from stablepush.planning import PlanningProblem, PlanResult, scene_to_json
from stablepush.stability import stable_region
from stablepush.surfaces import LimitSurface, PolynomialLimitSurface
from stablepush.views.pages import render, script

#: Points of the path of a push.
_POINTS = 30


def scene_html(
    problem: PlanningProblem,
    result: PlanResult | None = None,
    surface: LimitSurface | None = None,
    title: str = "Try pushes",
) -> str:
    """Return a page on which the parts of a scene and a rotation centre can be moved, by mouse, touch or keys.

    For each contact it shows whether the push about the rotation centre is stable, its margin, the load in the friction cone,
    what gives first, the way of the slider, and what it runs into. The page works that out itself: ``F = H_inv(V)`` by Newton's
    method on the polynomial, or the sum over support points. It saves the moved scene as ``scene/1``. Effects of the table are
    not in it.

    Parameters
    ----------
    problem : PlanningProblem
        With bounds.
    result : PlanResult, optional
        A plan, drawn as the path of the centre of mass.
    surface : LimitSurface, optional
        In place of the problem's.

    Raises
    ------
    InputError
        For surfaces of other kinds than polynomials and support points, and contacts of more than two points.
    """
    chosen = problem.surface if surface is None else surface
    for number, contact in enumerate(problem.contacts):
        if len(contact.points) > 2:
            raise InputError(f"contacts[{number}]", "expected one or two points for this page", len(contact.points))
    cor, sense = _first_turn(problem, chosen)
    data = {
        "scene": scene_to_json(problem),
        "surface": _surface(chosen),
        "frame": _frame(problem),
        "size": problem.slider.radius,
        "radius": problem.finger_radius,
        "fingers": [_tips(problem, k).tolist() for k in range(len(problem.contacts))],
        "plan": [] if result is None else [p.poses(np.linspace(0, p.duration, _POINTS))[:, :2].tolist() for p in result.pushes],
        "cor": cor,
        "sense": sense,
    }
    warning = ""
    key = "Green: the slider sticks to the fingers all the way; red: it does not."
    if problem.acting_effects:
        level = f"The scene has effects that this page does not reckon with: {', '.join(problem.acting_effects)}. "
        warning = f"{level}Its stability is that of a level, even table; plot_headings draws the true one."
    label = "A slider with its rotation centre, start, goal and obstacles, which can be moved"
    return render("scene.html", title=title, label=label, key=key, warning=warning, data=script(data))


def _surface(surface: LimitSurface) -> dict[str, Any]:
    rho = surface.characteristic_length
    if surface.point_loads is not None:
        points, loads = surface.point_loads
        return {"kind": "support", "rho": rho, "points": points.tolist(), "loads": loads.tolist()}
    if not isinstance(surface, PolynomialLimitSurface):
        raise InputError("surface", "expected a polynomial or support points", surface.kind)
    return {
        "kind": "polynomial", "rho": rho, "degree": surface.degree,
        "exponents": np.asarray(surface.exponents).tolist(), "coefficients": np.asarray(surface.coefficients).tolist(),
    }  # fmt: skip


def _first_turn(problem: PlanningProblem, surface: LimitSurface) -> tuple[list[float], int]:
    """A stable rotation centre (2,) in B to begin with, and its sense; one beside the slider if there is none."""
    region = stable_region(surface, problem.contacts[0])
    size = 3 * problem.slider.radius
    for sense in (1, -1):
        inside = [p for p in region.polygons(sense, size) if p.area > 0]
        if inside:
            largest = max(inside, key=lambda p: float(p.area))
            return list(largest.representative_point().coords[0]), sense
    center, _ = cor_from_twist(np.array((0.0, 1.0, 1.0 / size)))
    return center.tolist(), 1


def _tips(problem: PlanningProblem, number: int) -> FloatArray:
    """Centres (k, 2) of the fingers of a contact in B."""
    contact = problem.contacts[number]
    return contact.points - problem.finger_radius * contact.normals


def _frame(problem: PlanningProblem) -> list[float]:
    """What the page shows (xmin, ymin, xmax, ymax) in m: the bounds, or all that is there, with room for a rotation centre."""
    if problem.bounds is not None:
        low, high = problem.bounds[:2], problem.bounds[2:]
    else:
        bodies = [transform_points(pose, problem.slider.vertices) for pose in (problem.start, problem.goal)]
        points = np.concatenate([*bodies, *problem.obstacles])
        low, high = points.min(axis=0) - 3 * problem.slider.radius, points.max(axis=0) + 3 * problem.slider.radius
    padding = 0.05 * float((high - low).max())
    return [*(low - padding).tolist(), *(high + padding).tolist()]
