"""Readings that stand while others say that something moves: a record that stopped measures nothing."""

from __future__ import annotations

import numpy as np

from stablepush.io import PushLog, stopped, stopped_words

#: Columns of the channels that are left out.
_COLUMNS = {"poses": ("x", "y", "theta"), "tip positions": ("px", "py", "ptheta"), "forces": ("fx", "fy", "tau")}


def without_stopped(log: PushLog) -> tuple[PushLog, list[str]]:
    """Return a log in which readings that do not change in a push are missing values, and a line for each channel."""
    found = stopped(log)
    # poses that stand from first to last are a slider that stands
    found["poses"] = [name for name in found["poses"] if np.ptp(log.columns("x", "y", "theta")[log.rows(name)], axis=0).any()]
    if not any(found.values()):
        return log, []
    samples = {name: np.array(values) for name, values in log.samples.items()}
    for channel, names in found.items():
        rows = np.isin(samples["trial"], names)
        for column in _COLUMNS[channel]:
            if column in samples:
                samples[column][rows] = np.nan
    return PushLog(log.rig, log.trials, samples), [f"{words} They are left out." for words in stopped_words(found, len(log))]
