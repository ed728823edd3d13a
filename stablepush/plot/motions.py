"""Pictures of simulated motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from stablepush.planar import cor_from_twist
from stablepush.plot.canvas import COUNTER_CLOCKWISE, GOAL, SLIDER, START, canvas, fill, legend
from stablepush.se2 import transform_points
from stablepush.slider import Slider
from stablepush.sliding import Slide

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Outlines drawn along a motion, besides the first and the last.
_OUTLINES = 6


def plot_slide(slider: Slider, slide: Slide, title: str | None = None) -> Figure:
    """Draw a free slide in W (m): first and last outline, some between, the way of the centre of mass and of the COR."""
    figure, axes = canvas((7.5, 6.8))
    for row in np.linspace(0, len(slide.t) - 1, _OUTLINES + 2).round().astype(int)[1:-1]:
        ring = shapely.Polygon(transform_points(slide.poses[row], slider.vertices))
        fill(axes, ring, facecolor="none", edgecolor=SLIDER, linewidth=0.9, linestyle=":")
    for row, word, color in ((0, "first pose", START), (-1, "last pose", GOAL)):
        ring = shapely.Polygon(transform_points(slide.poses[row], slider.vertices))
        fill(axes, ring, facecolor="none", edgecolor=color, linewidth=2.2, label=word)
    axes.plot(*slide.poses[:, :2].T, color="black", linewidth=1.4, label="way of the centre of mass")
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
    # autoscale does not see patches that are not filled
    outlines = transform_points(slide.poses, slider.vertices).reshape(-1, 2)
    (x0, y0), (x1, y1) = outlines.min(axis=0), outlines.max(axis=0)
    room = 0.3 * slider.radius
    axes.set_xlim(x0 - room, x1 + room)
    axes.set_ylim(y0 - room, y1 + room)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    end = "at rest" if slide.at_rest else "cut"
    axes.set_title(title or f"Free slide: {end} after {slide.t[-1]:.3f} s")
    legend(axes, columns=3)
    return figure
