"""Pushes in MuJoCo: feet on vertical slides, so that the pressure is prescribed. Needs the extra ``sim``."""

from __future__ import annotations

import mujoco
import numpy as np
import shapely

from stablepush.engines.executor import FOOT, GRAVITY, HALF, HEAVY, HEIGHT, IN_FEET, Executor, Fingers, SliderOnFeet

#: Step (s), and after how many steps the commanded motion is updated.
_STEP, _EVERY = 5e-4, 4
#: Contacts of feet: with a time constant of 1 ms instead of 10 the forces of the fingers chatter, and the slider creeps along
#: them by half a millimetre a second.
_FEET = 'solref="0.01 1" solimp="0.99 0.999 0.0001"'
#: Contacts of fingers: they give a little, or they would bounce.
_FINGERS = 'solref="0.003 1" solimp="0.3 0.3 0.001"'


class MujocoExecutor(Executor):
    """A slider on feet and fingers in MuJoCo."""

    tick = _STEP * _EVERY

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
    # feet meet the table, not each other; fingers meet the slider
    ground, table, box = 'contype="1" conaffinity="0"', 'contype="0" conaffinity="1"', 'contype="2" conaffinity="2"'
    feet = "".join(
        f'<body pos="{x} {y} 0"><joint type="slide" axis="0 0 1"/><geom name="foot{k}" type="sphere" size="{FOOT}" '
        f'pos="0 0 {FOOT}" mass="{share * IN_FEET * slider.mass}" friction="{slider.friction}" priority="1" {table} {_FEET}/>'
        "</body>"
        for k, ((x, y), share) in enumerate(zip(slider.feet, slider.shares, strict=True))
    )
    (ratio, direction), pairs = slider.grain, ""
    if ratio != 1.0:
        along, across = slider.friction * ratio**0.5, slider.friction / ratio**0.5
        pairs = "".join(
            f'<pair geom1="table" geom2="foot{k}" condim="3" friction="{along} {across} 0.005 0.0001 0.0001" {_FEET}/>'
            for k in range(len(slider.feet))
        )
    turn = 0.5 * np.pi - direction if ratio != 1.0 else 0.0
    sx, sy, _ = GRAVITY * _turned(np.array((*slider.slope, 0.0))[None], turn)[0]
    tips = "".join(
        f'<geom type="sphere" size="{fingers.radius}" pos="{x} {y} 0" mass="{HEAVY}" friction="{fingers.friction}" '
        f'priority="1" {box} {_FINGERS}/>'
        for x, y in fingers.centers
    )
    parts = _convex_parts(slider.outline)
    meshes = "".join(f'<mesh name="part{k}" vertex="{_corners(part)}"/>' for k, part in enumerate(parts))
    solids = "".join(f'<geom type="mesh" mesh="part{k}" pos="0 0 {HEIGHT}" {box} {_FINGERS}/>' for k in range(len(parts)))
    # what is not in the feet sits at the origin of B, not at the middle of the mesh, and does not press on them
    return f"""
    <mujoco><option timestep="{_STEP}" cone="elliptic" impratio="1000" solver="Newton" tolerance="1e-12" iterations="50"
      gravity="{sx} {sy} -{GRAVITY}"/>
    <asset>{meshes}</asset><default><geom condim="3"/></default>
    <contact>{pairs}</contact>
    <worldbody><geom name="table" type="plane" size="3 3 0.1" {ground}/>
    <body>{planar}<inertial pos="0 0 {HEIGHT}" mass="{(1 - IN_FEET) * slider.mass}" diaginertia="1e-5 1e-5 1e-5"/>
      {solids}{feet}</body>
    <body pos="0 0 {HEIGHT}" gravcomp="1">{planar}{tips}</body></worldbody></mujoco>"""


def _corners(outline: np.ndarray) -> str:
    return " ".join(f"{x} {y} {z}" for z in (-HALF, HALF) for x, y in outline)


def _convex_parts(outline: np.ndarray) -> list[np.ndarray]:
    """MuJoCo takes a mesh for its hull: an outline that is not convex is cut into triangles."""
    whole = shapely.Polygon(outline)
    if whole.convex_hull.area - whole.area < 1e-9 * whole.area:
        return [np.asarray(outline)]
    return [
        shapely.get_coordinates(triangle.exterior)[:-1]
        for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(whole))
    ]
