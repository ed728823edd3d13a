"""What the instruments of a world record of its pushes, and what its operator believes: a ``pushlog/1`` folder. Only numpy."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stablepush.blind.laws import turned
from stablepush.blind.worlds import CHANGING_FORMS, GRAVITY, World, share_in_log

if TYPE_CHECKING:
    from stablepush.blind.engine import Truth

#: Noise of the moment (m) and of the pusher's place (m), outliers' share and how far off they are, and the scatter of friction
#: from push to push in the traps.
_MOMENT, _PUSHER, _SHARE, _FAR, SCATTER = 0.015, 3e-5, 0.05, 12.0, 0.03
Row = dict[str, Any]
COLUMNS = (
    "trial", "t", "phase", "x", "y", "theta", "fx", "fy", "tau", "vx", "vy", "omega", "c1x", "c1y", "c2x", "c2y",
    "px", "py", "ptheta",
)  # fmt: skip


def record(world: World, truths: list[Truth], rng: np.random.Generator) -> tuple[Row, list[Row], list[Row]]:
    """Return what a lab would have: the rig, the rows of ``trials.csv`` and those of ``samples.csv``."""
    trials, samples, clock = [], [], 0.0
    for k, (push, truth) in enumerate(zip(world.pushes, truths, strict=True)):
        order = k / max(1, len(truths) - 1)
        cor = push.cor or ("", "", "")
        trials.append(
            {
                "trial": str(k + 1),
                "start_time": round(clock, 3),
                "group": push.group,
                "speed": push.speed,
                "cor_x": cor[0],
                "cor_y": cor[1],
                "sense": cor[2],
            }
        )
        samples += _rows(world, str(k + 1), truth, order, rng)
        clock += float(truth.fine_time[-1]) + 8.0
    if not world.two or not any(push.cor for push in world.pushes):
        for row in trials:
            for name in ("cor_x", "cor_y", "sense"):
                row.pop(name)
    support = {"points": world.feet.tolist(), "weights": world.weights.tolist()} if world.trap != "patch" else None
    rig = {
        "format": "pushlog/1",
        "slider": {"format": "slider/1", "vertices": world.outline.tolist(), "mass": world.mass, "support": support},
        "friction": {"support": world.believed_mu, "contact": world.contact_mu},
        "gravity": GRAVITY,
        "contact_kind": "two-point" if world.two else "point",
        "finger_radius": world.radius,
        "noise": {"force": world.force_noise, "position": world.position_noise, "angle": world.angle_noise},
    }
    return rig, trials, samples


def _seen(world: World, truth: Truth, at: np.ndarray, order: float) -> np.ndarray:
    """Poses (n, 3) of the tracked frame at times (n,), without noise."""
    time, pose = truth.fine_time, truth.fine_pose
    latency, frame = world.of("latency"), world.of("frame-offset")
    if latency is not None:
        delay = latency.numbers["delay"] * (share_in_log(latency.form, order) if latency.form in CHANGING_FORMS else 1.0)
        if latency.form != "filter":
            at = np.maximum(at - delay, time[0])
        else:
            step, kept = float(time[1] - time[0]), pose.copy()
            for i in range(1, len(kept)):
                kept[i] = kept[i - 1] + (pose[i] - kept[i - 1]) * step / (delay + step)
            pose = kept
    found = np.stack([np.interp(at, time, pose[:, c]) for c in range(3)], axis=-1)
    if frame is not None:
        share = share_in_log(frame.form, order) if frame.form in CHANGING_FORMS else 1.0
        found[:, :2] += np.einsum("nij,j->ni", turned(found[:, 2]), share * np.array(frame.numbers["offset"]))
    return found


def _rows(world: World, name: str, truth: Truth, order: float, rng: np.random.Generator) -> list[Row]:
    w, n = world, len(truth.time)
    spread = np.array((w.position_noise, w.position_noise, w.angle_noise))
    far = np.where(rng.random(n) < _SHARE, _FAR, 1.0) if w.trap == "outliers" else np.ones(n)
    pose = _seen(w, truth, truth.time, order) + spread * rng.normal(size=(n, 3)) * far[:, None]
    pusher = truth.pusher + np.array((_PUSHER, _PUSHER, 1e-4)) * rng.normal(size=(n, 3))
    force = _sensed(w, truth.force[:, :2], truth.pusher[:, 2], order)
    moment = truth.force[:, 2] + _MOMENT * w.force_noise * rng.normal(size=n) * far
    force = force + w.force_noise * rng.normal(size=(n, 2)) * far[:, None]
    arm = pusher[:, :2] - pose[:, :2]
    back = turned(-pose[:, 2])
    load = np.column_stack((np.einsum("nij,nj->ni", back, force), moment + arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]))
    half = float(np.median(np.diff(truth.time))) / 2 if n > 1 else 0.05
    first, last = (_seen(w, truth, truth.time + s * half, order) for s in (-1, 1))
    moved = (last - first) / (2 * half)
    rate = np.column_stack((np.einsum("nij,nj->ni", back, moved[:, :2]), moved[:, 2]))
    rate = rate + 0.5 * spread / (2 * half) * rng.normal(size=(n, 3))
    still = np.zeros(3) if w.tracker else np.full(3, np.nan)
    rate = rate if w.tracker else np.full((n, 3), np.nan)
    points = _contacts(w, pose, pusher, truth.touches)
    shift = 0.4
    rest = _seen(w, truth, truth.fine_time[:1], order)[0]
    away = truth.pusher[0].copy()
    # well before it touches: the first row is a mean over a part of the push
    away[:2] -= 0.006 * np.array((np.cos(away[2]), np.sin(away[2])))
    rows = []
    for t in (0.1, 0.2):
        # nothing touches: the sensor reads its offset
        read = _sensed(w, np.zeros((1, 2)), away[2:], order)[0] + w.force_noise * rng.normal(size=2)
        seen = rest + spread * rng.normal(size=3)
        arm0 = away[:2] - seen[:2]
        f = turned(-seen[2]) @ read
        tau = _MOMENT * w.force_noise * rng.normal() + arm0[0] * read[1] - arm0[1] * read[0]
        rows.append(_row(name, t, "rest", seen, (*f, tau), still, np.full(4, np.nan), away))
    for i in range(n):
        rows.append(_row(name, shift + truth.time[i], "push", pose[i], load[i], rate[i], points[i], pusher[i]))
    return rows


def _sensed(world: World, force: np.ndarray, heading: np.ndarray, order: float) -> np.ndarray:
    """What a sensor reads of forces (n, 2) in W, without noise; ``heading`` (n,): of the pusher that carries it."""
    bias, rotation = world.of("force-bias"), world.of("force-rotation")
    if rotation is not None:
        angle = rotation.numbers["angle"] * (share_in_log(rotation.form, order) if rotation.form in CHANGING_FORMS else 1.0)
        # a sensor turned, or one axis that leaks into the other, or both
        leaks = {"crosstalk": np.array(((1.0, 2 * angle), (0.0, 1.0))), "shear": np.array(((1.0, angle), (angle, 1.0)))}
        mixed = leaks.get(rotation.form, turned(angle))
        force = force @ mixed.T
    if bias is not None:
        share = share_in_log(bias.form, order) if bias.form in CHANGING_FORMS else 1.0
        constant = np.broadcast_to(np.array(bias.numbers["force"]), force.shape)
        # of a sensor that turns with the tool, or stands still
        force = force + share * (np.einsum("nij,nj->ni", turned(heading), constant) if bias.form == "tool" else constant)
    return force


def _contacts(world: World, pose: np.ndarray, pusher: np.ndarray, touches: np.ndarray) -> np.ndarray:
    """Contact points (n, 4) in B, by the nominal fingers and the measured poses; NaN where a finger does not touch."""
    found = np.full((len(pose), 4), np.nan)
    places = np.array(((0.0, world.half), (0.0, -world.half))) if world.two else np.zeros((1, 2))
    for i in range(len(pose)):
        centers = (pusher[i, :2] + places @ turned(pusher[i, 2]).T - pose[i, :2]) @ turned(pose[i, 2])
        for k, center in enumerate(centers):
            if touches[i, k]:
                found[i, 2 * k : 2 * k + 2] = _nearest(world.outline, center)
    return found


def _nearest(outline: np.ndarray, point: np.ndarray) -> np.ndarray:
    a, b = outline, np.roll(outline, -1, axis=0)
    along = b - a
    share = np.clip(((point - a) * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
    feet = a + share[:, None] * along
    return feet[int(((feet - point) ** 2).sum(axis=1).argmin())]


def _row(name: str, t: float, phase: str, *values: Iterable[float]) -> Row:
    """A row of ``samples.csv``; blank where a value is missing."""
    flat = [float(v) for part in values for v in part]
    told = ["" if not np.isfinite(v) else v for v in flat]
    return {"trial": name, "t": round(float(t), 6), "phase": phase} | dict(zip(COLUMNS[3:], told, strict=True))


def write(folder: Path, rig: Row, trials: list[Row], samples: list[Row]) -> None:
    """Write a ``pushlog/1`` folder; columns that are blank throughout are left out."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.json").write_text(json.dumps(rig), encoding="utf-8")
    (folder / "trials.csv").write_text(_text(trials, list(trials[0])), encoding="utf-8")
    used = [c for c in COLUMNS if any(row[c] != "" for row in samples)]
    (folder / "samples.csv").write_text(_text(samples, used), encoding="utf-8")


def _text(rows: list[Row], names: list[str]) -> str:
    out = io.StringIO()
    writer = csv.DictWriter(out, names, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()
