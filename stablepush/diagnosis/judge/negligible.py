"""Causes that no plan needs: significant, but other pushes are predicted nearly as well without them."""

from __future__ import annotations

from dataclasses import replace

from stablepush.diagnosis.judge.gap_reduction import HeldOut, hold_out
from stablepush.diagnosis.likelihood.final_pose import FinalPoses
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.effects import FINGER_FRICTION
from stablepush.io import PushLog

#: Reductions below this share of the mean square count as zero. Effects that acted reduced that of some channel by
#: 3 % at least on 112 logs of simulated rigs.
_NEXT_TO_NOTHING = 0.015


def negligible_causes(found: Attribution, held: HeldOut, log: PushLog, poses: FinalPoses) -> list[str]:
    """Return the causes to set aside: all if together they change next to nothing, else the one that does least, if that is
    next to nothing, with those that it is confounded with.

    ``held``: how fits to other pushes, with what was found, predict each.
    """
    if changes_nothing(found, held):
        return [*found.chosen, *found.confounded]
    least: tuple[float, list[str]] = (_NEXT_TO_NOTHING, [])
    # noise would have to be alike in several logs to look like a cause
    likelihood = found.likelihood
    if len(found.named) < 2 or likelihood.experiment.logs > 1 or likelihood.wrench is None:
        return []
    for id in found.chosen:
        others = found.model.without(id)
        alike = found.confounded if found.confounded_with == id else []
        without = replace(
            found,
            model=others,
            confounded=[] if alike else found.confounded,
            confounded_with="" if alike else found.confounded_with,
            final=likelihood.fit(others),
        )
        share = _reduction_beside(held, hold_out(without, log, poses))
        if share < least[0]:
            least = share, [id, *alike]
    return least[1]


def changes_nothing(found: Attribution, held: HeldOut) -> bool:
    """Return whether what was found changes each channel, on trials that it was not fitted to, by less than rigid bodies err,
    or explains next to nothing of what a surface that was fitted alike leaves.

    It may be significant: noise that is not quite as stated looks like an effect as small, and means over rows show the impact of
    a finger as inertia. Friction of the fingers and clearances are judged by other things. Several logs together show effects as
    small: noise would have to be alike in each.
    """
    if found.likelihood.experiment.logs > 1 or not found.named or FINGER_FRICTION in found.named or "wrench" not in held.rigid:
        return False
    base = "refit" if found.free else "before"
    means = [(s[base].mean(), s["after"].mean()) for s in held.squares.values()]
    if all(abs(1 - after / before) < _NEXT_TO_NOTHING for before, after in means if before > 0):
        return True
    changes = {k: float(s["before"].mean() - s["after"].mean()) for k, s in held.squares.items()}
    if changes.pop("touch", 0.0) > 0.0:
        return False
    # rigid bodies predict whether a push is stable: what makes a prediction right is a change
    return abs(changes["wrench"]) < held.rigid["wrench"] and all(v <= held.rigid.get(k, 0.0) for k, v in changes.items())


def _reduction_beside(held: HeldOut, other: HeldOut) -> float:
    """Return the largest share, over the channels, by which one correction leaves less on left-out pushes than another does."""
    left = [(held.squares[k]["after"].mean(), other.squares[k]["after"].mean()) for k in held.squares if k in other.squares]
    return max((float(1 - mine / theirs) for mine, theirs in left if theirs > 0), default=0.0)
