"""A heap in two arrays: values and items, the least value first."""

from __future__ import annotations

from stablepush.core import inner


@inner
def heap_push(values, items, count, value, item):  # type: ignore[no-untyped-def]
    """Put an item into a heap of ``count`` items, the least value first."""
    n = count
    while n > 0:
        up = (n - 1) >> 1
        if values[up] <= value:
            break
        values[n], items[n] = values[up], items[up]
        n = up
    values[n], items[n] = value, item


@inner
def heap_pop(values, items, count):  # type: ignore[no-untyped-def]
    """Take the first item out of a heap of ``count`` items."""
    item, n = items[0], count - 1
    value, last = values[n], items[n]
    at = 0
    while True:
        child = 2 * at + 1
        if child >= n:
            break
        if child + 1 < n and values[child + 1] < values[child]:
            child += 1
        if values[child] >= value:
            break
        values[at], items[at] = values[child], items[child]
        at = child
    values[at], items[at] = value, last
    return item
