"""The answer to a log, and the answer where no cause can be told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stablepush.core import BoolArray, FloatArray, shown_as
from stablepush.diagnosis.judge.force_axes import uneven_axes
from stablepush.diagnosis.judge.where import Finding
from stablepush.diagnosis.results import ChannelGap, GapReduction, NextExperiment, RankedEffect, Verdict, as_json, size_in_words
from stablepush.diagnosis.search.finger_forces import FingerForces
from stablepush.diagnosis.telling.evidence import Evidence, not_identifiable
from stablepush.diagnosis.telling.signatures import Estimates, Signature
from stablepush.effects import CATALOGUE, LAB_REMEDY, OF_PRESSURE
from stablepush.geometry import rotate_vectors
from stablepush.io import PushLog, Rig, slider_to_json
from stablepush.planning import Correction
from stablepush.surfaces import IdealLimitSurface

#: The words of a verdict.
VERDICTS = tuple(Verdict)

#: A refitted support friction that differs by no more than this share from the rig's is the rig's.
_SAME = 0.01


#: What to do about a surface that is a little off.
_NO_NEARER = (
    "the surface is off by little more than noise, and a refitted one predicts left-out pushes no better: plans stay as they "
    "are; more pokes before planning give a better one"
)
#: What to do where a surface fits all pushes, and none is predicted by one that is fitted to the others.
_NOT_PREDICTED = (
    "a surface fitted to all pushes fits them, one fitted to some does not predict the others: more pokes give a better one; or "
    "stablepush correct, then plan again, and try single pushes first"
)
#: What to do about a pressure that is another where no reading tells how much friction there is.
_UNSIZED = (
    "state the support friction (friction: support) and the mass of the slider, rough values do, and diagnose again: without "
    "these or forces no corrected surface is made"
)
#: A correction predicts a channel worse if it leaves this multiple of the error before, and of the floor.
_WORSE, _BEYOND = 1.5, 1.1
#: Causes that are less probable than this need no further experiment.
_UNLIKELY = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class GapReport:
    """The answer to a log; :meth:`to_json` gives ``diagnosis/1``.

    ``rig``: the log's, with the friction and the radius of the fingers as the log has them where they were not known;
    ``surface``: the refitted limit surface without the effects (None if its size is not identifiable from the log); ``effects``:
    what acts, with its values, as the catalogue has them; ``corrected``: the rig as plans need it
    (:func:`stablepush.correct`), one for each of several causes that cannot be separated; ``evidence``: for and against each
    effect of the catalogue, in words.
    """

    _repr_html_ = shown_as("report")

    log: str
    trials: int
    channels: list[str]
    verdict: Verdict
    named: list[str]
    gap: list[ChannelGap]
    where: list[Finding] = field(repr=False)
    ranking: list[RankedEffect] = field(repr=False)
    reductions: list[GapReduction] = field(repr=False)
    worse: list[str] = field(repr=False)
    next_experiment: NextExperiment = field(repr=False)
    sentence: str
    notes: list[str]
    rig: Rig = field(repr=False)
    surface: IdealLimitSurface | None = field(repr=False)
    effects: dict[str, dict[str, Any]] = field(repr=False)
    corrected: list[Correction] = field(repr=False)
    evidence: dict[str, Evidence] = field(repr=False)
    residuals: dict[str, FloatArray] = field(repr=False)
    ends: dict[str, FloatArray] = field(repr=False)
    places: FloatArray = field(repr=False)
    poses: FloatArray = field(repr=False)
    loads: FloatArray = field(repr=False)
    headings: FloatArray = field(repr=False)
    orders: FloatArray = field(repr=False)
    speeds: FloatArray = field(repr=False)
    row_names: list[str] = field(repr=False)
    end_names: list[str] = field(repr=False)
    logs: list[str] = field(default_factory=list)
    #: what forces show of the fingers' friction, where that is named
    fingers: FingerForces | None = field(default=None, repr=False)
    #: what the named effects give in each push, and what is left there without them
    signatures: list[Signature] = field(default_factory=list, repr=False)
    #: correlation of the estimated parameters, and those at their bounds
    estimates: Estimates | None = field(default=None, repr=False)
    #: rows (n,) whose motion determines the load; the others are slow or turn about a support point, and count in no error of the
    #: wrench
    determined: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool), repr=False)
    #: time (s) of each row in its push
    times: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)
    #: friction of the fingers for a corrected scene; too few pushes show it to name it as the cause
    suspected_friction: float | None = None
    #: friction of the support beside the effects, over the believed one, where there are forces and a belief
    friction_level: float | None = None
    #: named effects that the log cannot tell apart; the others are certain
    apart: list[str] = field(default_factory=list, repr=False)
    #: effects of the lab's own that were not tested, and what the log lacks for them
    untested: dict[str, str] = field(default_factory=dict, repr=False)
    #: what to do about effects of the lab's own, where they say it
    remedies: dict[str, str] = field(default_factory=dict, repr=False)

    @property
    def steps(self) -> list[str]:
        """What to do, in order, against each named effect, and what the verdict asks for."""
        if self.verdict != "named":
            friction = self.suspected_friction
            plan = [] if friction is None else [f"stablepush correct, then plan again for friction {friction:.3g} of the fingers"]
            if (
                self.verdict == "absorbed"
                and self.reductions
                and all(e.before <= min(e.after, _WORSE * e.noise_floor) for e in self.reductions)
            ):
                # where the gap is near the noise a refit has little to go by
                return [_NO_NEARER, *plan]
            if self.verdict == "absorbed" and self.reductions and all(e.before <= e.after for e in self.reductions):
                return [_NOT_PREDICTED, *plan]
            if self.verdict == "ambiguous":
                certain = [id for id in self.named if id not in self.apart]
                return [*(f"{id}: {self._remedy(id)}" for id in certain), self.verdict.advice]
            if self.verdict == "unknown":
                after = self.next_experiment
                where = ": --html shows where it lies" if len(self.poses) or len(self.places) else ""
                pushes = "make the pushes of next_experiment, which --pushes writes" if after.pushes else after.why
                return [f"{self.verdict.advice}{where}", pushes, *plan]
            return plan if plan and self.verdict == "none" else [self.verdict.advice, *plan]
        remedies = [f"{id}: {self._remedy(id)}" for id in self.named]
        if self.surface_beside:
            remedies.append(f"{beside(self.rig)}: stablepush correct, then plan again")
        # what an import takes off changes no plan
        imported = all(id in CATALOGUE and CATALOGUE[id].import_key for id in self.named)
        far = [] if imported else self._predicted_worse()
        if far:
            told = [(e.channel, size_in_words(e.before, e.unit), size_in_words(e.after, e.unit)) for e in far]
            changes = ", ".join(f"{channel} {before} to {after}" for channel, before, after in told)
            remedies.append(
                f"but so corrected, pushes left out of the fit are predicted worse ({changes}): it may be another cause, or one "
                "that acts in another form; try single pushes of a corrected plan first"
            )
        return remedies

    def _predicted_worse(self) -> list[GapReduction]:
        """Channels that the correction predicts worse: all, if none is nearer, else those that are then clear of their floor."""
        if self.worse and all(entry.after >= entry.before for entry in self.reductions):
            return list(self.reductions)
        return [e for e in self.reductions if e.after > max(_WORSE * e.before, _BEYOND * e.noise_floor) and e.noise_floor > 0]

    @property
    def to_do(self) -> list[str]:
        """The :attr:`steps`; none where nothing is to be done."""
        return [] if self.verdict == "none" and self.suspected_friction is None else self.steps

    def _entry(self, id: str) -> RankedEffect | None:
        return next((entry for entry in self.ranking if entry.effect == id), None)

    def _remedy(self, id: str) -> str:
        if id not in CATALOGUE:
            return self.remedies.get(id) or LAB_REMEDY
        entry = self._entry(id)
        if uneven_axes(entry) is not None:
            return "calibrate each axis of the force sensor against known forces; fit again what was fitted to its readings"
        if id in OF_PRESSURE and self._lacks_surface:
            return _UNSIZED
        if id in OF_PRESSURE and self.rig.model is None and self.rig.slider.support is None and "wrench" in self.channels:
            return f"{CATALOGUE[id].remedy}; or stablepush fit this log: no surface was stated, and a fit finds this one, too"
        kind = CATALOGUE[id]
        if entry is not None and entry.form is not None and kind.remedy_in_form():
            return kind.remedy_in_form()
        late = kind.import_key and kind.shows_in == "pose" and not kind.moves_tracker
        stays = "; you need no new plan" if late and self.verdict == "named" and not self.changes_plans else ""
        return kind.remedy + stays + ("" if entry is None else self._in_numbers(entry))

    def _in_numbers(self, entry: RankedEffect) -> str:
        """What to write into the mapping of an import, for effects that it takes off."""
        kind, found = CATALOGUE[entry.effect], entry.estimates
        terms = [] if entry.form is None else entry.form["ci95"]
        if not kind.import_key or not found:
            return ""
        if any(low > 0 or high < 0 for low, high in terms):
            return ". Here it changes over the log: no one number takes it off"
        was = _at_import(self.rig, kind.import_key)
        unless = "" if was is not None else ", if the import had none"
        return f". Here{unless}: {kind.import_key}: {kind.import_value(found, was)}"

    @property
    def settled(self) -> bool:
        """Whether the log tells the causes that it names from all others that it can show."""
        others = [entry.probability for entry in self.ranking if entry.effect not in self.named and entry.identifiable]
        return self.verdict == "named" and max(others, default=0.0) < _UNLIKELY

    @property
    def effects_beside(self) -> dict[str, dict[str, Any]]:
        """The effects beside the first corrected surface: it holds those that change the pressure."""
        held = OF_PRESSURE if self.corrected and self.corrected[0].surface is not None else ()
        return {id: values for id, values in self.effects.items() if id not in held}

    @property
    def surface_differs(self) -> bool:
        """Whether the limit surface of the corrected simulation is not the nominal one."""
        surface = self.corrected[0].surface if self.corrected else None
        return surface is not None and surface is not self.rig.model

    @property
    def surface_beside(self) -> bool:
        """Whether another limit surface was found, and no named cause changes how the object slides."""
        return self.verdict == "named" and self.surface_differs and not self._changing()

    @property
    def _lacks_surface(self) -> bool:
        """Whether the corrected rig has no surface of its own. A comparison with another simulator's log corrects no rig."""
        return bool(self.corrected) and not self.surface_differs

    def _changing(self) -> list[str]:
        """The named effects with which plans differ."""
        carried = [id for id in self.named if not (id in OF_PRESSURE and self._lacks_surface)]
        return [id for id in carried if id in CATALOGUE and (CATALOGUE[id].moves_tracker or CATALOGUE[id].changes_plans)]

    @property
    def changes_plans(self) -> bool:
        """Whether plans for the scene that :func:`stablepush.correct` makes differ. Effects of sensors change none, a limit
        surface that is not the believed one does."""
        if self.suspected_friction is not None:
            return bool(self.corrected)
        if self.verdict == "named":
            return bool(self._changing()) or self.surface_differs
        return self.verdict in ("absorbed", "ambiguous") and bool(self.corrected)

    @property
    def support_friction(self) -> float | None:
        """Support friction of the corrected simulation, the friction load of its surface over the slider's weight.

        None if nothing was refitted to forces, if the rig states none or has a model instead, or if it is the rig's to 1 %.
        """
        believed, slider = self.rig.support_friction, self.rig.slider
        surface = self.corrected[0].surface if self.corrected else None
        refitted = self.verdict in ("absorbed", "named") and "wrench" in self.channels and self.rig.model is None
        if not refitted or not isinstance(surface, IdealLimitSurface) or not believed or not slider.mass:
            return None
        found = surface.friction_load / (slider.mass * self.rig.gravity)
        return None if abs(found - believed) <= _SAME * believed else found

    def pose_errors(self, key: str) -> FloatArray:
        """Return the errors (n, 2) of final positions in W, measured less simulated, in m.

        ``key``: "before" or "after" the correction. :attr:`ends` has them in the frame of the simulated poses, ``(x, y, rho θ)``.
        """
        turned = self.places[:, 2] - self.ends[key][:, 2] / self.rig.slider.characteristic_length
        return rotate_vectors(turned, self.ends[key][:, :2])

    def to_json(self) -> dict[str, Any]:
        """Return the ``diagnosis/1`` of the report."""
        return {
            "format": "diagnosis/1",
            "log": self.log,
            "trials": self.trials,
            "slider": slider_to_json(self.rig.slider),
            "support_friction": self.support_friction or self.rig.support_friction,
            "channels": self.channels,
            "gap": as_json(self.gap),
            "where": [
                {
                    "channel": f.channel, "component": f.component, "covariate": f.covariate,
                    "share": round(f.share, 4), "p_value": round(f.p_value, 4), "plot": None,
                }
                for f in self.where
            ],
            "verdict": str(self.verdict),
            "effects": self.named,
            "ranking": as_json(self.ranking),
            "shrink": as_json(self.reductions),
            "worse": self.worse,
            "logs": self.logs or [self.log],
            "corrected": [entry.to_json() for entry in self.corrected],
            "next_experiment": as_json(self.next_experiment),
            "sentence": self.sentence,
            "notes": self.notes,
        }  # fmt: skip


def beside(rig: Rig) -> str:
    """What is said of a limit surface that is another than the rig's, where no cause that is named changes it."""
    even = rig.model is None and rig.slider.support is None
    believed = "that of an even pressure under the outline, which was assumed" if even else "the believed one"
    return f"besides, the limit surface is not {believed}"


def without_causes(
    log: PushLog,
    name: str,
    verdict: Verdict,
    gaps: list[ChannelGap],
    reduced: list[GapReduction],
    sentence: str,
    notes: list[str],
    reason: str = "",
) -> GapReport:
    """Return the report of a log in which no cause can be told, for a ``reason``; that of each effect if it is not given."""
    reasons = {id: reason or kind.unseen for id, kind in CATALOGUE.items()}
    ranking = [RankedEffect(id, 0.02, {}, False, reasons[id]) for id in CATALOGUE]
    nothing = np.zeros((0, 3))
    after = NextExperiment([], [], "make more pushes, at varied headings, places, speeds and faces, in random order")
    return GapReport(
        name, len(log), [entry.channel for entry in gaps], verdict, [], gaps, [], ranking, reduced, [], after, sentence, notes,
        log.rig, None, {}, [], {id: not_identifiable(reasons[id]) for id in CATALOGUE}, {}, {}, nothing, nothing, nothing,
        np.zeros(0), np.zeros(0), np.zeros(0), [], [],
    )  # fmt: skip


def _at_import(rig: Rig, key: str) -> Any:
    """What the import of a log took off already, as its ``rig.json`` says: a number, or a pose (3,); None if it does not say."""
    source = (rig.extra or {}).get("source")
    value = source.get(key) if isinstance(source, Mapping) else None
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    fits = numbers.shape == ((3,) if key == "body_pose" else ()) and bool(np.isfinite(numbers).all())
    return numbers if fits and key == "body_pose" else float(numbers) if fits else None
