"""Pictures: maps of stable regions and plans. Figures are returned, or written as PNG; nothing is shown."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from stablepush._arrays import FloatArray
from stablepush.contact import PushContact
from stablepush.files import write_atomically
from stablepush.path import PlanResult, Push
from stablepush.planar import cor_from_twist
from stablepush.problem import PlanningProblem
from stablepush.region import StableRegion
from stablepush.se2 import transform_points
from stablepush.slider import Slider

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours that stay apart for colour-blind readers and in grey (Okabe and Ito 2008).
COUNTER_CLOCKWISE, CLOCKWISE = "#0072B2", "#E69F00"
SLIDER, PUSHER, OBSTACLE, START, GOAL = "#999999", "#D55E00", "#4D4D4D", "#0072B2", "#009E73"

_SENSES = ((1, "counter-clockwise", COUNTER_CLOCKWISE), (-1, "clockwise", CLOCKWISE))


def plot_regions(
    regions: Sequence[StableRegion],
    contact: PushContact,
    slider: Slider | None = None,
    extent: float | None = None,
    title: str = "Stable rotation centres",
) -> Figure:
    """Draw regions in the COR plane of B (m): the first filled, the others hatched; with slider and contacts.

    ``extent`` is the half side of the square shown, 5 radii of slider and contact by default.
    """
    radius = max(contact.radius, slider.radius if slider is not None else 0.0)
    size = 5 * radius if extent is None else extent
    figure, axes = _canvas((7.2, 7.6))
    for order, region in enumerate(regions):
        for sense, word, color in _SENSES:
            label = f"{region.name}, {word}"
            for polygon in region.polygons(sense, size):
                if order == 0:
                    _fill(axes, polygon, facecolor=color, alpha=0.45, edgecolor=color, linewidth=1.4, label=label)
                else:
                    _fill(axes, polygon, facecolor="none", hatch="////", edgecolor="#202020", linewidth=0.9, label=label)
                label = "_"
    if slider is not None:
        _fill(axes, slider.polygon, facecolor=SLIDER, alpha=0.5, edgecolor="black", linewidth=1.2, label="slider")
    _draw_contact(axes, contact, 0.35 * radius)
    axes.plot(0, 0, marker="+", color="black", markersize=9, linestyle="none", label="centre of mass")
    axes.set_xlim(-size, size)
    axes.set_ylim(-size, size)
    axes.set_xlabel("x in B [m]")
    axes.set_ylabel("y in B [m]")
    axes.set_title(title)
    _legend(axes, columns=2)
    return figure


def plot_plan(problem: PlanningProblem, result: PlanResult, title: str | None = None) -> Figure:
    """Draw a plan in W (m): outlines of slider and pusher along the path, obstacles, start, goal and rotation centres."""
    figure, axes = _canvas((9.0, 7.4))
    for i, obstacle in enumerate(problem.obstacles):
        _fill(axes, shapely.Polygon(obstacle), facecolor=OBSTACLE, edgecolor="black", label="_" if i else "obstacle")
    if problem.bounds is not None:
        _fill(axes, shapely.box(*problem.bounds), facecolor="none", edgecolor="black", linewidth=1.5)
    ways: list[FloatArray] = []
    for push in result.pushes:
        outlines = max(2, int(np.ceil(float(problem.push_speed(push.twist)) * push.duration / (0.5 * problem.slider.radius))))
        for pose in push.poses(np.linspace(0, push.duration, outlines)[:-1]):
            _outline(axes, problem, pose, push.contact, alpha=0.16)
        ways.append(push.poses(np.linspace(0, push.duration, 50))[:, :2])
    if ways:
        way = np.concatenate(ways)
        axes.plot(way[:, 0], way[:, 1], color="black", linewidth=1.3, label="way of the centre of mass")
        end = result.pushes[-1]
        _outline(axes, problem, end.end, end.contact, alpha=0.5)
    _draw_centers(axes, result)
    for name, pose, color, style in (("start", problem.start, START, "-"), ("goal", problem.goal, GOAL, "--")):
        ring = shapely.Polygon(transform_points(pose, problem.slider.vertices))
        _fill(axes, ring, facecolor="none", edgecolor=color, linewidth=2.4, linestyle=style, label=name)
        tip = transform_points(pose, np.array(((0.0, 0.0), (0.6 * problem.slider.radius, 0.0))))
        axes.plot(tip[:, 0], tip[:, 1], color=color, linewidth=2)
    _frame(axes, problem, ways)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(title or _plan_title(result))
    _legend(axes, columns=3)
    return figure


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG."""
    write_atomically(path, figure_png(figure))


def figure_png(figure: Figure) -> bytes:
    """Return a figure as PNG bytes, the same for the same figure."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=130, metadata={"Software": None})
    return stream.getvalue()


def _canvas(size: tuple[float, float]) -> tuple[Figure, Axes]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.grid(visible=True, color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    return figure, axes


def _fill(axes: Axes, polygon: shapely.Polygon, **style: Any) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    axes.add_patch(PathPatch(Outline.make_compound_path(*(Outline(ring, closed=True) for ring in rings)), **style))


def _draw_contact(axes: Axes, contact: PushContact, length: float) -> None:
    for i, (point, normal) in enumerate(zip(contact.points, contact.normals, strict=True)):
        axes.annotate(
            "",
            xy=(point[0], point[1]),
            xytext=(point[0] - length * normal[0], point[1] - length * normal[1]),
            arrowprops={"arrowstyle": "-|>", "color": PUSHER, "linewidth": 2},
        )
        axes.plot(*point, marker="o", color=PUSHER, markersize=5, linestyle="none", label="_" if i else "contact, normal")


def _outline(axes: Axes, problem: PlanningProblem, pose: FloatArray, contact: int, alpha: float) -> None:
    ring = shapely.Polygon(transform_points(pose, problem.slider.vertices))
    _fill(axes, ring, facecolor=SLIDER, edgecolor="black", linewidth=0.7, alpha=alpha)
    if problem.pusher is not None:
        docked = transform_points(problem.contacts[contact].frame, problem.pusher)
        _fill(axes, shapely.Polygon(transform_points(pose, docked)), facecolor=PUSHER, edgecolor="none", alpha=alpha)


def _draw_centers(axes: Axes, result: PlanResult) -> None:
    drawn = set()
    for push in result.pushes:
        if push.twist[2] == 0:
            continue
        center, sense = cor_from_twist(push.twist)
        at = transform_points(push.start, center[None])[0]
        word, color = ("counter-clockwise", COUNTER_CLOCKWISE) if sense > 0 else ("clockwise", CLOCKWISE)
        label = "_" if word in drawn else f"COR, {word}"
        drawn.add(word)
        axes.plot(*at, marker="x", color=color, markersize=7, markeredgewidth=2, linestyle="none", label=label)


def _frame(axes: Axes, problem: PlanningProblem, ways: list[FloatArray]) -> None:
    if problem.bounds is not None:
        low, high = problem.bounds[:2], problem.bounds[2:]
    else:
        points = np.concatenate([problem.start[None, :2], problem.goal[None, :2], *problem.obstacles, *ways])
        low, high = points.min(axis=0) - 2 * problem.slider.radius, points.max(axis=0) + 2 * problem.slider.radius
    room = 0.03 * float((high - low).max())
    axes.set_xlim(low[0] - room, high[0] + room)
    axes.set_ylim(low[1] - room, high[1] + room)


def _legend(axes: Axes, columns: int) -> None:
    handles, labels = axes.get_legend_handles_labels()
    kept = [(h, text) for h, text in zip(handles, labels, strict=True) if not text.startswith("_")]
    if kept:
        axes.legend(
            *zip(*kept, strict=True),
            loc="upper center",
            bbox_to_anchor=(0.5, -0.09),
            ncols=columns,
            frameon=False,
            fontsize=9,
        )


def _plan_title(result: PlanResult) -> str:
    if not result.solved:
        return f"{result.planner}: {result.status}"
    pushes = [s for s in result.segments if isinstance(s, Push)]
    return (
        f"{len(pushes)} pushes, {result.length:.2f} m, {result.duration:.1f} s, least margin {np.degrees(result.min_margin):.2f}°"
    )
