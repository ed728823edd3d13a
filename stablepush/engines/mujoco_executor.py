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
        self._model = mujoco.MjModel.from_xml_string(_xml(slider, fingers))
        self._data = mujoco.MjData(self._model)

    def _place(self, slider: np.ndarray, pusher: np.ndarray) -> np.ndarray:
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:3], self._data.qpos[-3:] = slider, pusher
        return self._poses()

    def _advance(self, rate: np.ndarray) -> np.ndarray:
        self._data.qvel[-3:] = rate
        mujoco.mj_step(self._model, self._data, nstep=_EVERY)
        return self._poses()

    def _poses(self) -> np.ndarray:
        return np.stack((self._data.qpos[:3], self._data.qpos[-3:]))


EXECUTOR = MujocoExecutor


def _xml(slider: SliderOnFeet, fingers: Fingers) -> str:
    planar = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
    # feet meet the table, not each other; fingers meet the slider
    ground, table, box = 'contype="1" conaffinity="0"', 'contype="0" conaffinity="1"', 'contype="2" conaffinity="2"'
    feet = "".join(
        f'<body pos="{x} {y} 0"><joint type="slide" axis="0 0 1"/><geom type="sphere" size="{FOOT}" pos="0 0 {FOOT}" '
        f'mass="{share * IN_FEET * slider.mass}" friction="{slider.friction}" priority="1" {table} {_FEET}/></body>'
        for (x, y), share in zip(slider.feet, slider.shares, strict=True)
    )
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
      gravity="0 0 -{GRAVITY}"/>
    <asset>{meshes}</asset><default><geom condim="3"/></default>
    <worldbody><geom type="plane" size="3 3 0.1" {ground}/>
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
