"""A diagnosis as a value: what a log was, what was found, and how it is judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stablepush.diagnosis.judge.gap_reduction import HeldOut
from stablepush.diagnosis.judge.other_simulator import Comparison
from stablepush.diagnosis.judge.ranking import rank
from stablepush.diagnosis.judge.verdicts import Judgement
from stablepush.diagnosis.judge.where import Finding, localise, residuals
from stablepush.diagnosis.likelihood.final_pose import FinalPoses
from stablepush.diagnosis.likelihood.likelihood import Likelihood
from stablepush.diagnosis.results import RankedEffect
from stablepush.diagnosis.rows.observations import Observations
from stablepush.diagnosis.search.attribution import Attribution
from stablepush.diagnosis.search.contact_friction import suspected_friction
from stablepush.diagnosis.search.finger_forces import FingerForces, finger_forces
from stablepush.effects import FINGER_FRICTION
from stablepush.io import PushLog


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A log that is diagnosed.

    ``comparison``: beside another simulator's log; ``untested``: effects of the lab's own that it cannot show, and what it lacks;
    ``left_out``: pushes whose final poses are no measurements.
    """

    log: PushLog
    name: str
    observations: Observations
    poses: FinalPoses
    likelihood: Likelihood
    comparison: Comparison | None
    untested: Mapping[str, str]
    left_out: int


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What a log shows.

    ``found``: what acts; ``held``: every push as fits to the others predict it; ``judged``: the verdict; ``trivial`` and
    ``stand_ins``: causes that were set aside, for they change next to nothing, or leave lost pushes where they are; ``where`` the
    gap lies; ``ranking`` of all effects; ``fingers``: what forces show of their friction; ``suspected``: friction of the fingers,
    with its standard error, that too few pushes show to name it.
    """

    case: Case
    found: Attribution
    held: HeldOut
    judged: Judgement
    trivial: Sequence[str]
    stand_ins: Sequence[str]
    where: list[Finding]
    ranking: list[RankedEffect]
    fingers: FingerForces | None
    suspected: tuple[float, float] | None

    @property
    def reshaped(self) -> bool:
        """Whether the nominal surface has another shape. A change of all friction alike leaves it as it is."""
        fits, better = self.found.scores, self.found.likelihood.significantly_better
        return self.judged.verdict == "absorbed" or ("free" in fits and better(fits["free"], fits["scaled"]))


def diagnosis_of(
    case: Case,
    found: Attribution,
    held: HeldOut,
    judged: Judgement,
    trivial: Sequence[str],
    stand_ins: Sequence[str],
) -> Diagnosis:
    """Return the diagnosis of a log, with what follows from its verdict."""
    likelihood, reported = found.likelihood, judged.effects
    trials = np.array([push.trial for push in case.poses.pushes], dtype=int)
    ends = held.ends.get("before", np.zeros((0, 3)))
    left = residuals(likelihood, held.wrenches.get("before"), ends, trials, held.floors)
    forces, suspected = finger_forces(likelihood, found.final), None
    if forces is not None and case.comparison is None and FINGER_FRICTION not in reported:
        suspected = suspected_friction(forces, case.log.rig.contact_friction, judged.verdict == "unknown")
    return Diagnosis(
        case,
        found,
        held,
        judged,
        trivial,
        stand_ins,
        localise(likelihood.experiment, left),
        rank(found, reported),
        forces,
        suspected,
    )
