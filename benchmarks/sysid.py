"""A diagnosis beside MuJoCo's own identification toolbox (``pip install 'stablepush[sysid]'``), on the same logs, in one run.

    python benchmarks/sysid.py LOG [LOG …] [--trials 24] [--evaluations 6] [--labels labels.json] [-o sysid.csv]

The toolbox is set up as by somebody who knows the rig and the list of effects: the model that ``stablepush export`` writes, with
light fingers that follow the logged pusher, and 16 parameters in their plausible ranges, all fitted at once. They are friction
and pressure of the feet, their drift, friction and radius of the fingers, slope, viscous friction, bias and rotation of the force
sensor, offset and delay of the tracker. Friction by place or direction is not among them. Residuals of poses and loads are in
units of their noise, that of poses raised to 0.5 mm and 0.5 degrees since a rollout strays. After ``--evaluations`` it stops,
converged or not. It fits every second trial and is scored on the others, by rollouts of its own.

``diagnose`` gets all of these trials and scores itself on pushes left out of its fits, with loads at the measured motion. Each is
compared with its own nominal simulation. Intervals are 95 %, by trials. Seconds are of the processor, on all threads. Neither
sees a label; ``--labels`` tells which effects act. The practice logs were made in MuJoCo, which is the toolbox's own engine.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import stablepush as sp
from stablepush.engines.executor import GRAVITY, Fingers, SliderOnFeet
from stablepush.engines.mjcf import STEP, Motion, mjcf

#: Parameters of the toolbox: the effect that each is of, and half of its range. All begin at zero, which is the nominal rig.
RANGES = {
    "support_mu": ("recalibration", 0.4),  # share of the friction
    "pressure_x": ("pressure-shift", 0.5),  # friction of the feet, per rho along x of B
    "pressure_y": ("pressure-shift", 0.5),
    "spread": ("pressure-spread", 0.5),  # the same, by the square of the distance
    "drift": ("drift", 0.5),  # share of the friction over the log
    "contact_mu": ("contact-friction", 0.6),  # share of the friction of the fingers
    "radius": ("contact-geometry", 0.003),  # m
    "slope_x": ("tilt", 0.08),
    "slope_y": ("tilt", 0.08),
    "damping": ("speed-dependence", 20.0),  # N s/m; none below zero
    "bias_x": ("force-bias", 0.6),  # N
    "bias_y": ("force-bias", 0.6),
    "rotation": ("force-rotation", 0.4),  # rad
    "offset_x": ("frame-offset", 0.008),  # m
    "offset_y": ("frame-offset", 0.008),
    "delay": ("latency", 0.3),  # s
}
#: Noise of poses (m, m, rad) that a rollout cannot keep below; size of residuals from which the loss is robust.
STRAYS, ROBUST = (5e-4, 5e-4, np.deg2rad(0.5)), 2.0
#: Share of the mass of the model's fingers that these have: what accelerates them would count as load.
LIGHT = 0.1
#: A parameter is told if its interval leaves out zero, and it is not below this share of its range.
TOLD = 0.02
COLUMNS = ("x", "y", "theta", "fx", "fy", "tau")


@dataclass
class Trial:
    """Rows of a push, from the last at rest on: times (n,), poses and loads (n, 6) in the log's columns, poses (n, 3) of the
    pusher; ``order``: place in the log, from 0 to 1."""

    order: float
    t: np.ndarray
    rows: np.ndarray
    pusher: np.ndarray

    @property
    def counts(self) -> np.ndarray:
        """Rows that are fitted and scored: all but the one at rest and that in which a finger touches."""
        return np.arange(len(self.t)) > 1


class Toolbox:
    """The identification toolbox on one log."""

    def __init__(self, log: sp.PushLog) -> None:
        try:
            from mujoco import sysid

            self.sysid = sysid
            self.start = sysid.ParameterDict()
        except (ImportError, AttributeError):
            raise SystemExit("expected the toolbox: pip install 'stablepush[sysid]'") from None
        self.log, rig = log, log.rig
        support, mass, noise = rig.slider.support, rig.slider.mass, rig.noise
        known = support and mass and noise and rig.support_friction and rig.contact_friction and rig.finger_radius
        if not known or "phase" not in log.samples:
            raise SystemExit("expected phases, and a rig with support, mass, noise, friction, and radius of the fingers")
        self.rho, self.feet = rig.slider.characteristic_length, support.points
        shares = support.weights / support.weights.sum()
        self.body = SliderOnFeet(rig.slider.vertices, mass, support.points, shares, rig.support_friction)
        spread = 0.0
        if rig.contact_kind == "two-point":
            spread = 0.5 * float(np.nanmedian(np.hypot(*(log.columns("c1x", "c1y") - log.columns("c2x", "c2y")).T)))
        centers = np.array(((0.0, -spread), (0.0, spread)))[: 2 if spread else 1]
        self.fingers = Fingers(centers, rig.finger_radius, rig.contact_friction)
        of_poses = np.maximum((noise.position, noise.position, noise.angle), STRAYS)
        self.noise = np.array((*of_poses, noise.force, noise.force, self.rho * noise.force))
        still = Motion(np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((1, 3)))
        self.spec = mujoco.MjSpec.from_string(mjcf(self.body, self.fingers, (), still))
        for kind, sensor in (("slider", mujoco.mjtSensor.mjSENS_JOINTPOS), ("pusher", mujoco.mjtSensor.mjSENS_JOINTACTFRC)):
            for name in (f"{kind}_x", f"{kind}_y", f"{kind}_theta"):
                self.spec.add_sensor(name=name, type=sensor, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=name)
        for k in range(len(centers)):
            self.spec.geom(f"finger{k}").mass *= LIGHT
        for actuator in self.spec.actuators:
            actuator.gainprm *= LIGHT
            actuator.biasprm *= LIGHT
        self.model = self.spec.compile()
        for name in RANGES:
            # the toolbox warns of fits that begin at a bound
            begin, least = (0.01, 0.0) if name == "damping" else (0.0, -1.0)
            self.start.add(self.sysid.Parameter(name, begin, least, 1.0))
        names = [str(name) for name in log.trials["trial"]]
        self.trials = {name: self._trial(name, k / max(1, len(names) - 1)) for k, name in enumerate(names)}

    def _trial(self, name: str, order: float) -> Trial:
        rows = self.log.rows(name)
        resting = np.flatnonzero(np.asarray(self.log.samples["phase"])[rows] == "rest")
        rows = rows[resting[-1] if len(resting) else 0 :]
        poses, pusher = self.log.columns(*COLUMNS)[rows], self.log.columns("px", "py", "ptheta")[rows]
        for turning in (poses, pusher):
            turning[:, 2] = np.unwrap(turning[:, 2])
        return Trial(order, np.asarray(self.log.samples["t"][rows], dtype=float), poses, pusher)

    def _values(self, params: Any) -> dict[str, float]:
        return {name: float(params[name].value[0]) * size for name, (_, size) in RANGES.items()}

    def build(self, params: Any, spec: mujoco.MjSpec) -> mujoco.MjModel:
        """The model of one trial, by whose name it goes, with parameters in it."""
        p, trial, spec = self._values(params), self.trials[spec.modelname], spec.copy()
        level = self.body.friction * (1 + p["support_mu"]) * (1 + p["drift"] * (trial.order - 0.5))
        away = (self.feet**2).sum(axis=1)
        away = away / float(self.body.shares @ away) - 1
        for k, (x, y) in enumerate(self.feet):
            pressed = 1 + (p["pressure_x"] * x + p["pressure_y"] * y) / self.rho + p["spread"] * away[k]
            spec.geom(f"foot{k}").friction[0] = level * max(0.05, pressed)
        for k in range(len(self.fingers.centers)):
            spec.geom(f"finger{k}").friction[0] = self.fingers.friction * (1 + p["contact_mu"])
            spec.geom(f"finger{k}").size[0] = self.fingers.radius + p["radius"]
        spec.option.gravity = (GRAVITY * p["slope_x"], GRAVITY * p["slope_y"], -GRAVITY)
        for joint in ("slider_x", "slider_y"):
            spec.joint(joint).damping = np.full_like(spec.joint(joint).damping, p["damping"])
        return spec.compile()

    def sequences(self, names: list[str]) -> list[Any]:
        """What the toolbox takes: of each trial the model, the start, the controls, and what was measured."""
        from mujoco.sysid import ModelSequences, TimeSeries, create_initial_state

        found = []
        for name in names:
            trial = self.trials[name]
            t = np.arange(trial.t[0], trial.t[-1] + 0.5 * STEP, STEP)
            path = np.stack([np.interp(t, trial.t, column) for column in trial.pusher.T], axis=1)
            drive = np.concatenate((path, np.gradient(path, t, axis=0)), axis=1)
            places = np.concatenate((trial.rows[0, :3], np.zeros(len(self.feet)), trial.pusher[0]))
            state = create_initial_state(self.model, places, np.zeros(self.model.nv))
            control = TimeSeries.from_control_names(t - t[0], drive, self.model)
            measured = TimeSeries.from_names(trial.t - t[0], trial.rows, self.model)
            spec = self.spec.copy()
            spec.modelname = name
            found.append(ModelSequences(name, spec, name, state, control, measured))
        return found

    def residual(self, params: Any, predicted: Any, measured: Any, model: Any, whole: bool, **_: Any) -> Any:
        """Differences of a trial's rows in units of the noise: each row is a mean over its part of the push."""
        from mujoco.sysid import TimeSeries

        p, t, rows, times = self._values(params), measured.times, measured.data, predicted.times
        trial = next(one for one in self.trials.values() if np.array_equal(one.rows, rows))
        half = 0.5 * float(np.median(np.diff(t[-5:])))
        sums = np.concatenate((np.zeros((1, 6)), np.cumsum(predicted.data * STEP, axis=0)))
        stamps = np.concatenate((times[:1] - STEP, times))
        found = np.empty_like(rows)
        for j in range(6):
            lag = p["delay"] if j < 3 else 0.0
            begin, end = (np.clip(edge - lag, stamps[0], stamps[-1]) for edge in (t - half, t + half))
            length = end - begin
            gained = np.interp(end, stamps, sums[:, j]) - np.interp(begin, stamps, sums[:, j])
            found[:, j] = np.where(length > 1e-9, gained / np.maximum(length, 1e-9), predicted.data[0, j])
        # a rollout begins at the tracked pose, whose origin is off the centre of mass: as the slider turns that moves
        c, s = (turn(found[:, 2]) - turn(rows[0, 2]) for turn in (np.cos, np.sin))
        found[:, 0] += c * p["offset_x"] - s * p["offset_y"]
        found[:, 1] += s * p["offset_x"] + c * p["offset_y"]
        # what the sensor reads at the pusher, as a load about the tracked origin in B by the poses as they are measured
        c, s = np.cos(p["rotation"]), np.sin(p["rotation"])
        fx, fy = c * found[:, 3] - s * found[:, 4] + p["bias_x"], s * found[:, 3] + c * found[:, 4] + p["bias_y"]
        arm = trial.pusher[:, :2] - rows[:, :2]
        found[:, 5] += arm[:, 0] * fy - arm[:, 1] * fx
        c, s = np.cos(rows[:, 2]), np.sin(rows[:, 2])
        found[:, 3], found[:, 4] = c * fx + s * fy, c * fy - s * fx
        return ((rows - found) / self.noise)[trial.counts], TimeSeries(t, found, measured.signal_mapping), measured

    def identify(self, names: list[str], evaluations: int) -> tuple[Any, dict[str, float], bool, float]:
        """Fit to trials: parameters, halves of their 95 % intervals, whether it converged, seconds of the processor."""
        begin = time.process_time()
        # contacts that stick or slip make residuals rough: hence steps of a hundredth of the ranges, and a loss that is robust
        found, result = self.sysid.optimize(
            self.start.copy(), self._fn(names), optimizer="scipy_parallel_fd", max_iters=evaluations, verbose=False,
            loss="soft_l1", f_scale=ROBUST, diff_step=1e-2,
        )  # fmt: skip
        seconds = time.process_time() - begin
        # rows of a rollout err alike: errors are those of trials
        weights = 1 / np.sqrt(1 + (result.fun / ROBUST) ** 2)
        jacobian = np.asarray(result.jac)
        trial = np.repeat(np.arange(len(names)), [6 * int(self.trials[name].counts.sum()) for name in names])
        scores = np.stack([np.bincount(trial, weights * result.fun * column, len(names)) for column in jacobian.T], axis=1)
        inverse = np.linalg.pinv(jacobian.T @ (weights[:, None] * jacobian), hermitian=True)
        covariance = inverse @ scores.T @ scores @ inverse * len(names) / (len(names) - 1)
        seen = np.abs(jacobian).max(axis=0) > 1e-9
        halves = np.where(seen, 1.96 * np.sqrt(np.maximum(np.diag(covariance), 0.0)), np.inf)
        spread = {name: float(half) * RANGES[name][1] for name, half in zip(RANGES, halves, strict=True)}
        return found, spread, bool(result.status > 0), seconds

    def _fn(self, names: list[str]) -> Any:
        return self.sysid.build_residual_fn(
            models_sequences=self.sequences(names), build_model=self.build, modify_residual=self.residual
        )

    def errors(self, names: list[str], params: Any) -> tuple[float, float]:
        """Root mean squares over trials: of the load's error (N), of the final pose's (mm)."""
        size = (1, 1, self.rho)
        left = [np.reshape(r, (-1, 6)) * self.noise for r in self._fn(names)(params.as_vector(), params.copy())[0]]
        loads = np.concatenate([one[:, 3:] for one in left]) / size
        ends = np.array([one[-1, :3] for one in left]) * size
        return float(np.sqrt((loads**2).sum(axis=1).mean())), 1e3 * float(np.sqrt((ends**2).sum(axis=1).mean()))

    def told(self, params: Any, spread: dict[str, float]) -> str:
        """The parameters that are not zero, with their intervals."""
        values = self._values(params)
        chosen = [n for n in values if abs(values[n]) > max(spread[n], TOLD * RANGES[n][1])]
        return ", ".join(f"{n} {values[n]:.3g} ± {spread[n]:.2g} ({RANGES[n][0]})" for n in chosen)


def part(log: sp.PushLog, names: list[str]) -> sp.PushLog:
    """A log of some of its trials."""
    chosen = np.isin([str(name) for name in log.trials["trial"]], names)
    rows = np.isin([str(name) for name in log.samples["trial"]], names)
    trials = {k: [v for v, use in zip(column, chosen, strict=True) if use] for k, column in log.trials.items()}
    return sp.PushLog(log.rig, trials, {k: np.asarray(column)[rows] for k, column in log.samples.items()})


def compared(path: Path, count: int, evaluations: int) -> dict[str, Any]:
    """Both on one log."""
    log = sp.read_pushlog(path)
    names = [str(name) for name in log.trials["trial"]][:count]
    box = Toolbox(log)
    before = box.errors(names[1::2], box.start)
    params, spread, converged, seconds = box.identify(names[::2], evaluations)
    after = box.errors(names[1::2], params)
    begin = time.process_time()
    report = sp.diagnose(part(log, names))
    ours = time.process_time() - begin
    row = {
        "log": path.name,
        "toolbox": box.told(params, spread) or "nothing",
        "toolbox: load, N": f"{before[0]:.3f} to {after[0]:.3f}",
        "toolbox: final pose, mm": f"{before[1]:.2f} to {after[1]:.2f}",
        "toolbox: s": round(seconds),
        "converged": "yes" if converged else "no",
        "diagnose": f"{report.verdict}: {', '.join(report.named)}".rstrip(": "),
        "diagnose: s": round(ours, 1),
    }
    for gap in report.reductions:
        if gap.channel in ("wrench", "pose"):
            word, scale = ("load, N", 1) if gap.channel == "wrench" else ("final pose, mm", 1e3)
            row[f"diagnose: {word}"] = f"{scale * gap.before:.3f} to {scale * gap.after:.3f}"
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", type=Path, nargs="+")
    parser.add_argument("--trials", type=int, default=24, help="pushes of each log, its first ones, that both are given")
    parser.add_argument("--evaluations", type=int, default=6, help="of the toolbox's residuals at most, besides their slopes")
    parser.add_argument("--labels", type=Path)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    labels = json.loads(options.labels.read_text()) if options.labels else {}
    table: list[dict[str, Any]] = []
    for path in options.logs:
        row = compared(path, options.trials, options.evaluations)
        row["acts"] = ", ".join(labels[path.name]["effects"]) or "nothing" if path.name in labels else ""
        table.append(row)
        print(row, flush=True)
    if options.output:
        with options.output.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(dict.fromkeys(key for row in table for key in row)))
            writer.writeheader()
            writer.writerows(table)


if __name__ == "__main__":
    sys.exit(main())
