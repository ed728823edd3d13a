"""Compiled: the last link of the cheapest chain of pushes to a pose of a path."""

from __future__ import annotations

from stablepush.core import compiled
from stablepush.planning.kernels import push_is_free
from stablepush_planners._connection import connect

#: A shortcut must save this much (s).
WORTH = 1e-9


@compiled
def cheapest_link(  # type: ignore[no-untyped-def]
    b, best, prices, pushes, world, body, connections, contact, connects, poses, cosines, lengths, work, link
):
    """Return the pose from which pose ``b`` is reached most cheaply, if not from the one before; -1 otherwise.

    ``best`` (n,) in s is what poses cost so far; that of ``b`` is replaced. Two poses are joined by one push, of those of
    ``pushes`` (n, n, 4), twist and duration, at ``prices`` (n, n), or by a connection if ``connects``. ``link`` (3, 4) receives
    what joins them; durations of 0 are no push. ``lengths`` (6, 3) and ``work`` (3, 4) are workspace.
    """
    chosen = -1
    for a in range(b - 1):
        most = best[b] - best[a] - WORTH
        if prices[a, b] < most:
            vx, vy, omega, duration = pushes[a, b, 0], pushes[a, b, 1], pushes[a, b, 2], pushes[a, b, 3]
            if push_is_free(world, body, poses[a, 0], poses[a, 1], cosines[a, 0], cosines[a, 1], vx, vy, omega, duration):
                best[b], chosen = best[a] + prices[a, b], a
                most = best[b] - best[a] - WORTH
                # element by element: compiling the assignment of a whole array takes seconds, for its message on shapes
                for q in range(4):
                    link[0, q], link[1, q], link[2, q] = pushes[a, b, q], 0.0, 0.0
        if connects and most > 0.0:
            found = connect(
                connections, world, body, contact, poses[a, 0], poses[a, 1], poses[a, 2], poses[b, 0], poses[b, 1], poses[b, 2],
                most, lengths, work,
            )  # fmt: skip
            if found < most:
                best[b], chosen = best[a] + found, a
                for k in range(3):
                    for q in range(4):
                        link[k, q] = work[k, q]
    return chosen
