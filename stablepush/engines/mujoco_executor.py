"""Pushes in MuJoCo: feet on vertical slides, so that the pressure is prescribed. Needs the extra ``sim``."""

from __future__ import annotations

import mujoco
import numpy as np

from stablepush.engines.executor import GRAVITY, HEAVY, HEIGHT, Executor, Fingers, SliderOnFeet
from stablepush.engines.mjcf import BOX, FEET, FINGERS, GROUND, OPTION, STEP, convex_parts, slider_parts, solid_meshes

#: After how many steps the commanded motion is updated.
_EVERY = 4


class MujocoExecutor(Executor):
    """A slider on feet and fingers in MuJoCo."""

    tick = STEP * _EVERY

    def __init__(self, slider: SliderOnFeet, fingers: Fingers) -> None:
        super().__init__(fingers)
        # the first tangent of a foot's contact lies along y: the world is turned until the grain does
        self._turn = 0.5 * np.pi - slider.grain[1] if slider.grain[0] != 1.0 else 0.0
        self._model = mujoco.MjModel.from_xml_string(_xml(slider, fingers))
        self._data = mujoco.MjData(self._model)

    def _place(self, slider: np.ndarray, pusher: np.ndarray) -> np.ndarray:
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:3], self._data.qpos[-3:] = _turned(np.stack((slider, pusher)), self._turn)
        return self._poses()

    def _advance(self, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        velocity = _turned(np.array((*rate[:2], 0.0))[None], self._turn)[0, :2]
        self._data.qvel[-3:] = (*velocity, rate[2])
        mujoco.mj_step(self._model, self._data, nstep=_EVERY)
        x, y, omega = self._data.qvel[-3:]
        left = _turned(np.array((x, y, 0.0))[None], -self._turn)[0, :2]
        return self._poses(), np.array((*left, omega))

    def _poses(self) -> np.ndarray:
        return _turned(np.stack((self._data.qpos[:3], self._data.qpos[-3:])), -self._turn)


EXECUTOR = MujocoExecutor


def _turned(poses: np.ndarray, angle: float) -> np.ndarray:
    """Poses (n, 3) seen in a frame that is turned back by an angle."""
    if angle == 0.0:
        return poses
    c, s = np.cos(angle), np.sin(angle)
    return np.stack((c * poses[:, 0] - s * poses[:, 1], s * poses[:, 0] + c * poses[:, 1], poses[:, 2] + angle), axis=-1)


def _xml(slider: SliderOnFeet, fingers: Fingers) -> str:
    planar = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
    (ratio, direction), pairs = slider.grain, ""
    if ratio != 1.0:
        along, across = slider.friction * ratio**0.5, slider.friction / ratio**0.5
        pairs = "".join(
            f'<pair geom1="table" geom2="foot{k}" condim="3" friction="{along} {across} 0.005 0.0001 0.0001" {FEET}/>'
            for k in range(len(slider.feet))
        )
    turn = 0.5 * np.pi - direction if ratio != 1.0 else 0.0
    sx, sy, _ = GRAVITY * _turned(np.array((*slider.slope, 0.0))[None], turn)[0]
    tips = "".join(
        f'<geom type="sphere" size="{fingers.radius}" pos="{x} {y} 0" mass="{HEAVY}" friction="{fingers.friction}" '
        f'priority="1" {BOX} {FINGERS}/>'
        for x, y in fingers.centers
    )
    parts = convex_parts(slider.outline)
    return f"""
    <mujoco><option {OPTION} gravity="{sx} {sy} -{GRAVITY}"/>
    <asset>{solid_meshes(parts)}</asset><default><geom condim="3"/></default>
    <contact>{pairs}</contact>
    <worldbody><geom name="table" type="plane" size="3 3 0.1" {GROUND}/>
    <body>{planar}{slider_parts(slider, parts)}</body>
    <body pos="0 0 {HEIGHT}" gravcomp="1">{planar}{tips}</body></worldbody></mujoco>"""
