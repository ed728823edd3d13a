"""Pushes in Drake: feet on vertical slides as prismatic joints, contact by its convex SAP solver. Needs the extra ``drake``."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from pydrake.geometry import AddContactMaterial, Box, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation
from pydrake.multibody.tree import FixedOffsetFrame, PlanarJoint, PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from stablepush.engines.executor import FOOT, GRAVITY, HALF, HEAVY, HEIGHT, IN_FEET, Executor, Fingers, SliderOnFeet
from stablepush.engines.sdf import RELAXATION, STIFF, WALL
from stablepush.engines.walls import walls

#: Step (s).
_STEP = 2e-3

# it warns of half spaces that deformable bodies, which there are none of, do not touch
logging.getLogger("drake").setLevel(logging.ERROR)


class DrakeExecutor(Executor):
    """A slider on feet and fingers in Drake."""

    tick = _STEP

    def __init__(self, slider: SliderOnFeet, fingers: Fingers) -> None:
        super().__init__(fingers)
        # its mass is put at the origin of its frame, wherever the fingers are
        self._middle = np.zeros(2)
        if slider.grain[0] != 1.0:
            raise ValueError("slider.grain: Drake's friction has one coefficient, use mujoco")
        builder = DiagramBuilder()
        plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=_STEP)
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        plant.mutable_gravity_field().set_gravity_vector((*(GRAVITY * np.asarray(slider.slope)), -GRAVITY))
        table, skin = _material(slider.friction), _material(fingers.friction)
        plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), HalfSpace(), "floor", table)
        small = (1 - IN_FEET) * slider.mass
        turning = 1e-5 / small
        body = plant.AddRigidBody("slider", SpatialInertia(small, np.zeros(3), UnitInertia(turning, turning, turning)))
        self._slider = _planar(plant, "slider joint", body)
        for k, (middle, angle, length) in enumerate(walls(slider.outline, WALL)):
            pose = RigidTransform(RollPitchYaw(0.0, 0.0, angle), (*middle, 0.0))
            plant.RegisterCollisionGeometry(body, pose, Box(length, WALL, 2 * HALF), f"wall{k}", skin)
        for k, ((a, b), share) in enumerate(zip(slider.feet, slider.shares, strict=True)):
            foot = plant.AddRigidBody(
                f"foot{k}", SpatialInertia(share * IN_FEET * slider.mass, np.zeros(3), UnitInertia(0, 0, 0))
            )
            frame = _frame(plant, body, RigidTransform((a, b, FOOT - HEIGHT)), f"foot{k}")
            plant.AddJoint(PrismaticJoint(f"foot joint{k}", frame, foot.body_frame(), (0, 0, 1)))
            plant.RegisterCollisionGeometry(foot, RigidTransform(), Sphere(FOOT), f"foot ball{k}", table)
        mass = HEAVY * len(fingers.centers)
        turning = float((0.4 * fingers.radius**2 + (fingers.centers**2).sum(axis=1)).mean())
        # what carries the pusher holds its weight: on a slope it would count as force on the slider
        tool = plant.AddModelInstance("tool")
        pusher = plant.AddRigidBody("pusher", tool, SpatialInertia(mass, np.zeros(3), UnitInertia(turning, turning, turning)))
        plant.set_gravity_enabled(tool, False)
        self._pusher = _planar(plant, "pusher joint", pusher)
        for k, (a, b) in enumerate(fingers.centers):
            plant.RegisterCollisionGeometry(pusher, RigidTransform((a, b, 0.0)), Sphere(fingers.radius), f"finger{k}", skin)
        plant.Finalize()
        self._simulator = Simulator(builder.Build())
        self._context = self._simulator.get_mutable_context()
        self._own = plant.GetMyMutableContextFromRoot(self._context)
        self._start = self._context.Clone()
        self._ticks = 0

    def _place(self, slider: np.ndarray, pusher: np.ndarray) -> np.ndarray:
        self._context.SetTimeStateAndParametersFrom(self._start)
        for joint, pose in ((self._slider, slider), (self._pusher, pusher)):
            joint.set_pose(self._own, pose[:2], pose[2])
        self._ticks = 0
        self._simulator.Initialize()
        return self._poses()

    def _advance(self, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._pusher.set_translational_velocity(self._own, rate[:2])
        self._pusher.set_angular_velocity(self._own, rate[2])
        # the sum of many ticks would drift away from Drake's own
        self._ticks += 1
        self._simulator.AdvanceTo(self._ticks * _STEP)
        velocity = self._pusher.get_translational_velocity(self._own)
        return self._poses(), np.array((*velocity, self._pusher.get_angular_velocity(self._own)))

    def _poses(self) -> np.ndarray:
        return np.array(
            [(*joint.get_translation(self._own), joint.get_rotation(self._own)) for joint in (self._slider, self._pusher)]
        )


EXECUTOR = DrakeExecutor


def _material(mu: float) -> ProximityProperties:
    properties = ProximityProperties()
    AddContactMaterial(None, STIFF, CoulombFriction(mu, mu), properties)
    properties.AddProperty("material", "relaxation_time", RELAXATION)
    return properties


def _planar(plant: Any, name: str, body: Any) -> Any:
    """A joint that lets a body move in the plane, at its height."""
    height = RigidTransform((0.0, 0.0, HEIGHT))
    return plant.AddJoint(PlanarJoint(name, _frame(plant, plant.world_body(), height, name), body.body_frame()))


def _frame(plant: Any, body: Any, pose: RigidTransform, name: str) -> Any:
    return plant.AddFrame(FixedOffsetFrame(f"frame of {name}", body.body_frame(), pose))
