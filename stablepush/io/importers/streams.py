"""Streams of samples, each with its own clock, brought to one."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stablepush.core import FloatArray, InputError
from stablepush.io.force_spikes import without_spikes
from stablepush.io.tracker_glitches import without_glitches


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """Samples of one thing, in the order in which they were recorded.

    ``what``: its name; ``t`` (n,): s; ``values`` (n, k), NaN for a missing one; ``turning``: column of an angle, if any;
    ``leaps``: how many of them were wrong for a moment (:func:`without_leaps`).

    Raises :class:`InputError` if there is no sample, if none of them is known, and if the stamps go back: the clock was set, and
    nobody knows which samples belong together.
    """

    what: str
    t: FloatArray
    values: FloatArray
    turning: int | None = None
    leaps: int = 0

    def __post_init__(self) -> None:
        """Keep the first of samples with one stamp."""
        t, values = np.asarray(self.t, dtype=np.float64), np.array(self.values, dtype=np.float64)
        if not len(t):
            raise InputError(self.what, "expected at least one sample")
        back = np.flatnonzero(np.diff(t) < 0)
        if len(back):
            k = int(back[0])
            step, times = t[k] - t[k + 1], "" if len(back) == 1 else f", and {len(back) - 1} times more"
            raise InputError(self.what, f"expected stamps that grow, they go back by {step:.3g} s after {t[k]:.3f} s{times}")
        distinct = np.diff(t, prepend=-np.inf) > 0
        t, values = t[distinct], values[distinct]
        values[~np.isfinite(values)] = np.nan
        if np.isnan(values).all():
            raise InputError(self.what, "expected a sample of finite numbers", f"none in {len(t)}")
        if self.turning is not None:
            angles = values[:, self.turning]
            known = np.isfinite(angles)
            angles[known] = np.unwrap(angles[known])
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "values", values)

    def at(self, t: FloatArray) -> FloatArray:
        """Values (m, k) at times (m,) within the stream, on straight lines between its samples; NaN beside a missing one."""
        return np.column_stack([np.interp(t, self.t, column) for column in self.values.T])


def without_leaps(stream: Stream, length: float | None = None) -> tuple[Stream, list[str]]:
    """Return a stream of poses, or of forces, without values that leap away and back, and notes on them.

    ``length`` (m) makes an angle of poses a distance; None: of forces. This comes before streams are brought to one clock, for
    means of samples, and lines between them, would spread a leap over its neighbours.
    """
    rows = [np.arange(len(stream.t))]
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        if length is None:
            kept = without_spikes(stream.t, stream.values[:, :2], rows, [""])
        else:
            kept = without_glitches(stream.t, stream.values, rows, [""], length)
    wrong = np.asarray(np.isnan(kept).any(axis=1) & ~np.isnan(stream.values).any(axis=1))
    values = np.where(wrong[:, None], np.nan, stream.values)
    return replace(stream, values=values, leaps=int(wrong.sum())), [f"{stream.what}: {one.message}" for one in heard]


def on_one_clock(
    streams: Sequence[Stream | None], rate: float | None, largest_gap: float
) -> tuple[FloatArray, list[FloatArray | None], list[str]]:
    """Return times (n,) that all streams cover, those of the first, the values of each at them, and notes on what is left out.

    ``rate`` (Hz): the times and values are means over 1/rate s each, not those of the first stream. Raises
    :class:`InputError` if a stream covers none of the others' time, or has two samples farther apart than ``largest_gap`` (s).
    """
    known = [stream for stream in streams if stream is not None]
    for stream in known:
        if len(stream.t) < 2:
            raise InputError(stream.what, "expected at least two samples", len(stream.t))
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
    notes = [words for stream in known for words in (_lacking(stream), _short(stream, known, largest_gap)) if words]
    t = known[0].t[(known[0].t >= low) & (known[0].t <= high)]
    values = [None if stream is None else stream.at(t) for stream in streams]
    if rate is None or len(t) < 2:
        return t, values, notes
    bins = np.floor((t - t[0]) * rate + 1e-9).astype(int)
    _, place, count = np.unique(bins, return_inverse=True, return_counts=True)

    def mean(column: FloatArray) -> FloatArray:
        here = np.isfinite(column)
        seen = np.bincount(place, here)
        return np.bincount(place, np.where(here, column, 0.0)) / np.where(seen > 0, seen, np.nan)

    origin = t[0]
    clock = origin + np.bincount(place, t - origin) / count
    return clock, [None if v is None else np.column_stack([mean(c) for c in v.T]) for v in values], notes


def _lacking(stream: Stream) -> str:
    """Words on samples that hold no number."""
    lost = int((~np.isfinite(stream.values).all(axis=1)).sum()) - stream.leaps
    return f"{stream.what}: {lost} of {len(stream.t)} samples are no numbers: missing values" if lost else ""


def _short(stream: Stream, streams: Sequence[Stream], largest_gap: float) -> str:
    """Words on a stream that begins later or ends earlier than others by more than samples may be apart."""
    low, high = min(s.t[0] for s in streams), max(s.t[-1] for s in streams)
    left_out = [what for what in (stream.t[0] - low, high - stream.t[-1]) if what > largest_gap]
    if not left_out:
        return ""
    covers = f"{stream.t[-1] - stream.t[0]:.3g} of {high - low:.3g} s"
    return f"{stream.what} covers {covers}: {sum(left_out):.3g} s are left out"
