"""Pushes in MuJoCo: feet on vertical slides, so that the pressure is prescribed; friction in an elliptic cone whose axes may be
turned. Needs the extra ``sim``.
"""

from __future__ import annotations

import mujoco
import numpy as np

from stablepush.blind.engine import FOOT, HALF, HEAVY, HEIGHT, IN_FEET, Engine, State
from stablepush.blind.laws import CHANGING, ellipse, friction, slope_at, turned
from stablepush.blind.worlds import GRAVITY, World

#: Step (s), after how many of them friction and motion are reset, and time constants of table and finger contacts.
STEP, _EVERY, _HARD, _SOFT = 5e-4, 4, 1e-3, 3e-3


class MujocoEngine(Engine):
    """A world's slider and pusher in MuJoCo."""

    name, tick = "mujoco", STEP * _EVERY

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self.model = mujoco.MjModel.from_xml_string(self._xml())
        self.data = mujoco.MjData(self.model)
        names = [self.model.geom(i).name for i in range(self.model.ngeom)]
        self.foot_geoms = np.array([names.index(f"foot{k}") for k in range(len(self.feet))])
        self.foot_bodies = np.array([self.model.geom_bodyid[g] for g in self.foot_geoms])
        self.finger_geoms = np.array([names.index(f"finger{k}") for k in range(len(self.fingers))])
        self._curved = ellipse(world, 0.0) is not None
        self._changes = any(a.effect in CHANGING or a.form == "load" for a in world.applied)
        self._begun = False

    def _xml(self) -> str:
        w, step = self.world, STEP
        planar = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
        # fingers give a little, or they would bounce, and along the face a thousand times less, or they would creep
        hard = f'solref="{_HARD} 1" solimp="0.99 0.999 0.0001"'
        soft = f'solref="{_SOFT} 1" solimp="0.3 0.3 0.001"'
        # feet meet the table, not each other; fingers meet the slider
        ground, table, box = 'contype="1" conaffinity="0"', 'contype="0" conaffinity="1"', 'contype="2" conaffinity="2"'
        feet = "".join(
            f'<body pos="{x} {y} 0"><joint type="slide" axis="0 0 1"/><geom name="foot{k}" type="sphere" size="{FOOT}" '
            f'pos="0 0 {FOOT}" mass="{share * IN_FEET * w.mass}" friction="{w.mu}" priority="1" {table} {hard}/></body>'
            for k, ((x, y), share) in enumerate(zip(self.feet, self.weights, strict=True))
        )
        fingers = "".join(
            f'<geom name="finger{k}" type="sphere" size="{r}" pos="{x} {y} 0" mass="{HEAVY}" friction="{self.contact_mu}" '
            f'priority="1" {box} {soft}/>'
            for k, ((x, y), r) in enumerate(zip(self.fingers, self.radii, strict=True))
        )
        corners = " ".join(f"{x} {y} {z}" for z in (-HALF, HALF) for x, y in w.outline)
        # what is not in the feet sits at the centre of mass, not at that of the mesh
        return f"""
        <mujoco><option timestep="{step}" cone="elliptic" impratio="1000" solver="Newton" tolerance="1e-12" iterations="50"
          gravity="0 0 -{GRAVITY}"/>
        <asset><mesh name="slider" vertex="{corners}"/></asset>
        <default><geom condim="3"/></default>
        <worldbody><geom type="plane" size="3 3 0.1" {ground}/>
        <body>{planar}<inertial pos="0 0 {HEIGHT}" mass="{(1 - IN_FEET) * w.mass}" diaginertia="1e-5 1e-5 1e-5"/>
          <geom type="mesh" mesh="slider" pos="0 0 {HEIGHT}" {box} {soft}/>{feet}</body>
        <body pos="0 0 {HEIGHT}" gravcomp="1">{planar}{fingers}</body></worldbody></mujoco>"""

    def begin(self, slider: np.ndarray, pusher: np.ndarray) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:3], self.data.qpos[-3:] = slider, pusher
        self._begun = False

    def advance(self, imposed: np.ndarray, order: float, force: np.ndarray) -> State:
        model, data = self.model, self.data
        data.qvel[-3:] = imposed
        if self._changes or not self._begun:
            self._set(order, force)
            self._begun = True
        if self._curved:
            for _ in range(_EVERY):
                self._curved_step()
        else:
            mujoco.mj_step(model, data, nstep=_EVERY)
        pairs = data.contact.geom
        touches = [bool((pairs == finger).any()) for finger in self.finger_geoms] + [False]
        return State(
            data.qpos[:3].copy(), data.qpos[-3:].copy(), data.qvel[:3].copy(), data.qvel[-3:].copy(), (touches[0], touches[1])
        )

    def _set(self, order: float, force: np.ndarray) -> None:
        """Friction of feet and fingers, the slope of the table and the load of the feet, as they are now."""
        w, model, data = self.world, self.model, self.data
        theta = float(data.qpos[2])
        rotation = turned(theta)
        arms = self.feet @ rotation.T
        velocity = data.qvel[:2] + data.qvel[2] * np.stack((-arms[:, 1], arms[:, 0]), axis=-1)
        along, left = friction(w, data.qpos[:2] + arms, velocity, theta, order)
        model.geom_friction[self.foot_geoms, 0] = along
        data.xfrc_applied[self.foot_bodies, :2] = 0.0
        if left.any():
            e = velocity / (np.linalg.norm(velocity, axis=1, keepdims=True) + 1e-9)
            aside = (self.normal * left)[:, None] * np.stack((e[:, 1], -e[:, 0]), axis=-1)
            data.xfrc_applied[self.foot_bodies, :2] = aside
        slope = slope_at(w, data.qpos[:2])
        model.opt.gravity[:] = (*(GRAVITY * slope), -GRAVITY)
        model.geom_friction[self.finger_geoms, 0] = self.contact_mu_at(force)
        data.xfrc_applied[self.foot_bodies, 2] = self.lifted(arms, force)

    def _curved_step(self) -> None:
        """A step with the axes of the feet's friction turned, between the search for contacts and their constraints."""
        model, data = self.model, self.data
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_factorM(model, data)
        mujoco.mj_collision(model, data)
        shape = ellipse(self.world, float(data.qpos[2]))
        assert shape is not None
        c, s = float(np.cos(shape[2])), float(np.sin(shape[2]))
        found = data.contact
        feet = np.flatnonzero(np.isin(found.geom, self.foot_geoms).any(axis=1))
        # normals of the table are upright
        found.frame[feet] = (0.0, 0.0, 1.0, c, s, 0.0, -s, c, 0.0)
        found.friction[feet, :2] = found.friction[feet, :1] * np.array(shape[:2])
        mujoco.mj_makeConstraint(model, data)
        mujoco.mj_projectConstraint(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
        mujoco.mj_Euler(model, data)
