"""Pictures of simulated motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import FloatArray
from stablepush.geometry import cor_from_twist, transform_points
from stablepush.mechanics import Pusher, PushTrace, Slide
from stablepush.objects import Slider
from stablepush.surfaces import LimitSurface
from stablepush.views.plot.canvas import CLOCKWISE, COUNTER_CLOCKWISE, GOAL, OBSTACLE, PUSHER, SLIDER, START, canvas, fill, legend
from stablepush.views.plot.surfaces import plot_limit_surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Outlines drawn along a motion, besides the first and the last.
_OUTLINES = 6


def plot_slide(slider: Slider, slide: Slide, title: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw a free slide in W (m): first and last outline, some between, the path of the centre of mass and of the COR."""
    axes = canvas((7.5, 6.8), ax=ax)
    _motion(axes, slider, slide.poses)
    # the twist of the last row is zero: its direction is kept apart
    twists = np.concatenate((slide.twists[:-1], slide.direction[None]))
    cors, _ = cor_from_twist(twists)
    near = np.asarray((np.abs(cors) < 4 * slider.radius).all(axis=1))
    if near.any():
        cors[~near] = np.nan
        places = np.array([transform_points(pose, cor[None])[0] for pose, cor in zip(slide.poses, cors, strict=True)])
        axes.plot(*places.T, color=COUNTER_CLOCKWISE, linewidth=1.0, linestyle="--", label="rotation centre")
    if near[-1]:
        axes.plot(
            *places[-1],
            marker="o",
            color=COUNTER_CLOCKWISE,
            markersize=9,
            fillstyle="none",
            linestyle="none",
            label="last rotation centre",
        )
    _frame(axes, transform_points(slide.poses, slider.vertices).reshape(-1, 2), 0.3 * slider.radius)
    end = "at rest" if slide.at_rest else "cut"
    axes.set_title(title or f"Free slide: {end} after {slide.t[-1]:.3f} s")
    legend(axes, columns=3)
    return axes


def plot_push(slider: Slider, pusher: Pusher, trace: PushTrace, title: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw a push in W (m) with the modes of its contacts: where the fingers stick, slip or are open."""
    axes = canvas((7.5, 6.8), ax=ax)
    _motion(axes, slider, trace.poses)
    for row in (0, -1):
        for center in transform_points(trace.pushers[row], pusher.fingers):
            disc = shapely.Point(center).buffer(max(pusher.radius, 0.01 * slider.radius))
            fill(axes, disc, facecolor=PUSHER, edgecolor="none", alpha=0.7)
    places = transform_points(trace.pushers[1:], pusher.fingers)
    for numbers, word, color in (
        ((1,), "finger sticks", GOAL),
        ((2, 3), "finger slips", CLOCKWISE),
        ((0,), "finger is open", OBSTACLE),
    ):
        for k in range(len(pusher.fingers)):
            track = np.where(np.isin(trace.modes[:, k], numbers)[:, None], places[:, k], np.nan)
            if np.isfinite(track).any():
                axes.plot(*track.T, color=color, linewidth=3.0, label="_" if word in _words(axes) else word)
    outlines = np.concatenate((transform_points(trace.poses, slider.vertices).reshape(-1, 2), places.reshape(-1, 2)))
    _frame(axes, outlines, 0.3 * slider.radius)
    axes.set_title(title or f"Push: {trace.t[-1]:.2f} s")
    legend(axes, columns=3)
    return axes


def plot_wrench_paths(
    surface: LimitSurface, wrenches: Mapping[str, ArrayLike], title: str | None = None, ax: Axes | None = None
) -> Axes:
    """Draw paths of loads (n, 3) on their limit surface in ``(fx, fy, tau/rho)``, all over the size of the surface along x.

    ``wrenches`` holds paths by name, as ``Slide.wrenches`` or ``PushTrace.wrenches``.
    """
    axes: Any = plot_limit_surface(surface, title=title or "Loads on the limit surface", ax=ax)
    rho = surface.characteristic_length
    for (name, path), color in zip(
        wrenches.items(), ("#D55E00", "black", "#0072B2", "#009E73", "#E69F00", "#CC79A7"), strict=False
    ):
        points = np.asarray(path, dtype=np.float64) / (1, 1, rho)
        axes.plot(*points.T, color=color, linewidth=2.0, label=name)
        axes.plot(*points[-1:].T, marker="o", color=color, linestyle="none")
    if wrenches:
        axes.legend(loc="upper left", frameon=False)
    return axes  # type: ignore[no-any-return]


def _motion(axes: Axes, slider: Slider, poses: FloatArray) -> None:
    """Outlines along poses (n, 3), and the path of the centre of mass."""
    for row in np.linspace(0, len(poses) - 1, _OUTLINES + 2).round().astype(int)[1:-1]:
        ring = shapely.Polygon(transform_points(poses[row], slider.vertices))
        fill(axes, ring, facecolor="none", edgecolor=SLIDER, linewidth=0.9, linestyle=":")
    for row, word, color in ((0, "first pose", START), (-1, "last pose", GOAL)):
        ring = shapely.Polygon(transform_points(poses[row], slider.vertices))
        fill(axes, ring, facecolor="none", edgecolor=color, linewidth=2.2, label=word)
    axes.plot(*poses[:, :2].T, color="black", linewidth=1.4, label="path of the centre of mass")


def _words(axes: Axes) -> list[str]:
    return list(axes.get_legend_handles_labels()[1])


def _frame(axes: Axes, points: FloatArray, padding: float) -> None:
    """Show all points: autoscale does not see patches that are not filled."""
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    axes.set_xlim(x0 - padding, x1 + padding)
    axes.set_ylim(y0 - padding, y1 + padding)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
