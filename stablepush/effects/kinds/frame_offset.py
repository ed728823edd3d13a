"""The origin of the tracked frame is away from the centre of mass."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stablepush.core import FloatArray
from stablepush.effects.kind import EffectKind, Family, Parameter, PushSetup, ReplayedPush, RigBounds, TouchingRows
from stablepush.geometry import compose

if TYPE_CHECKING:
    from stablepush.mechanics import PushTrace

_HALF = "o - 1/2"


class FrameOffset(EffectKind):
    number, id = 14, "frame-offset"
    what = "origin of the tracked frame away from the centre of mass"
    acts = "sensing"
    needs = "forces with moments, or poses of a slider that turns"
    unseen = "needs moments, or fingers on several faces"
    remedy = (
        "either move body_pose in the mapping of the import back by the offset, along the axes of the slider, and import "
        "again; or plan with the scene that stablepush correct writes, which moves start and goal; not both"
    )
    says = "The tracked origin lies {offset} along x and y of the slider from the centre of mass"
    parameters = (Parameter("offset", "m in B", 0.0, -0.01, 0.01, 2),)
    size, plausible, small, pose_step = 2, 0.01, 2e-4, 5e-4
    family = Family("place o of the push in the log", (f"({_HALF}) along x", f"({_HALF}) along y"), "m", 0.01)
    slots, term_slots = (17, 19), (51, 53)
    in_clearances = moves_tracker = True
    # what is read late is of the tracked origin, too
    rank = 1
    shows_in, import_key = "pose", "body_pose"
    engines = ("mujoco", "drake")

    def at_start(self, setup: PushSetup, push: ReplayedPush, value: FloatArray) -> PushSetup:
        return setup._replace(start=compose(setup.start, -np.array((*value[:2], 0.0))))

    def at_end(self, end: FloatArray, trace: PushTrace, push: ReplayedPush, value: FloatArray) -> FloatArray:
        return compose(end, np.array((*value[:2], 0.0)))

    def clearance_slope(self, touch: TouchingRows, value: FloatArray) -> FloatArray:
        # the outline is drawn about the tracked origin: it lies off by minus the offset
        return touch.normal

    def largest(self, bounds: RigBounds) -> float:
        return bounds.radius

    def import_value(self, estimates: Mapping[str, Any], was: Any) -> str:
        x, y = estimates["offset"]
        pose = compose(np.zeros(3) if was is None else np.asarray(was), (-x, -y, 0.0)) + 0.0
        return f"[{pose[0]:.5f}, {pose[1]:.5f}, {pose[2]:.5g}]"
