"""A world's pushes in MuJoCo: feet on vertical slides, so that the pressure is prescribed; a heavy pusher with an imposed motion.

Friction of the feet is set anew as they move, in an elliptic cone whose axes may be turned; the force is what the pusher loses in
momentum. Needs the extra ``sim``.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from stablepush.blind.laws import ellipse, feet_of, friction, slope_at, turned
from stablepush.blind.worlds import GRAVITY, Push, World

#: Step (s), after how many of them friction and motion are set anew, and time constants of table and finger contacts.
STEP, _EVERY, _HARD, _SOFT = 5e-4, 4, 1e-3, 3e-3
#: Share of the mass that is in the feet, mass of a finger (kg), radius of a foot, heights of the slider's middle and of its half.
_IN_FEET, _HEAVY, _FOOT, _HEIGHT, _HALF = 0.999, 500.0, 0.002, 0.03, 0.01
#: Ways (m) from which on a push is recorded, where inertia is to show and where it is not; share of the speed at first, where it
#: is; force (N) at which friction of the form "load" is nominal.
_MOVES, _FROM, _NOMINAL_FORCE = (5e-5, 5e-4), 0.25, 1.5


@dataclass(frozen=True)
class Truth:
    """What really happened in a push, as means over its parts (n,): times (s), poses (n, 3) of the slider and of the pusher's
    centre in W, forces (n, 3) that the pusher exerts in W with the moment about its centre, body twists (n, 3) and accelerations
    (n, 3) of the slider in W, fingers (n, 2) that touch; and all poses (m, 3) of the slider at times (m,)."""

    time: np.ndarray
    pose: np.ndarray
    pusher: np.ndarray
    force: np.ndarray
    twist: np.ndarray
    acceleration: np.ndarray
    touches: np.ndarray
    fine_time: np.ndarray
    fine_pose: np.ndarray


class Engine:
    """A world's slider and pusher in MuJoCo."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.feet, self.weights = feet_of(world)
        self.fingers = np.array(((0.0, world.half), (0.0, -world.half))) if world.two else np.zeros((1, 2))
        radii = np.full(len(self.fingers), world.radius)
        geometry, grip = world.of("contact-geometry"), world.of("contact-friction")
        if geometry is not None:
            radii[: 1 if geometry.form == "one-finger" else 2] += geometry.numbers["change"]
        self.radii = np.maximum(radii, 5e-4)
        self.grip = world.grip + (grip.numbers["change"] if grip is not None and grip.form == "constant" else 0.0)
        self.by_load = grip.numbers["change"] if grip is not None and grip.form == "load" else 0.0
        self.transfer = world.of("load-transfer")
        self.model = mujoco.MjModel.from_xml_string(self._xml())
        self.data = mujoco.MjData(self.model)
        names = [self.model.geom(i).name for i in range(self.model.ngeom)]
        self.foot_geoms = np.array([names.index(f"foot{k}") for k in range(len(self.feet))])
        self.foot_bodies = np.array([self.model.geom_bodyid[g] for g in self.foot_geoms])
        self.finger_geoms = np.array([names.index(f"finger{k}") for k in range(len(self.fingers))])

    def _xml(self) -> str:
        w, step = self.world, STEP
        planar = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
        # fingers give a little, or they would bounce, and along the face a thousand times less, or they would creep
        hard = f'solref="{_HARD} 1" solimp="0.99 0.999 0.0001"'
        soft = f'solref="{_SOFT} 1" solimp="0.3 0.3 0.001"'
        # feet meet the table, not each other; fingers meet the slider
        ground, table, box = 'contype="1" conaffinity="0"', 'contype="0" conaffinity="1"', 'contype="2" conaffinity="2"'
        feet = "".join(
            f'<body pos="{x} {y} 0"><joint type="slide" axis="0 0 1"/><geom name="foot{k}" type="sphere" size="{_FOOT}" '
            f'pos="0 0 {_FOOT}" mass="{share * _IN_FEET * w.mass}" friction="{w.mu}" priority="1" {table} {hard}/></body>'
            for k, ((x, y), share) in enumerate(zip(self.feet, self.weights, strict=True))
        )
        fingers = "".join(
            f'<geom name="finger{k}" type="sphere" size="{r}" pos="{x} {y} 0" mass="{_HEAVY}" friction="{self.grip}" '
            f'priority="1" {box} {soft}/>'
            for k, ((x, y), r) in enumerate(zip(self.fingers, self.radii, strict=True))
        )
        corners = " ".join(f"{x} {y} {z}" for z in (-_HALF, _HALF) for x, y in w.outline)
        # what is not in the feet sits at the centre of mass, not at that of the mesh
        return f"""
        <mujoco><option timestep="{step}" cone="elliptic" impratio="1000" solver="Newton" tolerance="1e-12" iterations="50"
          gravity="0 0 -{GRAVITY}"/>
        <asset><mesh name="slider" vertex="{corners}"/></asset>
        <default><geom condim="3"/></default>
        <worldbody><geom type="plane" size="3 3 0.1" {ground}/>
        <body>{planar}<inertial pos="0 0 {_HEIGHT}" mass="{(1 - _IN_FEET) * w.mass}" diaginertia="1e-5 1e-5 1e-5"/>
          <geom type="mesh" mesh="slider" pos="0 0 {_HEIGHT}" {box} {soft}/>{feet}</body>
        <body pos="0 0 {_HEIGHT}" gravcomp="1">{planar}{fingers}</body></worldbody></mujoco>"""

    def push(self, push: Push, order: float) -> Truth:
        """Carry out a push; ``order``: its place in the log, 0 to 1."""
        w, model, data = self.world, self.model, self.data
        mujoco.mj_resetData(model, data)
        q, v = model.nq - 3, model.nv - 3
        data.qpos[:3] = push.start
        rotation = turned(push.start[2])
        # fingers thicker or thinner than they are believed to be begin as far from the slider
        toward = push.place[2]
        place = push.place[:2] - (self.radii.max() - w.radius) * np.array((np.cos(toward), np.sin(toward)))
        data.qpos[q:] = (*(push.start[:2] + rotation @ place), push.start[2] + toward)
        steps = max(8, round(push.duration / (STEP * _EVERY)))
        begin = _FROM * push.speed if push.acceleration else push.speed
        ramp = max((push.speed - begin) / push.acceleration, STEP) if push.acceleration else STEP
        mass = np.array((*([_HEAVY * len(self.fingers)] * 2), self._turning_mass()))
        rows = np.empty((steps, 13))
        touches = np.zeros((steps, 2), dtype=bool)
        smooth = np.zeros(2)
        curved = ellipse(w, 0.0) is not None
        for i in range(steps):
            c, s = np.cos(data.qpos[q + 2]), np.sin(data.qpos[q + 2])
            share = (begin + (push.speed - begin) * min(1.0, i * STEP * _EVERY / ramp)) / push.speed
            vx, vy, omega = share * push.twist
            imposed = np.array((c * vx - s * vy, s * vx + c * vy, omega))
            data.qvel[v:] = imposed
            self._set(data, order, smooth)
            if curved:
                for _ in range(_EVERY):
                    self._curved_step(data)
            else:
                mujoco.mj_step(model, data, nstep=_EVERY)
            # what the pusher lost is what the slider got
            force = mass * (imposed - data.qvel[v:]) / (STEP * _EVERY)
            smooth += 0.2 * (force[:2] - smooth)
            rows[i] = (data.time, *data.qpos[:3], *data.qpos[q:], *force, *data.qvel[:3])
            pairs = data.contact.geom
            for k, finger in enumerate(self.finger_geoms):
                touches[i, k] = bool((pairs == finger).any())
        return self._means(rows, touches, _MOVES[0] if push.acceleration else _MOVES[1])

    def _turning_mass(self) -> float:
        """Moment of inertia (kg m²) of the pusher about its centre."""
        spheres = 0.4 * _HEAVY * self.radii**2
        return float((spheres + _HEAVY * (self.fingers**2).sum(axis=1)).sum())

    def _set(self, data: mujoco.MjData, order: float, force: np.ndarray) -> None:
        """Friction of feet and fingers, the slope of the table and the load of the feet, as they are now."""
        w, model = self.world, self.model
        theta = float(data.qpos[2])
        rotation = turned(theta)
        arms = self.feet @ rotation.T
        velocity = data.qvel[:2] + data.qvel[2] * np.stack((-arms[:, 1], arms[:, 0]), axis=-1)
        along, left = friction(w, data.qpos[:2] + arms, velocity, theta, order)
        model.geom_friction[self.foot_geoms, 0] = along
        data.xfrc_applied[self.foot_bodies, :2] = 0.0
        if left.any():
            e = velocity / (np.linalg.norm(velocity, axis=1, keepdims=True) + 1e-9)
            aside = (self.weights * w.mass * GRAVITY * left)[:, None] * np.stack((e[:, 1], -e[:, 0]), axis=-1)
            data.xfrc_applied[self.foot_bodies, :2] = aside
        slope = slope_at(w, data.qpos[:2])
        model.opt.gravity[:] = (*(GRAVITY * slope), -GRAVITY)
        if self.by_load:
            size = float(np.linalg.norm(force)) / len(self.fingers)
            # a single finger has the load's friction, two share it
            change = self.by_load * 2 * size / (size + _NOMINAL_FORCE)
            model.geom_friction[self.finger_geoms, 0] = max(0.02, self.grip + change)
        if self.transfer is not None:
            spread = (arms * self.weights[:, None]).T @ arms
            more = self.transfer.numbers["height"] * self.weights * (arms @ np.linalg.solve(spread, force))
            normal = self.weights * w.mass * GRAVITY
            data.xfrc_applied[self.foot_bodies, 2] = -np.clip(more, -0.9 * normal, 2 * normal)

    def _curved_step(self, data: mujoco.MjData) -> None:
        """A step with the axes of the feet's friction turned, between the search for contacts and their constraints."""
        model = self.model
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

    def _means(self, rows: np.ndarray, touches: np.ndarray, least: float) -> Truth:
        """Means over equal parts of the time in which the slider moves."""
        way = np.hypot(*(rows[:, 1:3] - rows[0, 1:3]).T) + 0.03 * np.abs(rows[:, 3] - rows[0, 3])
        moves = np.flatnonzero(way > least)
        first = int(moves[0]) if len(moves) else len(rows) // 2
        parts = [p for p in np.array_split(np.arange(first, len(rows)), self.world.rows) if len(p) > 4]
        mean = np.array([rows[p].mean(axis=0) for p in parts])
        span = np.array([(len(p) - 1) * STEP * _EVERY for p in parts])[:, None]
        moved = np.array([rows[p[-1], 1:4] - rows[p[0], 1:4] for p in parts]) / span
        turn = turned(mean[:, 3])
        twist = np.column_stack((np.einsum("nji,nj->ni", turn, moved[:, :2]), moved[:, 2]))
        gained = np.array([rows[p[-1], 10:13] - rows[p[0], 10:13] for p in parts]) / span
        return Truth(
            mean[:, 0], mean[:, 1:4], mean[:, 4:7], mean[:, 7:10], twist, gained,
            np.array([touches[p].mean(axis=0) > 0.5 for p in parts]), rows[:, 0], rows[:, 1:4],
        )  # fmt: skip
