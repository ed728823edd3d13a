"""The verdict on a log: whether what was found explains the gap, or whether anything is left to be explained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.judge.gap_reduction import (
    FITS,
    HeldOut,
    above_floor,
    clearance_reduction,
    gap,
    reductions,
    wrenches_lack_of_fit,
)
from stablepush.diagnosis.judge.negligible import changes_nothing
from stablepush.diagnosis.judge.where import flexible_share, repeats_share
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.final_pose import FinalPoses
from stablepush.diagnosis.likelihood.likelihood import Likelihood
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.likelihood.robust import robust_variance
from stablepush.diagnosis.results import ChannelGap, GapReduction, Verdict
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.diagnosis.search.folds import folds_of, predicted
from stablepush.diagnosis.search.friction_from_poses import lost_pushes
from stablepush.effects import CATALOGUE
from stablepush.io import PushLog

#: Share of the gap of some channel that named effects must explain on left-out pushes. On 75 logs of simulated rigs those that
#: acted explained 0.84 at least, 0.46 where the stated noise is too small; stand-ins for a wrong scale of the tracker 0.39.
_LITTLE = 0.4
#: Residuals count up to this multiple of their noise.
_MOST_OVER_NOISE = 10.0
#: Mean square of a channel over its floor from which a share of the gap is known.
_WELL = 2.0
#: The verdict is "unknown" if place, heading, order or speed explain so much of the residuals, with so small a p-value, and the
#: residuals are this multiple of the noise.
_UNKNOWN_SHARE, _UNKNOWN_P, _UNKNOWN_SIZE = 0.25, 0.03, 1.3
#: Residuals of this multiple of the noise are no fit, whatever they depend on.
_NO_FIT = 4.0
#: Nor are means of trials so large over the noise, in mean square, if repeats of a push share them with so small a p-value.
_COMMON, _P_COMMON = 8.0, 1e-3
#: Places of the last wave of a family of anisotropy in its values: two lobes, four, six.
_WAVES = 4
#: So many pushes whose fingers slip though the nominal simulation calls them stable are not "none".
_SLIPPING = 2
#: Largest significant p-value; pose errors must also be this multiple of their floor.
_SIGNIFICANT, _OFF = 0.01, 2.0
#: Final poses are spoilt if their error grows by this factor, and the interval of their gap reduction ends below this.
_SPOILT, _SURELY_WORSE = 1.4, -1.0
#: A channel stands clear of its floor if that is significant, or at this multiple of it, because of a few pushes.
_FAR = 3.0
#: A refit that leaves this multiple of the noise is no fit; nor one that leaves this share of the mean square gap of the wrench.
_MISFIT, _LEFT_OF_GAP = 1.5, 0.25
#: Shares of a gap that effects may leave of what a refit without them leaves, and of what the nominal simulation leaves.
_LEAVES_OF_REFIT, _LEAVES = 0.5, 0.1
#: A correction that explains less of the gap of final poses brings none of them nearer.
_NEXT_TO_NONE = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Judgement:
    """A verdict, and what it rests on.

    ``effects`` that are named or confounded; ``apart``: those of them that the log cannot tell apart; ``gaps`` by channel,
    ``clear``: those that stand clear of their floor; ``reductions``: how far the correction reduces them, ``touch``: in how
    fingers touch; ``lost``: pushes that ended far from where the nominal simulation has them, by trial, and how far (m);
    ``slipping``: trials whose fingers slipped though they should not; ``share`` of the residuals that place, heading, order and
    speed could explain, with its p-value; ``unnamed``: why what was found is not named, blank if it is.
    """

    verdict: Verdict
    effects: list[str]
    apart: list[str]
    gaps: list[ChannelGap]
    clear: list[ChannelGap]
    reductions: list[GapReduction]
    touch: float
    lost: Mapping[int, float]
    slipping: list[int]
    share: float
    p_share: float
    unnamed: str


def judge(found: Attribution, held: HeldOut, log: PushLog, poses: FinalPoses, simulator_is_off: bool) -> Judgement:
    """Return the verdict. ``simulator_is_off``: another simulator's log, as the nominal simulation, clearly differs."""
    likelihood = found.likelihood
    share, p_share, size, shared = _left(found, held)
    reduced, touch, gaps = reductions(held), clearance_reduction(held), gap(likelihood, held)
    clear = [entry for entry in gaps if stands_clear(entry)]
    lost, slipping = lost_pushes(poses), slipping_unexpectedly(likelihood.experiment, held, log)
    worse = _explains_too_little(found, held, clear) or _brings_nothing_nearer(found, reduced, touch)
    trivial = changes_nothing(found, held)
    effects: list[str] = []
    apart: list[str] = []
    unnamed = ""

    def nameless() -> Verdict:
        no_fit = _fits_nothing(likelihood, held, size, shared) or bool(lost)
        beyond = len(slipping) >= _SLIPPING or (simulator_is_off and not poses.pushes)
        return _without_names(found, held, poses, no_fit, beyond, clear)

    patterned = share > _UNKNOWN_SHARE and p_share < _UNKNOWN_P and size > _UNKNOWN_SIZE
    if trivial:
        off = bool(clear or lost) or len(slipping) >= _SLIPPING
        verdict = nameless() if off else Verdict.NONE
        unnamed = "it changes loads and poses by next to nothing"
    elif worse:
        verdict, unnamed = Verdict.UNKNOWN, "it fits these pushes, but does not predict left-out ones better"
    elif found.named and not found.model.families and _spoils_poses(held, reduced):
        # a form that the catalogue does not have cannot be simulated
        verdict, unnamed = Verdict.UNKNOWN, "its correction would throw off final poses that the nominal simulation has right"
    elif waves := _other_waves(found):
        # with another law of friction, what the fingers do is no measure of theirs either
        verdict, unnamed = Verdict.UNKNOWN, waves
    elif leaves_lost_pushes(found, held, poses):
        verdict, unnamed = Verdict.UNKNOWN, "pushes that the nominal simulation has elsewhere end as far from where it puts them"
    elif patterned and not explains_most(held, found.named):
        verdict, unnamed = Verdict.UNKNOWN, "the remaining residuals still depend on place, heading, order or speed"
    elif found.confounded:
        verdict = Verdict.AMBIGUOUS
        apart = [found.confounded_with, *found.confounded]
        effects = [*apart, *(id for id in found.named if id != found.confounded_with)]
    elif found.named:
        verdict, effects = Verdict.NAMED, found.named
    else:
        verdict = nameless()
    return Judgement(verdict, effects, apart, gaps, clear, reduced, touch, lost, slipping, share, p_share, unnamed)


def _other_waves(found: Attribution) -> str:
    """Why friction over direction is no anisotropy; blank if it is, or is even.

    Anisotropy has two lobes, of an amplitude of half the difference of its squares over their mean. A family may give it more of
    four and six; where these are larger it is another law, of which anisotropy is the part that its family happens to hold.
    """
    for id, kind in CATALOGUE.items():
        if kind.two_lobed and id in found.named and len(values := found.final.values.get(id, ())) > _WAVES:
            two, *others = (float(np.hypot(*values[k : k + 2])) for k in range(0, _WAVES + 1, 2))
            largest = int(np.argmax(others))
            if others[largest] > two / 2:
                lobes = 4 + 2 * largest
                maker = "; four are those of a simulator's pyramidal friction cone" if lobes == 4 else ""
                return (
                    f"friction over direction has {lobes} lobes of an amplitude of {others[largest]:.3f}, larger than the two "
                    f"that anisotropy has{maker}"
                )
    return ""


def _fits_nothing(likelihood: Likelihood, held: HeldOut, size: float, shared: bool) -> bool:
    """Whether residuals are such that no model here fits: not only in a few rows, or shared by repeats of a push; without forces,
    if many pushes end far off."""
    if likelihood.wrench is None:
        return pose_errors_are_significant(held)
    # precise sensors see the error of rigid bodies, where no cause acts: that is no gap
    return (size > _NO_FIT or shared) and correction_leaves_more(likelihood, held)


def _without_names(
    found: Attribution,
    held: HeldOut,
    poses: FinalPoses,
    no_fit: bool,
    beyond: bool,
    clear: Sequence[ChannelGap],
) -> Verdict:
    """The verdict where no effect is named. ``beyond``: whether more is off than the channels that stand ``clear``."""
    if no_fit:
        return Verdict.UNKNOWN
    # a refit may predict better than a simulation that fits within the noise
    if not (clear or beyond):
        return Verdict.NONE
    # only means of pushes are off, within the noise of a row, and no refit is shown to do better
    if not (found.recalibrated or beyond) and all(entry.nominal <= entry.noise_floor for entry in clear):
        return Verdict.NONE if _refit_may_absorb(found.likelihood, held, poses, clear) else Verdict.UNKNOWN
    # a refit that leaves pushes where they were absorbs nothing of that
    nearer = found.recalibrated and not refit_leaves_poses_off(held) and not _leaves_a_gap(held, clear)
    absorbed = nearer or _refit_may_absorb(found.likelihood, held, poses, clear)
    return Verdict.ABSORBED if absorbed else Verdict.UNKNOWN


def _left(found: Attribution, held: HeldOut) -> tuple[float, float, float, bool]:
    """What the corrected simulation leaves of wrenches: the share that covariates could explain and its p-value, the size over
    the noise, and whether repeats of a push share it."""
    experiment, wrench = found.likelihood.experiment, found.likelihood.wrench
    if wrench is None:
        return 0.0, 1.0, 0.0, False
    white = wrench.white(experiment.observations.wrench - held.wrenches["after"]).reshape(-1, 3)
    share, p_share = flexible_share(experiment, white)
    common, p_common = repeats_share(experiment, found.final.residual[: white.size].reshape(-1, 3))
    return share, p_share, float(np.sqrt(robust_variance(white**2))), common > _COMMON and p_common < _P_COMMON


def _explains_too_little(found: Attribution, held: HeldOut, clear: Sequence[ChannelGap]) -> bool:
    """Whether gaps are well above their floors, and what was found explains little of each: a stand-in for another cause.

    Neither of the gap of the nominal simulation nor of what a refitted surface leaves, as where feet were not known. Several logs
    together are not asked this: a cause must show in each of them, and the surface of each is fitted to few pushes.
    """
    likelihood = found.likelihood
    if likelihood.experiment.logs > 1 or not found.named:
        return False
    gaps = [
        (*(float(held.squares[channel][key].mean()) for key in FITS), held.floors[channel])
        for channel in ("touch", *(entry.channel for entry in clear))
        if channel in held.squares
    ]
    # few rows of slow motions, whose loads noise leaves open, may be most of a mean square: so each row by its own noise, too
    if any(entry.channel == "wrench" and entry.nominal**2 > _WELL * entry.noise_floor**2 for entry in clear):
        gaps.append((*(_over_noise(likelihood, held.wrenches[key]) for key in FITS), 1.0))
    shares = []
    for before, refit, after, floor in gaps:
        # a refit that predicts worse is no measure of what is not fitted beside one
        bases = (before, refit if found.free and after < before else min(refit, before))
        # a gap near its floor has no share that says anything
        shares += [(base - after) / (base - floor) for base in bases if base > _WELL * floor > 0]
    return bool(shares) and max(shares) < _LITTLE


def _over_noise(likelihood: Likelihood, wrenches: FloatArray) -> float:
    """Mean square of what predicted wrenches (n, 3) leave of the rows, over the noise; a component counts up to ten times it."""
    assert likelihood.wrench is not None
    left = likelihood.wrench.white(likelihood.experiment.observations.wrench - wrenches)
    return float(np.minimum(left**2, _MOST_OVER_NOISE**2).mean())


def _brings_nothing_nearer(found: Attribution, reduced: Sequence[GapReduction], touch: float) -> bool:
    """Whether what was found reduces no channel on trials that it was not fitted to: then it explains nothing."""
    if not (found.named and reduced) or max(touch, *(entry.closed for entry in reduced)) > 0:
        return False
    if not (found.chosen and found.scores):
        return True
    # a few uninformative rows may hide it from the mean square
    likelihood, folds = found.likelihood, folds_of(found.likelihood.experiment)
    models = found.model, found.model.of(())
    with_them, without = (predicted(likelihood, model, folds).density for model in models)
    return not likelihood.significantly_better(with_them, without)


def _spoils_poses(held: HeldOut, reduced: Sequence[GapReduction]) -> bool:
    """Whether a correction makes final poses clearly worse that were within the noise. Then another cause is present."""
    pose = next((entry for entry in reduced if entry.channel == "pose"), None)
    if pose is None or "wrench" not in held.squares or "pose" not in held.squares:
        return False
    before, after = (float(held.squares["pose"][key].mean()) for key in ("before", "after"))
    return before < held.floors["pose"] and after > _SPOILT**2 * before and pose.ci95[1] < _SURELY_WORSE


def leaves_lost_pushes(found: Attribution, held: HeldOut, poses: FinalPoses) -> bool:
    """Whether pushes of a log without forces are lost, and a correction brings next to none of the final poses nearer: a finger
    that leaves a lost slider touches it where no cause has it, and what explains that is a stand-in."""
    likelihood = found.likelihood
    if likelihood.wrench is not None or not found.chosen or not lost_pushes(poses):
        return False
    return _leaves_poses(reductions(held), [entry for entry in gap(likelihood, held) if stands_clear(entry)])


def _leaves_poses(reduced: Sequence[GapReduction], clear: Sequence[ChannelGap]) -> bool:
    """Whether final poses stand clear of their floor, and a correction brings next to none of them nearer."""
    pose = next((entry for entry in reduced if entry.channel == "pose"), None)
    return pose is not None and pose.closed < _NEXT_TO_NONE and any(entry.channel == "pose" for entry in clear)


def _leaves_a_gap(held: HeldOut, clear: Sequence[ChannelGap]) -> bool:
    """Whether a refit leaves a quarter or more of the mean square gap of the wrench, and clearly more than noise.

    Both are those of pushes that it was not fitted to.
    """
    if not any(entry.channel == "wrench" for entry in clear):
        return False
    before, after = (float(held.squares["wrench"][key].mean()) for key in ("before", "after"))
    return after > _FAR**2 * held.floors["wrench"] and after > _LEFT_OF_GAP * before


def _refit_may_absorb(likelihood: Likelihood, held: HeldOut, poses: FinalPoses, clear: Sequence[ChannelGap]) -> bool:
    """Whether a refit fits what stands clear, though few trials do not show that it predicts others better.

    A push that is like no other is lost by a fit to the others. That says nothing against a surface that fits all.
    """
    of_forces = bool(clear) and all(entry.channel in ("wrench", "twist") for entry in clear)
    return of_forces and refit_leaves_noise(likelihood, held) and not _refit_moves_poses(likelihood, held, poses)


def _refit_moves_poses(likelihood: Likelihood, held: HeldOut, poses: FinalPoses) -> bool:
    """Whether pushes end clearly elsewhere than a surface has them that is fitted to all."""
    pushes = poses.pushes
    if not (pushes and refit_leaves_poses_off(held)):
        return False
    fit = likelihood.fit(Model())
    errors = poses.errors(pushes, fit.loads, {id: v for id, v in fit.values.items() if id in likelihood.nuisance})
    left = (errors**2).sum(axis=1)
    return not np.isfinite(left).all() or _poses_off(left, np.array([push.trial for push in pushes]), held.floors["pose"])


def explains_most(held: HeldOut, effects: Sequence[str]) -> bool:
    """Return whether the corrected simulation explains most of the gap of the wrench.

    Effects that a refitted pressure cannot explain must reduce the gap that a refit without effects leaves to a half. A smaller
    reduction may come from a cause outside of the catalogue that they fit in part; a larger one is not asked, as an effect whose
    form differs from the catalogue's leaves a gap, too. The other effects act like a refit: they must leave a tenth of the gap
    of the nominal simulation or less.
    """
    beyond = any(id not in CATALOGUE or (CATALOGUE[id].in_loads and CATALOGUE[id].reshapes != "pressure") for id in effects)
    base, most = ("refit", _LEAVES_OF_REFIT) if beyond else ("before", _LEAVES)
    gap, after = (float(held.squares["wrench"][k].mean()) for k in (base, "after"))
    floor = min(held.floors["wrench"], after)
    return bool((after - floor) < most * (gap - floor))


def pose_errors_are_significant(held: HeldOut) -> bool:
    """Return whether the pose errors of the corrected simulation are far larger than noise, and not in a few pushes only."""
    if "pose" not in held.squares:
        return False
    left, floor = held.squares["pose"]["after"], held.floors["pose"]
    return bool(left.mean() > _OFF**2 * floor) and above_floor(left, held.trials["pose"], floor) < _SIGNIFICANT


def stands_clear(entry: ChannelGap) -> bool:
    """Return whether what the nominal simulation leaves of a channel is more than its floor.

    Its p-value says so; or the size of poses and directions of motion, where a few pushes are far off. Labels of stability have
    no floor: :func:`slipping_unexpectedly` counts those that are wrong.
    """
    if entry.channel == "stability":
        return False
    far = entry.channel != "wrench" and 0 < _FAR * entry.noise_floor < entry.nominal
    return far or entry.p_lack_of_fit < _SIGNIFICANT


def refit_leaves_noise(likelihood: Likelihood, held: HeldOut) -> bool:
    """Return whether a refitted surface leaves no more of the wrenches that it is fitted to than noise, and of the directions
    of motion of other pushes."""
    wrench = likelihood.wrench
    if wrench is None:
        return False
    if above_floor(held.squares["twist"]["refit"], held.trials["twist"], held.floors["twist"]) < _SIGNIFICANT:
        return False
    fit = likelihood.fit(Model())
    left = likelihood.rows_of(wrench, fit.residual)
    predicted = wrench.predict(fit.loads, fit.values)
    return bool(np.sqrt(np.mean(left**2)) < _MISFIT and wrenches_lack_of_fit(likelihood, predicted) > _SIGNIFICANT)


def correction_leaves_more(likelihood: Likelihood, held: HeldOut) -> bool:
    """Return whether the corrected simulation leaves more of the wrenches of other pushes than their floor."""
    return likelihood.wrench is not None and wrenches_lack_of_fit(likelihood, held.wrenches["after"]) < _SIGNIFICANT


def refit_leaves_poses_off(held: HeldOut) -> bool:
    """Return whether pushes that a refitted surface was not fitted to end clearly elsewhere than it has them."""
    if "pose" not in held.squares:
        return False
    return _poses_off(held.squares["pose"]["refit"], held.trials["pose"], held.floors["pose"])


def _poses_off(left: FloatArray, trials: np.ndarray, floor: float) -> bool:
    size = float(np.sqrt(left.mean() / floor))
    return size > _FAR or (size > _MISFIT and above_floor(left, trials, floor) < _SIGNIFICANT)


def slipping_unexpectedly(experiment: Experiment, held: HeldOut, log: PushLog) -> list[int]:
    """Return the numbers of the trials whose fingers slipped although the nominal simulation calls them stable.

    Both fingers must be seen to touch at once: one that never met the slider is no slip.
    """
    if "stability" not in held.squares:
        return []
    stable = np.asarray(log.trials["stable"], dtype=np.float64)
    wrong = held.squares["stability"]["before"] > 0
    o = experiment.observations
    both = set(o.trial[np.isfinite(o.normal).all(axis=(1, 2))].tolist())
    return [int(trial) for trial in held.trials["stability"][wrong] if stable[trial] == 0 and trial in both]
