"""Pushes in Drake: feet on vertical slides as prismatic joints, contact by its convex SAP solver. Needs the extra ``drake``.

Contact has the table's nominal friction; what effects change of it acts on the feet besides, by the last tick's motion.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, RoleAssign, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    CoulombFriction,
    DiscreteContactApproximation,
    ExternallyAppliedSpatialForce,
)
from pydrake.multibody.tree import FixedOffsetFrame, PlanarJoint, PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from stablepush.blind.engine import FOOT, HALF, HEAVY, HEIGHT, IN_FEET, Engine, State
from stablepush.blind.laws import friction_at, slope_at, turned
from stablepush.blind.worlds import GRAVITY, World
from stablepush.engines import walls

#: Step (s), stiffness (N/m) and relaxation time (s) of contacts, thickness (m) of the slider's walls, and of the table, and speed
#: (m/s) up to which a foot rests.
STEP, _STIFF, _RELAXATION, _WALL, _FLOOR, _STILL = 2e-3, 2e5, 2e-3, 1e-3, 0.2, 1e-5


class DrakeEngine(Engine):
    """A world's slider and pusher in Drake."""

    name, tick = "drake", STEP

    def __init__(self, world: World) -> None:
        super().__init__(world)
        contact_mu = world.of("contact-friction")
        self._contact_mu_by_load = contact_mu is not None and contact_mu.form == "load"
        builder = DiagramBuilder()
        plant, scene = AddMultibodyPlantSceneGraph(builder, time_step=STEP)
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        plant.mutable_gravity_field().set_gravity_vector((0.0, 0.0, -GRAVITY))
        floor = _material(world.mu)
        plant.RegisterCollisionGeometry(
            plant.world_body(), RigidTransform((0.0, 0.0, -_FLOOR / 2)), Box(6.0, 6.0, _FLOOR), "floor", floor
        )
        self._slider = plant.AddRigidBody("slider", _inertia((1 - IN_FEET) * world.mass))
        self._slider_joint = _planar(plant, "slider joint", self._slider)
        self._walls = [
            plant.RegisterCollisionGeometry(
                self._slider,
                RigidTransform(RollPitchYaw(0.0, 0.0, angle), (*middle, 0.0)),
                Box(length, _WALL, 2 * HALF),
                f"wall{k}",
                _material(self.contact_mu),
            )
            for k, (middle, angle, length) in enumerate(walls(world.outline, _WALL))
        ]
        self._feet = []
        for k, ((x, y), share) in enumerate(zip(self.feet, self.weights, strict=True)):
            foot = plant.AddRigidBody(f"foot{k}", SpatialInertia(share * IN_FEET * world.mass, np.zeros(3), UnitInertia(0, 0, 0)))
            place = RigidTransform((x, y, FOOT - HEIGHT))
            plant.AddJoint(
                PrismaticJoint(f"foot joint{k}", _frame(plant, self._slider, place, f"foot{k}"), foot.body_frame(), (0, 0, 1))
            )
            plant.RegisterCollisionGeometry(foot, RigidTransform(), Sphere(FOOT), f"foot ball{k}", floor)
            self._feet.append(foot)
        self._pusher = plant.AddRigidBody("pusher", _pusher_inertia(self.fingers, self.radii))
        self._pusher_joint = _planar(plant, "pusher joint", self._pusher)
        self._balls = [
            plant.RegisterCollisionGeometry(
                self._pusher, RigidTransform((x, y, 0.0)), Sphere(r), f"finger{k}", _material(self.contact_mu)
            )
            for k, ((x, y), r) in enumerate(zip(self.fingers, self.radii, strict=True))
        ]
        plant.Finalize()
        self._plant, self._scene = plant, scene
        diagram = builder.Build()
        self._simulator = Simulator(diagram)
        self._context = self._simulator.get_mutable_context()
        self._own = plant.GetMyMutableContextFromRoot(self._context)
        self._forces = plant.get_applied_spatial_force_input_port()
        self._forces.FixValue(self._own, [])
        self._start = self._context.Clone()
        self._sides = _sides(world.outline)

    def begin(self, slider: np.ndarray, pusher: np.ndarray) -> None:
        self._context.SetTimeStateAndParametersFrom(self._start)
        self._forces.FixValue(self._own, [])
        self._ticks = 0
        for joint, pose in ((self._slider_joint, slider), (self._pusher_joint, pusher)):
            joint.set_pose(self._own, pose[:2], pose[2])
        self._simulator.Initialize()

    def advance(self, imposed: np.ndarray, order: float, force: np.ndarray) -> State:
        joint = self._pusher_joint
        joint.set_translational_velocity(self._own, imposed[:2])
        joint.set_angular_velocity(self._own, imposed[2])
        self._set(order, force)
        # the sum of many ticks would drift away from Drake's own
        self._ticks += 1
        self._simulator.AdvanceTo(self._ticks * STEP)
        slider, slider_rate = self._state(self._slider_joint)
        pusher, pusher_rate = self._state(joint)
        return State(slider, pusher, slider_rate, pusher_rate, self._touches(slider, pusher))

    def _state(self, joint: PlanarJoint) -> tuple[np.ndarray, np.ndarray]:
        pose = np.array((*joint.get_translation(self._own), joint.get_rotation(self._own)))
        return pose, np.array((*joint.get_translational_velocity(self._own), joint.get_angular_velocity(self._own)))

    def _set(self, order: float, force: np.ndarray) -> None:
        """What effects change of the friction of the feet, the slope of the table and the load of the feet, as forces on them."""
        w = self.world
        slider, rate = self._state(self._slider_joint)
        arms = self.feet @ turned(slider[2]).T
        velocity = rate[:2] + rate[2] * np.stack((-arms[:, 1], arms[:, 0]), axis=-1)
        lifted = self.lifted(arms, force)
        more = _friction_beyond(w, slider, arms, velocity, order) * (self.normal - lifted)[:, None]
        more += (self.weights * w.mass * GRAVITY)[:, None] * slope_at(w, slider[:2])
        if more.any() or lifted.any():
            acting = []
            for foot, (fx, fy), fz in zip(self._feet, more, lifted, strict=True):
                one = ExternallyAppliedSpatialForce()
                one.body_index, one.p_BoBq_B = foot.index(), np.zeros(3)
                one.F_Bq_W = SpatialForce(np.zeros(3), np.array((fx, fy, fz)))
                acting.append(one)
            self._forces.FixValue(self._own, acting)
        if self._contact_mu_by_load:
            material = _material(self.contact_mu_at(force))
            for shape in (*self._balls, *self._walls):
                self._scene.AssignRole(
                    self._scene.GetMyMutableContextFromRoot(self._context), self._plant.get_source_id(), shape, material,
                    RoleAssign.kReplace,
                )  # fmt: skip

    def _touches(self, slider: np.ndarray, pusher: np.ndarray) -> tuple[bool, bool]:
        """Which fingers reach into the outline, as they do under load."""
        found = [False, False]
        centers = (pusher[:2] + self.fingers @ turned(pusher[2]).T - slider[:2]) @ turned(slider[2])
        for k, center in enumerate(centers):
            found[k] = bool(_distance(self._sides, center) < self.radii[k])
        return found[0], found[1]


def _friction_beyond(world: World, slider: np.ndarray, arms: np.ndarray, velocity: np.ndarray, order: float) -> np.ndarray:
    """Force (k, 2) in W on feet of unit load that friction has beyond the isotropic one of the world."""
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    e = velocity / np.maximum(speed, 1e-12)
    full = friction_at(world, slider[:2] + arms, velocity, float(slider[2]), order)
    # a foot at rest is held by what is in the contact
    return np.asarray((world.mu * e - full) * speed / (speed + _STILL))


def _material(mu: float) -> ProximityProperties:
    properties = ProximityProperties()
    AddContactMaterial(None, _STIFF, CoulombFriction(mu, mu), properties)
    properties.AddProperty("material", "relaxation_time", _RELAXATION)
    return properties


def _inertia(mass: float) -> SpatialInertia:
    return SpatialInertia(mass, np.zeros(3), UnitInertia(1e-5 / mass, 1e-5 / mass, 1e-5 / mass))


def _pusher_inertia(fingers: np.ndarray, radii: np.ndarray) -> SpatialInertia:
    mass = HEAVY * len(fingers)
    turning = float((0.4 * HEAVY * radii**2).sum() + HEAVY * (fingers**2).sum()) / mass
    return SpatialInertia(mass, np.zeros(3), UnitInertia(turning, turning, turning))


def _planar(plant: Any, name: str, body: Any) -> Any:
    """A joint that lets a body move in the plane, at its height."""
    height = RigidTransform((0.0, 0.0, HEIGHT))
    return plant.AddJoint(PlanarJoint(name, _frame(plant, plant.world_body(), height, name), body.body_frame()))


def _frame(plant: Any, body: Any, pose: RigidTransform, name: str) -> Any:
    return plant.AddFrame(FixedOffsetFrame(f"frame of {name}", body.body_frame(), pose))


def _sides(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return outline, np.roll(outline, -1, axis=0) - outline


def _distance(sides: tuple[np.ndarray, np.ndarray], point: np.ndarray) -> float:
    """Distance (m) of a point outside from the outline."""
    starts, along = sides
    share = np.clip(((point - starts) * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
    return float(np.linalg.norm(starts + share[:, None] * along - point, axis=1).min())
