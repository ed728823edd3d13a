"""Compiled search: A* on the lattice, joints to the goal, distance fields."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush._arrays import BoolArray, FloatArray
from stablepush._compiled import compiled, inner
from stablepush._sweep import Body, edges_near, line_is_free, pose_is_free, push_is_free, room_at
from stablepush_planners.dubins import CURVATURES, dubins_lengths

#: What :func:`expand` returns: it found the goal, everything is expanded, its quota is used up, the tree is full.
DONE, EXHAUSTED, PAUSED, FULL = 0, 1, 2, 3
#: How a node was reached, if not along an edge: it is the start, by a change of contact, by a joint to the goal.
START, TRANSFER, JOINT = -1, -2, -3

#: How a change of contact is tested: the pusher takes no room; it goes one of the ways known; as if it could go any way.
NO_PUSHER, KNOWN_WAYS, ANY_WAY = 0, 1, 2

#: As far from the goal as the start is, one pose in so many is joined to it.
_JOINTS = 16

#: Bits of a key: position along either axis, heading, contact.
_POSITION, _HEADING, _CONTACT = 21, 10, 8
_HALF = 1 << (_POSITION - 1)


class Cells(NamedTuple):
    """The lattice: pose of its origin in W, width of a cell (m), number of headings, cosines and sines (headings,) of body
    angles; edges: where those of a contact and heading begin, steps (n, 3), body twists (n, 3), durations and costs (n,)."""

    origin: FloatArray
    cell: float
    headings: int
    cos: FloatArray
    sin: FloatArray
    first: np.ndarray
    steps: np.ndarray
    twists: FloatArray
    durations: FloatArray
    costs: FloatArray


class Bodies(NamedTuple):
    """Slider and docked pusher, by contact: where edges and corners of each begin, and radii (m)."""

    edge_first: np.ndarray
    edges: FloatArray
    corner_first: np.ndarray
    corners: FloatArray
    radii: FloatArray


class Goal(NamedTuple):
    """Goal pose, tolerance (m, rad), outline (k, 2) of the slider, speed limit (m/s); least times (s) by place, and the place's
    grid (:class:`DistanceField`); times without obstacles by contact, heading and cells from the goal's cell ``at``."""

    pose: FloatArray
    tolerance: FloatArray
    outline: FloatArray
    speed: float
    field: FloatArray
    low: FloatArray
    cell: float
    table: FloatArray
    at: np.ndarray


class Joints(NamedTuple):
    """Dubins paths by contact: frame of the reference point in B (3,), radii (m, zero for none), times and costs (s/m) of left,
    straight and right."""

    frames: FloatArray
    radii: FloatArray
    paces: FloatArray
    prices: FloatArray


class Changes(NamedTuple):
    """Changes of contact: time (s), how they are tested (:data:`NO_PUSHER` and so on), the pusher in its frame, its docked poses
    (contacts, 3) in B, how far it backs off (m), and two ways round the slider in B for every pair of contacts."""

    cost: float
    kind: int
    edges: FloatArray
    corners: FloatArray
    radius: float
    docks: FloatArray
    retreats: FloatArray
    first: np.ndarray
    routes: FloatArray


class Graph(NamedTuple):
    """What a search runs on."""

    cells: Cells
    bodies: Bodies
    goal: Goal
    joints: Joints
    changes: Changes


class Tree(NamedTuple):
    """Nodes of a search, a table that finds them by key, and the queue. ``counts``: nodes, queue, expanded, goal's node."""

    key: np.ndarray
    cost: FloatArray
    least: FloatArray
    guess: FloatArray
    parent: np.ndarray
    via: np.ndarray
    closed: BoolArray
    table: np.ndarray
    queue: FloatArray
    queued: np.ndarray
    counts: np.ndarray


@compiled
def key_of(contact, heading, i, j):  # type: ignore[no-untyped-def]
    """One number for a lattice pose at a contact."""
    return (((contact << _HEADING) | heading) << (2 * _POSITION)) | ((i + _HALF) << _POSITION) | (j + _HALF)


@compiled
def parts_of(key):  # type: ignore[no-untyped-def]
    """Contact, heading and cells of a key."""
    mask = (1 << _POSITION) - 1
    rest = key >> (2 * _POSITION)
    return rest >> _HEADING, rest & ((1 << _HEADING) - 1), ((key >> _POSITION) & mask) - _HALF, (key & mask) - _HALF


@inner
def body_at(bodies, contact):  # type: ignore[no-untyped-def]
    """Slider and pusher docked at a contact."""
    a, b = bodies.edge_first[contact], bodies.edge_first[contact + 1]
    c, d = bodies.corner_first[contact], bodies.corner_first[contact + 1]
    return Body(bodies.edges[a:b], bodies.corners[c:d], bodies.radii[contact])


@inner
def place_of(cells, i, j):  # type: ignore[no-untyped-def]
    """Place in W of a lattice pose."""
    x, y = i * cells.cell, j * cells.cell
    cos, sin = math.cos(cells.origin[2]), math.sin(cells.origin[2])
    return cells.origin[0] + cos * x - sin * y, cells.origin[1] + sin * x + cos * y


@compiled
def least_time(goal, x, y, cos, sin):  # type: ignore[no-untyped-def]
    """Time (s) that every way to the goal takes: no point of the outline is faster than the limit, nor goes through walls."""
    gc, gs = math.cos(goal.pose[2]), math.sin(goal.pose[2])
    most = 0.0
    for v in range(goal.outline.shape[0]):
        px, py = goal.outline[v, 0], goal.outline[v, 1]
        dx = x + cos * px - sin * py - goal.pose[0] - gc * px + gs * py
        dy = y + sin * px + cos * py - goal.pose[1] - gs * px - gc * py
        slack = goal.tolerance[0] + goal.tolerance[1] * math.sqrt(px * px + py * py)
        most = max(most, math.sqrt(dx * dx + dy * dy) - slack)
    i, j = (
        math.floor((x - goal.low[0]) / goal.cell),
        math.floor((y - goal.low[1]) / goal.cell),
    )
    if 0 <= i < goal.field.shape[0] and 0 <= j < goal.field.shape[1]:
        return max(most / goal.speed, goal.field[i, j])
    return most / goal.speed


@inner
def guessed_time(goal, contact, heading, i, j, least):  # type: ignore[no-untyped-def]
    """Time (s) to the goal that the edges take without obstacles, near the goal, and at least ``least``."""
    di, dj = i - goal.at[0], j - goal.at[1]
    reach = (goal.table.shape[2] - 1) // 2
    if -reach <= di <= reach and -reach <= dj <= reach:
        known = goal.table[contact, heading, di + reach, dj + reach]
        if known < math.inf:
            return max(least, known)
    return least


@compiled
def at_goal(goal, x, y, theta):  # type: ignore[no-untyped-def]
    """Whether a pose is within the tolerance."""
    dx, dy = x - goal.pose[0], y - goal.pose[1]
    turn = (theta - goal.pose[2] + math.pi) % (2 * math.pi) - math.pi
    slack = 1e-7
    return math.sqrt(dx * dx + dy * dy) <= goal.tolerance[0] - slack and abs(turn) <= goal.tolerance[1] - slack


@inner
def turn_twist(frame, curvature):  # type: ignore[no-untyped-def]
    """Body twist of unit speed of the reference point, turning with a curvature (1/m)."""
    return math.cos(frame[2]) + curvature * frame[1], math.sin(frame[2]) - curvature * frame[0], curvature


@compiled
def join(joints, world, body, contact, x, y, theta, gx, gy, gt, most, lengths, pieces):  # type: ignore[no-untyped-def]
    """Cheapest free Dubins word of the reference point between two poses that costs less than ``most``; its cost (s).

    ``pieces`` (3, 4) receives body twists and durations; ``lengths`` (6, 3) is room to work in.
    """
    frame = joints.frames[contact]
    c0, s0, c1, s1 = math.cos(theta), math.sin(theta), math.cos(gt), math.sin(gt)
    x0, y0 = x + c0 * frame[0] - s0 * frame[1], y + s0 * frame[0] + c0 * frame[1]
    x1, y1 = gx + c1 * frame[0] - s1 * frame[1], gy + s1 * frame[0] + c1 * frame[1]
    best = math.inf
    tried = 1e-9
    # words in the order of their cost; each is looked at once
    for _ in range(4):
        found, word, which = math.inf, -1, -1
        for r in range(joints.radii.shape[1]):
            radius = joints.radii[contact, r]
            if radius <= 0.0:
                continue
            dubins_lengths(x0, y0, theta + frame[2], x1, y1, gt + frame[2], radius, lengths)
            for w in range(6):
                cost = 0.0
                for p in range(3):
                    cost += lengths[w, p] * radius * joints.prices[contact, r, int(1 - CURVATURES[w, p])]
                if tried < cost < min(found, most):
                    found, word, which = cost, w, r
        if word < 0:
            break
        tried = found
        radius = joints.radii[contact, which]
        dubins_lengths(x0, y0, theta + frame[2], x1, y1, gt + frame[2], radius, lengths)
        px, py, pt = x, y, theta
        good = True
        for p in range(3):
            curvature = CURVATURES[word, p] / radius
            pace = joints.paces[contact, which, int(1 - CURVATURES[word, p])]
            vx, vy, omega = turn_twist(frame, curvature)
            duration = lengths[word, p] * radius * pace
            pieces[p, 0], pieces[p, 1], pieces[p, 2], pieces[p, 3] = vx / pace, vy / pace, omega / pace, duration
            if duration > 0.0:
                c, s = math.cos(pt), math.sin(pt)
                if not push_is_free(world, body, px, py, c, s, vx / pace, vy / pace, omega / pace, duration):
                    good = False
                    break
                px, py, pt = moved(px, py, pt, vx / pace, vy / pace, omega / pace, duration)
        if good:
            best = found
            break
    return best


@compiled
def moved(x, y, theta, vx, vy, omega, duration):  # type: ignore[no-untyped-def]
    """Pose after a body twist is followed for a time."""
    angle = omega * duration
    half = angle / 2
    # sin(angle)/angle and (1 - cos(angle))/angle without cancellation
    shrink = math.sin(half) / half if abs(half) > 1e-12 else 1.0
    a, b = shrink * math.cos(half), shrink * math.sin(half)
    dx, dy = duration * (a * vx - b * vy), duration * (b * vx + a * vy)
    c, s = math.cos(theta), math.sin(theta)
    return x + c * dx - s * dy, y + s * dx + c * dy, theta + angle


@inner
def disc_is_free(world, x0, y0, x1, y1, radius):  # type: ignore[no-untyped-def]
    """Whether a disc that moves straight stays clear of obstacles and within the bounds."""
    low_x, low_y, high_x, high_y = min(x0, x1) - radius, min(y0, y1) - radius, max(x0, x1) + radius, max(y0, y1) + radius
    b = world.bounds
    if low_x < b[0] or low_y < b[1] or high_x > b[2] or high_y > b[3]:
        return False
    dx, dy = x1 - x0, y1 - y0
    way = dx * dx + dy * dy
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
        if way > 0.0:
            t = min(1.0, max(0.0, ((ax - x0) * dx + (ay - y0) * dy) / way))
            if (ax - x0 - t * dx) ** 2 + (ay - y0 - t * dy) ** 2 < radius * radius:
                return False
    return True


@inner
def route_is_free(changes, world, route, x, y, cos, sin):  # type: ignore[no-untyped-def]
    """Whether the pusher, as a disc, can take a way round the slider."""
    a, b = changes.first[route], changes.first[route + 1]
    if b == a:
        return False
    for k in range(a, b - 1):
        px, py = changes.routes[k, 0], changes.routes[k, 1]
        qx, qy = changes.routes[k + 1, 0], changes.routes[k + 1, 1]
        if not disc_is_free(
            world,
            x + cos * px - sin * py,
            y + sin * px + cos * py,
            x + cos * qx - sin * qy,
            y + sin * qx + cos * qy,
            changes.radius,
        ):
            return False
    return True


@inner
def can_back_off(changes, world, contact, x, y, cos, sin):  # type: ignore[no-untyped-def]
    """Whether the docked pusher can back off straight, as far as obstacles and bounds go."""
    pusher = Body(changes.edges, changes.corners, changes.radius)
    dock = changes.docks[contact]
    c, s = math.cos(dock[2]), math.sin(dock[2])
    c, s = cos * c - sin * s, sin * c + cos * s
    px, py = x + cos * dock[0] - sin * dock[1], y + sin * dock[0] + cos * dock[1]
    way = changes.retreats[contact]
    return line_is_free(world, pusher, px, py, c, s, -way * c, -way * s)


@compiled
def route_between(changes, bodies, world, source, target, x, y, cos, sin):  # type: ignore[no-untyped-def]
    """A free way round the slider from one contact to another: its number, or -1."""
    contacts = changes.docks.shape[0]
    if changes.retreats[source] < 0.0 or changes.retreats[target] < 0.0:
        return -1
    if room_at(world, x, y) <= bodies.radii[target] and not pose_is_free(world, body_at(bodies, target), x, y, cos, sin):
        return -1
    if not can_back_off(changes, world, source, x, y, cos, sin) or not can_back_off(changes, world, target, x, y, cos, sin):
        return -1
    if changes.kind == ANY_WAY:
        return 0
    for side in range(2):
        route = 2 * (source * contacts + target) + side
        if route_is_free(changes, world, route, x, y, cos, sin):
            return route
    return -1


@inner
def _find(tree, key):  # type: ignore[no-untyped-def]
    """Where in the table a key is, or belongs."""
    size = tree.table.shape[0]
    at = ((key * 0x9E3779B97F4A7C1) >> 20) & (size - 1)
    while tree.table[at] >= 0 and tree.key[tree.table[at]] != key:
        at = (at + 1) & (size - 1)
    return at


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


@inner
def _enqueue(tree, value, node):  # type: ignore[no-untyped-def]
    heap_push(tree.queue, tree.queued, tree.counts[1], value, node)
    tree.counts[1] += 1


@inner
def _dequeue(tree):  # type: ignore[no-untyped-def]
    node = heap_pop(tree.queue, tree.queued, tree.counts[1])
    tree.counts[1] -= 1
    return node


@inner
def _settled(tree, node, cost, weight):  # type: ignore[no-untyped-def]
    """Whether a node is not worth reaching again. Greedy searches expand no pose twice: costs that grow a little weigh less than
    a search that takes many times as long."""
    return cost >= tree.cost[node] - 1e-12 or (weight > 1.0 and tree.closed[node])


@compiled
def reach(cells, goal, tree, key, cost, parent, via, weight, limit):  # type: ignore[no-untyped-def]
    """Note that a lattice pose can be reached at a cost; queue it if that is cheaper than before."""
    at = _find(tree, key)
    node = tree.table[at]
    if node < 0:
        contact, heading, i, j = parts_of(key)
        x, y = place_of(cells, i, j)
        least = least_time(goal, x, y, cells.cos[heading], cells.sin[heading])
        if least == math.inf or cost + least >= limit:
            return
        node = tree.counts[0]
        tree.counts[0] += 1
        tree.table[at] = node
        tree.key[node] = key
        tree.least[node] = least
        tree.guess[node] = guessed_time(goal, contact, heading, i, j, least)
    elif _settled(tree, node, cost, weight) or cost + tree.least[node] >= limit:
        return
    tree.cost[node], tree.parent[node], tree.via[node], tree.closed[node] = cost, parent, via, False
    _enqueue(tree, cost + weight * tree.guess[node], node)


@compiled
def least_open(tree):  # type: ignore[no-untyped-def]
    """Least cost and admissible estimate of what is queued: no path of the lattice that is not found yet costs less."""
    found = math.inf
    for n in range(tree.counts[1]):
        node = tree.queued[n]
        if not tree.closed[node]:
            found = min(found, tree.cost[node] + tree.least[node])
    return found


@compiled
def expand(graph, world, tree, weight, limit, quota, denied):  # type: ignore[no-untyped-def]
    """Expand up to ``quota`` nodes in the order of cost plus ``weight`` times the guess; paths that cost ``limit`` are of no use.

    ``denied`` (n, 2) holds keys to which a change of contact was found impossible, and from which contact. Returns why it
    stopped.
    """
    cells, changes = graph.cells, graph.changes
    lengths, pieces = np.empty((6, 3)), np.empty((3, 4))
    room = cells.first.shape[0] + 64
    contacts = graph.joints.frames.shape[0]
    for _ in range(quota):
        # room for all that one expansion may add
        if tree.counts[0] + room > tree.key.shape[0] or tree.counts[1] + room > tree.queue.shape[0]:
            return FULL
        if 2 * (tree.counts[0] + room) > tree.table.shape[0]:
            return FULL
        while True:
            if tree.counts[1] == 0:
                return EXHAUSTED
            value = tree.queue[0]
            node = _dequeue(tree)
            if not tree.closed[node] and value <= tree.cost[node] + weight * tree.guess[node] + 1e-12:
                break
        if tree.cost[node] + tree.least[node] >= limit:
            tree.closed[node] = True
            continue
        if tree.via[node] == JOINT:
            tree.counts[3] = node
            return DONE
        tree.closed[node] = True
        tree.counts[2] += 1
        contact, heading, i, j = parts_of(tree.key[node])
        x, y = place_of(cells, i, j)
        cos, sin = cells.cos[heading], cells.sin[heading]
        theta = math.atan2(sin, cos)
        if tree.via[node] >= 0 and at_goal(graph.goal, x, y, theta):
            tree.counts[3] = node
            return DONE
        body = body_at(graph.bodies, contact)
        cost = tree.cost[node]
        # near the goal every pose is joined to it, far away now and then
        interval = 1 + int(_JOINTS * tree.least[node] / max(tree.least[0], 1e-9))
        if graph.joints.radii[contact, 0] > 0.0 and (tree.counts[2] == 1 or tree.counts[2] % interval == 0):
            most = limit - cost
            goal = tree.counts[3]
            if goal >= 0:
                most = min(most, tree.cost[goal] - cost)
            g = graph.goal.pose
            time = join(graph.joints, world, body, contact, x, y, theta, g[0], g[1], g[2], most, lengths, pieces)
            if time < most:
                # joints are nodes of their own, one at most is of use
                if goal < 0:
                    goal = tree.counts[0]
                    tree.counts[0] += 1
                    tree.counts[3] = goal
                tree.key[goal] = tree.key[node]
                tree.cost[goal], tree.parent[goal], tree.via[goal] = cost + time, node, JOINT
                tree.least[goal] = tree.guess[goal] = 0.0
                tree.closed[goal] = False
                _enqueue(tree, cost + time, goal)
        for e in range(cells.first[contact * cells.headings + heading], cells.first[contact * cells.headings + heading + 1]):
            k = (heading + cells.steps[e, 2]) % cells.headings
            key = key_of(contact, k, i + cells.steps[e, 0], j + cells.steps[e, 1])
            there = tree.table[_find(tree, key)]
            total = cost + cells.costs[e]
            if there >= 0 and _settled(tree, there, total, weight):
                continue
            t = cells.twists[e]
            if push_is_free(world, body, x, y, cos, sin, t[0], t[1], t[2], cells.durations[e]):
                reach(cells, graph.goal, tree, key, total, node, e, weight, limit)
        # a change of contact right after another one is never needed
        if tree.via[node] != TRANSFER:
            for other in range(contacts):
                if other == contact or cells.first[other * cells.headings] == cells.first[(other + 1) * cells.headings]:
                    continue
                key = key_of(other, heading, i, j)
                total = cost + changes.cost
                there = tree.table[_find(tree, key)]
                if there >= 0 and _settled(tree, there, total, weight):
                    continue
                if changes.kind != NO_PUSHER and route_between(changes, graph.bodies, world, contact, other, x, y, cos, sin) < 0:
                    continue
                impossible = False
                for n in range(denied.shape[0]):
                    impossible = impossible or (denied[n, 0] == key and denied[n, 1] == contact)
                if impossible:
                    continue
                reach(cells, graph.goal, tree, key, total, node, TRANSFER, weight, limit)
    return PAUSED


@compiled
def unobstructed(edge_first, steps, durations, headings, contacts, switch_cost, goal_heading, size, table):  # type: ignore[no-untyped-def]
    """Fill ``table`` (contacts, headings, size, size) with least times (s) to its middle without obstacles.

    Dijkstra from the goal along edges turned round.
    """
    table[:] = math.inf
    middle = (size - 1) // 2
    # edges by contact and the heading in which they end
    count = np.zeros(contacts * headings + 1, dtype=np.int64)
    for a in range(contacts):
        for k in range(headings):
            for e in range(edge_first[a * headings + k], edge_first[a * headings + k + 1]):
                count[a * headings + (k + steps[e, 2]) % headings + 1] += 1
    first = np.cumsum(count)
    listed, origin = np.empty(len(durations), dtype=np.int64), np.empty(len(durations), dtype=np.int64)
    fill = first.copy()
    for a in range(contacts):
        for k in range(headings):
            for e in range(edge_first[a * headings + k], edge_first[a * headings + k + 1]):
                to = a * headings + (k + steps[e, 2]) % headings
                listed[fill[to]], origin[fill[to]] = e, k
                fill[to] += 1
    capacity = 4 * contacts * headings * size * size + 64
    value, code = np.empty(capacity), np.empty(capacity, dtype=np.int64)
    n = 0
    for a in range(contacts):
        table[a, goal_heading, middle, middle] = 0.0
        value[n], code[n] = 0.0, ((a * headings + goal_heading) * size + middle) * size + middle
        n += 1
    while n > 0:
        cost, at = value[0], heap_pop(value, code, n)
        n -= 1
        j, i = at % size, (at // size) % size
        k, a = (at // (size * size)) % headings, at // (size * size * headings)
        if cost > table[a, k, i, j]:
            continue
        number = first[a * headings + k + 1] - first[a * headings + k]
        for q in range(number + contacts):
            if q < number:
                e = listed[first[a * headings + k] + q]
                b, h, u, v = a, origin[first[a * headings + k] + q], i - steps[e, 0], j - steps[e, 1]
                total = cost + durations[e]
            else:
                b, h, u, v = q - number, k, i, j
                total = cost + switch_cost
            if 0 <= u < size and 0 <= v < size and total < table[b, h, u, v] - 1e-12 and n < capacity:
                table[b, h, u, v] = total
                heap_push(value, code, n, total, ((b * headings + h) * size + u) * size + v)
                n += 1


@compiled
def flood(blocked, distance):  # type: ignore[no-untyped-def]
    """Spread octile distances (cells) over the free cells, from those that are zero in ``distance`` (Dijkstra)."""
    nx, ny = distance.shape
    capacity = 8 * nx * ny + 16
    value, code = np.empty(capacity), np.empty(capacity, dtype=np.int64)
    n = 0
    for i in range(nx):
        for j in range(ny):
            if distance[i, j] == 0.0:
                value[n], code[n] = 0.0, i * ny + j
                n += 1
    while n > 0:
        cost, at = value[0], heap_pop(value, code, n)
        n -= 1
        i, j = at // ny, at % ny
        if cost > distance[i, j]:
            continue
        for di in range(-1, 2):
            for dj in range(-1, 2):
                u, v = i + di, j + dj
                if (di == 0 and dj == 0) or not (0 <= u < nx and 0 <= v < ny) or blocked[u, v]:
                    continue
                total = cost + (1.0 if di == 0 or dj == 0 else math.sqrt(2.0))
                if total < distance[u, v]:
                    distance[u, v] = total
                    heap_push(value, code, n, total, u * ny + v)
                    n += 1


@compiled
def refill(tree):  # type: ignore[no-untyped-def]
    """Put all nodes into an empty table."""
    for node in range(tree.counts[0]):
        # the joint to the goal is under no key of its own
        if tree.via[node] != JOINT:
            tree.table[_find(tree, tree.key[node])] = node
