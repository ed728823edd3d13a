"""Several logs of one rig as one, in the order in which they are given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stablepush.core import InputError
from stablepush.diagnosis.rows.observations import Observations, observe
from stablepush.io import Noise, PushLog, rig_to_json

#: Time (s) between logs, of which only the order counts.
_PAUSE = 1.0
#: Entries of ``rig.json`` that must agree, and up to what share.
_OF_RIG, _ROUNDING = ("slider", "friction", "gravity", "contact_kind", "finger_radius", "model"), 1e-6


def join(logs: Sequence[PushLog], names: Sequence[str]) -> tuple[PushLog, np.ndarray]:
    """Return several logs of one rig as one, and the number (trials,) of the log of each trial.

    Trials and groups have the name of their log before their own. The noise is the largest of all; twists count as those of
    no window where the logs have different ones. Raises
    :class:`InputError` if the rigs differ, or a log is given twice.
    """
    first = rig_to_json(logs[0].rig)
    for log, name in zip(logs[1:], names[1:], strict=True):
        other = rig_to_json(log.rig)
        for key in _OF_RIG:
            if not _alike(first.get(key), other.get(key)):
                raise InputError(f"{name}: rig.json: {key}", "expected the rig of the first log", "another one")
    for k, (log, name) in enumerate(zip(logs, names, strict=True)):
        if any(_same_samples(log, other) for other in logs[:k]):
            raise InputError(name, "expected another log", "the same pushes twice")
    noises = [log.rig.noise for log in logs if log.rig.noise]
    worst = Noise(*(max(getattr(noise, key) for noise in noises) for key in ("force", "position", "angle"))) if noises else None
    windows = {log.rig.twist_window for log in logs}
    rig = replace(
        logs[0].rig,
        noise=worst if len(noises) == len(logs) else None,
        twist_window=windows.pop() if len(windows) == 1 else None,
    )
    tables: list[dict[str, list[object]]] = []
    for attribute in ("trials", "samples"):
        columns = dict.fromkeys(key for log in logs for key in getattr(log, attribute))
        tables.append({key: [] for key in columns})
    begun, number = 0.0, []
    for k, (log, name) in enumerate(zip(logs, names, strict=True)):
        for table, mine in zip(tables, (log.trials, log.samples), strict=True):
            count = len(mine["trial"])
            for key, column in table.items():
                values = mine.get(key)
                if values is None:
                    like = next(other for log in logs for other in (log.trials, log.samples) if key in other)[key]
                    # a log without phases counts every row as a push
                    blank = "push" if key == "phase" else "" if like.dtype == object else np.nan
                    column.extend([blank] * count)
                elif key in ("trial", "group"):
                    column.extend(f"{name}/{value}" if value else "" for value in values)
                elif key == "start_time":
                    column.extend((values - values.min() + begun).tolist())
                    begun += float(np.ptp(values)) + _PAUSE
                else:
                    column.extend(values.tolist())
        number += [k] * len(log)
    return PushLog(rig, *tables), np.array(number)


def _same_samples(log: PushLog, other: PushLog) -> bool:
    poses = [one.columns("t", "x", "y", "theta") for one in (log, other)]
    return poses[0].shape == poses[1].shape and np.array_equal(poses[0], poses[1], equal_nan=True)


def _alike(a: Any, b: Any) -> bool:
    """Whether two entries of JSON are the same, up to rounding."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_alike(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_alike, a, b))
    if isinstance(a, float | int) and isinstance(b, float | int):
        return math.isclose(a, b, rel_tol=_ROUNDING, abs_tol=_ROUNDING)
    return bool(a == b)


def observe_each(log: PushLog, number: np.ndarray) -> Observations:
    """Return the observations of joined logs; the order of the trials counts within each."""
    o = observe(log)
    begun, order = np.asarray(log.trials["start_time"], dtype=np.float64), np.zeros(len(log))
    for k in range(int(number.max()) + 1):
        mine = np.flatnonzero(number == k)
        order[mine] = np.argsort(np.argsort(begun[mine], kind="stable"), kind="stable") / max(1, len(mine) - 1)
    return replace(o, order=order[o.trial])
