"""Channels that stand although they should change: a record that stopped, a sensor at its limit, a component that is dead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stablepush.core import BoolArray, FloatArray, some_of
from stablepush.geometry import contacts_on_outline, point_velocity, rotate_vectors
from stablepush.io.pushlog import PushLog
from stablepush.io.sensor_offset import LEAST_REST

#: What may be wrong where a channel does not change.
_ASKED = {
    "poses": "while the tip moves: did the tracker freeze, or the finger miss?",
    "tip positions": "while the slider moves: did their record stop?",
    "forces": "while the slider moves: is the sensor stuck?",
}
#: A slider that is slower than this share of its greatest speed counts as standing.
_STANDS = 0.02
#: Readings that differ by a smaller share of the largest do not change: turning and interpolating them leaves that, 1e-7 m at
#: places 1000 km from the origin.
_SAME = 1e-13
#: A limit of a sensor shows in so many rows, and in such a share of those that read more than half of it. A sensor that reads
#: fewer values than that, some of them more than once, has coarse steps, and reads the largest of them often.
_CUT, _SHARE_CUT, _MANY_VALUES = 10, 0.05, 200
#: Readings with noise change in such a share of the rows, also at rest.
_NOISY = 0.9
#: Forces that differ by less than this share of the noise of a row do not change: of three rows with noise one in 10^4 do so.
_BELOW_NOISE = 0.02
#: Columns of instruments, of which one may be dead.
_INSTRUMENTS = {"poses": ("x", "y", "theta"), "forces": ("fx", "fy", "tau")}
#: A pose that is told in so many times as many rows as usual is held.
_HELD = 3.0
#: A tip that goes so far (m) while it pushes takes the slider along.
_TAKES_ALONG = 5e-3


def stopped(log: PushLog) -> dict[str, list[str]]:
    """Return the trials in which channels stand still although they should change: poses, tip positions, forces."""
    body, tips, forces = log.columns("x", "y", "theta"), log.columns("px", "py"), log.columns("fx", "fy")
    speed = np.nan_to_num(np.linalg.norm(point_velocity(log.twists(), log.rig.slider.vertices), axis=-1).max(axis=1))
    found: dict[str, list[str]] = {"poses": [], "tip positions": [], "forces": []}
    noise = log.rig.noise.force if log.rig.noise is not None else 0.0
    noisy, stale = noise > 0, frozen(log)
    constant: dict[str, float] = {}
    stuck: set[str] = set()
    for name in map(str, log.trials["trial"]):
        rows = log.rows(name)
        moves = speed[rows] > _STANDS * speed[rows].max(initial=0.0)
        if _ptp(tips[rows]) > _TAKES_ALONG and (_is_same(body[rows]) or name in stale):
            found["poses"].append(name)
        pushed = moves & (log.samples["phase"][rows] == "push") if "phase" in log.samples else moves
        if pushed.any() and _is_same(tips[rows]):
            found["tip positions"].append(name)
        # in whatever axes they were recorded
        size = np.linalg.norm(forces[rows], axis=1)[:, None]
        if _is_same(size, _BELOW_NOISE * noise) and np.isfinite(size[pushed]).sum() >= LEAST_REST:
            constant[name] = float(np.nanmean(size))
            # friction of a slider that stands and then moves changes
            stuck |= set() if moves.all() else {name}
    sizes = np.array(list(constant.values()))
    # and so do readings with noise, from push to push: a value of several pushes is one that is held
    held = {name for name, size in constant.items() if noisy and _near(sizes, size, noise).sum() > 1}
    # a push without rest reads the same as those that show it
    values = np.array([constant[name] for name in stuck | held])
    found["forces"] = [name for name, size in constant.items() if _near(values, size, noise).any()]
    return found


def dead_columns(log: PushLog) -> dict[str, list[str]]:
    """Return by instrument, poses and forces, the columns that never change within a trial while its others change in every row.

    Only of readings with noise, which is told or shows at rest: a slider that is simulated without it may keep its heading.
    """
    noise = log.rig.noise
    told = {"poses": noise is not None and min(noise.position, noise.angle) > 0, "forces": noise is not None and noise.force > 0}
    phase = log.samples.get("phase", np.full(len(log.samples["t"]), ""))
    found = {}
    for channel, names in _INSTRUMENTS.items():
        values = log.columns(*names)
        known = np.asarray(np.isfinite(values).all(axis=1))
        still, changes = np.ones(len(names), dtype=bool), []
        for trial in map(str, log.trials["trial"]):
            rows = log.rows(trial)
            rows = rows[known[rows]]
            noisy = rows if told[channel] else rows[phase[rows] == "rest"]
            if len(noisy) >= LEAST_REST:
                still &= (np.diff(values[rows], axis=0) == 0).all(axis=0)
                changes.append((np.diff(values[noisy], axis=0) != 0).mean(axis=0))
        # one of the others changes in every push
        if changes and (np.min(changes, axis=0) > _NOISY).any() and still.any():
            found[channel] = [name for name, stands in zip(names, still, strict=True) if stands]
    return found


def dead_words(found: Mapping[str, Sequence[str]]) -> list[str]:
    """Return a line for each instrument of which :func:`dead_columns` has ``found`` some."""
    return [
        f"{' and '.join(names)} do{'es' * (len(names) == 1)} not change in any push, while other {channel} do: are they measured?"
        for channel, names in found.items()
    ]


def stopped_words(found: Mapping[str, Sequence[str]], total: int) -> list[str]:
    """Return a line for each channel that :func:`stopped` has ``found`` in some of ``total`` trials."""
    lines = []
    for channel, names in found.items():
        if names:
            pushes = "any push" if len(names) == total else f"{len(names)} of {total} pushes ({some_of(names)})"
            lines.append(f"{channel} do not change in {pushes}, {_ASKED[channel]}")
    return lines


def frozen(log: PushLog) -> dict[str, np.ndarray[Any, np.dtype[np.intp]]]:
    """Return the rows of trials whose pose was told before, while the tip goes into the slider: the tracker had stopped.

    A pose that is told again and again is no measurement if the tip enters the outline by more than 5 mm and it is held for far
    longer than the others of the log: trackers slower than the rows repeat poses, too. Of a tracker that repeats itself at rest
    only rows of the push count, for afterwards a tool may be lifted and pass over the slider.
    """
    found: dict[str, np.ndarray[Any, np.dtype[np.intp]]] = {}
    usual, at_rest = _repeats(log)
    poses, tips, radius = log.columns("x", "y", "theta"), log.columns("px", "py"), log.rig.finger_radius or 0.0
    seen = np.asarray(np.isfinite(np.column_stack((poses, tips))).all(axis=1))
    for name in map(str, log.trials["trial"]) if log.rig.contact_kind != "held" else ():
        rows = log.rows(name)
        rows = rows[seen[rows]]
        if len(rows) < LEAST_REST:
            continue
        stays = _stays(poses[rows])
        # the row that told the pose of each first
        first = np.maximum.accumulate(np.where(stays, 0, np.arange(len(rows))))
        local = rotate_vectors(-poses[rows[first], 2], tips[rows] - poses[rows[first], :2])
        places = contacts_on_outline(log.rig.slider.vertices, local)[2]
        inside = np.asarray(np.minimum(places, radius)[first] - places > _TAKES_ALONG)
        if at_rest and "phase" in log.samples:
            inside &= log.samples["phase"][rows] == "push"
        long = np.bincount(first)[first] > _HELD * usual
        held = np.unique(first[inside & long])
        if len(held):
            found[name] = rows[np.isin(first, held) & stays]
    return found


def dead_or_cut_off(forces: FloatArray) -> list[str]:
    """Return a line for a component of recorded forces (n, 2) that is dead, or cut off at a limit.

    In the axes of the record: loads in B, of which :func:`dead_columns` speaks, turn with the slider and hide it.
    """
    lines = []
    known = forces[np.isfinite(forces).all(axis=1)]
    for name, values, other in (("fx", *known.T), ("fy", *known.T[::-1])) if len(known) >= LEAST_REST else ():
        top = float(np.abs(values).max())
        # a force along the other axis is 0 here, without noise
        is_read = len(np.unique(other)) > _MANY_VALUES or (values[0] != 0 and (np.diff(other) != 0).mean() > _NOISY)
        if not np.ptp(values) and is_read:
            lines.append(
                f"{name} is {values[0]:.3g} in all rows, while the other component changes: is it connected, and mapped?"
            )
        cut, near = int((np.abs(values) == top).sum()), int((np.abs(values) > top / 2).sum())
        below = values[np.abs(values) < top]
        fine = len(np.unique(values)) > _MANY_VALUES or len(np.unique(below)) > _NOISY * len(below) >= _CUT
        if cut >= _CUT and cut > _SHARE_CUT * near and fine:
            lines.append(f"{name} is {top:.3g} at most, in {cut} rows: is the sensor saturated? Its loads are then too small")
    return lines


def _is_same(values: FloatArray, least: float = 0.0) -> bool:
    """Whether known rows (n, k), three at least, are all the same, but for ``least``."""
    known = values[np.isfinite(values).all(axis=1)]
    return len(known) >= LEAST_REST and _ptp(known) <= max(_SAME * float(np.abs(known).max()), least)


def _near(values: FloatArray, value: float, noise: float) -> BoolArray:
    """Which values (n,) are the same as one, of readings with noise."""
    return np.asarray(np.abs(values - value) <= max(_SAME * abs(value), _BELOW_NOISE * noise))


def _stays(body: FloatArray) -> BoolArray:
    """Which poses (n, 3) are those of the row before."""
    same = (np.abs(np.diff(body, axis=0)) <= _SAME * np.abs(body[1:])).all(axis=1)
    return np.concatenate(([False], np.asarray(same)))


def _repeats(log: PushLog) -> tuple[float, bool]:
    """How many rows a pose of a log is usually told in, and whether it is told again and again at rest."""
    lengths, at_rest = [], []
    for name in map(str, log.trials["trial"]):
        rows = log.rows(name)
        body = log.columns("x", "y", "theta")[rows]
        rows, body = rows[np.isfinite(body).all(axis=1)], body[np.isfinite(body).all(axis=1)]
        if len(body):
            stays = _stays(body)
            lengths += np.diff(np.concatenate((np.flatnonzero(~stays), [len(body)]))).tolist()
            if "phase" in log.samples:
                at_rest += stays[1:][log.samples["phase"][rows][1:] == "rest"].tolist()
    return float(np.median(lengths)) if lengths else 1.0, not at_rest or float(np.mean(at_rest)) > 0.5


def _ptp(values: FloatArray) -> float:
    known = values[np.isfinite(values).all(axis=1)]
    return float(np.ptp(known, axis=0).max()) if len(known) else 0.0
