"""What all pictures share: colours, axes, polygons, legends, and writing them. Nothing is shown on a screen."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import shapely

from stablepush.io import write_atomically
from stablepush.objects import PushContact

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours that stay apart for colour-blind readers and in grey (Okabe and Ito 2008).
COUNTER_CLOCKWISE, CLOCKWISE = "#0072B2", "#E69F00"
SLIDER, PUSHER, OBSTACLE, START, GOAL, LOST = "#999999", "#D55E00", "#4D4D4D", "#0072B2", "#009E73", "#CC3311"
SENSES = ((1, "counter-clockwise", COUNTER_CLOCKWISE), (-1, "clockwise", CLOCKWISE))


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG."""
    write_atomically(path, figure_png(figure))


def figure_png(figure: Figure) -> bytes:
    """Return a figure as PNG bytes, the same for the same figure."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=130, metadata={"Software": None})
    return stream.getvalue()


def canvas(size: tuple[float, float], equal: bool = True) -> tuple[Figure, Axes]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="compressed" if equal else "constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    if equal:
        axes.set_aspect("equal")
    axes.grid(visible=True, color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    return figure, axes


def fill(axes: Axes, polygon: shapely.Polygon, **style: Any) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    axes.add_patch(PathPatch(Outline.make_compound_path(*(Outline(ring, closed=True) for ring in rings)), **style))


def draw_contact(axes: Axes, contact: PushContact, length: float) -> None:
    for i, (point, normal) in enumerate(zip(contact.points, contact.normals, strict=True)):
        axes.annotate(
            "",
            xy=(point[0], point[1]),
            xytext=(point[0] - length * normal[0], point[1] - length * normal[1]),
            arrowprops={"arrowstyle": "-|>", "color": PUSHER, "linewidth": 2},
        )
        axes.plot(*point, marker="o", color=PUSHER, markersize=5, linestyle="none", label="_" if i else "contact, normal")


def legend(axes: Axes, columns: int) -> None:
    """Put the legend of some axes under the figure."""
    handles, labels = axes.get_legend_handles_labels()
    kept = [(h, text) for h, text in zip(handles, labels, strict=True) if not text.startswith("_")]
    if kept:
        figure = axes.get_figure(root=True)
        assert figure is not None
        figure.legend(*zip(*kept, strict=True), loc="outside lower center", ncols=columns, frameon=False, fontsize=9)
