"""Pictures of the gap between simulation and reality."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray, InputError
from stablepush.diagnosis import GapReport, RankedEffect, shown_unit
from stablepush.effects import (
    CATALOGUE,
    REFERENCE_SPEED,
    friction_over_direction,
    friction_over_log,
    friction_over_place,
    friction_over_speed,
)
from stablepush.geometry import rotate_vectors
from stablepush.views.plot.canvas import CLOCKWISE, COUNTER_CLOCKWISE, OBSTACLE, PUSHER, SLIDER, canvas, legend, panels, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: An effect leaves a component alone if it gives less than this share of what it gives the others.
_UNTOUCHED = 0.02
#: A third colour of dots, told from the others by the colour-blind.
_THIRD = "#009E73"
#: Names of effects that a log cannot judge; still read on white.
_HIDDEN = "#767676"
#: Length of a large arrow, and of the longest that is not cut off, over the extent of the table.
_GOOD, _LONGEST = 0.12, 0.45
#: Errors of final positions are drawn so many times as long, at most.
_MOST_TIMES = 1000
#: Places from which on arrows and dots are thin.
_MANY = 60
#: Opacity of what counts in no error.
_FAINT = 0.2
#: Names of pushes up to so many letters stand close on an axis; longer ones are cut to so many, or the axes have no room.
_SHORT, _LONGEST_TICK = 4, 16


def marks_pushes(report: GapReport, entry: RankedEffect) -> bool:
    """Return whether :func:`plot_forms` marks pushes beside the curve of an effect: where there are forces, and one curve."""
    curve = _curve_of(entry)
    of_several = any(isinstance(parameter.estimate, list) for parameter in entry.parameters.values())
    drawn = curve.startswith("direction") or curve == "speed" or (curve == "log" and not of_several)
    return drawn and "after" in report.residuals


def _curve_of(entry: RankedEffect) -> str:
    """What friction is a function of with an effect; blank if of nothing."""
    return CATALOGUE[entry.effect].curve if entry.effect in CATALOGUE else ""


def simulations(report: GapReport) -> dict[str, str]:
    """Return what pictures call the simulations that they show, by the report's keys: only the nominal one where it fits."""
    words = {"before": "nominal", "after": "corrected" if report.named else "refitted"}
    return {"before": "nominal"} if report.verdict == "none" else words


def plot_residuals(report: GapReport, ax: Axes | None = None) -> Axes:
    """Draw the forces that the nominal simulation lacks, as arrows over the table, and what remains after the correction.

    Raises :class:`InputError` for a log without forces.
    """
    residuals = _of_both(report.residuals, "loads of pushes, a log with forces has them")
    good = np.isfinite(residuals).all(axis=(0, 2))
    places = report.poses[good][:, :2]
    forces = [rotate_vectors(report.poses[good][:, 2], one[good][:, :2]) for one in residuals]
    scale = arrow_scale(places, forces)
    title = f"Measured less predicted force, 1 N {1000 * scale:.3g} mm long"
    axes = _draw_over_table(report, places, np.stack([places] * len(forces)), scale * np.stack(forces), title, ax)
    for entry in report.ranking:
        kind = CATALOGUE.get(entry.effect)
        if kind is not None and kind.pulls and entry.effect in report.named and entry.estimates and entry.form is None:
            _draw_downhill(axes, np.asarray(entry.estimates[kind.parameters[0].name]))
    return axes


def _of_both(arrays: Mapping[str, FloatArray], needed: str) -> list[FloatArray]:
    """What there is before the correction, and after it, each of the same shape."""
    found = [arrays[key] for key in ("before", "after") if key in arrays]
    if not found:
        raise InputError("report", f"expected {needed}")
    return found


def _draw_downhill(axes: Axes, slope: FloatArray) -> None:
    """The direction in which a table slopes, as a large arrow about its middle."""
    middle = np.array((sum(axes.get_xlim()) / 2, sum(axes.get_ylim()) / 2))
    half = 0.18 * min(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())) * slope / np.linalg.norm(slope)
    arrow = {"arrowstyle": "simple", "facecolor": "black", "edgecolor": "none", "alpha": 0.5, "mutation_scale": 45}
    axes.annotate("", middle + half, middle - half, arrowprops=arrow, zorder=4)
    words = f"downhill, {np.linalg.norm(slope):.3g} rad"
    around = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5}
    axes.text(*(middle - 1.3 * half), words, ha="center", va="center", fontsize=9, bbox=around, zorder=5)


def arrow_scale(places: FloatArray, arrows: Sequence[FloatArray], room: float = 0.0) -> float:
    """Return the length (m) at which an arrow of length 1 is drawn at places (n, 2).

    The longest stays on the picture, unless the others would become too small to see. ``arrows``: one or more (n, 2); ``room``
    (m): what else is drawn around the places.
    """
    if not len(places):
        return 1.0
    extent = max(float(np.ptp(places, axis=0).max()) + room, 0.05)
    lengths = [np.linalg.norm(arrow, axis=1) for arrow in arrows]
    large = max(float(np.quantile(one, 0.95)) for one in lengths)
    longest = max(float(one.max()) for one in lengths)
    if large == 0.0:
        return 1.0
    good = _GOOD * extent / large
    return max(min(good, _LONGEST * extent / longest), good / 4)


def magnification(scale: float) -> float:
    """Return the whole number by which distances are drawn larger than they are."""
    return float(np.clip(round(scale), 1, _MOST_TIMES))


def view_limits(places: FloatArray, tips: FloatArray, room: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return lower and upper corner (m) of a picture of places (n, 2), with ``room`` around them, and of arrow ends (…, 2).

    Arrows that are far longer than the others are cut off.
    """
    low, high = places.min(axis=0) - room, places.max(axis=0) + room
    most = _LONGEST * max(float((high - low).max()), 0.05)
    ends = tips.reshape(-1, 2)
    return np.minimum(low, np.maximum(ends.min(axis=0), low - most)), np.maximum(high, np.minimum(ends.max(axis=0), high + most))


def _draw_over_table(
    report: GapReport, places: FloatArray, tails: FloatArray, arrows: FloatArray, title: str, ax: Axes | None
) -> Axes:
    """Draw places (n, 2), and arrows (1 or 2, n, 2) before and after the correction. The picture is as high as that needs."""
    low, high = view_limits(places, np.stack((tails, tails + arrows)), 0.02) if len(places) else (np.zeros(2), np.ones(2))
    low, high = low - 0.02 * (high - low), high + 0.02 * (high - low)
    axes = canvas((6.2, float(np.clip(5.5 * (high - low)[1] / (high - low)[0] + 1.1, 2.8, 7.4))), ax=ax)
    for tail, arrow, word, color in zip(tails, arrows, simulations(report).values(), (PUSHER, COUNTER_CLOCKWISE), strict=False):
        style = {"color": color, "width": 0.0025 if len(places) > _MANY else 0.005, "label": word}
        axes.quiver(*tail.T, *arrow.T, angles="xy", scale_units="xy", scale=1.0, **style)
    axes.plot(*places.T, linestyle="none", marker=".", markersize=3 if len(places) > _MANY else 6, color=OBSTACLE)
    if ax is None:
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
    else:
        # what else is in these axes stays in sight
        axes.update_datalim((low, high))
        axes.autoscale_view()
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(title)
    legend(axes, columns=2)
    return axes


def plot_residuals_against(report: GapReport, ax: ArrayLike | None = None) -> np.ndarray:
    """Draw the residual force along and across the measured one, against heading and trial order, before and after the
    correction; into four axes, which are returned (2, 2). Faint: rows whose load is left open, since they are slow or turn about
    a support point.

    Raises :class:`InputError` for a log without forces.
    """
    residuals = _of_both(report.residuals, "loads of pushes, a log with forces has them")
    shown = panels((6.6, 4.8), 2, 2, ax, sharey="row")
    direction = np.arctan2(report.loads[:, 1], report.loads[:, 0])
    for row, name in enumerate(("along the load [N]", "across it [N]")):
        for column, (values, label) in enumerate(
            ((np.degrees(report.headings), "heading of the motion in W [deg]"), (report.orders, ""))
        ):
            axes = shown[row, column]
            for left, word, color, marker in zip(
                residuals, simulations(report).values(), (PUSHER, COUNTER_CLOCKWISE), ("o", "."), strict=False
            ):
                residual = rotate_vectors(-direction, left[:, :2])[:, row]
                style = {"linestyle": "none", "marker": marker, "markersize": 3, "color": color}
                for chosen, look in ((report.determined, {"label": word}), (~report.determined, {"alpha": _FAINT})):
                    axes.plot(values[chosen], residual[chosen], **style, **look)
            axes.axhline(0.0, color=OBSTACLE, linewidth=0.8)
            axes.grid(visible=True, color="0.9", linewidth=0.6)
            if row == 1:
                axes.set_xlabel(label)
            if column == 1:
                _name_pushes(axes, report, told=row == 1)
        shown[row, 0].set_ylabel(name)
    # above the axes: not over rows
    shown[0, 0].legend(frameon=False, fontsize=9, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return shown


def plot_final_poses(report: GapReport, ax: Axes | None = None) -> Axes:
    """Draw measured against simulated final poses of pushes, as arrows over the table.

    Raises :class:`InputError` for a log without pushes that could be simulated.
    """
    good = np.isfinite(_of_both(report.ends, "pushes that could be simulated")).all(axis=(0, 2))
    places = report.places[good][:, :2]
    errors = [report.pose_errors(key)[good] for key in ("before", "after") if key in report.ends]
    times = magnification(arrow_scale(places, errors))
    longer = f", {times:.0f} times as long" if times > 1 else ""
    arrows = times * np.stack(errors)
    # to the measured end
    return _draw_over_table(report, places, places - arrows, arrows, f"Final position, simulated to measured{longer}", ax)


def plot_effects(report: GapReport, ax: Axes | None = None) -> Axes:
    """Draw how probable each effect of the catalogue is; those that the log cannot judge have grey names and no bar."""
    axes = canvas((6.0, 4.6), equal=False, ax=ax)
    entries = report.ranking[::-1]
    unseen = [bool(report.evidence[entry.effect].unseen) for entry in entries]
    colors = [COUNTER_CLOCKWISE if entry.effect in report.named else CLOCKWISE for entry in entries]
    lengths = [0.0 if hidden else entry.probability for entry, hidden in zip(entries, unseen, strict=True)]
    axes.barh([entry.effect for entry in entries], lengths, color=colors)
    for label, hidden in zip(axes.get_yticklabels(), unseen, strict=True):
        label.set_color(_HIDDEN if hidden else "black")
    axes.set_xlim(0, 1)
    axes.set_xlabel("probability")
    axes.set_title("Blue: named; orange: others; grey: not identifiable")
    return axes


def drawn_forms(report: GapReport) -> list[RankedEffect]:
    """Return the named effects that :func:`plot_forms` draws: those that make friction a function of something, and friction of
    the fingers if forces show it."""
    drawn = [curve for curve in _CURVES if curve != "fingers" or report.fingers is not None]
    return [entry for entry in report.ranking if entry.effect in report.named and _curve_of(entry) in drawn]


def plot_forms(report: GapReport, ax: ArrayLike | None = None) -> np.ndarray:
    """Draw the form of the named effects of friction that follow something: friction against direction, against speed, over the
    log, and as a map of the table; into axes, one for each of :func:`drawn_forms`, which are returned. Grey: the effect's own
    form, without the terms of its family. Dots: pushes, each as far off the curve as the
    corrected simulation leaves of its load. For friction of the fingers: what the force of each push shows of it, the friction
    that was found (blue) and the one that was assumed (black).

    Raises :class:`InputError` if no effect is named that has such a form.
    """
    entries = drawn_forms(report)
    if not entries:
        raise InputError(
            "report", "expected a named effect of friction over direction, speed, place or the log, or of the fingers' friction"
        )
    rows, columns = (math.ceil(len(entries) / 2), min(2, len(entries))) if ax is None else (1, len(entries))
    shown = panels((columns * 4.2, rows * 3.5), rows, columns, ax).ravel()
    for axes, entry in zip(shown, entries, strict=False):
        _CURVES[_curve_of(entry)](axes, entry, report)
        axes.set_title(plain(entry.effect))
    for axes in shown[len(entries) :]:
        axes.set_axis_off()
    return shown[: len(entries)]


def plot_signatures(report: GapReport, ax: ArrayLike | None = None) -> np.ndarray:
    """Draw each of ``report.signatures`` into axes of its own, which are returned: what is left of the measurements without an
    effect against what the effect gives, a dot a push and component. If the effect acts as fitted the dots lie on the line; if it
    did not act they would lie on the level one.

    Raises :class:`InputError` if the report has none.
    """
    if not report.signatures:
        raise InputError("report", "expected named effects that show in loads or clearances")
    count = len(report.signatures)
    shown = panels((4.2 * count, 3.9), 1, count, ax)[0]
    for axes, signature in zip(shown, report.signatures, strict=True):
        factor, unit = shown_unit(signature.unit)
        given, left = factor * signature.contribution, factor * signature.partial_residual
        sizes = np.abs(given).max(axis=0)
        for k, (marker, color) in zip(range(len(sizes)), (("o", COUNTER_CLOCKWISE), ("^", PUSHER), ("s", _THIRD)), strict=False):
            # a component that the effect leaves alone says nothing of it
            if sizes[k] > _UNTOUCHED * sizes.max():
                style = {"linestyle": "none", "marker": marker, "markersize": 4, "color": color, "alpha": 0.7}
                axes.plot(given[:, k], left[:, k], label=plain(signature.parts[k]), **style)
        axes.axhline(0.0, color=OBSTACLE, linewidth=0.8)
        axes.axline((0.0, 0.0), slope=1.0, color="black", linewidth=1.4)
        axes.grid(visible=True, color="0.9", linewidth=0.6)
        axes.locator_params(axis="x", nbins=5)
        axes.set_xlabel(f"predicted by the effect [{unit.strip()}]")
        axes.set_ylabel(f"measured, other causes removed [{unit.strip()}]")
        axes.set_title(plain(signature.effect), fontsize=11)
        axes.legend(fontsize=8, framealpha=0.5, edgecolor="none")
    return np.asarray(shown)


def _terms(entry: RankedEffect) -> list[float]:
    return [] if entry.form is None else list(entry.form["coefficients"])


def _curve(
    axes: Axes, entry: RankedEffect, report: GapReport, x: FloatArray, share: Callable[[list[float]], FloatArray], label: str
) -> None:
    level = report.friction_level or 1.0
    if entry.form is not None:
        axes.plot(x, level * share([]), color=SLIDER, linewidth=1.2)
    axes.plot(x, level * share(_terms(entry)), color=COUNTER_CLOCKWISE, linewidth=2.0)
    axes.axhline(1.0, color=OBSTACLE, linewidth=0.8)
    axes.grid(visible=True, color="0.9", linewidth=0.6)
    axes.set_xlabel(label)
    axes.set_ylabel("friction over nominal" if report.friction_level is None else "friction over the one believed")


def _of_pushes(
    axes: Axes, report: GapReport, at: FloatArray, share: Callable[[FloatArray], FloatArray], scale: float = 1.0
) -> None:
    """Mark pushes beside a curve: its value at each, and what the corrected simulation leaves of the load, over that load.

    ``at`` (n,): where rows are on the curve; complex numbers of that direction for half turns.
    """
    good = report.determined & np.isfinite(report.residuals["after"]).all(axis=1)
    if not good.any():
        return
    left = report.residuals["after"][good] / (1.0, 1.0, report.rig.slider.characteristic_length)
    load = report.loads[good] / (1.0, 1.0, report.rig.slider.characteristic_length) - left
    _, push = np.unique(np.asarray(report.row_names)[good], return_inverse=True)
    over = np.bincount(push, (left * load).sum(axis=1)) / np.bincount(push, (load**2).sum(axis=1))
    means = np.bincount(push, at[good].real) + 1j * np.bincount(push, at[good].imag)
    places = 0.5 * np.angle(means) % np.pi if np.iscomplexobj(at) else means.real / np.bincount(push)
    style = {"linestyle": "none", "marker": "o", "markersize": 3.5, "color": PUSHER, "alpha": 0.6}
    axes.plot(scale * places, (report.friction_level or 1.0) * share(places) * (1 + over), **style, zorder=3)


def _name_pushes(axes: Axes, report: GapReport, told: bool = True) -> None:
    """Name pushes on an axis of places in the log, 0 to 1; of several logs the places themselves."""
    if told:
        axes.set_xlabel("place in its log, 0 first to 1 last push" if report.logs else "push, in the order of the log")
    names = dict(zip(report.orders.tolist(), report.row_names, strict=True))
    if not report.logs and names:
        places = sorted(names)
        shown = places[:: math.ceil(len(places) / (4 if max(map(len, names.values())) > _SHORT else 10))]
        axes.set_xticks(shown, labels=[plain(names[place], _LONGEST_TICK) for place in shown])


def _over_direction(axes: Axes, entry: RankedEffect, report: GapReport) -> None:
    ratio, direction = (entry.parameters[name].estimate for name in ("ratio", "direction"))
    assert isinstance(ratio, float)
    assert isinstance(direction, float)
    angles = np.linspace(0.0, np.pi, 361)
    label = f"direction of motion [deg in {'W' if _curve_of(entry).endswith('W') else 'B'}]"
    _curve(axes, entry, report, np.degrees(angles), lambda terms: friction_over_direction(ratio, direction, terms, angles), label)
    turned = report.headings - (0.0 if _curve_of(entry).endswith("W") else report.poses[:, 2])
    over = partial(friction_over_direction, ratio, direction, _terms(entry))
    if marks_pushes(report, entry):
        _of_pushes(axes, report, np.exp(2j * turned), over, 180 / np.pi)


def _over_speed(axes: Axes, entry: RankedEffect, report: GapReport) -> None:
    slope = entry.parameters["slope"].estimate
    assert isinstance(slope, float)
    seen = report.speeds[report.speeds > 0]
    low, high = np.quantile(seen, (0.02, 0.98)) if len(seen) else (0.5 * REFERENCE_SPEED, 2 * REFERENCE_SPEED)
    speeds = np.geomspace(low, max(high, 1.01 * low), 200)
    _curve(
        axes,
        entry,
        report,
        1000 * speeds,
        lambda terms: friction_over_speed(slope, terms, speeds, REFERENCE_SPEED),
        "speed [mm/s]",
    )
    over = partial(friction_over_speed, slope, _terms(entry), reference=REFERENCE_SPEED)
    if marks_pushes(report, entry):
        _of_pushes(axes, report, report.speeds, over, 1000.0)


def _over_log(axes: Axes, entry: RankedEffect, report: GapReport) -> None:
    rate = entry.parameters["rate"].estimate
    orders = np.linspace(0.0, 1.0, 200)
    # one for each of several logs
    for each in rate if isinstance(rate, list) else [rate]:
        _curve(axes, entry, report, orders, lambda terms, each=each: friction_over_log(each, terms, orders), "")  # type: ignore[misc]
    if marks_pushes(report, entry):
        assert isinstance(rate, float)
        _of_pushes(axes, report, report.orders, partial(friction_over_log, rate, _terms(entry)))
    _name_pushes(axes, report)


def _over_place(axes: Axes, entry: RankedEffect, report: GapReport) -> None:
    gradient = entry.parameters["gradient"].estimate
    assert isinstance(gradient, list)
    low, high = report.poses[:, :2].min(axis=0), report.poses[:, :2].max(axis=0)
    x, y = (np.linspace(a, b, 61) for a, b in zip(low, high, strict=True))
    at = np.stack(np.meshgrid(x, y), axis=-1)
    # the form is that over the origin of W, the level that of the refitted surface
    believed, level = report.rig.support_friction, report.friction_level or 1.0
    share = level * friction_over_place(gradient, _terms(entry), at)
    # nothing is known of friction where the slider has not been
    nearest = np.linalg.norm(at[:, :, None] - report.poses[None, None, :, :2], axis=-1).min(axis=-1)
    share = np.where(nearest <= report.rig.slider.radius, share, np.nan)
    most = max(0.02, float(np.nanmax(np.abs(share - 1))))
    picture = axes.pcolormesh(x, y, share, cmap="PuOr_r", vmin=1 - most, vmax=1 + most, shading="auto")
    axes.plot(*report.poses[:, :2].T, linestyle="none", marker=".", markersize=2, color=OBSTACLE)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    believed_as = "" if believed is None else f" ({believed:.3g})"
    axes.figure.colorbar(picture, ax=axes, label=f"friction over the one believed{believed_as}", shrink=0.85)


def _of_fingers(axes: Axes, entry: RankedEffect, report: GapReport) -> None:
    fingers, friction = report.fingers, entry.parameters["mu"]
    assert fingers is not None
    assert isinstance(friction.estimate, float)
    orders = np.linspace(0.0, 1.0, 101)
    change = sum(_terms(entry)) * (orders - 0.5)
    found, low, high = (np.maximum(0.0, end + change) for end in (friction.estimate, *friction.ci95))
    axes.fill_between(orders, low, high, color=COUNTER_CLOCKWISE, alpha=0.15, linewidth=0)
    axes.plot(orders, found, color=COUNTER_CLOCKWISE, linewidth=2.0, label="friction found")
    axes.axhline(report.rig.contact_friction or 0.0, color=OBSTACLE, linewidth=0.8, label="friction assumed")
    for chosen, marker, inner, word in (
        (fingers.slips, "o", PUSHER, "push that slips"),
        (fingers.creeps, "s", PUSHER, "push that creeps"),
        (~fingers.moving, "^", "none", "push that sticks: at least this friction"),
    ):
        style = {"linestyle": "none", "marker": marker, "color": PUSHER, "markersize": 5, "markerfacecolor": inner}
        if chosen.any():
            axes.plot(fingers.order[chosen], fingers.ratio[chosen], label=word, **style)
    top = max(float(fingers.ratio.max()), float(high.max()), report.rig.contact_friction or 0.0)
    # room for the legend above all that is drawn
    axes.set_ylim(min(0.0, float(fingers.ratio.min())), 1.8 * top)
    axes.grid(visible=True, color="0.9", linewidth=0.6)
    _name_pushes(axes, report)
    axes.set_ylabel("tangential over normal force")
    axes.legend(fontsize=8, framealpha=0.5, edgecolor="none", loc="upper left")


_CURVES: Mapping[str, Callable[[Axes, RankedEffect, GapReport], None]] = MappingProxyType(
    {
        "direction in W": _over_direction,
        "direction in B": _over_direction,
        "speed": _over_speed,
        "log": _over_log,
        "place": _over_place,
        "fingers": _of_fingers,
    }
)
