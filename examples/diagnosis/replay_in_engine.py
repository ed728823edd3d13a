"""A log whose pushes are carried out again in MuJoCo or Drake, on the rig as its operator believes it to be.

The fingers follow the poses that the log has of the pusher, from where it has the slider at first. What comes out is the log of
another simulator, trial by trial and row by row, for ``diagnose --simulated``: a model of the rig in a simulator that a lab
already has takes the place of the nominal simulation.

    python examples/diagnosis/replay_in_engine.py LOG [--engine mujoco] -o SIM_LOG
    stablepush diagnose LOG --simulated SIM_LOG --html report.html
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import stablepush as sp
from stablepush.engines import Execution, Fingers, SliderOnFeet, executor
from stablepush.geometry import rotate_vectors

#: Distance (m) of two fingers, which no log states: that of the rig of the practice logs.
SPACING = 0.03


def replayed(log: sp.PushLog, engine: str) -> sp.PushLog:
    """The same trials and rows in an engine."""
    rig = log.rig
    support, mass = rig.slider.support, rig.slider.mass
    if support is None or mass is None or not rig.support_friction or not rig.contact_friction or not rig.finger_radius:
        raise SystemExit("expected a rig with support, mass, friction of support and contact, and finger_radius")
    shares = support.weights / support.weights.sum()
    body = SliderOnFeet(rig.slider.vertices, mass, support.points, shares, rig.support_friction)
    spread = SPACING / 2 if rig.contact_kind == "two-point" else 0.0
    fingers = Fingers(np.array(((0.0, -spread), (0.0, spread))[: 2 if spread else 1]), rig.finger_radius, rig.contact_friction)
    columns = {name: np.full(len(log.samples["t"]), np.nan) for name in ("x", "y", "theta", "fx", "fy", "tau")}
    for trial in log.trials["trial"]:
        rows = log.rows(trial)
        poses, pusher, t = log.columns("x", "y", "theta")[rows], log.columns("px", "py", "ptheta")[rows], log.samples["t"][rows]
        run = executor(engine, body, fingers).follow(poses[0], t, pusher)
        for row, values in zip(rows, _rows(run, t), strict=True):
            for name, value in zip(columns, values, strict=True):
                columns[name][row] = value
    kept = {name: log.samples[name] for name in ("trial", "t", "px", "py", "ptheta", "phase") if name in log.samples}
    return sp.PushLog(rig, log.trials, kept | columns)


def _rows(run: Execution, t: np.ndarray) -> np.ndarray:
    """Pose and load (n, 6) at the times of rows: means over the time that is nearest to each."""
    edges = np.concatenate(([run.t[0]], 0.5 * (t[1:] + t[:-1]), [run.t[-1]]))
    found = np.empty((len(t), 6))
    for k in range(len(t)):
        mine = (run.t >= edges[k]) & (run.t <= edges[k + 1])
        pose = np.array([np.interp(t[k], run.t, column) for column in run.slider.T])
        pusher, wrench = run.pusher[mine].mean(axis=0), run.wrench[mine].mean(axis=0)
        arm = pusher[:2] - pose[:2]
        force = rotate_vectors(-pose[2], wrench[:2])
        found[k] = (*pose, *force, wrench[2] + arm[0] * wrench[1] - arm[1] * wrench[0])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path)
    parser.add_argument("--engine", default="mujoco", choices=["mujoco", "drake"])
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    sp.write_pushlog(replayed(sp.read_pushlog(options.log), options.engine), options.output)


if __name__ == "__main__":
    main()
