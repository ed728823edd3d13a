"""Streams of samples, each with its own clock, brought to one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stablepush.core import FloatArray, InputError


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """Samples of one thing. ``what``: its name; ``t`` (n,): s; ``values`` (n, k); ``turning``: column of an angle, if any."""

    what: str
    t: FloatArray
    values: FloatArray
    turning: int | None = None

    def __post_init__(self) -> None:
        """Samples in the order of time; the first of those with one stamp."""
        t, first = np.unique(np.asarray(self.t, dtype=np.float64), return_index=True)
        if not len(t):
            raise InputError(self.what, "expected at least one sample")
        values = np.asarray(self.values, dtype=np.float64)[first]
        if self.turning is not None:
            values = values.copy()
            values[:, self.turning] = np.unwrap(values[:, self.turning])
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "values", values)

    def at(self, t: FloatArray) -> FloatArray:
        """Values (m, k) at times (m,) within the stream, on straight lines between its samples."""
        return np.column_stack([np.interp(t, self.t, column) for column in self.values.T])


def on_one_clock(
    streams: Sequence[Stream | None], rate: float | None, largest_gap: float
) -> tuple[FloatArray, list[FloatArray | None]]:
    """Return times (n,) that all streams cover, those of the first, and the values of each at them.

    ``rate`` (Hz): the times and values are means over 1/rate s each, not those of the first stream. Raises
    :class:`InputError` if a stream covers none of the others' time, or has two samples farther apart than ``largest_gap`` (s).
    """
    known = [stream for stream in streams if stream is not None]
    low, high = max(s.t[0] for s in known), min(s.t[-1] for s in known)
    if low > high:
        late = max(known, key=lambda s: s.t[0])
        raise InputError(
            late.what, "expected samples at the time of the others", f"its first {low - high:.3g} s after their last"
        )
    for stream in known:
        inside = stream.t[max(np.searchsorted(stream.t, low) - 1, 0) : np.searchsorted(stream.t, high) + 1]
        steps = np.diff(inside)
        if len(steps) and steps.max() > largest_gap:
            k = int(np.argmax(steps))
            since = inside[k] - min(s.t[0] for s in known)
            raise InputError(
                stream.what, f"expected samples at most {largest_gap:g} s apart (largest_gap)",
                f"none for {steps[k]:.3g} s, from {since:.3f} s after the first",
            )  # fmt: skip
    t = known[0].t[(known[0].t >= low) & (known[0].t <= high)]
    values = [None if stream is None else stream.at(t) for stream in streams]
    if rate is None or len(t) < 2:
        return t, values
    bins = np.floor((t - t[0]) * rate + 1e-9).astype(int)
    _, place, count = np.unique(bins, return_inverse=True, return_counts=True)

    def mean(column: FloatArray) -> FloatArray:
        return np.bincount(place, column) / count

    origin = t[0]
    return origin + mean(t - origin), [None if v is None else np.column_stack([mean(c) for c in v.T]) for v in values]
