"""Readings that stand while others say that something moves: a record that stopped measures nothing."""

from __future__ import annotations

import numpy as np

from stablepush.io import PushLog, frozen, stopped, stopped_words

#: Columns of the channels that are left out; poses that stand from first to last are a slider that stands.
_COLUMNS = {"tip positions": ("px", "py", "ptheta"), "forces": ("fx", "fy", "tau")}
_POSE = ("x", "y", "theta")


def without_stopped(log: PushLog) -> tuple[PushLog, list[str]]:
    """Return a log in which readings that do not change in a push are missing values, and a line for each channel.

    Of poses those rows are left out in which the tracker had stopped.
    """
    found, rows = stopped(log), {}
    for channel, columns in _COLUMNS.items():
        rows[columns] = np.flatnonzero(np.isin(log.samples["trial"], found[channel]))
    stale = frozen(log)
    found["poses"] = list(stale)
    rows[_POSE] = np.concatenate([np.zeros(0, dtype=int), *stale.values()])
    if not any(found.values()):
        return log, []
    samples = {name: np.array(values) for name, values in log.samples.items()}
    for columns, mine in rows.items():
        for column in columns:
            if column in samples:
                samples[column][mine] = np.nan
    return PushLog(log.rig, log.trials, samples), [f"{words} They are left out." for words in stopped_words(found, len(log))]
