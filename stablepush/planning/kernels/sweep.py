"""Compiled tests of moving polygons against fixed ones: exact along arcs and straight lines, no sampling.

A polygon that starts clear of another one and moves rigidly first touches it where a vertex of either meets an edge of the
other. While it turns about a point, its vertices run on circles about that point; seen from the polygon, the other's vertices
run on circles the other way. So a motion is free if and only if its start is, and none of these arcs meets an edge.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush.core import FloatArray, compiled, inner

#: Turns are tested in parts of at most this angle (rad); below pi, so that signs of cross products show what an arc passes.
_LARGEST_PART = 2.0
#: Turns (rad) below this move like translations, to far below the tolerance.
_NO_TURN = 1e-9


class World(NamedTuple):
    """Edges of what stands still, in cells of a grid, and the clearance of every cell.

    ``edges`` (m, 4): both ends of every edge (m); a corner is the first end of one edge. ``first`` (nx*ny + 1,) and ``listed``
    name the edges that cross a cell. ``clearance`` (nx, ny): no point of a cell is nearer to an obstacle or the bounds than this
    (m). ``seen`` (m,) marks edges that were looked at in the test whose number is in ``turn`` (1,), ``found`` (m,) takes those
    near.
    """

    edges: FloatArray
    first: np.ndarray
    listed: np.ndarray
    clearance: FloatArray
    low: FloatArray
    cell: float
    bounds: FloatArray
    seen: np.ndarray
    turn: np.ndarray
    found: np.ndarray


class Body(NamedTuple):
    """A rigid body: edges (n, 4) in B, moved inwards by the overlap that is allowed, its true corners (k, 2), and the radius
    about the origin of B that holds all of it."""

    edges: FloatArray
    corners: FloatArray
    radius: float


@inner
def clearance_at(world, x, y):  # type: ignore[no-untyped-def]
    """Least distance (m) from a place to obstacles and bounds, as far as the grid knows."""
    i, j = math.floor((x - world.low[0]) / world.cell), math.floor((y - world.low[1]) / world.cell)
    if 0 <= i < world.clearance.shape[0] and 0 <= j < world.clearance.shape[1]:
        return world.clearance[i, j]
    return 0.0


@inner
def edges_near(world, low_x, low_y, high_x, high_y):  # type: ignore[no-untyped-def]
    """Put the edges whose boxes meet a box into ``world.found``, each once; return how many there are."""
    count = 0
    if world.edges.shape[0] == 0:
        return count
    world.turn[0] += 1
    mark = world.turn[0]
    nx, ny = world.clearance.shape
    i0 = max(0, math.floor((low_x - world.low[0]) / world.cell))
    j0 = max(0, math.floor((low_y - world.low[1]) / world.cell))
    i1 = min(nx - 1, math.floor((high_x - world.low[0]) / world.cell))
    j1 = min(ny - 1, math.floor((high_y - world.low[1]) / world.cell))
    for i in range(i0, i1 + 1):
        for j in range(j0, j1 + 1):
            for k in range(world.first[i * ny + j], world.first[i * ny + j + 1]):
                e = world.listed[k]
                if world.seen[e] == mark:
                    continue
                world.seen[e] = mark
                ax, ay, bx, by = world.edges[e, 0], world.edges[e, 1], world.edges[e, 2], world.edges[e, 3]
                if max(ax, bx) < low_x or min(ax, bx) > high_x or max(ay, by) < low_y or min(ay, by) > high_y:
                    continue
                world.found[count] = e
                count += 1
    return count


@inner
def _meets_arc(px, py, qx, qy, ax, ay, ex, ey, sign):  # type: ignore[no-untyped-def]
    """Whether the arc about the origin from (px, py) to (qx, qy), turning by less than pi, meets a + t e."""
    qa = ex * ex + ey * ey
    qb = ax * ex + ay * ey
    qc = ax * ax + ay * ay - px * px - py * py
    discriminant = qb * qb - qa * qc
    if discriminant < 0.0 or qa == 0.0:
        return False
    root = math.sqrt(discriminant)
    for side in (-1.0, 1.0):
        t = (-qb + side * root) / qa
        if 0.0 <= t <= 1.0:
            x, y = ax + t * ex, ay + t * ey
            if sign * (px * y - py * x) >= 0.0 and sign * (x * qy - y * qx) >= 0.0:
                return True
    return False


@inner
def _meets_line(px, py, dx, dy, ax, ay, ex, ey):  # type: ignore[no-untyped-def]
    """Whether the segment from (px, py) by (dx, dy) meets a + t e."""
    across = dx * ey - dy * ex
    if across == 0.0:
        return False
    gx, gy = ax - px, ay - py
    s = (gx * ey - gy * ex) / across
    t = (gx * dy - gy * dx) / across
    return 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0


@inner
def _span(ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Squares of the least and the largest distance of a segment from the origin."""
    ex, ey = bx - ax, by - ay
    a, b = ax * ax + ay * ay, bx * bx + by * by
    length = ex * ex + ey * ey
    t = -(ax * ex + ay * ey)
    least = (ax * ey - ay * ex) ** 2 / length if 0.0 < t < length else min(a, b)
    return least * (1.0 - 1e-12), max(a, b) * (1.0 + 1e-12)


@inner
def arc_is_free(world, body, x, y, cos, sin, cx, cy, angle):  # type: ignore[no-untyped-def]
    """Whether a body that is free at the pose (x, y, cos, sin) stays so while it turns by ``angle`` about (cx, cy)."""
    parts = math.ceil(abs(angle) / _LARGEST_PART)
    part = angle / parts
    ca, sa = math.cos(part), math.sin(part)
    sign = 1.0 if angle > 0.0 else -1.0
    # the pose seen from the centre
    rx, ry = x - cx, y - cy
    for _ in range(parts):
        if not _part_is_free(world, body, rx, ry, cos, sin, cx, cy, part, ca, sa, sign):
            return False
        rx, ry = ca * rx - sa * ry, sa * rx + ca * ry
        cos, sin = ca * cos - sa * sin, sa * cos + ca * sin
    return True


@inner
def _part_is_free(world, body, rx, ry, cos, sin, cx, cy, angle, ca, sa, sign):  # type: ignore[no-untyped-def]
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    farthest = 0.0
    for i in range(body.corners.shape[0]):
        px = rx + cos * body.corners[i, 0] - sin * body.corners[i, 1]
        py = ry + sin * body.corners[i, 0] + cos * body.corners[i, 1]
        qx, qy = ca * px - sa * py, sa * px + ca * py
        low_x, high_x = min(low_x, px, qx), max(high_x, px, qx)
        low_y, high_y = min(low_y, py, qy), max(high_y, py, qy)
        farthest = max(farthest, px * px + py * py)
    # an arc bulges over the box of its ends by no more than its height
    bulge = math.sqrt(farthest) * (1.0 - math.cos(angle / 2))
    low_x, low_y, high_x, high_y = low_x - bulge + cx, low_y - bulge + cy, high_x + bulge + cx, high_y + bulge + cy
    b = world.bounds
    if low_x < b[0] or low_y < b[1] or high_x > b[2] or high_y > b[3]:
        for i in range(body.corners.shape[0]):
            px = rx + cos * body.corners[i, 0] - sin * body.corners[i, 1]
            py = ry + sin * body.corners[i, 0] + cos * body.corners[i, 1]
            qx, qy = ca * px - sa * py, sa * px + ca * py
            if min(px, qx) + cx < b[0] or max(px, qx) + cx > b[2] or min(py, qy) + cy < b[1] or max(py, qy) + cy > b[3]:
                return False
            radius = math.sqrt(px * px + py * py)
            for k in range(4):
                if k == 0:
                    ux, uy, out = -radius, 0.0, cx - radius < b[0]
                elif k == 1:
                    ux, uy, out = 0.0, -radius, cy - radius < b[1]
                elif k == 2:
                    ux, uy, out = radius, 0.0, cx + radius > b[2]
                else:
                    ux, uy, out = 0.0, radius, cy + radius > b[3]
                if out and sign * (px * uy - py * ux) >= 0.0 and sign * (ux * qy - uy * qx) >= 0.0:
                    return False
    for n in range(edges_near(world, low_x, low_y, high_x, high_y)):
        e = world.found[n]
        ax, ay, bx, by = world.edges[e, 0], world.edges[e, 1], world.edges[e, 2], world.edges[e, 3]
        ax, ay, bx, by = ax - cx, ay - cy, bx - cx, by - cy
        near, far = _span(ax, ay, bx, by)
        # the first end of the edge, seen from the body, runs back
        fx, fy = ca * ax + sa * ay, ca * ay - sa * ax
        corner = ax * ax + ay * ay
        for v in range(body.edges.shape[0]):
            px = rx + cos * body.edges[v, 0] - sin * body.edges[v, 1]
            py = ry + sin * body.edges[v, 0] + cos * body.edges[v, 1]
            square = px * px + py * py
            if near <= square <= far:
                qx, qy = ca * px - sa * py, sa * px + ca * py
                if _meets_arc(px, py, qx, qy, ax, ay, bx - ax, by - ay, sign):
                    return False
            ox = rx + cos * body.edges[v, 2] - sin * body.edges[v, 3]
            oy = ry + sin * body.edges[v, 2] + cos * body.edges[v, 3]
            near_o, far_o = _span(px, py, ox, oy)
            if near_o <= corner <= far_o and _meets_arc(ax, ay, fx, fy, px, py, ox - px, oy - py, -sign):
                return False
    return True


@compiled
def line_is_free(world, body, x, y, cos, sin, dx, dy):  # type: ignore[no-untyped-def]
    """Whether a body that is free at the pose (x, y, cos, sin) stays so while it moves straight by (dx, dy)."""
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for i in range(body.corners.shape[0]):
        px = x + cos * body.corners[i, 0] - sin * body.corners[i, 1]
        py = y + sin * body.corners[i, 0] + cos * body.corners[i, 1]
        low_x, high_x = min(low_x, px, px + dx), max(high_x, px, px + dx)
        low_y, high_y = min(low_y, py, py + dy), max(high_y, py, py + dy)
    b = world.bounds
    if low_x < b[0] or low_y < b[1] or high_x > b[2] or high_y > b[3]:
        return False
    for n in range(edges_near(world, low_x, low_y, high_x, high_y)):
        e = world.found[n]
        ax, ay, bx, by = world.edges[e, 0], world.edges[e, 1], world.edges[e, 2], world.edges[e, 3]
        for v in range(body.edges.shape[0]):
            px = x + cos * body.edges[v, 0] - sin * body.edges[v, 1]
            py = y + sin * body.edges[v, 0] + cos * body.edges[v, 1]
            if _meets_line(px, py, dx, dy, ax, ay, bx - ax, by - ay):
                return False
            ox = x + cos * body.edges[v, 2] - sin * body.edges[v, 3]
            oy = y + sin * body.edges[v, 2] + cos * body.edges[v, 3]
            if _meets_line(ax, ay, -dx, -dy, px, py, ox - px, oy - py):
                return False
    return True


@compiled
def pose_is_free(world, body, x, y, cos, sin):  # type: ignore[no-untyped-def]
    """Whether a body at a pose overlaps nothing and lies within the bounds."""
    b = world.bounds
    for i in range(body.corners.shape[0]):
        px = x + cos * body.corners[i, 0] - sin * body.corners[i, 1]
        py = y + sin * body.corners[i, 0] + cos * body.corners[i, 1]
        if px < b[0] or px > b[2] or py < b[1] or py > b[3]:
            return False
    # a vertex in the other polygon, by the parity of crossings of a ray, or edges that cross
    count, many = body.edges.shape[0], world.edges.shape[0]
    for v in range(count):
        px = x + cos * body.edges[v, 0] - sin * body.edges[v, 1]
        py = y + sin * body.edges[v, 0] + cos * body.edges[v, 1]
        ex = x + cos * body.edges[v, 2] - sin * body.edges[v, 3] - px
        ey = y + sin * body.edges[v, 2] + cos * body.edges[v, 3] - py
        inside = False
        for e in range(many):
            ax, ay, bx, by = world.edges[e, 0], world.edges[e, 1], world.edges[e, 2], world.edges[e, 3]
            if (ay > py) != (by > py) and px < ax + (py - ay) / (by - ay) * (bx - ax):
                inside = not inside
            if _meets_line(px, py, ex, ey, ax, ay, bx - ax, by - ay):
                return False
        if inside:
            return False
    for e in range(many):
        # the corner of the obstacle in the body's frame
        gx, gy = world.edges[e, 0] - x, world.edges[e, 1] - y
        px, py = cos * gx + sin * gy, cos * gy - sin * gx
        inside = False
        for v in range(count):
            ax, ay, bx, by = body.edges[v, 0], body.edges[v, 1], body.edges[v, 2], body.edges[v, 3]
            if (ay > py) != (by > py) and px < ax + (py - ay) / (by - ay) * (bx - ax):
                inside = not inside
        if inside:
            return False
    return True


@compiled
def push_is_free(world, body, x, y, cos, sin, vx, vy, omega, duration):  # type: ignore[no-untyped-def]
    """Whether a body that is free at a pose stays so while it follows a body twist for a time (s)."""
    angle = omega * duration
    travel = math.sqrt(vx * vx + vy * vy) * duration
    if clearance_at(world, x, y) > body.radius + travel:
        return True
    if abs(angle) < _NO_TURN:
        dx, dy = vx * duration, vy * duration
        return line_is_free(world, body, x, y, cos, sin, cos * dx - sin * dy, sin * dx + cos * dy)
    bx, by = -vy / omega, vx / omega
    return arc_is_free(world, body, x, y, cos, sin, x + cos * bx - sin * by, y + sin * bx + cos * by, angle)


@compiled
def pushes_are_free(world, body, poses, twists, durations, result):  # type: ignore[no-untyped-def]
    """Fill ``result`` (n,) with :func:`push_is_free` of pushes (n, 3), (n, 3), (n,)."""
    for n in range(poses.shape[0]):
        cos, sin = math.cos(poses[n, 2]), math.sin(poses[n, 2])
        result[n] = push_is_free(
            world, body, poses[n, 0], poses[n, 1], cos, sin, twists[n, 0], twists[n, 1], twists[n, 2], durations[n]
        )


@compiled
def poses_are_free(world, body, poses, result):  # type: ignore[no-untyped-def]
    """Fill ``result`` (n,) with :func:`pose_is_free` of poses (n, 3)."""
    for n in range(poses.shape[0]):
        result[n] = pose_is_free(world, body, poses[n, 0], poses[n, 1], math.cos(poses[n, 2]), math.sin(poses[n, 2]))


@compiled
def list_edges(edges, low, cell, nx, ny, first, listed):  # type: ignore[no-untyped-def]
    """Count, then list, the edges of every cell that their boxes meet; call with an empty list to count."""
    count = np.zeros(nx * ny, dtype=np.int64)
    for e in range(edges.shape[0]):
        i0 = max(0, math.floor((min(edges[e, 0], edges[e, 2]) - low[0]) / cell - 1e-9))
        i1 = min(nx - 1, math.floor((max(edges[e, 0], edges[e, 2]) - low[0]) / cell + 1e-9))
        for i in range(i0, i1 + 1):
            # the part of the edge over this column of cells
            left, right = low[0] + i * cell - 1e-9, low[0] + (i + 1) * cell + 1e-9
            dx = edges[e, 2] - edges[e, 0]
            s0, s1 = 0.0, 1.0
            if abs(dx) > 1e-12:
                a, b = (left - edges[e, 0]) / dx, (right - edges[e, 0]) / dx
                s0, s1 = max(0.0, min(a, b)), min(1.0, max(a, b))
            y0, y1 = edges[e, 1] + s0 * (edges[e, 3] - edges[e, 1]), edges[e, 1] + s1 * (edges[e, 3] - edges[e, 1])
            j0 = max(0, math.floor((min(y0, y1) - low[1]) / cell - 1e-9))
            j1 = min(ny - 1, math.floor((max(y0, y1) - low[1]) / cell + 1e-9))
            for j in range(j0, j1 + 1):
                at = i * ny + j
                if listed.shape[0]:
                    listed[first[at] + count[at]] = e
                count[at] += 1
    if not listed.shape[0]:
        first[0] = 0
        for at in range(nx * ny):
            first[at + 1] = first[at] + count[at]
