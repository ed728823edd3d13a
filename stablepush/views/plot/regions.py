"""Pictures of stable regions: in the COR plane, on the sphere of unit twists, as margins along a line, and of contacts to
choose from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import FloatArray, InputError, check_choice, check_number
from stablepush.geometry import cor_from_twist, unit
from stablepush.objects import PushContact, Slider
from stablepush.stability import MEASURES, ProbabilityMap, RankedContact, StabilityOracle, StableRegion
from stablepush.stability.kernels import RIM, disc_from_twists
from stablepush.surfaces import LimitSurface
from stablepush.views.plot.canvas import (
    CLOCKWISE,
    COUNTER_CLOCKWISE,
    PUSHER,
    SENSES,
    SLIDER,
    canvas,
    draw_contact,
    figure_of,
    fill,
    legend,
    panels,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: How regions are drawn, by the first word of their names; what the surface says is filled, what is promised is lined.
_STYLES: dict[str, dict[str, Any]] = {
    "all-pressure": {"facecolor": "none", "edgecolor": "#000000", "linewidth": 2.2, "hatch": ".."},
    "conservative": {"facecolor": "none", "edgecolor": "#303030", "linewidth": 0.9, "hatch": "////"},
    "probability": {"facecolor": "none", "linewidth": 1.8, "linestyle": (0, (5, 2))},
}
_HATCHES: dict[str, Any] = {"facecolor": "none", "edgecolor": "#202020", "linewidth": 0.9, "hatch": "xx"}
_RANGE_STEPS = 721
#: Least distance (deg) between ticks of a range of turns.
_APART = 9.0


def plot_regions(
    regions: Sequence[StableRegion],
    contact: PushContact,
    slider: Slider | None = None,
    extent: float | None = None,
    title: str = "Stable rotation centres",
    probability: ProbabilityMap | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw regions in the COR plane of B (m), with slider, contacts and the tightest turns of the first region.

    The first region is filled, the darker the more probable if a :class:`ProbabilityMap` is given; the others are hatched or
    outlined by their names. ``extent`` is the half side of the square shown, 5 radii of slider and contact by default.
    """
    radius = max(contact.radius, slider.radius if slider is not None else 0.0)
    size = 5 * radius if extent is None else check_number(extent, "extent", positive=True)
    axes = canvas((7.4, 8.8), ax=ax)
    if probability is not None:
        _shade(axes, probability)
        axes.plot(
            [], [], marker="s", markersize=9, color="0.6", linestyle="none", label="shading: probability, from 0 (white) to 1"
        )
    for order, region in enumerate(regions):
        for sense, word, color in SENSES:
            style = _style(region, order, color, filled=probability is None)
            style["label"] = f"{region.name}, {word}" if order == 0 else region.name if sense > 0 else "_"
            for polygon in region.polygons(sense, size):
                fill(axes, polygon, **style)
                style["label"] = "_"
            if region.curve is not None:
                _draw_curve(axes, region, sense, {"color": color, "linewidth": 2.4, "label": style["label"]})
    if slider is not None:
        fill(axes, slider.polygon, facecolor=SLIDER, alpha=0.5, edgecolor="black", linewidth=1.2, label="slider")
    draw_contact(axes, contact, 0.35 * radius)
    axes.plot(0, 0, marker="+", color="black", markersize=9, linestyle="none", label="centre of mass")
    for sense, word, color in SENSES:
        cor = regions[0].tightest_turn(sense) if regions else None
        if cor is not None and np.abs(cor).max() <= size:
            label = f"tightest turn, {word}: {_length(float(np.linalg.norm(cor)))}"
            axes.plot(*cor, marker="D", color=color, markeredgecolor="black", markersize=7, linestyle="none", label=label)
    axes.set_xlim(-size, size)
    axes.set_ylim(-size, size)
    axes.set_xlabel("x in B [m]")
    axes.set_ylabel("y in B [m]")
    axes.set_title(title)
    legend(axes, columns=2)
    return axes


def plot_twist_sphere(regions: Sequence[StableRegion], title: str = "Stable motions", ax: ArrayLike | None = None) -> np.ndarray:
    """Draw regions on the sphere of unit twists, as one equal-area disc for each sense of rotation.

    The middle of a disc is rotation about the origin of B, its rim are the translations, rings mark the distance of the COR.
    Draws into two axes, which are returned.
    """
    lengths = sorted({region.characteristic_length for region in regions})
    if len(lengths) != 1:
        raise InputError("regions", "expected at least one, all of one characteristic length", lengths)
    shown = panels((10.5, 6.2), 1, 2, ax, "compressed")[0]
    for axes, (sense, word, color) in zip(shown, SENSES, strict=True):
        axes.set_aspect("equal")
        axes.set_axis_off()
        ring = np.linspace(0, 2 * np.pi, 361)
        circle = np.stack((np.cos(ring), np.sin(ring)), axis=-1)
        axes.plot(*(RIM * circle).T, color="black", linewidth=1.4)
        for order, region in enumerate(regions):
            style = _style(region, order, color, filled=True)
            style["label"] = region.name
            for polygon in shapely.get_parts(region.disc(sense)):
                if not polygon.is_empty:
                    fill(axes, polygon, **style)
                    style["label"] = "_"
            if region.curve is not None:
                turning = region.curve[sense * region.curve[:, 2] >= 0]
                if len(turning):
                    marker = "o" if len(turning) == 1 else None
                    axes.plot(*disc_from_twists(turning, sense).T, color=color, linewidth=2.4, marker=marker, label=region.name)
        for ratio in (0.5, 1.0, 2.0, 5.0):
            at = disc_from_twists(unit(np.array(((0.0, -ratio, 1.0),))), 1)[0, 0]
            axes.plot(*(at * circle).T, color="0.6", linewidth=0.7, linestyle=":")
            axes.annotate(f"{ratio:g} ρ", (0.0, at), color="0.35", fontsize=8, ha="center", va="bottom")
        axes.plot(0, 0, marker="+", color="black", markersize=9)
        axes.annotate("translations", (0.0, RIM), fontsize=9, ha="center", va="bottom")
        axes.set_title(f"{word}: direction and distance of the COR", fontsize=10)
    legend(shown[0], columns=4, panels=len(shown))
    figure_of(shown).suptitle(f"{title} (equal areas are equal solid angles; ρ = {_length(lengths[0])})")
    return shown


def plot_margins(
    surface: LimitSurface,
    contact: PushContact,
    regions: Sequence[StableRegion] = (),
    direction: float | None = None,
    title: str = "Margin of stability",
    ax: Axes | None = None,
) -> Axes:
    """Draw the margin of all turns while pushing in one direction, from the tightest right to the tightest left, and a strip
    a region.

    The CORs lie on the line through the origin of B square to ``direction`` (rad in B; the middle of the first region's
    translations, or the contact's mean normal, if not given). The band holds 90 % of the surface's ensemble.
    """
    if direction is None:
        spans = regions[0].translation_intervals if regions else ()
        direction = float(np.mean(spans[0])) if spans else float(contact.frame[2])
    rho = surface.characteristic_length
    turn = np.linspace(-np.pi / 2, np.pi / 2, _RANGE_STEPS)
    twists = np.stack(
        (np.cos(turn) * np.cos(direction), np.cos(turn) * np.sin(direction), np.sin(turn) / rho),
        axis=-1,
    )
    axes = canvas((8.4, 5.4), equal=False, ax=ax)
    members = surface.members()
    degrees = np.degrees(turn)
    if members:
        spread = np.degrees([StabilityOracle(member, contact).margin(twists) for member in members])
        low, high = np.quantile(spread, (0.05, 0.95), axis=0)
        axes.fill_between(degrees, low, high, color=COUNTER_CLOCKWISE, alpha=0.25, linewidth=0, label="90 % of the ensemble")
    margin = np.degrees(StabilityOracle(surface, contact).margin(twists))
    axes.plot(degrees, margin, color=COUNTER_CLOCKWISE, linewidth=1.8, label="margin")
    axes.axhline(0.0, color="black", linewidth=1.0)
    step = 0.06 * float(np.ptp(margin) or 1.0)
    base = min(axes.dataLim.y0, float(margin.min())) - step
    for row, region in enumerate(regions):
        inside = region.contains_twists(twists)
        y = base - row * step
        shade = "#000000" if row % 2 else "#707070"
        axes.fill_between(degrees, y - 0.35 * step, y + 0.35 * step, where=inside, color=shade, linewidth=0)
        axes.annotate(region.name, (91.0, y), fontsize=8, va="center", annotation_clip=False)
    # round distances, as far apart as their words are wide
    radii = [d * 10.0**k for k in (-3, -2, -1, 0) for d in (1, 2, 5)][::-1]
    marks, names = [0.0], ["straight"]
    for radius in radii:
        angle = float(np.degrees(np.arctan(rho / radius)))
        if max(_APART, marks[-1] + _APART) <= angle <= 90 - _APART:
            marks.append(angle)
            names.append(_length(radius))
    marks = [-m for m in marks[:0:-1]] + marks
    names = [f"{name} right" for name in names[:0:-1]] + names[:1] + [f"{name} left" for name in names[1:]]
    axes.set_xticks(marks, names, rotation=30, ha="right", fontsize=8)
    axes.set_xlim(-90, 90)
    # adding zero takes the sign off a zero
    axes.set_xlabel(f"distance and side of the COR, pushing towards {round(np.degrees(direction)) + 0}° in B")
    axes.set_ylabel("margin [deg]")
    axes.set_title(title)
    axes.legend(frameon=False, fontsize=9, loc="upper right")
    return axes


def plot_contacts(
    slider: Slider, ranked: Sequence[RankedContact], measure: str = "area", title: str | None = None, ax: Axes | None = None
) -> Axes:
    """Draw ranked contacts along the edges of a slider, one row of dots for each spacing of the fingers, and the best of them."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import FuncFormatter, LogLocator

    check_choice(measure, "measure", MEASURES)
    if not ranked:
        raise InputError("ranked", "expected at least one contact")
    factor, unit_name = {"area": (1.0, "sr"), "tightest-turn": (1e3, "mm"), "margin": (180 / np.pi, "deg")}[measure]
    attribute = MEASURES[measure][0]
    values = factor * np.array([getattr(contact, attribute) for contact in ranked], dtype=float)
    # as high as the slider is for its width, beside title and legend
    extent = np.ptp(slider.vertices, axis=0) + 0.5 * slider.radius
    axes = canvas((7.6, float(np.clip(5.8 * extent[1] / extent[0] + 1.4, 3.6, 9.0))), ax=ax)
    fill(axes, slider.polygon, facecolor=SLIDER, alpha=0.35, edgecolor="black", linewidth=1.2)
    widths = sorted({contact.width for contact in ranked})
    gap = 0.09 * slider.radius
    places = np.array([_outside(slider, c, gap * (1 + widths.index(c.width))) for c in ranked])
    shown = np.where(np.isfinite(values), values, np.nan)
    # turns from some mm to some m, of which the tight ones matter
    positive = bool(np.all(shown[np.isfinite(shown)] > 0))
    scale = LogNorm() if measure == "tightest-turn" and positive else None
    dots = axes.scatter(
        places[:, 0],
        places[:, 1],
        c=shown,
        cmap="cividis_r" if measure == "tightest-turn" else "cividis",
        norm=scale,
        s=46,
        edgecolors="black",
        linewidths=0.4,
        zorder=3,
        plotnonfinite=True,
    )
    bar = figure_of(axes).colorbar(dots, ax=axes, label=f"{measure.replace('-', ' ')} [{unit_name}]", shrink=0.8)
    if scale is not None:
        bar.locator = LogLocator(subs=(1, 2, 5))
        bar.formatter = FuncFormatter(lambda value, _: f"{value:g}")
        bar.minorticks_off()
    best = ranked[0]
    axes.plot(*best.contact.points.T, marker="^", color=PUSHER, markersize=9, linestyle="none", label="fingers of the best")
    axes.plot(*places[0], marker="o", markersize=12, markerfacecolor="none", markeredgewidth=2, color=PUSHER, linestyle="none")
    if not np.isfinite(values).all():
        axes.plot([], [], marker="o", markerfacecolor="white", color="black", linestyle="none", label="no stable turn")
    words = ", ".join(f"{1e3 * width:.0f}" for width in widths)
    axes.plot(0, 0, marker="+", color="black", markersize=9, linestyle="none", label="centre of mass")
    for edge in range(len(slider.vertices)):
        start, end = slider.edge(edge)
        inwards = np.array((start[1] - end[1], end[0] - start[0])) / np.linalg.norm(end - start)
        x, y = (start + end) / 2 + 0.6 * gap * inwards
        along = (math.degrees(math.atan2(*(end - start)[::-1])) + 90) % 180 - 90
        axes.text(x, y, f"edge {edge}", fontsize=7, color="0.35", ha="center", va="center", rotation=along)
    axes.margins(0.12)
    axes.set_xlabel("x in B [m]")
    axes.set_ylabel("y in B [m]")
    rows = "Dots: middles of two fingers" + (
        f", {words} mm apart" if len(widths) == 1 else f"; rows, inner to outer: {words} mm apart"
    )
    chosen = f"best: edge {best.edge}, {1e3 * best.width:.0f} mm apart, {measure.replace('-', ' ')} {values[0]:.3g} {unit_name}"
    axes.set_title(title or f"{rows}\n{chosen}", fontsize=10)
    legend(axes, columns=2)
    return axes


def _style(region: StableRegion, order: int, color: str, filled: bool) -> dict[str, Any]:
    if order == 0:
        return {"facecolor": color if filled else "none", "alpha": 0.45 if filled else 1.0, "edgecolor": color, "linewidth": 1.6}
    style = dict(_STYLES.get(region.name.split()[0], _HATCHES))
    style.setdefault("edgecolor", color)
    return style


def _shade(axes: Axes, probability: ProbabilityMap) -> None:
    from matplotlib.colors import to_rgb

    half = float(probability.x[-1] + (probability.x[1] - probability.x[0]) / 2) if len(probability.x) > 1 else 1.0
    for shares, color in ((probability.counter_clockwise, COUNTER_CLOCKWISE), (probability.clockwise, CLOCKWISE)):
        image = np.empty((*shares.shape, 4))
        image[..., :3] = to_rgb(color)
        image[..., 3] = 0.6 * shares
        axes.imshow(image, extent=(-half, half, -half, half), origin="lower", interpolation="nearest", zorder=0)


def _draw_curve(axes: Axes, region: StableRegion, sense: int, style: dict[str, Any]) -> None:
    assert region.curve is not None
    curve = region.curve[sense * region.curve[:, 2] > 0]
    if len(curve):
        cors = cor_from_twist(curve / (1.0, 1.0, region.characteristic_length))[0]
        axes.plot(*cors.T, marker="o" if len(cors) == 1 else None, **style)


def _length(metres: float) -> str:
    """A length in mm up to a metre, in m above."""
    return f"{1e3 * metres:.3g} mm" if metres < 1 else f"{metres:.3g} m"


def _outside(slider: Slider, contact: RankedContact, distance: float) -> FloatArray:
    start, end = slider.edge(contact.edge)
    along = unit(end - start)
    return np.asarray(start + contact.center * along + distance * np.array((along[1], -along[0])))
