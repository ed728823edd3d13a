"""Self-contained HTML pages: the animation of a plan, and a report of the whole chain."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stablepush import __version__
from stablepush._arrays import FloatArray
from stablepush.path import PlanResult, Push
from stablepush.planar import cor_from_twist
from stablepush.problem import PlanningProblem
from stablepush.pushing import Pusher, PushTrace
from stablepush.se2 import transform_points
from stablepush.slider import Slider
from stablepush.sliding import Slide
from stablepush.trajectory import pusher_on_the_way

#: Poses of the pusher that the page has for a change of contact.
_TRANSFER_POSES = 121
#: Rows of a motion that a page has, at most.
_MOTION_ROWS = 601


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a report: title, text, rows of a table, a PNG picture, a link to a neighbouring file."""

    title: str
    text: str = ""
    rows: Sequence[tuple[str, str]] = ()
    picture: str = ""
    link: str = ""
    link_text: str = ""

    @classmethod
    def with_picture(cls, title: str, png: bytes, text: str = "", rows: Sequence[tuple[str, str]] = ()) -> Section:
        """Return a section whose picture stands in the page itself."""
        return cls(title, text, rows, base64.b64encode(png).decode())


def report_html(title: str, lead: str, sections: Sequence[Section]) -> str:
    """Return a report as one HTML page that needs no network."""
    return _render("report.html", title=title, lead=lead, sections=sections, version=__version__)


def plan_html(problem: PlanningProblem, result: PlanResult, title: str = "Plan of stable pushes") -> str:
    """Return the animation of a plan as one HTML page that needs no network."""
    data = json.dumps(_plan_data(problem, result), allow_nan=False)
    # inside a script element only these could end it or open a comment
    return _render("plan.html", title=title, data=data.replace("<", "\\u003c"))


def push_html(slider: Slider, pusher: Pusher, trace: PushTrace, title: str = "A push") -> str:
    """Return the animation of a simulated push as one HTML page that needs no network: poses, modes, rotation centres."""
    rows = np.unique(np.linspace(0, len(trace.t) - 1, _MOTION_ROWS).round().astype(int))
    moves = np.minimum(rows, len(trace.twists) - 1)
    entries = _motion_rows(slider, trace.t[rows], trace.poses[rows], trace.twists[moves])
    for entry, row, move in zip(entries, rows, moves, strict=True):
        entry["pusher"], entry["modes"] = trace.pushers[row].tolist(), trace.modes[move].tolist()
    places = transform_points(trace.pushers, pusher.fingers).reshape(-1, 2)
    return _motion_page(slider, entries, pusher.fingers.tolist(), pusher.radius, pusher.flat, places, title)


def slide_html(slider: Slider, slide: Slide, title: str = "A free slide") -> str:
    """Return the animation of a free slide as one HTML page that needs no network."""
    rows = np.unique(np.linspace(0, len(slide.t) - 1, _MOTION_ROWS).round().astype(int))
    twists = np.concatenate((slide.twists[:-1], slide.direction[None]))
    entries = _motion_rows(slider, slide.t[rows], slide.poses[rows], twists[rows])
    return _motion_page(slider, entries, [], 0.0, False, np.zeros((0, 2)), title)


def _motion_rows(slider: Slider, t: FloatArray, poses: FloatArray, twists: FloatArray) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = []
    for now, pose, twist in zip(t, poses, twists, strict=True):
        entry: dict[str, Any] = {"t": float(now), "pose": pose.tolist()}
        # centres far away would only squeeze the picture
        if abs(twist[2]) * 3 * slider.radius > np.hypot(twist[0], twist[1]):
            center, _ = cor_from_twist(twist)
            entry["cor"] = transform_points(pose, center[None])[0].tolist()
        entries.append(entry)
    return entries


def _motion_page(
    slider: Slider,
    rows: list[dict[str, Any]],
    fingers: list[list[float]],
    radius: float,
    flat: bool,
    places: FloatArray,
    title: str,
) -> str:
    outlines = transform_points(np.array([row["pose"] for row in rows]), slider.vertices).reshape(-1, 2)
    points = np.concatenate((outlines, places))
    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.3 * slider.radius
    data = {
        "slider": slider.vertices.tolist(),
        "fingers": fingers,
        "radius": radius,
        "flat": flat,
        "frame": [*(low - room).tolist(), *(high + room).tolist()],
        "rows": rows,
    }
    text = json.dumps(data, allow_nan=False).replace("<", "\\u003c")
    return _render("motion.html", title=title, data=text)


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
            entry["way"] = pusher_on_the_way(problem, segment, pose, shares).tolist()
        segments.append(entry)
    docked = [None if problem.pusher is None else transform_points(c.frame, problem.pusher).tolist() for c in problem.contacts]
    return {
        "status": result.status,
        "slider": problem.slider.vertices.tolist(),
        "contacts": [c.points.tolist() for c in problem.contacts],
        "docked": docked,
        "pusher": None if problem.pusher is None else problem.pusher.tolist(),
        "obstacles": [o.tolist() for o in problem.obstacles],
        "bounds": None if problem.bounds is None else problem.bounds.tolist(),
        "start": problem.start.tolist(),
        "goal": problem.goal.tolist(),
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
    room = 0.02 * float((high - low).max())
    return np.concatenate((low - room, high + room))


def _render(template: str, **values: Any) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("stablepush", "templates"), autoescape=True, undefined=jinja2.StrictUndefined
    )
    if "data" in values:
        from markupsafe import Markup

        values["data"] = Markup(values["data"])
    return environment.get_template(template).render(**values)
