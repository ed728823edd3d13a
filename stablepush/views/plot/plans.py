"""Pictures of plans."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
import shapely

from stablepush.core import FloatArray
from stablepush.geometry import cor_from_twist, transform_points
from stablepush.planning import PlanningProblem, PlanResult, Push, Transfer
from stablepush.views.plot.canvas import (
    CLOCKWISE,
    COUNTER_CLOCKWISE,
    GOAL,
    LOST,
    OBSTACLE,
    PUSHER,
    SLIDER,
    START,
    canvas,
    fill,
    legend,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Letters of a line of the title that the picture is wide enough for.
_TITLE = 92


def plot_plan(problem: PlanningProblem, result: PlanResult, title: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw a plan in W (m): outlines of slider and pusher along the path, obstacles, start and goal; each push with its number,
    joined to its rotation centre."""
    tracks = [push.poses(np.linspace(0, push.duration, 50))[:, :2] for push in result.pushes]
    low, high = _frame(problem, tracks)
    # as high as the scene is for its width, beside title and legend
    size = (9.0, float(np.clip(8.4 * (high - low)[1] / (high - low)[0] + 1.65, 3.6, 12.0)))
    axes = canvas(size, ax=ax)
    for i, obstacle in enumerate(problem.obstacles):
        fill(axes, shapely.Polygon(obstacle), facecolor=OBSTACLE, edgecolor="black", label="_" if i else "obstacle")
    if problem.bounds is not None:
        fill(axes, shapely.box(*problem.bounds), facecolor="none", edgecolor="black", linewidth=1.5)
    for push in result.pushes:
        outlines = max(2, int(np.ceil(float(problem.push_speed(push.twist)) * push.duration / (0.5 * problem.slider.radius))))
        for pose in push.poses(np.linspace(0, push.duration, outlines)[:-1]):
            _outline(axes, problem, pose, push.contact, alpha=0.16)
    if tracks:
        track = np.concatenate(tracks)
        axes.plot(track[:, 0], track[:, 1], color="black", linewidth=1.3, label="path of the centre of mass")
        end = result.pushes[-1]
        _outline(axes, problem, end.end, end.contact, alpha=0.5, named=True)
    for i, pose in enumerate(() if result.success is None else result.success.ends):
        ring = shapely.Polygon(transform_points(pose, problem.slider.vertices))
        label = "_" if i else "ends after a slip, simulated"
        fill(axes, ring, facecolor="none", edgecolor=LOST, linewidth=0.7, alpha=0.5, label=label)
    _draw_pushes(axes, result)
    changes = [s.pusher_path for s in result.segments if isinstance(s, Transfer) and len(s.pusher_path)]
    for i, path in enumerate(changes):
        axes.plot(path[:, 0], path[:, 1], color=PUSHER, linewidth=1.3, linestyle=":", label="_" if i else "path of the pusher")
    for name, pose, color, style in (("start", problem.start, START, "-"), ("goal", problem.goal, GOAL, "--")):
        ring = shapely.Polygon(transform_points(pose, problem.slider.vertices))
        fill(axes, ring, facecolor="none", edgecolor=color, linewidth=2.4, linestyle=style, label=name)
        tip = transform_points(pose, np.array(((0.0, 0.0), (0.6 * problem.slider.radius, 0.0))))
        axes.plot(tip[:, 0], tip[:, 1], color=color, linewidth=2, label="_" if name == "goal" else "x axis of the slider")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(title or _plan_title(result), fontsize=11)
    legend(axes, columns=4)
    return axes


def _outline(axes: Axes, problem: PlanningProblem, pose: FloatArray, contact: int, alpha: float, named: bool = False) -> None:
    """Slider and pusher at a pose, in the legend if they are ``named``."""
    ring = shapely.Polygon(transform_points(pose, problem.slider.vertices))
    fill(axes, ring, facecolor=SLIDER, edgecolor="black", linewidth=0.7, alpha=alpha, label="slider" if named else "_")
    for i, docked in enumerate(problem.docked_outlines(problem.contacts[contact])):
        shape, label = shapely.Polygon(transform_points(pose, docked)), "pusher" if named and i == 0 else "_"
        fill(axes, shape, facecolor=PUSHER, edgecolor="none", alpha=alpha, label=label)


def _draw_pushes(axes: Axes, result: PlanResult) -> None:
    """The number of each push at the middle of its path, and its rotation centre."""
    drawn = set()
    for number, push in enumerate(result.pushes, start=1):
        middle = push.poses(0.5 * push.duration)[:2]
        around = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": "black", "linewidth": 0.6}
        axes.annotate(f"{number}", middle, fontsize=6.5, ha="center", va="center", bbox=around, zorder=6, annotation_clip=True)
        # no turn but for rounding
        if abs(push.twist[2]) * push.duration < 1e-9:
            continue
        center, sense = cor_from_twist(push.twist)
        at = transform_points(push.start, center[None])[0]
        word, color = ("counter-clockwise", COUNTER_CLOCKWISE) if sense > 0 else ("clockwise", CLOCKWISE)
        label = "_" if word in drawn else f"COR, {word}"
        drawn.add(word)
        axes.plot(*at, marker="x", color=color, markersize=7, markeredgewidth=2, linestyle="none", label=label)
        axes.plot(*np.stack((middle, at), axis=-1), color=color, linewidth=0.6, alpha=0.7, zorder=1)


def _frame(problem: PlanningProblem, tracks: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Lower left and upper right corner (2,) of what is drawn."""
    if problem.bounds is not None:
        low, high = np.asarray(problem.bounds[:2]), np.asarray(problem.bounds[2:])
    else:
        points = np.concatenate([problem.start[None, :2], problem.goal[None, :2], *problem.obstacles, *tracks])
        low, high = points.min(axis=0) - 2 * problem.slider.radius, points.max(axis=0) + 2 * problem.slider.radius
    padding = 0.03 * float((high - low).max())
    return low - padding, high + padding


def _plan_title(result: PlanResult) -> str:
    if not result.solved:
        return f"{result.planner}: {result.status}"
    pushes = [s for s in result.segments if isinstance(s, Push)]
    words = f"{len(pushes)} push{'es' * (len(pushes) != 1)}, {result.length:.2f} m, {result.duration:.1f} s"
    words += f", least margin {np.degrees(result.min_margin):.2f}°"
    if result.success_probability is None:
        return words
    return "\n".join((words, *(line for part in result.outlook.split("; ") for line in wrap(part, _TITLE))))
