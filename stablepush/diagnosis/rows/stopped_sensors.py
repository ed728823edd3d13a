"""Readings that stand while others say that something moves: a record that stopped measures nothing."""

from __future__ import annotations

import numpy as np

from stablepush.io import PushLog, dead_columns, dead_words, frozen, stopped, stopped_words

_COLUMNS = {"poses": ("x", "y", "theta"), "tip positions": ("px", "py", "ptheta"), "forces": ("fx", "fy", "tau")}


def without_stopped(log: PushLog) -> tuple[PushLog, list[str]]:
    """Return a log in which readings that do not change in a push are missing values, and a line for each channel.

    Of poses those rows are left out in which the tracker had stopped: a pose that stands from first to last is that of a slider
    that stands. An instrument with a dead column is left out as a whole.
    """
    found, stale, dead = stopped(log), frozen(log), dead_columns(log)
    found["poses"] = list(stale)
    rows = {channel: np.flatnonzero(np.isin(log.samples["trial"], names)) for channel, names in found.items()}
    rows["poses"] = np.concatenate([np.zeros(0, dtype=int), *stale.values()])
    for channel in dead:
        # the line on its column says enough
        found[channel], rows[channel] = [], np.arange(len(log.samples["t"]))
    if not any(found.values()) and not dead:
        return log, []
    samples = {name: np.array(values) for name, values in log.samples.items()}
    for channel, mine in rows.items():
        for column in _COLUMNS[channel]:
            if column in samples:
                samples[column][mine] = np.nan
    words = [*stopped_words(found, len(log)), *dead_words(dead)]
    return PushLog(log.rig, log.trials, samples), [f"{line} They are left out." for line in words]
