"""Readings that stand while others say that something moves: a record that stopped measures nothing."""

from __future__ import annotations

import numpy as np

from stablepush.io import PushLog, dead_columns, dead_words, frozen, stopped, stopped_words

#: Columns of the channels that are left out; poses that stand from first to last are a slider that stands.
_COLUMNS = {"tip positions": ("px", "py", "ptheta"), "forces": ("fx", "fy", "tau")}
_POSE = ("x", "y", "theta")


def without_stopped(log: PushLog) -> tuple[PushLog, list[str]]:
    """Return a log in which readings that do not change in a push are missing values, and a line for each channel.

    Of poses those rows are left out in which the tracker had stopped. An instrument with a dead column is left out as a whole.
    """
    found, rows, dead = stopped(log), {}, dead_columns(log)
    for channel, columns in _COLUMNS.items():
        rows[columns] = np.flatnonzero(np.isin(log.samples["trial"], found[channel]))
    stale = frozen(log)
    found["poses"] = list(stale)
    rows[_POSE] = np.concatenate([np.zeros(0, dtype=int), *stale.values()])
    for channel, columns in (("forces", _COLUMNS["forces"]), ("poses", _POSE)):
        if channel in dead:
            found[channel], rows[columns] = [], np.arange(len(log.samples["t"]))
    if not any(found.values()) and not dead:
        return log, []
    samples = {name: np.array(values) for name, values in log.samples.items()}
    for columns, mine in rows.items():
        for column in columns:
            if column in samples:
                samples[column][mine] = np.nan
    words = [*stopped_words(found, len(log)), *dead_words(dead)]
    return PushLog(log.rig, log.trials, samples), [f"{line} They are left out." for line in words]
