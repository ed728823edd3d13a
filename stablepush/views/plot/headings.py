"""Stable rotation centres on a table whose effects make them depend on the slider's heading."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray, InputError, check_array, check_count, check_number
from stablepush.geometry import normalize_wrench, rotate_vectors, twist_from_cor
from stablepush.planning import PlanningProblem, PushLoads, loads_of
from stablepush.views.plot.canvas import PUSHER, SENSES, SLIDER, draw_contact, figure_of, fill, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Points of the grid of rotation centres along a side.
_GRID = 240
_COLUMNS = 4


def plot_headings(
    problem: PlanningProblem,
    contact: int = 0,
    headings: int = 8,
    place: ArrayLike = (0.0, 0.0),
    extent: float | None = None,
    title: str = "Stable rotation centres by heading",
    ax: ArrayLike | None = None,
) -> np.ndarray:
    """Draw which rotation centres are stable at each of several headings, in the COR plane of B (m).

    Filled: the load ``F(V, x, theta)`` of the push, with the problem's effects, is in the cone of the contact at its start.
    Dashed: the same without effects, at any heading. A planner asks more: that it is so all along the push, with what is
    uncertain. An arrow points down the slope.

    Parameters
    ----------
    problem : PlanningProblem
        With effects that plans reckon with: tilt, anisotropy, friction by place or speed, mass.
    contact : int
        Number of the contact.
    headings : int
        How many headings are drawn, spread evenly over a turn.
    place : array-like, shape (2,)
        Place of the slider in W, m.
    extent : float, optional
        Half side (m) of the squares shown, 5 radii of slider and contact by default.
    ax : array of axes, optional
        As many as ``headings``.

    Returns
    -------
    array of axes
    """
    loads = loads_of(problem)
    if loads is None:
        raise InputError("problem", "expected effects that change which pushes are stable")
    check_count(headings, "headings", most=64)
    if not 0 <= contact < len(problem.contacts):
        raise InputError("contact", f"expected 0 to {len(problem.contacts) - 1}", contact)
    at, touching = check_array(place, "place", (2,)), problem.contacts[contact]
    radius = max(touching.radius, problem.slider.radius)
    size = 5 * radius if extent is None else check_number(extent, "extent", positive=True)
    # as near to a square as rows of four allow
    fitting = [count for count in range(1, min(_COLUMNS, headings) + 1) if headings % count == 0]
    columns = next((count for count in fitting if count**2 >= headings), fitting[-1])
    rows = headings // columns
    shown = panels((3.1 * columns, 3.3 * rows + 0.6), rows, columns, ax, "compressed")
    line = np.linspace(-size, size, _GRID)
    centers = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    for number, axes in enumerate(np.ravel(shown)):
        heading = 2 * math.pi * number / headings
        _draw(axes, problem, loads, contact, np.array((*at, heading)), centers, line)
        fill(axes, problem.slider.polygon, facecolor=SLIDER, alpha=0.5, edgecolor="black", linewidth=1.0)
        draw_contact(axes, touching, 1.2 * radius)
        pull = rotate_vectors(-heading, np.array(loads.friction.external_force))
        if np.any(pull):
            down = 2.2 * radius * pull / np.linalg.norm(pull)
            axes.annotate("", xy=tuple(down), xytext=(0, 0), arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 1.4})
        axes.set(xlim=(-size, size), ylim=(-size, size), aspect="equal")
        axes.set_title(f"slider turned by {math.degrees(heading):.0f}°", fontsize=10)
        axes.tick_params(labelsize=7)
    _legend(shown, bool(np.any(loads.friction.external_force)))
    figure_of(shown).suptitle(f"{title} (x and y in B, m)", fontsize=11)
    return shown


def _draw(
    axes: Axes, problem: PlanningProblem, loads: PushLoads, number: int, pose: FloatArray, centers: FloatArray, line: FloatArray
) -> None:
    cone, surface = problem.contacts[number].cone(loads.rho), problem.surface
    for sense, _, color in SENSES:
        twists = twist_from_cor(centers, sense)
        twists = twists * (problem.speed / problem.push_speed(twists))[:, None]
        with_effects = cone.margin(normalize_wrench(loads.at(twists, np.tile(pose, (len(twists), 1))), loads.rho))
        level = cone.margin(normalize_wrench(surface.wrench(twists), loads.rho))
        shape = (len(line), len(line))
        axes.contourf(line, line, with_effects.reshape(shape), levels=(0.0, np.inf), colors=[color], alpha=0.6)
        axes.contour(line, line, level.reshape(shape), levels=(0.0,), colors=[color], linewidths=1.0, linestyles="dashed")


def _legend(shown: np.ndarray, slopes: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Patch | Line2D] = [Patch(color=color, alpha=0.6, label=word) for _, word, color in SENSES]
    entries.append(Line2D([], [], color="0.3", linestyle="dashed", label="without effects"))
    entries.append(Line2D([], [], color=PUSHER, marker=r"$\uparrow$", markersize=10, linestyle="none", label="contact, normal"))
    if slopes:
        entries.append(
            Line2D([], [], color="black", marker=r"$\downarrow$", markersize=10, linestyle="none", label="down the slope")
        )
    figure_of(shown).legend(
        handles=entries, loc="outside lower center", ncols=len(entries) if shown.shape[1] > 2 else 3, frameon=False, fontsize=9
    )
