"""The slider's poses lag the pusher's and the forces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stablepush.core import FloatArray
from stablepush.effects.kind import EffectKind, Family, Parameter, ReplayedPush, RigBounds, TouchingRows
from stablepush.geometry import compose, exp, inverse, log as log_of

if TYPE_CHECKING:
    from stablepush.mechanics import PushTrace


class Latency(EffectKind):
    number, id = 15, "latency"
    what = "the slider's poses lag the pusher's and the forces"
    acts = "sensing"
    needs = "poses of pusher and slider at speeds that vary"
    unseen = "needs poses of pusher and slider at different speeds"
    remedy = (
        "set pose_delay (s) in the mapping of the import to this delay, and import the log again (fingers or an arm that "
        "bend under load delay the object as well)"
    )
    says = "The slider's poses lag all other readings by {delay}"
    parameters = (Parameter("delay", "s", 0.0, 0.0, 0.3, least=0.0),)
    size, plausible, small, pose_step = 1, 0.3, 5e-3, 0.02
    family = Family("place o of the push in the log", ("o - 1/2",), "s", 0.3)
    slots, term_slots = (19, 20), (50, 51)
    in_clearances = True
    shows_in, import_key = "pose", "pose_delay"
    engines = ("mujoco", "drake")

    def at_end(self, end: FloatArray, trace: PushTrace, push: ReplayedPush, value: FloatArray) -> FloatArray:
        delay = float(value[0]) if push.logged else 0.0
        if delay > 0:
            at = max(0.0, float(trace.t[-1]) - delay)
            i = int(np.clip(np.searchsorted(trace.t, at), 1, len(trace.t) - 1))
            share = (at - trace.t[i - 1]) / (trace.t[i] - trace.t[i - 1])
            return compose(trace.poses[i - 1], exp(share * log_of(compose(inverse(trace.poses[i - 1]), trace.poses[i]))))
        if delay < 0:
            # poses ahead of the pusher: on as it went last
            last = trace.t[-1] - trace.t[-2]
            return compose(end, exp(-delay / last * log_of(compose(inverse(trace.poses[-2]), end))))
        return end

    def clearance_slope(self, touch: TouchingRows, value: FloatArray) -> FloatArray:
        # how far the contact moves in the delay: its velocity grows meanwhile
        velocity = touch.velocity + float(value[0]) * touch.acceleration if len(value) else touch.velocity
        return -(touch.normal * velocity).sum(axis=1, keepdims=True)

    def largest(self, bounds: RigBounds) -> float:
        # no delay outlasts a push
        return bounds.longest_push

    def is_possible(self, own: FloatArray) -> bool:
        return bool(own[0] >= 0)

    def import_value(self, estimates: Mapping[str, Any], was: Any) -> str:
        return f"{estimates['delay'] + (was or 0.0):.4f}"
