"""Whether the pusher can go from one contact to another among obstacles."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush.core import FloatArray, compiled, inner
from stablepush.planning.kernels import Body, clearance_at, edges_near, line_is_free, pose_is_free

#: How a change of contact is tested: the pusher takes one of the known paths; as if it could take any path.
KNOWN_PATHS, ANY_PATH = 0, 1


class Bodies(NamedTuple):
    """Slider and docked pusher, by contact: where edges and corners of each begin, and radii (m)."""

    edge_first: np.ndarray
    edges: FloatArray
    corner_first: np.ndarray
    corners: FloatArray
    radii: FloatArray


class Transfers(NamedTuple):
    """Changes of contact: time (s), how they are tested (:data:`KNOWN_PATHS`), the pusher in its frame as it is at each contact,
    radius (m) of a disc that holds it, its docked poses (contacts, 3) in B, how far it backs off (m), and two paths round the
    slider in B for every pair of contacts."""

    cost: float
    kind: int
    pushers: Bodies
    radius: float
    docks: FloatArray
    retreats: FloatArray
    first: np.ndarray
    routes: FloatArray


@inner
def body_at(bodies, contact):  # type: ignore[no-untyped-def]
    """Slider and pusher docked at a contact."""
    a, b = bodies.edge_first[contact], bodies.edge_first[contact + 1]
    c, d = bodies.corner_first[contact], bodies.corner_first[contact + 1]
    return Body(bodies.edges[a:b], bodies.corners[c:d], bodies.radii[contact])


@inner
def disc_is_free(world, x0, y0, x1, y1, radius):  # type: ignore[no-untyped-def]
    """Whether a disc that moves straight stays clear of obstacles and within the bounds."""
    low_x, low_y, high_x, high_y = min(x0, x1) - radius, min(y0, y1) - radius, max(x0, x1) + radius, max(y0, y1) + radius
    b = world.bounds
    if low_x < b[0] or low_y < b[1] or high_x > b[2] or high_y > b[3]:
        return False
    dx, dy = x1 - x0, y1 - y0
    route = dx * dx + dy * dy
    for n in range(edges_near(world, low_x, low_y, high_x, high_y)):
        e = world.found[n]
        ax, ay, bx, by = world.edges[e, 0], world.edges[e, 1], world.edges[e, 2], world.edges[e, 3]
        ex, ey = bx - ax, by - ay
        across = dx * ey - dy * ex
        if across != 0.0:
            s = ((ax - x0) * ey - (ay - y0) * ex) / across
            t = ((ax - x0) * dy - (ay - y0) * dx) / across
            if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
                return False
        # else the least distance is at an end of either
        length = ex * ex + ey * ey
        for px, py in ((x0, y0), (x1, y1)):
            t = min(1.0, max(0.0, ((px - ax) * ex + (py - ay) * ey) / length))
            if (px - ax - t * ex) ** 2 + (py - ay - t * ey) ** 2 < radius * radius:
                return False
        if route > 0.0:
            t = min(1.0, max(0.0, ((ax - x0) * dx + (ay - y0) * dy) / route))
            if (ax - x0 - t * dx) ** 2 + (ay - y0 - t * dy) ** 2 < radius * radius:
                return False
    return True


@inner
def route_is_free(transfers, world, route, x, y, cos, sin):  # type: ignore[no-untyped-def]
    """Whether the pusher, as a disc, can take a path round the slider."""
    a, b = transfers.first[route], transfers.first[route + 1]
    if b == a:
        return False
    for k in range(a, b - 1):
        px, py = transfers.routes[k, 0], transfers.routes[k, 1]
        qx, qy = transfers.routes[k + 1, 0], transfers.routes[k + 1, 1]
        if not disc_is_free(
            world,
            x + cos * px - sin * py,
            y + sin * px + cos * py,
            x + cos * qx - sin * qy,
            y + sin * qx + cos * qy,
            transfers.radius,
        ):
            return False
    return True


@inner
def can_back_off(transfers, world, contact, x, y, cos, sin):  # type: ignore[no-untyped-def]
    """Whether the docked pusher can back off straight, as far as obstacles and bounds go."""
    pusher = body_at(transfers.pushers, contact)
    dock = transfers.docks[contact]
    c, s = math.cos(dock[2]), math.sin(dock[2])
    c, s = cos * c - sin * s, sin * c + cos * s
    px, py = x + cos * dock[0] - sin * dock[1], y + sin * dock[0] + cos * dock[1]
    route = transfers.retreats[contact]
    return line_is_free(world, pusher, px, py, c, s, -route * c, -route * s)


@compiled
def route_between(transfers, bodies, world, source, target, x, y, cos, sin):  # type: ignore[no-untyped-def]
    """A free path round the slider from one contact to another: its number, or -1."""
    contacts = transfers.docks.shape[0]
    if transfers.retreats[source] < 0.0 or transfers.retreats[target] < 0.0:
        return -1
    if clearance_at(world, x, y) <= bodies.radii[target] and not pose_is_free(world, body_at(bodies, target), x, y, cos, sin):
        return -1
    if not can_back_off(transfers, world, source, x, y, cos, sin) or not can_back_off(transfers, world, target, x, y, cos, sin):
        return -1
    if transfers.kind == ANY_PATH:
        return 0
    for side in range(2):
        route = 2 * (source * contacts + target) + side
        if route_is_free(transfers, world, route, x, y, cos, sin):
            return route
    return -1
