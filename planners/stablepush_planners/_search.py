"""Compiled A* on a lattice of poses, with transfers of the pusher, and connections that finish it at the goal."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stablepush.core import BoolArray, FloatArray, compiled, inner
from stablepush.planning.kernels import push_is_free
from stablepush_planners._connection import Connections, connect
from stablepush_planners._goal import Goal, at_goal, guessed_time, least_time
from stablepush_planners._heap import heap_pop, heap_push
from stablepush_planners._transfer import Bodies, Transfers, body_at, route_between
from stablepush_planners.lattice import Lattice

#: What :func:`expand` returns: it found the goal, everything is expanded, its quota is used up, the tree is full.
DONE, EXHAUSTED, PAUSED, FULL = 0, 1, 2, 3
#: How a node was reached, if not along an edge: it is the start, by a transfer of the pusher, by a connection to the goal.
START, TRANSFER, CONNECTION = -1, -2, -3

#: As far from the goal as the start is, one pose in so many is connected to it.
_INTERVAL = 16

#: Bits of a key: position along either axis, heading, contact; 63 in all, as many as a number of 64 bits has beside its sign.
_POSITION, _HEADING, _CONTACT = 21, 10, 11
_HALF = 1 << (_POSITION - 1)
#: Contacts that a key has room for.
MOST_CONTACTS = 1 << _CONTACT


class Graph(NamedTuple):
    """What a search runs on."""

    lattice: Lattice
    bodies: Bodies
    goal: Goal
    connections: Connections
    transfers: Transfers


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
def place_of(lattice, i, j):  # type: ignore[no-untyped-def]
    """Place in W of a lattice pose."""
    x, y = i * lattice.cell, j * lattice.cell
    cos, sin = math.cos(lattice.origin[2]), math.sin(lattice.origin[2])
    return lattice.origin[0] + cos * x - sin * y, lattice.origin[1] + sin * x + cos * y


@inner
def _find(tree, key):  # type: ignore[no-untyped-def]
    """Where in the table a key is, or belongs."""
    size = tree.table.shape[0]
    at = ((key * 0x9E3779B97F4A7C1) >> 20) & (size - 1)
    while tree.table[at] >= 0 and tree.key[tree.table[at]] != key:
        at = (at + 1) & (size - 1)
    return at


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
def in_ticks(lattice, cost):  # type: ignore[no-untyped-def]
    """A cost (s) as a whole multiple of the tick."""
    return math.floor(cost / lattice.tick + 0.5) * lattice.tick


@inner
def _settled(tree, node, cost, weight):  # type: ignore[no-untyped-def]
    """Whether a node is not worth reaching again. Greedy searches expand no pose twice: costs that grow a little weigh less than
    a search that takes many times as long."""
    return cost >= tree.cost[node] or (weight > 1.0 and tree.closed[node])


@compiled
def reach(lattice, goal, tree, key, cost, parent, via, weight, limit):  # type: ignore[no-untyped-def]
    """Note that a lattice pose can be reached at a cost; queue it if that is cheaper than before."""
    at = _find(tree, key)
    node = tree.table[at]
    if node < 0:
        contact, heading, i, j = parts_of(key)
        x, y = place_of(lattice, i, j)
        least = least_time(goal, x, y, lattice.cos[heading], lattice.sin[heading])
        if least == math.inf or cost + least >= limit - 0.5 * lattice.tick:
            return
        node = tree.counts[0]
        tree.counts[0] += 1
        tree.table[at] = node
        tree.key[node] = key
        tree.least[node] = least
        tree.guess[node] = in_ticks(lattice, guessed_time(goal, contact, heading, i, j, least))
    elif _settled(tree, node, cost, weight) or cost + tree.least[node] >= limit - 0.5 * lattice.tick:
        return
    tree.cost[node], tree.parent[node], tree.via[node], tree.closed[node] = cost, parent, via, False
    _enqueue(tree, cost + weight * tree.guess[node], node)


@compiled
def expand(graph, world, tree, weight, limit, quota, denied):  # type: ignore[no-untyped-def]
    """Expand up to ``quota`` nodes in the order of cost plus ``weight`` times the guess; paths that cost ``limit`` are of no use.

    ``denied`` (n, 2) holds keys to which a change of contact was found impossible, and from which contact. Returns why it
    stopped.
    """
    lattice, transfers = graph.lattice, graph.transfers
    lengths, pieces = np.empty((6, 3)), np.empty((3, 4))
    spare = lattice.first.shape[0] + 64
    contacts = graph.connections.frames.shape[0]
    for _ in range(quota):
        # room for all that one expansion may add
        if tree.counts[0] + spare > tree.key.shape[0] or tree.counts[1] + spare > tree.queue.shape[0]:
            return FULL
        if 2 * (tree.counts[0] + spare) > tree.table.shape[0]:
            return FULL
        while True:
            if tree.counts[1] == 0:
                return EXHAUSTED
            value = tree.queue[0]
            node = _dequeue(tree)
            if not tree.closed[node] and value <= tree.cost[node] + weight * tree.guess[node] + 0.5 * lattice.tick:
                break
        if tree.cost[node] + tree.least[node] >= limit - 0.5 * lattice.tick:
            tree.closed[node] = True
            continue
        if tree.via[node] == CONNECTION:
            tree.counts[3] = node
            return DONE
        tree.closed[node] = True
        tree.counts[2] += 1
        contact, heading, i, j = parts_of(tree.key[node])
        x, y = place_of(lattice, i, j)
        cos, sin = lattice.cos[heading], lattice.sin[heading]
        theta = math.atan2(sin, cos)
        pushed = tree.via[node] >= 0
        if tree.via[node] == TRANSFER:
            pushed = lattice.alignments.durations[contact * lattice.headings + heading] > 0.0
        if pushed and at_goal(graph.goal, x, y, theta):
            tree.counts[3] = node
            return DONE
        body = body_at(graph.bodies, contact)
        cost = tree.cost[node]
        # near the goal every pose is joined to it, far away now and then
        interval = 1 + int(_INTERVAL * tree.least[node] / max(tree.least[0], 1e-9) + 1e-9)
        if graph.connections.radii[contact, 0] > 0.0 and (tree.counts[2] == 1 or tree.counts[2] % interval == 0):
            most = limit - cost
            goal = tree.counts[3]
            if goal >= 0:
                most = min(most, tree.cost[goal] - cost)
            time = most
            for g in graph.goal.ends:
                time = min(
                    time, connect(graph.connections, world, body, contact, x, y, theta, g[0], g[1], g[2], time, lengths, pieces)
                )
            if time < most:
                time = in_ticks(lattice, time)
                # connections are nodes of their own, one at most is of use
                if goal < 0:
                    goal = tree.counts[0]
                    tree.counts[0] += 1
                    tree.counts[3] = goal
                tree.key[goal] = tree.key[node]
                tree.cost[goal], tree.parent[goal], tree.via[goal] = cost + time, node, CONNECTION
                tree.least[goal] = tree.guess[goal] = 0.0
                tree.closed[goal] = False
                _enqueue(tree, cost + time, goal)
        for e in range(
            lattice.first[contact * lattice.headings + heading], lattice.first[contact * lattice.headings + heading + 1]
        ):
            k = (heading + lattice.steps[e, 2]) % lattice.headings
            key = key_of(contact, k, i + lattice.steps[e, 0], j + lattice.steps[e, 1])
            there = tree.table[_find(tree, key)]
            total = cost + lattice.costs[e]
            if there >= 0 and _settled(tree, there, total, weight):
                continue
            t = lattice.twists[e]
            if push_is_free(world, body, x, y, cos, sin, t[0], t[1], t[2], lattice.durations[e]):
                reach(lattice, graph.goal, tree, key, total, node, e, weight, limit)
        # a change of contact right after another one is never needed
        if tree.via[node] != TRANSFER:
            for other in range(contacts):
                if other == contact or lattice.first[other * lattice.headings] == lattice.first[(other + 1) * lattice.headings]:
                    continue
                row = other * lattice.headings + heading
                aligning = lattice.alignments.durations[row]
                if aligning == math.inf:
                    continue
                key = key_of(other, heading, i + lattice.alignments.steps[row, 0], j + lattice.alignments.steps[row, 1])
                total = cost + transfers.cost + lattice.alignments.costs[row]
                there = tree.table[_find(tree, key)]
                if there >= 0 and _settled(tree, there, total, weight):
                    continue
                if route_between(transfers, graph.bodies, world, contact, other, x, y, cos, sin) < 0:
                    continue
                impossible = False
                for n in range(denied.shape[0]):
                    impossible = impossible or (denied[n, 0] == key and denied[n, 1] == contact)
                if impossible:
                    continue
                if aligning > 0.0:
                    t = lattice.alignments.twists[row]
                    docked = body_at(graph.bodies, other)
                    if not push_is_free(world, docked, x, y, cos, sin, t[0], t[1], t[2], aligning):
                        continue
                reach(lattice, graph.goal, tree, key, total, node, TRANSFER, weight, limit)
    return PAUSED


@compiled
def refill(tree):  # type: ignore[no-untyped-def]
    """Put all nodes into an empty table."""
    for node in range(tree.counts[0]):
        # the connection to the goal is under no key of its own
        if tree.via[node] != CONNECTION:
            tree.table[_find(tree, tree.key[node])] = node
