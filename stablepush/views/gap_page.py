"""The page of a diagnosis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count, groupby
from types import MappingProxyType
from typing import Any

import numpy as np

from stablepush.core import BoolArray, FloatArray, counted
from stablepush.diagnosis import (
    ChannelGap,
    Estimates,
    Evidence,
    GapReport,
    RankedEffect,
    estimate_in_words,
    readable,
    size_in_words,
)
from stablepush.effects import CATALOGUE, FINGER_FRICTION
from stablepush.geometry import rotate_vectors, wrap_angle
from stablepush.objects import EdgePush, Slider
from stablepush.views.pages import Section, render, script
from stablepush.views.plot.canvas import figure_png
from stablepush.views.plot.gaps import (
    arrow_scale,
    drawn_forms,
    magnification,
    marks_pushes,
    plot_effects,
    plot_final_poses,
    plot_forms,
    plot_residuals,
    plot_residuals_against,
    plot_signatures,
    simulations,
    view_limits,
)

#: The page says that a refit is worse where it leaves more than this times the error of the nominal simulation.
_WORSE = 1.05
#: Rows that a page has, at most.
_MOST_ROWS = 2000
#: Pairs of parameters whose correlation is told, at most.
_MOST_PAIRS = 12
#: Covariates that every row has.
_PLACE = (("x", "m"), ("y", "m"), ("heading", "deg"))


_SIZE = (
    "Root mean squares over all trials. Floor: what the noise, and the compliance of fingers and table, leave. "
    "p: how likely noise alone is to leave as much as the nominal simulation does. It counts pushes: a single push that is "
    "far off hardly lowers it."
)
_SIGNATURES = (
    "Each dot is a push. Horizontal axis: what the effect adds to the measurement, as fitted. Vertical axis: the "
    "measurement less everything else that was fitted. If the effect acts as fitted, the dots lie on the slanted line; "
    "if it did not act, they would lie on the level one."
)
_EFFECTS = (
    "For each effect: its probability, its estimate with 95 % intervals, and what speaks for and against it; or why this log "
    "cannot show it. The named ones are taken as given for the others. The gain says how much better the fit "
    "becomes: the fall of its sum of squares, in units of the scatter that is left. Below 18, or 25 for an executed plan, it "
    "may be chance."
)
_HOW = (
    "Loads of support points under the outline and the parameters of effects are fitted jointly to the measured "
    "wrenches and to the clearances between fingers and outline, each row weighted by the noise of forces and motion and by "
    "how far off it is. Without forces the final poses are fitted instead of wrenches: each push is simulated again. "
    "An effect is named if its family-wise p-value is below 1 %, or 0.2 % with forces on a rig that states a limit surface "
    "(a bootstrap over the signs of the trials' scores; without forces a larger gain may take its place), and the log "
    "density rises by more than its scatter between pushes explains; the others are judged given it. A wrong pressure is "
    "named if it predicts held-out trials as well as any pressure does. "
    "A wrong friction of the fingers is named if the forces of slipping and sticking fingers, or the final poses, show it "
    "significantly. All trials decide which effects act. Reductions of the gap are those of trials left out of the fit, in "
    "five folds that keep repeats together."
)


def gap_html(report: GapReport, title: str = "Diagnosis of a push log") -> str:
    """Return a diagnosis as one HTML page that needs no network: verdict, evidence to look at row by row, pictures, all effects,
    what to try next."""
    channels = _channels(report)
    # what convinces comes before what can be looked at row by row
    convincing = [_verdict(report), *_signatures(report), *_forms(report)]
    pictures = _pictures(report)
    sections = [*convincing, *_sizes(report, channels)]
    for channel in sorted(pictures, key=channels.index):
        sections += pictures[channel]
    sections += [*_dependence(report), _why(report), _next_pushes(report), *_how(report)]
    lead = ", ".join(filter(None, (report.log, counted(report.trials, "push"))))
    values = {"title": title, "lead": lead, "sections": sections, "first": len(convincing)}
    looks = {"wrench": _rows_of_loads, "pose": _rows_of_final_poses}
    seen = looks[next((name for name in channels if name in pictures), "pose")](report)
    if not seen.rows:
        return render("report.html", **values)
    return render(
        "diagnosis.html",
        **values,
        other=simulations(report).get("after", ""),
        about=seen.about,
        label="the slider on the table with what the simulations leave, as arrows",
        data=seen.data(report.rig.slider),
    )


def _verdict(report: GapReport) -> Section:
    steps = "\n".join(report.steps)
    rows = [("verdict", str(report.verdict)), ("effects", ", ".join(report.named) or "none"), ("what to do", steps)]
    if report.support_friction is not None:
        friction = f"{report.support_friction:.3g} as refitted, where {report.rig.support_friction:.3g} was assumed"
        rows.append(("support friction", friction))
    return Section("Verdict", report.sentence, rows)


def _signatures(report: GapReport) -> list[Section]:
    if not report.signatures:
        return []
    rows = [(entry.effect, _numbers(entry)) for entry in report.ranking if entry.effect in report.named]
    return [Section.with_picture("The evidence in one picture", figure_png(plot_signatures(report)), _SIGNATURES, rows)]


def _forms(report: GapReport) -> list[Section]:
    if not drawn_forms(report):
        return []
    kinds = [entry.effect == FINGER_FRICTION for entry in drawn_forms(report)]
    of_table = (
        "Friction of the table, over the nominal one, which is the level grey line. Blue: as found; grey beside it: without "
        "the further terms that this log needs."
    )
    if any(marks_pushes(report, entry) for entry in drawn_forms(report)):
        of_table += " Orange: pushes, each as far off the curve as its measured load is off the corrected simulation."
    of_fingers = (
        "Friction of the fingers: the tangential over the normal force of each push, less what named effects of sensors do."
    )
    pressed = 0 if report.fingers is None else len(report.fingers.trial)
    if pressed < report.trials:
        of_fingers += (
            f" {pressed} of {counted(report.trials, 'push')}: in the others no finger is seen on a face, or none presses "
            "with more than three times the noise."
        )
    words = " ".join([of_table] * (not all(kinds)) + [of_fingers] * any(kinds))
    found = [] if report.signatures else [(entry.effect, _numbers(entry)) for entry in drawn_forms(report)]
    return [Section.with_picture("What was found", figure_png(plot_forms(report)), words, found)]


def _sizes(report: GapReport, channels: Sequence[str]) -> list[Section]:
    sections = []
    if report.gap:
        gaps = sorted(report.gap, key=lambda entry: channels.index(entry.channel))
        sections.append(Section("How large the gap is", _SIZE, [(entry.channel, _gap(entry)) for entry in gaps]))
    left_out = "Root mean squares on held-out trials. Floor: what the noise, and the compliance of fingers and table, leave."
    if report.verdict == "absorbed":
        left_out += " No effect is named: what reduces the gap is a refitted surface."
    if report.verdict == "unknown":
        left_out += " No effect is named: what reduces the gap is a fit for which no cause is known."
    reductions = [
        (e.channel, f"{e.sizes}; {e.explained}, {counted(e.held_out_trials, 'held-out trial')}")
        for e in sorted(report.reductions, key=lambda e: channels.index(e.channel))
    ]
    return [*sections, Section("Gap reduction", left_out, reductions)]


def _pictures(report: GapReport) -> dict[str, list[Section]]:
    """Pictures of where the gap lies, by channel."""
    pictures: dict[str, list[Section]] = {}
    if report.residuals:
        text = " and ".join(f"of the {word} simulation" for word in simulations(report).values())
        pictures["wrench"] = [
            Section.with_picture("Where: over the table", figure_png(plot_residuals(report))),
            Section.with_picture("Where: heading and order", figure_png(plot_residuals_against(report)), f"Residuals {text}."),
        ]
    if report.ends and len(report.places):
        words = "Each push is simulated again from the logged start pose, along the logged path of the pusher."
        pictures["pose"] = [Section.with_picture("Where: final poses", figure_png(plot_final_poses(report)), words)]
    return pictures


def _dependence(report: GapReport) -> list[Section]:
    if not report.where:
        return []
    rows = [
        (f"{f.channel}, {f.component}", f"follows the {f.covariate}: {100 * f.share:.0f} % of its variance, p {f.p_value:.4f}")
        for f in report.where[:12]
    ]
    words = "Errors of the nominal simulation, on pushes left out of the fit."
    return [Section("Where: what the errors follow", words, rows)]


def _why(report: GapReport) -> Section:
    rows = [(entry.effect, _effect(entry, report.evidence[entry.effect])) for entry in report.ranking]
    return Section.with_picture("Why", figure_png(plot_effects(report)), _EFFECTS, rows)


def _next_pushes(report: GapReport) -> Section:
    after = report.next_experiment
    numbers = count(1)
    pushes = [(f"push {' and '.join(str(next(numbers)) for _ in same)}", _push(push)) for push, same in groupby(after.pushes)]
    words = f"To separate {' and '.join(after.separates)}: {after.why}." if after.separates else f"{after.why}."
    if report.settled:
        check = "execute a plan of the corrected scene" if report.changes_plans else "mend the sensor, record again"
        words = f"Nothing that this log can show is left to separate. To check the correction, {check}, and diagnose that log."
        if pushes and after.separates:
            words += f" Should you doubt the cause, these pushes tell {' from '.join(after.separates)} best."
    if report.verdict == "none" and "wrench" in report.channels:
        words, pushes = "Nothing is left to be explained.", []
    if pushes:
        words += (
            " Edges are counted from 0, places along them from their first corner; directions turn counter-clockwise "
            "from the inward normal."
        )
    return Section("What to try next", words, pushes)


def _how(report: GapReport) -> list[Section]:
    sections = [Section("Data quality", "", [("note", note) for note in report.notes] or [("note", "none")])]
    if report.estimates is not None:
        words = "Correlation of the errors of parameters that were fitted together: near 1 or -1, the log hardly separates them."
        sections.append(Section("Estimated parameters", words, _correlations(report.estimates), folded=True))
    return [*sections, Section("How it was computed", _HOW, folded=True)]


def _channels(report: GapReport) -> list[str]:
    """Channels in the order in which they show what the sentence says: first those whose gap the correction surely reduces, the
    most reduced first; those within the noise come last."""
    by_name = {entry.channel: entry for entry in report.reductions}

    def rank(name: str) -> tuple[bool, bool, float]:
        entry = by_name.get(name)
        return (True, True, 0.0) if entry is None else (entry.before <= entry.noise_floor, not entry.ci95[0] > 0, -entry.closed)

    names = dict.fromkeys([*by_name, *(entry.channel for entry in report.gap), "wrench", "pose"])
    return sorted(names, key=rank)


@dataclass(frozen=True, slots=True)
class _Seen:
    """What can be looked at row by row: poses of the slider, arrows and components before and after the correction, covariates.

    ``scale``: m of the table for a unit of an arrow; ``behind``: whether arrows end where the slider is, else they begin there.
    """

    about: str
    rows: list[dict[str, Any]]
    components: list[tuple[str, str]]
    covariates: list[tuple[str, str]]
    scale: float
    behind: bool

    def data(self, slider: Slider) -> str:
        """The JSON that the page's script reads."""
        places = np.array([row["at"][:2] for row in self.rows])
        arrows = np.array([[row["arrow"][key] for key in row["arrow"]] for row in self.rows])
        tips = places[:, None] + (-self.scale if self.behind else self.scale) * arrows
        low, high = view_limits(places, tips, slider.radius)
        return script(
            {
                "rows": self.rows,
                "components": [{"name": name, "unit": unit} for name, unit in self.components],
                "covariates": [{"name": name, "unit": unit} for name, unit in self.covariates],
                "frame": [*low.tolist(), *high.tolist()],
                "scale": self.scale,
                "behind": int(self.behind),
                "slider": slider.vertices.tolist(),
            }
        )


def _scale(rows: list[dict[str, Any]], slider: Slider) -> float:
    """Factor by which large arrows get a good length on the table; those of rows that show nothing do not count."""
    rows = [row for row in rows if row["determined"]] or rows
    arrows = [np.array([row["arrow"][key] for row in rows]) for key in ("before", "after") if rows and key in rows[0]["arrow"]]
    return arrow_scale(np.array([row["at"][:2] for row in rows]), arrows, slider.radius)


def _cut_faint(rows: list[dict[str, Any]]) -> None:
    """Make lines of rows that show nothing no longer than the longest of the others."""
    most = max((math.hypot(*arrow) for row in rows if row["determined"] for arrow in row["arrow"].values()), default=math.inf)
    for row in rows:
        for key, arrow in row["arrow"].items():
            size = math.hypot(*arrow)
            if size > most and not row["determined"]:
                row["arrow"][key] = [most / size * part for part in arrow]


def _rows_of_loads(report: GapReport) -> _Seen:
    direction = np.arctan2(report.loads[:, 1], report.loads[:, 0])
    parts = {}
    for key in ("before", "after"):
        force, moment = report.residuals[key][:, :2], report.residuals[key][:, 2]
        parts[key] = np.column_stack((rotate_vectors(-direction, force), 1000 * moment))
    arrows = {key: rotate_vectors(report.poses[:, 2], report.residuals[key][:, :2]) for key in ("before", "after")}
    # the places of several logs coincide
    order = report.orders if report.logs else 1 + np.unique(report.orders, return_inverse=True)[1]
    covariates = np.column_stack(
        (
            np.degrees(report.headings),
            order,
            1000 * report.speeds,
            report.poses[:, :2],
            np.degrees(wrap_angle(report.poses[:, 2])),
        )
    )
    load = report.loads * (1, 1, 1000)
    signals = {key: load - report.residuals[key] * (1, 1, 1000) for key in ("before", "after")} | {"measured": load}
    rows = _rows(report.row_names, report.poses, arrows, parts, covariates, signals, report.times, report.determined)
    scale = _scale(rows, report.rig.slider)
    about = "Lines from the slider's position: measured minus simulated force."
    if not all(row["determined"] for row in rows):
        about += (
            " Faint, and cut where they are long: slow rows and turns about a support point. Noise leaves their load open, so "
            "the errors leave them out."
        )
        _cut_faint(rows)
    return _Seen(
        about,
        rows,
        [("along the load", "N"), ("across the load", "N"), ("moment", "N mm")],
        [
            ("heading of the motion", "deg"),
            ("place in its log, 0 to 1" if report.logs else "number of the push in the log", ""),
            ("speed", "mm/s"),
            *_PLACE,
        ],
        scale,
        behind=False,
    )


def _rows_of_final_poses(report: GapReport) -> _Seen:
    ends: dict[str, FloatArray] = {key: report.ends[key] for key in ("before", "after") if key in report.ends}
    parts = {key: 1000 * error for key, error in ends.items()}
    arrows = {key: report.pose_errors(key) for key in ends}
    covariates = np.column_stack(
        (report.places[:, :2], np.degrees(wrap_angle(report.places[:, 2])), np.arange(len(report.places)))
    )
    rows = _rows(report.end_names, report.places, arrows, parts, covariates)
    scale = magnification(_scale(rows, report.rig.slider))
    longer = f", {scale:.0f} times as long" if scale > 1 else ""
    return _Seen(
        f"Arrows: from the simulated to the measured final position{longer}.",
        rows,
        [("along x of the slider", "mm"), ("along y of the slider", "mm"), ("turn times the radius of gyration", "mm")],
        [*_PLACE, ("number", "")],
        scale,
        behind=True,
    )


def _rows(
    names: list[str],
    poses: FloatArray,
    arrows: dict[str, FloatArray],
    parts: dict[str, FloatArray],
    covariates: FloatArray,
    signals: Mapping[str, FloatArray] = MappingProxyType({}),
    times: FloatArray | None = None,
    determined: BoolArray | None = None,
) -> list[dict[str, Any]]:
    """Rows whose numbers are all known, as many as a page can take. ``signals``: loads (fx, fy, tau; N, N mm) over ``times``;
    ``determined``: rows whose motion determines the load."""
    if not arrows:
        return []
    numbers = np.column_stack([poses, covariates, *arrows.values(), *parts.values()])
    known = np.flatnonzero(np.isfinite(numbers).all(axis=1))
    chosen = known[np.unique(np.linspace(0, max(0, len(known) - 1), min(len(known), _MOST_ROWS)).round().astype(int))]
    return [
        {
            "trial": names[i],
            "at": poses[i].tolist(),
            "arrow": {key: arrow[i].tolist() for key, arrow in arrows.items() if key in ("before", "after")},
            **{key: part[i].tolist() for key, part in parts.items() if key in ("before", "after")},
            "covariates": covariates[i].tolist(),
            "determined": int(determined is None or determined[i]),
            **({} if times is None else {"t": float(times[i]), "signals": {k: v[i].tolist() for k, v in signals.items()}}),
        }
        for i in chosen
    ]


def _gap(entry: ChannelGap) -> str:
    """A channel of ``gap``."""
    if entry.channel == "stability":
        # the square of an error of a label, right or wrong, is 1 or 0
        wrong, refitted = (f"{100 * size**2:.1f} %" for size in (entry.nominal, entry.refitted))
        return f"wrongly predicted to be stable or not: {wrong} of the pushes, {refitted} with a refitted surface"
    nominal, p = size_in_words(entry.nominal, entry.unit), entry.p_lack_of_fit
    refitted, floor = (size_in_words(size, entry.unit, named=False) for size in (entry.refitted, entry.noise_floor))
    worse = " (a refit to so few pushes predicts others worse)" if entry.refitted > _WORSE * entry.nominal else ""
    words = f"{nominal} from the nominal simulation, {refitted} with a refitted surface{worse}, floor {floor}"
    return f"{words}; p {f'{p:.2g}' if p > 1e-4 else 'below 0.0001'}"


def _correlations(estimates: Estimates) -> list[tuple[str, str]]:
    """The pairs of parameters that hang together most, and those at their bounds."""
    first, second = np.triu_indices(len(estimates.names), 1)
    values = estimates.correlation[first, second]
    order = np.argsort(-np.abs(values), kind="stable")[:_MOST_PAIRS]
    pairs = [(f"{estimates.names[first[k]]} with {estimates.names[second[k]]}", f"{values[k]:.2f}") for k in order]
    bounds = ", ".join(estimates.at_bound) or "none"
    return [*pairs, ("as large as this rig can have it", bounds)]


def _effect(entry: RankedEffect, evidence: Evidence) -> str:
    """An effect: probability, parameters, evidence for and against; or why it is not identifiable."""
    parameters = _numbers(entry) if entry.identifiable else ""
    if evidence.unseen:
        return "\n".join(filter(None, (parameters, evidence.unseen)))
    lines = [f"{entry.probability:.2f}" + (f": {parameters}" if parameters else "")]
    lines += [f"for: {clause}" for clause in evidence.supporting] + [f"against: {clause}" for clause in evidence.opposing]
    return "\n".join(lines)


def _numbers(entry: RankedEffect) -> str:
    """Parameters of an effect, and the terms of its family."""
    # as the sentence says them; those of a lab's own in the lab's units
    known = {p.name: p for p in CATALOGUE[entry.effect].parameters} if entry.effect in CATALOGUE else {}
    words = [f"{name} {estimate_in_words(known[name], p) if name in known else p}" for name, p in entry.parameters.items()]
    if entry.form is not None:
        terms = zip(entry.form["basis"], entry.form["coefficients"], entry.form["ci95"], strict=True)
        listed = ", ".join(
            f"{name} {readable(value)} ({readable(low)} to {readable(high)})" for name, value, (low, high) in terms
        )
        words.append(f"terms of the {entry.form['covariate']}: {listed}")
    return "; ".join(words)


def _push(push: EdgePush) -> str:
    """A proposed push as a lab would read it."""
    x, y, theta = np.zeros(3) if push.start is None else push.start
    apart = f"fingers {1000 * push.width:.1f} mm apart, " if push.width else ""
    words = (
        f"slider at x {1000 * x:.0f} mm, y {1000 * y:.0f} mm, heading {math.degrees(theta):.0f}°; on edge {push.edge}, "
        f"{1000 * push.arc_length:.1f} mm along it, {apart}{math.degrees(push.direction):.0f}° off its normal, "
        f"{1000 * push.distance:.0f} mm at {1000 * push.speed:.0f} mm/s; the causes differ by "
    )
    if "expected_difference_of_ends_m" in push.expected:
        return f"{words}{1000 * push.expected['expected_difference_of_ends_m']:.2g} mm in the final pose"
    return (
        f"{words}{push.expected['expected_difference_N']:.2g} N in the load, "
        f"{1000 * push.expected['expected_difference_m']:.2g} mm in the clearance between finger and outline"
    )
