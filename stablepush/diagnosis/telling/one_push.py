"""The answer to a log of one push: how far it ends from where the simulation carries it. One push tells no causes apart."""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import chi2

from stablepush.diagnosis.judge.gap_reduction import rigid_square
from stablepush.diagnosis.likelihood.experiment import noise_of
from stablepush.diagnosis.likelihood.nominal import nominal_of
from stablepush.diagnosis.likelihood.replay import carried, friction_of, replays
from stablepush.diagnosis.results import ChannelGap, GapReduction, Verdict
from stablepush.diagnosis.rows.observations import Observations
from stablepush.diagnosis.telling.report import GapReport, without_causes
from stablepush.io import PushLog

#: p-value below which a push ends elsewhere than simulated.
_OFF = 1e-3
_WHY = "one push cannot tell causes apart"
_WHY_STILL = "did the tracker freeze, or the fingers miss?"
_TOO_LITTLE = "the log has fewer than two pushes in which the slider is seen to move: it cannot be diagnosed"


def of_one_push(log: PushLog, name: str, observations: Observations) -> GapReport:
    """Return the answer to a log in which one push moves, or none.

    The push is off if its pose error (3,) is more than noise of its poses, noise of its start as the simulation carries it on,
    and the error of a simulation with rigid bodies explain (a chi-square test).
    """
    pushes = replays(log, observations, whole=True)
    if len(pushes) != 1:
        return _too_little(log, name, observations)
    believed, slider, noise = nominal_of(log.rig), log.rig.slider, noise_of(log.rig, observations, 1.0)
    mu = log.rig.contact_friction if log.rig.contact_friction is not None else 1.0
    (error,), (moved,) = carried(pushes, friction_of(believed, believed.points, {}, 0.0), slider, mu, noise)
    rho = slider.characteristic_length
    own = np.array((noise.position, noise.position, rho * noise.angle))
    variance = own**2 + moved**2 + rigid_square(slider) / 3
    if not np.isfinite(error + variance).all():
        return _too_little(log, name, observations)
    far, floor = float(np.linalg.norm(error)), float(np.sqrt(variance.sum()))
    p = float(chi2.sf((error**2 / variance).sum(), 3))
    where = f"{1000 * float(np.hypot(*error[:2])):.3g} mm and {abs(math.degrees(error[2] / rho)):.2g} deg"
    sentence = f"The push ends {where} from where the simulation carries it (noise {1000 * floor:.2g} mm): {_WHY}."
    gap = ChannelGap("pose", "m", far, far, floor, p)
    reduced = GapReduction("pose", "m", 1, far, far, min(floor, far), 0.0, [0.0, 0.0], floor)
    verdict = Verdict.UNKNOWN if p < _OFF else Verdict.NONE
    return without_causes(log, name, verdict, [gap], [reduced], sentence, [], _WHY)


def _too_little(log: PushLog, name: str, observations: Observations) -> GapReport:
    """The answer to a log that can show nothing: that nothing is known is not that nothing is wrong."""
    still = len(observations.still)
    sentence = f"{_TOO_LITTLE[0].upper()}{_TOO_LITTLE[1:]}."
    if still:
        sentence += f" In {still} of {len(log)} pushes it stands: {_WHY_STILL}"
    return without_causes(log, name, Verdict.UNKNOWN, [], [], sentence, [_TOO_LITTLE])
