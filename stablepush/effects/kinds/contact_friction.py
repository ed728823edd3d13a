"""Friction between pusher and slider is away from nominal."""

from __future__ import annotations

import numpy as np

from stablepush.core import FloatArray
from stablepush.effects.kind import EffectKind, Parameter, PushSetup, ReplayedPush


def friction_change(value: FloatArray, order: float) -> float:
    """Return what is added to the friction of the fingers in a push at a place in the log, 0 to 1; ``value``: in the middle of
    the log, and its change from the first push to the last, if it has one."""
    middle, *change = np.atleast_1d(value).tolist()
    return float(middle + sum(change) * (order - 0.5))


class ContactFriction(EffectKind):
    number, id = 10, "contact-friction"
    what = "friction between pusher and slider away from nominal"
    acts = "contact"
    needs = "pushes that slip along the face, with poses of the pusher"
    unseen = "needs forces of three pushes whose fingers slip, or press beyond the friction cone"
    remedy = "stablepush correct, then plan again; or use rougher fingers"
    says = "The friction of the fingers is {mu}"
    parameters = (Parameter("mu", "1", None, 0.0, 1.2, least=0.0),)
    size, plausible, pose_step = 1, 0.4, 0.03
    by_slip = True
    shows_in, curve = "pose", "fingers"
    instead = "friction of the fingers is mu of the contacts"
    engines = ("mujoco", "drake")

    def at_start(self, setup: PushSetup, push: ReplayedPush, value: FloatArray) -> PushSetup:
        return setup._replace(mu=max(0.0, setup.mu + friction_change(value, push.order)))
