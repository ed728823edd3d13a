"""The worst that any pressure distribution can do to a push: a small linear program with a continuum of columns, solved exactly.

For a facet ``a`` of the wrench cone and a twist ``V`` with COR ``c``, a unit of friction load at ``x`` contributes

    g(x) = b(x)·e(x),   b(x) = (a_x - a_tau y, a_y + a_tau x),   e(x) = v(x)/|v(x)|,

and the push can break over the facet iff ``min Σ m g < 0`` over ``m >= 0, Σ m = 1, Σ m x = COM``: the lower convex envelope of
``g`` at the COM. With ``x = c + r u`` one finds ``g = s r + w·u`` with constant ``s, w``: along every ray from ``c`` it is
linear, so only the polygon's boundary and ``c`` itself, where friction may point anywhere and ``g = -|b(c)|``, can carry the
worst pressure. Along an edge, ``g''`` has the sign of a quadratic: at most three pieces, each convex or concave, whose
minimum against any affine function is found without sampling. So column generation (the simplex method with the worst point
of the boundary as entering column) gives two bounds that close in on the value: from above by a distribution, from below by
an affine function under ``g``.

Lengths are in units of the normalising length, and so are ``a_tau`` and ``omega``; arrays are checked by the callers.
"""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import compiled

#: Pivots before the bounds are returned as they are, and a gap between them that is rounding.
MOST_PIVOTS = 100
CLOSED = 1e-13
#: Error of the least value of a convex piece at which Newton's method ends.
_DECREMENT = 1e-15
#: In the search for an edge of the region: gap between the bounds, as a share of their distance from the level.
_SEARCH = 0.01
#: Distance (normalised) at which a COR counts as on the polygon: rounding may only make the bound lower.
_ON = 1e-12


@compiled
def _edge_minimum(start, end, facet, twist, slope, level, best, at):  # type: ignore[no-untyped-def]
    """Lower ``best`` to the minimum of ``g(x) - level - slope·x`` over an edge; ``at`` (3,) receives the point and its ``g``."""
    length = math.hypot(end[0] - start[0], end[1] - start[1])
    if length == 0.0:
        return best
    tx, ty = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    omega = twist[2]
    # velocity and b at the start, across and along the edge's left normal J t = (-ty, tx)
    v0x, v0y = twist[0] - omega * start[1], twist[1] + omega * start[0]
    b0x, b0y = facet[0] - facet[2] * start[1], facet[1] + facet[2] * start[0]
    d, p0 = v0x * tx + v0y * ty, -v0x * ty + v0y * tx
    bt, bn = b0x * tx + b0y * ty, -b0x * ty + b0y * tx
    base, beta = level + slope[0] * start[0] + slope[1] * start[1], slope[0] * tx + slope[1] * ty
    # with p = p0 + omega t: g = (bt d + (bn + a_tau t) p)/r, r² = p² + d², and omega times its curvature is a quadratic over r⁵
    a_omega, b_omega = bt * d * omega, bn * omega - facet[2] * p0
    d2 = d * d
    c2, c1, c0 = 2 * a_omega - facet[2] * d2, -3 * b_omega * d2, d2 * (2 * facet[2] * d2 - a_omega)
    # pieces end where the curvature changes sign; a place that is outside of the edge makes a piece of no length
    first = second = 0.0
    if omega != 0.0:
        one = other = np.nan
        if c2 == 0.0:
            if c1 != 0.0:
                one = -c0 / c1
        else:
            inside = c1 * c1 - 4 * c2 * c0
            if inside >= 0.0:
                q = -0.5 * (c1 + math.copysign(math.sqrt(inside), c1))
                one = q / c2
                if q != 0.0:
                    other = c0 / q
        one, other = (one - p0) / omega, (other - p0) / omega
        first = one if 0.0 < one < length else 0.0
        second = other if 0.0 < other < length else 0.0
        if first > second:
            first, second = second, first
    cuts = (0.0, first, second, length)
    for i in range(4):
        t = cuts[i]
        if 0 < i < 3 and t == 0.0:
            continue
        value = _along(t, p0, d, bt, bn, omega, facet[2])
        if value - base - beta * t < best:
            best = value - base - beta * t
            at[0], at[1], at[2] = start[0] + t * tx, start[1] + t * ty, value
    for i in range(3):
        low, high = cuts[i], cuts[i + 1]
        if low == high:
            continue
        middle = 0.5 * (low + high)
        p = p0 + omega * middle
        if omega * (c2 * p * p + c1 * p + c0) <= 0.0:
            continue
        down = _slope(low, p0, d, a_omega, b_omega, omega, facet[2]) - beta
        up = _slope(high, p0, d, a_omega, b_omega, omega, facet[2]) - beta
        if down >= 0 or up <= 0:
            continue
        # a convex piece lies over its tangents: where they meet above the best, nothing is to be found
        left = _along(low, p0, d, bt, bn, omega, facet[2]) - base - beta * low
        right = _along(high, p0, d, bt, bn, omega, facet[2]) - base - beta * high
        if (up * left - down * right + up * down * (high - low)) / (up - down) >= best:
            continue
        t = middle
        for _ in range(60):
            rise = _slope(t, p0, d, a_omega, b_omega, omega, facet[2]) - beta
            if rise > 0:
                high = t
            else:
                low = t
            p = p0 + omega * t
            r2 = p * p + d2
            bend = omega * (c2 * p * p + c1 * p + c0) / (r2 * r2 * math.sqrt(r2))
            # what a step could still lower the value by, twice
            if rise * rise <= _DECREMENT * bend:
                break
            following = t - rise / bend if bend > 0 else low
            if not low < following < high:
                following = 0.5 * (low + high)
            moved = abs(following - t)
            t = following
            if moved <= 1e-15 * length:
                break
        value = _along(t, p0, d, bt, bn, omega, facet[2])
        if value - base - beta * t < best:
            best = value - base - beta * t
            at[0], at[1], at[2] = start[0] + t * tx, start[1] + t * ty, value
    return best


@compiled
def _along(t, p0, d, bt, bn, omega, turning):  # type: ignore[no-untyped-def]
    """``g`` at the place ``t`` of an edge."""
    p, b = p0 + omega * t, bn + turning * t
    r = math.hypot(p, d)
    if r <= _ON * abs(omega):
        return -math.hypot(bt, b)
    return (bt * d + b * p) / r


@compiled
def _slope(t, p0, d, a_omega, b_omega, omega, turning):  # type: ignore[no-untyped-def]
    """``dg/dt`` at the place ``t`` of an edge."""
    p = p0 + omega * t
    d2 = d * d
    r2 = p * p + d2
    if r2 == 0.0:
        return 0.0
    return (turning * p * r2 - (a_omega - turning * d2) * p + b_omega * d2) / (r2 * math.sqrt(r2))


@compiled
def _worst_point(vertices, facet, twist, slope, level, at):  # type: ignore[no-untyped-def]
    """Minimum of ``g(x) - level - slope·x`` over the polygon; ``at`` (3,) receives the point and its ``g``."""
    best = np.inf
    count = len(vertices)
    turning = twist[2] != 0.0
    inside = False
    cx = cy = 0.0
    if turning:
        cx, cy = -twist[1] / twist[2], twist[0] / twist[2]
    for i in range(count):
        start, end = vertices[i], vertices[(i + 1) % count]
        best = _edge_minimum(start, end, facet, twist, slope, level, best, at)
        if turning:
            # is the COR in the polygon? By even and odd crossings, and on an edge it is
            if (start[1] > cy) != (end[1] > cy) and cx < start[0] + (cy - start[1]) / (end[1] - start[1]) * (end[0] - start[0]):
                inside = not inside
            ex, ey = end[0] - start[0], end[1] - start[1]
            share = ((cx - start[0]) * ex + (cy - start[1]) * ey) / (ex * ex + ey * ey)
            share = min(max(share, 0.0), 1.0)
            if math.hypot(start[0] + share * ex - cx, start[1] + share * ey - cy) <= _ON:
                turning = False
                inside = True
    if inside:
        value = -math.hypot(facet[0] - facet[2] * cy, facet[1] + facet[2] * cx)
        if value - level - slope[0] * cx - slope[1] * cy < best:
            best = value - level - slope[0] * cx - slope[1] * cy
            at[0], at[1], at[2] = cx, cy, value
    return best


@compiled
def _solve(matrix, right, a, solution):  # type: ignore[no-untyped-def]
    """Solve 4 equations by elimination with row exchanges, in ``a`` (4, 4); returns False if they have no unique solution."""
    for i in range(4):
        solution[i] = right[i]
        for j in range(4):
            a[i, j] = matrix[i, j]
    for k in range(4):
        pivot = k
        for i in range(k + 1, 4):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if abs(a[pivot, k]) < 1e-14:
            return False
        if pivot != k:
            for j in range(4):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
            solution[k], solution[pivot] = solution[pivot], solution[k]
        for i in range(k + 1, 4):
            share = a[i, k] / a[k, k]
            for j in range(k, 4):
                a[i, j] -= share * a[k, j]
            solution[i] -= share * solution[k]
    for k in range(3, -1, -1):
        for j in range(k + 1, 4):
            solution[k] -= a[k, j] * solution[j]
        solution[k] /= a[k, k]
    return True


@compiled
def begin(first, coms, columns):  # type: ignore[no-untyped-def]
    """Set ``columns`` (4, 4) to pressure on ``first`` (3, 2), points of the polygon whose triangle holds ``coms[0]``."""
    for i in range(3):
        columns[i, 0], columns[i, 1], columns[i, 3] = first[i, 0], first[i, 1], 1.0
    columns[3, 0], columns[3, 1], columns[3, 3] = coms[0, 0], coms[0, 1], 0.0


@compiled
def envelope(vertices, coms, facet, twist, share, level, columns, weights):  # type: ignore[no-untyped-def]
    """Bounds (lower, upper) of ``min Σ m a·F`` over the pressures on a simple polygon (k, 2) with their mean in the hull of
    ``coms``.

    ``columns`` (4, 4) holds the points of a pressure with such a mean: those of :func:`begin`, or what the search for another
    twist has left, which is nearer. The search ends once the bounds have closed, or their gap is at most ``share`` of their
    distance from ``level``: with an infinite share once the minimum is known to be below it or not. ``columns`` and ``weights``
    (4,) receive the worst distribution: rows ``x, y, g, 1`` of pressure points, with 0 instead of 1 for places of the COM.
    """
    matrix, rows, room = np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4))
    right, duals, costs = np.array((1.0, 1.0, 0.0, 0.0)), np.empty(4), np.empty(4)
    entering, change, at = np.empty(4), np.empty(4), np.empty(3)
    for i in range(4):
        columns[i, 2] = 0.0
        if columns[i, 3] == 1.0:
            vx, vy = twist[0] - twist[2] * columns[i, 1], twist[1] + twist[2] * columns[i, 0]
            bx, by = facet[0] - facet[2] * columns[i, 1], facet[1] + facet[2] * columns[i, 0]
            speed = math.hypot(vx, vy)
            columns[i, 2] = (bx * vx + by * vy) / speed if speed > _ON * abs(twist[2]) else -math.hypot(bx, by)
    lower, upper = -np.inf, np.inf
    for _ in range(MOST_PIVOTS):
        for i in range(4):
            pressure = columns[i, 3]
            sign = 2.0 * pressure - 1.0
            matrix[0, i], matrix[1, i] = pressure, 1.0 - pressure
            matrix[2, i], matrix[3, i] = sign * columns[i, 0], sign * columns[i, 1]
            costs[i] = columns[i, 2]
            for j in range(4):
                rows[i, j] = matrix[j, i]
        if not _solve(matrix, right, room, weights) or not _solve(rows, costs, room, duals):
            break
        upper = 0.0
        for i in range(4):
            weights[i] = max(weights[i], 0.0)
            upper += weights[i] * costs[i]
        if share == np.inf and upper < level:
            break
        slope = duals[2:]
        worst = _worst_point(vertices, facet, twist, slope, duals[0], at)
        # places of the COM: reduced cost -duals[1] + slope·z
        moved = np.inf
        place = 0
        for k in range(len(coms)):
            cost = -duals[1] + slope[0] * coms[k, 0] + slope[1] * coms[k, 1]
            if cost < moved:
                moved, place = cost, k
        lower = max(lower, duals[0] + duals[1] + min(worst, 0.0) + min(moved, 0.0))
        away = max(lower - level, level - upper)
        if upper - lower <= CLOSED or (away > 0.0 and upper - lower <= share * away):
            break
        pressure = 1.0 if worst <= moved else 0.0
        x = at[0] if pressure else coms[place, 0]
        y = at[1] if pressure else coms[place, 1]
        entering[0], entering[1] = pressure, 1.0 - pressure
        entering[2], entering[3] = (2.0 * pressure - 1.0) * x, (2.0 * pressure - 1.0) * y
        if not _solve(matrix, entering, room, change):
            break
        leaving, least = -1, np.inf
        for i in range(4):
            if change[i] > 1e-11:
                ratio = weights[i] / change[i]
                # among ties the largest pivot, for the sake of accuracy
                if ratio < least - 1e-15 or (ratio <= least + 1e-15 and change[i] > change[leaving]):
                    leaving, least = i, min(ratio, least)
        if leaving < 0:
            break
        columns[leaving, 0], columns[leaving, 1] = x, y
        columns[leaving, 2] = at[2] if pressure else 0.0
        columns[leaving, 3] = pressure
    return lower, upper


@compiled
def envelopes(vertices, coms, first, facets, twists, level, lower, upper):  # type: ignore[no-untyped-def]
    """Fill bounds (n,) of the least over all facets (m, 3) for twists (n, 3): sharp enough to compare it with ``level``."""
    columns, weights = np.empty((4, 4)), np.empty(4)
    for q in range(len(twists)):
        lower[q], upper[q] = np.inf, np.inf
        for f in range(len(facets)):
            begin(first, coms, columns)
            low, high = envelope(vertices, coms, facets[f], twists[q], np.inf, level, columns, weights)
            lower[q], upper[q] = min(lower[q], low), min(upper[q], high)
            if upper[q] < level:
                break


@compiled
def edges(vertices, coms, first, facet, across, low, high, tolerance, level, angles):  # type: ignore[no-untyped-def]
    """Fill ``angles`` (n,) with the largest ``t`` at which the minimum for the twist ``cos(t) facet + sin(t) across`` keeps
    ``level``.

    ``across`` (n, 3) are unit vectors square to the unit vector ``facet``; the minimum crosses the level once between 0 and
    pi, from above. ``low, high`` (n,) are guesses on either side, which need not hold. Regula falsi (Illinois), with halvings
    where it is slow, until the two sides are ``tolerance`` (rad) apart; the inner one is returned.
    """
    columns, weights, twist = np.empty((4, 4)), np.empty(4), np.empty(3)
    begin(first, coms, columns)
    for q in range(len(across)):
        inner, outer = 0.0, math.pi
        f_inner, f_outer = 1.0, -1.0
        known = 0
        side = 0
        width = math.pi
        for step in range(200):
            if outer - inner <= tolerance:
                break
            if step == 0:
                t = low[q]
            elif step == 1 and known == 1 and high[q] > inner:
                t = high[q]
            elif known < 3 or (step % 3 == 2 and outer - inner > 0.5 * width):
                t = 0.5 * (inner + outer)
            else:
                t = (inner * f_outer - outer * f_inner) / (f_outer - f_inner)
            if step % 3 == 2:
                width = outer - inner
            t = min(max(t, inner + 0.5 * tolerance), outer - 0.5 * tolerance)
            for k in range(3):
                twist[k] = math.cos(t) * facet[k] + math.sin(t) * across[q, k]
            value, above = envelope(vertices, coms, facet, twist, _SEARCH, level, columns, weights)
            if above - value > max(CLOSED, _SEARCH * max(value - level, level - above)):
                # pivots that came to nothing: once more, from where each search can begin
                begin(first, coms, columns)
                value, _ = envelope(vertices, coms, facet, twist, _SEARCH, level, columns, weights)
            value -= level
            if value >= 0.0:
                if side == 1:
                    f_outer *= 0.5
                inner, f_inner, side = t, value, 1
                known |= 1
            else:
                if side == -1:
                    f_inner *= 0.5
                outer, f_outer, side = t, value, -1
                known |= 2
        angles[q] = inner
