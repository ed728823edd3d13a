"""The demo's scenes in MuJoCo and in Drake: where does each plan end, in an engine that is not ours?

The corrected scene is written as a model (``stablepush export``) and opened as it is. It has the fingers' friction as the
diagnosis found it: the first plan, which believed in another, must lose the slider there, and the corrected plan must arrive.

    stablepush demo -o DEMO
    python examples/simulation/demo_in_engines.py DEMO
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import stablepush as sp

#: Radius (m) of the fingers' tips: the demo's touch at points, no engine has those.
RADIUS = 0.002


def in_mujoco(text: str) -> tuple[np.ndarray, Any, Any]:
    """Final pose of the slider, the servos driven by the keyframes; MuJoCo's model and data."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    while data.time < model.key_time[-1]:
        data.ctrl[:] = [np.interp(data.time, model.key_time, column) for column in model.key_ctrl.T]
        mujoco.mj_step(model, data)
    return np.array([data.joint(f"slider_{name}").qpos[0] for name in ("x", "y", "theta")]), model, data


def in_drake(text: str, motion: sp.Trajectory, step: float = 2e-3) -> np.ndarray:
    """Final pose of the slider, the servos driven by a trajectory of the pusher."""
    from pydrake.math import RollPitchYaw
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, DiscreteContactApproximation
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder
    from pydrake.systems.primitives import TrajectorySource
    from pydrake.trajectories import PiecewisePolynomial

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=step)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    Parser(plant).AddModelsFromString(text, "sdf")
    plant.Finalize()
    travel = motion.pusher - motion.pusher[0]
    travel[:, 2] = np.unwrap(travel[:, 2])
    states = np.concatenate((travel, motion.velocity), axis=1).T
    source = builder.AddSystem(TrajectorySource(PiecewisePolynomial.FirstOrderHold(motion.t, states)))
    tool = plant.get_desired_state_input_port(plant.GetModelInstanceByName("pusher"))
    builder.Connect(source.get_output_port(), tool)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(motion.t[-1])
    pose = plant.GetBodyByName("slider").EvalPoseInWorld(plant.GetMyContextFromRoot(simulator.get_context()))
    return np.array((*pose.translation()[:2], RollPitchYaw(pose.rotation()).yaw_angle()))


def ends(demo: Path, engines: Sequence[str] = ("MuJoCo", "Drake")) -> Iterator[tuple[str, str, float, float, float]]:
    """Plan, engine, how far the slider ends from the plan's end and from the goal (mm), and how far turned (deg)."""
    corrected = sp.load_scene(demo / "corrected.json").with_changes(finger_radius=RADIUS)
    believed = sp.load_scene(demo / "scene.json").with_changes(finger_radius=RADIUS)
    # the first plan among fingers as they really are
    before = believed.with_changes(contacts=corrected.contacts)
    for name, problem, file in (("first plan", before, "plan.json"), ("corrected plan", corrected, "corrected-plan.json")):
        result = sp.load_plan(demo / file)
        motion = sp.sample_plan(problem, result, 50.0)
        for engine in engines:
            if engine == "MuJoCo":
                end, _, _ = in_mujoco(sp.export_mjcf(problem, result))
            else:
                end = in_drake(sp.export_sdf(problem, result), motion)
            planned, goal = (1e3 * float(np.hypot(*(end - pose)[:2])) for pose in (motion.slider[-1], problem.goal))
            turned = abs(float(np.rad2deg(np.angle(np.exp(1j * (end[2] - problem.goal[2]))))))
            yield name, engine, planned, goal, turned


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("demo", type=Path, help="folder that stablepush demo wrote")
    for name, engine, planned, goal, turned in ends(parser.parse_args().demo):
        print(f"{name} in {engine}: {planned:.1f} mm off the plan's end, {goal:.1f} mm and {turned:.2f} deg off the goal")


if __name__ == "__main__":
    main()
