"""The finger radius, or the place of contact, is away from nominal."""

from __future__ import annotations

import numpy as np

from stablepush.core import FloatArray
from stablepush.effects.kind import EffectKind, Family, Parameter, PushSetup, ReplayedPush, RigBounds, TouchingRows


class ContactGeometry(EffectKind):
    number, id = 11, "contact-geometry"
    what = "finger radius or contact place away from nominal"
    acts = "contact"
    needs = "poses of the pusher and the slider in contact, from several sides"
    unseen = "needs poses of the pusher, the radius of its fingers, and forces or pushes of several faces"
    remedy = "measure the fingers; stablepush correct has the radius"
    says = "The fingers act as if their radius were {radius}"
    parameters = (Parameter("radius", "m", None, 0.0, 0.02, least=0.0, most=1.0),)
    size, plausible, pose_step = 1, 0.01, 5e-4
    family = Family("place o of the push in the log", ("o - 1/2",), "m", 0.01)
    in_clearances = of_radius = True
    shows_in = "pose"
    instead = "the fingers are finger_radius and the points of the contacts"
    engines = ("mujoco", "drake")

    def at_start(self, setup: PushSetup, push: ReplayedPush, value: FloatArray) -> PushSetup:
        return setup._replace(pusher=push.thicker(float(value[0]))) if push.logged else setup

    def clearance_slope(self, touch: TouchingRows, value: FloatArray) -> FloatArray:
        return np.full((len(touch.chosen), 1), touch.off)

    def largest(self, bounds: RigBounds) -> float:
        return bounds.radius

    def limited(self, value: FloatArray, bounds: RigBounds) -> FloatArray:
        return np.maximum(value, -np.inf if bounds.finger_radius is None else -bounds.finger_radius)
