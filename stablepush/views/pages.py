"""Self-contained HTML pages: the animation of a plan, and a report of the whole chain."""

from __future__ import annotations

import base64
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stablepush import __version__
from stablepush.core import FloatArray, InputError, first_least, shown
from stablepush.geometry import angle_between, compose, cor_from_twist, exp, transform_points, twist_from_cor, unit
from stablepush.mechanics import Pusher, PushTrace, Slide
from stablepush.objects import PushContact, Slider
from stablepush.planning import PlanningProblem, PlanResult, Push, pusher_in_transfer
from stablepush.stability import StabilityOracle, StableRegion
from stablepush.surfaces import LimitSurface
from stablepush.views.plot.canvas import PNG_DPI

#: Poses of the pusher that the page has for a change of contact.
_TRANSFER_POSES = 121
#: Rows of a motion that a page has, at most.
_MOTION_ROWS = 601
#: Cells of a map's margins along a side.
_CELLS = 101
#: Lines of the mesh of a limit surface.
_LATITUDES, _LONGITUDES = 37, 72
#: Places that the page has for a planned push.
_PUSH_PLACES = 21
#: Rows that each push of several has, at least.
_FEWEST_ROWS = 12


#: Share of its size to which a picture may shrink: small letters are 9 points, 12 px of a page.
_LEAST_SIZE = 0.85


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a report: title, text, rows of a table, a PNG picture, a link to a neighbouring file, and neighbouring pages side
    by side, each with a heading. ``folded``: open only once it is asked for."""

    title: str
    text: str = ""
    rows: Sequence[tuple[str, str]] = ()
    picture: str = ""
    link: str = ""
    link_text: str = ""
    pages: Sequence[tuple[str, str]] = ()
    folded: bool = False

    @classmethod
    def with_picture(cls, title: str, png: bytes, text: str = "", rows: Sequence[tuple[str, str]] = ()) -> Section:
        """Return a section whose picture stands in the page itself."""
        return cls(title, text, rows, base64.b64encode(png).decode())

    @property
    def least_width(self) -> int:
        """Width (px of a page) below which letters of the picture are too small to read."""
        # a PNG has its width in its bytes 16 to 19
        width = int.from_bytes(base64.b64decode(self.picture[:32])[16:20], "big")
        return round(_LEAST_SIZE * width * 96 / PNG_DPI)


def report_html(title: str, lead: str, sections: Sequence[Section]) -> str:
    """Return a report as one HTML page that needs no network."""
    return render("report.html", title=title, lead=lead, sections=sections)


def plan_html(problem: PlanningProblem, result: PlanResult, title: str = "Plan of stable pushes") -> str:
    """Return the animation of a plan as one HTML page that needs no network."""
    key = "" if result.success_probability is None else f"The plan {result.outlook}."
    label = "The slider and its pusher among obstacles"
    return render("plan.html", title=title, label=label, key=key, data=script(_plan_data(problem, result)))


def push_html(slider: Slider, pusher: Pusher, trace: PushTrace, title: str = "A push") -> str:
    """Return the animation of a simulated push as one HTML page that needs no network: poses, modes, rotation centres."""
    return _motion_page(slider, _push_rows(slider, pusher, trace, _MOTION_ROWS), title)


def execution_html(
    problem: PlanningProblem,
    pushers: Sequence[Pusher],
    traces: Sequence[PushTrace],
    result: PlanResult | None = None,
    title: str = "Pushes on a simulated rig",
) -> str:
    """Return the animation of pushes carried out one after the other, in the scene of a problem.

    ``pushers`` and ``traces``: of each push; ``result``: the plan that was followed.
    """
    rows: list[dict[str, Any]] = []
    share = max(_FEWEST_ROWS, 4 * _MOTION_ROWS // max(1, len(traces)))
    begin = 0.0
    for number, (pusher, trace) in enumerate(zip(pushers, traces, strict=True)):
        for entry in _push_rows(problem.slider, pusher, trace, share):
            rows.append({**entry, "t": begin + entry["t"], "push": number})
        begin = rows[-1]["t"]
    return _motion_page(problem.slider, rows, title, problem, result)


def slide_html(slider: Slider, slide: Slide, title: str = "A free slide") -> str:
    """Return the animation of a free slide as one HTML page that needs no network."""
    twists = np.concatenate((slide.twists[:-1], slide.direction[None]))
    chosen = _spread(len(slide.t), _MOTION_ROWS)
    return _motion_page(slider, _motion_rows(slider, slide.t[chosen], slide.poses[chosen], twists[chosen]), title)


def surface_html(
    surface: LimitSurface,
    wrenches: ArrayLike = (),
    twists: ArrayLike = (),
    names: Sequence[str] = (),
    title: str = "A limit surface",
) -> str:
    """Return a limit surface that can be turned, with pokes on it, as one HTML page that needs no network.

    ``wrenches`` (n, 3) in N and N·m and ``twists`` (n, 3), in B, are those of pokes; ``names`` what they are called. The surface
    is drawn in ``(fx, fy, tau/rho)``.
    """
    rho = surface.characteristic_length
    scale = (1.0, 1.0, rho)
    loads, motions = np.reshape(wrenches, (-1, 3)).astype(np.float64), np.reshape(twists, (-1, 3)).astype(np.float64)
    if loads.shape != motions.shape:
        raise InputError("wrenches, twists", "expected as many of one as of the other", f"{len(loads)} and {len(motions)}")
    latitude, longitude = np.linspace(-np.pi / 2, np.pi / 2, _LATITUDES), np.linspace(0, 2 * np.pi, _LONGITUDES, endpoint=False)
    up, around = np.meshgrid(latitude, longitude, indexing="ij")
    rays = np.stack((np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)), axis=-1)
    value, twice = surface.value(rays * scale), surface.value(2 * rays * scale)
    degree = round(float(np.log2(np.median(np.abs(twice)) / np.median(np.abs(value)))))
    radius = np.where(value > 0, np.abs(value), np.nan) ** (-1 / degree)
    # a surface that is not convex may be open: no more of it than twice its usual size
    size = min(float(np.nanmax(radius)), 2 * float(np.nanmedian(radius)))
    mesh = np.where(radius[..., None] <= size, radius[..., None] * rays, np.nan)
    pokes, errors = [], []
    for k, (load, motion) in enumerate(zip(loads, motions, strict=True)):
        measured, predicted = unit(motion * scale), unit(surface.twist(load) * scale)
        errors.append(float(np.degrees(angle_between(measured, predicted))))
        pokes.append(
            {
                "name": names[k] if k < len(names) else str(k + 1), "wrench": load.tolist(), "load": (load / scale).tolist(),
                "measured": measured.tolist(), "predicted": predicted.tolist(), "error": errors[-1],
                "level": float(surface.value(load)),
            }
        )  # fmt: skip
    summary = f"Loads up to {size:.3g} {surface.force_unit}; characteristic length {rho:.3g} m."
    if errors:
        summary += f" {len(errors)} pokes, slip {np.mean(errors):.1f}° off on average."
    corners = [[None if np.isnan(p).any() else p.tolist() for p in row] for row in mesh]
    data = {"mesh": corners, "limit": size, "unit": surface.force_unit, "pokes": pokes, "summary": summary}
    key = "Dots: measured loads, orange: measured slip, dark: slip of the surface." if pokes else ""
    return render("surface.html", title=title, label="The limit surface in three dimensions", key=key, data=script(data))


def region_html(
    surface: LimitSurface,
    contact: PushContact,
    regions: Sequence[StableRegion],
    slider: Slider | None = None,
    extent: float | None = None,
    title: str = "Stable rotation centres",
) -> str:
    """Return a map of stable regions as one HTML page that needs no network: it shows for any rotation centre whether each region
    has it and with what margin, and shows the turn about it.

    ``extent``: half side of the map in m; five times the radius of slider or contact if not given.
    """
    radius = max(contact.radius, 0.0 if slider is None else slider.radius)
    size = 5 * radius if extent is None else extent
    places = np.linspace(-size, size, _CELLS)
    centers = np.stack(np.meshgrid(places, places), axis=-1)
    oracle = StabilityOracle(surface, contact)
    margins = {}
    for sense in (1, -1):
        degrees = np.degrees(oracle.margin(twist_from_cor(centers, sense)))
        margins[str(sense)] = [[round(float(v), 2) for v in row] for row in degrees]
    if not regions:
        raise InputError("regions", "expected at least one")
    entries = []
    for region in regions:
        rings = {}
        for sense in (1, -1):
            found = region.polygons(sense, size)
            rings[str(sense)] = [list(r.coords) for polygon in found for r in (polygon.exterior, *polygon.interiors)]
        entries.append({"name": region.name, "rings": rings})
    # begin at a stable turn, if there is one
    inside = [(p.area, *p.representative_point().coords[0], sense) for sense in (1, -1) for p in regions[0].polygons(sense, size)]
    # of areas alike, as a symmetric slider has them, the counter-clockwise one
    largest = first_least([-area for area, *_ in inside], 1e-9 * size**2) if inside else 0
    start = inside[largest][1:] if inside else (0.0, 0.5 * size, 1)
    data = {
        "extent": size, "cells": _CELLS, "margins": margins, "regions": entries, "cor": start,
        "contacts": contact.points.tolist(), "slider": None if slider is None else slider.vertices.tolist(),
    }  # fmt: skip
    lines = zip(("filled", "dashed", "dotted", "finely dotted"), regions, strict=False)
    key = "Blue: counter-clockwise, orange: clockwise; " + ", ".join(f"{line}: {region.name}" for line, region in lines) + "."
    return render("region.html", title=title, label="Map of rotation centres about the slider", key=key, data=script(data))


def _spread(count: int, most: int) -> np.ndarray:
    """Rows spread evenly over ``count``, first and last among them."""
    return np.unique(np.linspace(0, count - 1, most).round().astype(int))


def _push_rows(slider: Slider, pusher: Pusher, trace: PushTrace, most: int) -> list[dict[str, Any]]:
    chosen = _spread(len(trace.t), most)
    # what happens from a pose on; the last one keeps what happened before it
    moves = np.minimum(chosen, len(trace.twists) - 1)
    entries = _motion_rows(slider, trace.t[chosen], trace.poses[chosen], trace.twists[moves])
    for entry, row, move in zip(entries, chosen, moves, strict=True):
        entry["fingers"] = transform_points(trace.pushers[row], pusher.fingers).tolist()
        entry["modes"], entry["flat"], entry["radius"] = trace.modes[move].tolist(), pusher.flat, pusher.radius
    return entries


def _motion_rows(slider: Slider, t: FloatArray, poses: FloatArray, twists: FloatArray) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = []
    for now, pose, twist in zip(t, poses, twists, strict=True):
        entry: dict[str, Any] = {"t": float(now), "pose": pose.tolist(), "push": 0}
        # centres far away would only squeeze the picture
        if abs(twist[2]) * 3 * slider.radius > np.hypot(twist[0], twist[1]):
            center, _ = cor_from_twist(twist)
            entry["cor"] = transform_points(pose, center[None])[0].tolist()
        entries.append(entry)
    return entries


def _motion_page(
    slider: Slider,
    rows: list[dict[str, Any]],
    title: str,
    problem: PlanningProblem | None = None,
    result: PlanResult | None = None,
) -> str:
    corners = transform_points(np.array([row["pose"] for row in rows]), slider.vertices).reshape(-1, 2)
    obstacles = [] if problem is None else list(problem.obstacles)
    bounds = None if problem is None or problem.bounds is None else problem.bounds
    fingers = [np.array(row["fingers"]) for row in rows if "fingers" in row]
    points = np.concatenate([corners, *fingers, *obstacles, *([] if bounds is None else [bounds.reshape(2, 2)])])
    padding = 0.3 * slider.radius
    data = {
        "slider": slider.vertices.tolist(),
        "radius": max((row["radius"] for row in rows if "radius" in row), default=0.0),
        "frame": [*(points.min(axis=0) - padding).tolist(), *(points.max(axis=0) + padding).tolist()],
        "bounds": None if bounds is None else bounds.tolist(),
        "obstacles": [o.tolist() for o in obstacles],
        "first": rows[0]["pose"],
        "last": rows[-1]["pose"] if problem is None or result is None else problem.goal.tolist(),
        "planned": [] if result is None else _planned_path(result),
        "pushes": 1 + rows[-1]["push"],
        "rows": rows,
    }
    key = "Blue: the start. Line: path of the centre of mass; dotted: rotation centre."
    if fingers:
        key += " Fingers: green sticks, orange slips, grey is open."
    if result is not None:
        key += " Dashed: the plan and its goal."
    label = "The slider as it moves over the table"
    return render("motion.html", title=title, label=label, key=key, data=script(data))


def _planned_path(result: PlanResult) -> list[list[float]]:
    """Places of the body origin along the pushes of a plan."""
    times = np.linspace(0.0, 1.0, _PUSH_PLACES)[:, None]
    paths = [compose(push.start, exp(times * push.duration * push.twist))[:, :2] for push in result.pushes]
    return [place for path in paths for place in path.tolist()]


def script(data: dict[str, Any]) -> str:
    """JSON for a script element: inside one only "<" could end it or open a comment."""
    return json.dumps(data, allow_nan=False).replace("<", "\\u003c")


def _plan_data(problem: PlanningProblem, result: PlanResult) -> dict[str, Any]:
    segments: list[dict[str, Any]] = []
    pose = problem.start
    for segment in result.segments:
        if isinstance(segment, Push):
            entry: dict[str, Any] = {
                "kind": "push",
                "contact": segment.contact,
                "twist": segment.twist.tolist(),
                "duration": segment.duration,
                "start": segment.start.tolist(),
                "margin": segment.margin,
            }
            if segment.twist[2] != 0:
                center, _ = cor_from_twist(segment.twist)
                entry["cor"] = transform_points(segment.start, center[None])[0].tolist()
            pose = segment.end
        else:
            entry = {"kind": "transfer", "from": segment.source, "duration": segment.duration, "pose": pose.tolist()}
            shares = np.linspace(0.0, 1.0, _TRANSFER_POSES)
            entry["path"] = pusher_in_transfer(problem, segment, pose, shares).tolist()
        segments.append(entry)
    docked = [[outline.tolist() for outline in problem.docked_outlines(contact)] for contact in problem.contacts]
    return {
        "status": result.status,
        "slider": problem.slider.vertices.tolist(),
        "contacts": [c.points.tolist() for c in problem.contacts],
        "docked": docked,
        "pusher": [[outline.tolist() for outline in problem.pusher_outlines(contact)] for contact in problem.contacts],
        "obstacles": [o.tolist() for o in problem.obstacles],
        "bounds": None if problem.bounds is None else problem.bounds.tolist(),
        "ends": [] if result.success is None else result.success.ends.tolist(),
        "first": problem.start.tolist(),
        "last": problem.goal.tolist(),
        "frame": _frame(problem, result).tolist(),
        "segments": segments,
    }


def _frame(problem: PlanningProblem, result: PlanResult) -> FloatArray:
    """What the page shows (xmin, ymin, xmax, ymax) in m."""
    if problem.bounds is not None:
        low, high = problem.bounds[:2], problem.bounds[2:]
    else:
        ends = [p.end[None, :2] for p in result.pushes]
        points = np.concatenate([problem.start[None, :2], problem.goal[None, :2], *problem.obstacles, *ends])
        low, high = points.min(axis=0) - 2 * problem.slider.radius, points.max(axis=0) + 2 * problem.slider.radius
    padding = 0.02 * float((high - low).max())
    return np.concatenate((low - padding, high + padding))


def render(template: str, **values: Any) -> str:
    """Return a template of the package, filled in; ``data`` is what :func:`script` returned."""
    import jinja2
    from markupsafe import Markup

    def safe(value: Any) -> Any:
        """Names of files and folders without what changes the direction of a line or cannot be seen."""
        return shown(value, sys.maxsize, keep="\n\t") if isinstance(value, str) and not isinstance(value, Markup) else value

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("stablepush.views", "templates"), autoescape=True, undefined=jinja2.StrictUndefined,
        finalize=safe,
    )  # fmt: skip
    if "data" in values:
        values["data"] = Markup(values["data"])
    return environment.get_template(template).render(version=__version__, **values)
