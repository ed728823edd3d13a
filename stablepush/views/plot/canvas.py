"""What all pictures share: colours, axes, polygons, legends, and writing them. Nothing is shown on a screen."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import InputError, shown
from stablepush.io import write_atomically
from stablepush.objects import PushContact

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Drawn: TypeAlias = Figure | Axes | np.ndarray

#: Colours that stay apart for colour-blind readers and in grey (Okabe and Ito 2008).
COUNTER_CLOCKWISE, CLOCKWISE = "#0072B2", "#E69F00"
SLIDER, PUSHER, OBSTACLE, START, GOAL, LOST = "#999999", "#D55E00", "#4D4D4D", "#0072B2", "#009E73", "#CC3311"
#: Projections that no flat picture is drawn in.
_OTHER = ("3d", "polar")
#: Characters of a label that is a name.
_LONGEST_LABEL = 40
#: Pixels an inch of PNG pictures.
PNG_DPI = 150
SENSES = ((1, "counter-clockwise", COUNTER_CLOCKWISE), (-1, "clockwise", CLOCKWISE))


def save_figure(drawn: Drawn, path: str | Path) -> None:
    """Write a figure, or that of axes, as PNG."""
    write_atomically(path, figure_png(drawn))


def figure_png(drawn: Drawn) -> bytes:
    """Return a figure, or that of axes, as PNG bytes, the same for the same figure."""
    stream = io.BytesIO()
    figure_of(drawn).savefig(stream, format="png", dpi=PNG_DPI, metadata={"Software": None})
    return stream.getvalue()


def figure_of(drawn: Drawn) -> Figure:
    """Return the figure of axes, of an array of them, or itself."""
    if hasattr(drawn, "savefig"):
        return drawn
    figure = np.ravel(drawn)[0].get_figure(root=True)  # type: ignore[arg-type]
    assert figure is not None
    return figure


def plain(name: object, most: int = _LONGEST_LABEL) -> str:
    """Return a name that a file gave as a label: no formula, no control characters, and at most so many letters."""
    words = str(name)
    return shown(words if len(words) <= most else f"{words[: most - 1]}…").replace("$", r"\$")


def canvas(size: tuple[float, float], equal: bool = True, ax: Axes | None = None, **projection: str) -> Axes:
    """Return axes to draw in: those that are given, else new ones of a size (inches)."""
    axes = panels(size, 1, 1, ax, "compressed" if equal else "constrained", **projection)[0, 0]
    if equal:
        axes.set_aspect("equal")
    if not projection:
        axes.grid(visible=True, color="0.9", linewidth=0.6)
        axes.set_axisbelow(True)
    return axes


def panels(
    size: tuple[float, float],
    rows: int,
    columns: int,
    ax: ArrayLike | Axes | None = None,
    layout: str = "constrained",
    sharey: str = "none",
    **projection: str,
) -> np.ndarray:
    """Return axes (rows, columns) to draw in: those that are given, else new ones in a figure of a size (inches)."""
    if ax is not None:
        given = np.ravel(np.asarray(ax, dtype=object))
        kind = projection.get("projection")
        if len(given) != rows * columns:
            raise InputError("ax", f"expected {rows * columns} axes", len(given))
        from matplotlib.axes import Axes as AnyAxes

        for one in given:
            name = getattr(one, "name", None)
            if not isinstance(one, AnyAxes) or (name != kind if kind else name in _OTHER):
                words = f'axes of matplotlib with projection="{kind}"' if kind else "plain axes of matplotlib"
                raise InputError("ax", f"expected {words}", type(one).__name__)
        return given.reshape(rows, columns)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout=layout)  # type: ignore[arg-type]
    FigureCanvasAgg(figure)
    found: np.ndarray = figure.subplots(
        rows,
        columns,
        squeeze=False,
        sharey=sharey,
        subplot_kw=projection or None,  # type: ignore[arg-type]
    )
    return found


def fill(axes: Axes, polygon: shapely.Polygon, **style: Any) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    axes.add_patch(PathPatch(Outline.make_compound_path(*(Outline(ring, closed=True) for ring in rings)), **style))


def draw_contact(axes: Axes, contact: PushContact, length: float) -> None:
    for i, (point, normal) in enumerate(zip(contact.points, contact.normals, strict=True)):
        tail = point - length * normal
        # an annotation alone may leave the axes
        axes.update_datalim((tail,))
        axes.annotate(
            "",
            xy=(point[0], point[1]),
            xytext=(tail[0], tail[1]),
            arrowprops={"arrowstyle": "-|>", "color": PUSHER, "linewidth": 2},
        )
        axes.plot(*point, marker="o", color=PUSHER, markersize=5, linestyle="none", label="_" if i else "contact, normal")


def legend(axes: Axes, columns: int, panels: int = 1) -> None:
    """Put the legend of some axes, one for so many panels, under the figure.

    If others are in the figure it is put under the axes; in a figure that makes no room for it, into them.
    """
    handles, labels = axes.get_legend_handles_labels()
    kept = [(h, text) for h, text in zip(handles, labels, strict=True) if not text.startswith("_")]
    if kept:
        figure = figure_of(axes)
        if figure.get_layout_engine() is None:
            axes.legend(*zip(*kept, strict=True), frameon=False, fontsize=8)
        elif sum(other.get_label() != "<colorbar>" for other in figure.axes) > panels:
            where = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.14)}
            axes.legend(*zip(*kept, strict=True), ncols=columns, frameon=False, fontsize=8, **where)
        else:
            # room (inches) between the label of the axis and the legend
            figure.get_layout_engine().set(h_pad=0.12)  # type: ignore[call-arg, union-attr]
            figure.legend(*zip(*kept, strict=True), loc="outside lower center", ncols=columns, frameon=False, fontsize=9)
