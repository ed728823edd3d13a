"""How the pusher goes from one contact to another: it backs off, goes round the slider, and docks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from stablepush.core import Deadline, FloatArray, first_least, order_with_ties
from stablepush.geometry import compose, transform_points, wrap_angle
from stablepush.objects import PushContact
from stablepush.planning import PlanningProblem, body_of, disc_outlines, world_of
from stablepush.planning.kernels import line_is_free

if TYPE_CHECKING:
    import networkx as nx

#: Radius of fingers that are points, where they go round the slider, in radii of the slider.
_POINT = 0.02
#: The pusher keeps this far (m) from what it goes round.
CLEARANCE = 2e-6
#: Paths whose lengths (m) differ by no more are as long as each other.
_ALIKE = 1e-9
#: Sides of a quarter circle when outlines are widened.
_QUARTER = 4
#: The pusher backs off in steps of this share of its radius, at most so many.
_STEP, _MOST_STEPS = 0.05, 400
#: How far from the slider the pusher looks for a path, in radii of the slider and diameters of the pusher, and among how many
#: corners.
_NEARBY, _MOST_CORNERS = 2.0, 300


@dataclass(frozen=True, slots=True, eq=False)
class Routes:
    """Paths round the slider, for the centre of a disc that holds the pusher, in B.

    Attributes
    ----------
    radius : float
        Of the disc about the origin of the pusher's frame, in m.
    docks : array, shape (contacts, 3)
        Docked poses of the pusher's frame in B.
    retreats : array, shape (contacts,)
        How far (m) the pusher backs off against its x axis before it may turn; -1 where it cannot.
    first : array, shape (2 * contacts**2 + 1,)
        Where the paths from contact i to j begin in ``points``: rows ``2 (i contacts + j)`` and the next, the shorter one first.
    points : array, shape (n, 2)
    """

    radius: float
    docks: FloatArray
    retreats: FloatArray
    first: np.ndarray
    points: FloatArray


def routes_of(problem: PlanningProblem, deadline: Deadline | None = None) -> Routes:
    """Return the paths round the slider between all contacts of a problem; raises :class:`OutOfTimeError` at the deadline."""
    docks = np.array([contact.frame for contact in problem.contacts])
    outlines = [pusher_shapes(problem, contact) for contact in problem.contacts]
    radius = max(float(np.linalg.norm(np.concatenate(shape), axis=1).max()) for shape in outlines)
    around = _widened(problem.slider.polygon, radius).convex_hull
    alone = PlanningProblem(
        problem.slider, problem.surface, problem.contacts, problem.start, problem.goal, obstacles=[problem.slider.vertices]
    )
    world, pushers = world_of(alone), [body_of(shape) for shape in outlines]
    retreats = np.full(len(docks), -1.0)
    for i, dock in enumerate(docks):
        ahead = np.array((math.cos(dock[2]), math.sin(dock[2])))
        sides = _STEP * radius * np.arange(1, _MOST_STEPS)
        clear = ~shapely.contains_xy(around, *(dock[:2] - sides[:, None] * ahead).T)
        if clear.any():
            route = float(sides[np.argmax(clear)])
            if line_is_free(world, pushers[i], dock[0], dock[1], ahead[0], ahead[1], -route * ahead[0], -route * ahead[1]):
                retreats[i] = route
    first, points = [0], [np.zeros((0, 2))]
    for i in range(len(docks)):
        if deadline is not None:
            deadline.check()
        for j in range(len(docks)):
            found = (np.zeros((0, 2)),) * 2
            if i != j and min(retreats[i], retreats[j]) >= 0:
                found = _both_paths(around, backed_off(docks[i], retreats[i])[:2], backed_off(docks[j], retreats[j])[:2])
            # the shorter one first, of two alike the counter-clockwise one; one that is not there has no points
            for k in order_with_ties([_length(line) for line in found], _ALIKE):
                points.append(found[k])
                first.append(first[-1] + len(found[k]))
    return Routes(radius, docks, retreats, np.array(first), np.ascontiguousarray(np.concatenate(points)))


def pusher_shapes(problem: PlanningProblem, contact: PushContact) -> list[FloatArray]:
    """Return what the pusher fills in its frame (m) at a contact; points go round the slider as small fingers would."""
    return problem.pusher_outlines(contact) or disc_outlines(contact, _POINT * problem.slider.radius)


def contact_graph(problem: PlanningProblem) -> nx.DiGraph:
    """Return the contacts of a problem and the changes between them, without obstacles, as a graph.

    Nodes are numbers of contacts, with ``frame`` (3,), the docked pose of the pusher in B. An edge has the ``length`` (m) of the
    shorter path round the slider and ``path`` (n, 3), the poses of the pusher's frame in B. Contacts that the pusher
    cannot leave straight backwards have no edges.
    """
    # not needed by plans, and slow to import
    import networkx as nx

    graph = nx.DiGraph()
    contacts = range(len(problem.contacts))
    graph.add_nodes_from((i, {"frame": problem.contacts[i].frame}) for i in contacts)
    routes = routes_of(problem)
    for i in contacts:
        for j in contacts:
            if i != j:
                first = routes.first[2 * (i * len(contacts) + j) :]
                sides = [routes.points[first[side] : first[side + 1]] for side in (0, 1)]
                paths = [docking_path((routes.docks[i], routes.docks[j]), route) for route in sides if len(route)]
                lengths = [float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum()) for path in paths]
                if paths:
                    k = first_least(lengths, _ALIKE)
                    graph.add_edge(i, j, length=lengths[k], path=paths[k])
    return graph


def backed_off(dock: FloatArray, route: float) -> FloatArray:
    """Return a pose of the pusher's frame, moved back along its x axis."""
    return np.array((dock[0] - route * math.cos(dock[2]), dock[1] - route * math.sin(dock[2]), dock[2]))


def docking_path(docks: tuple[FloatArray, FloatArray], route: FloatArray) -> FloatArray:
    """Return poses (n, 3) of the pusher's frame: back off to the start of ``route`` (k, 2), along it turning evenly, and dock."""
    start, end = docks
    turn = float(wrap_angle(end[2] - start[2]))
    steps = np.linalg.norm(np.diff(route, axis=0), axis=1)
    share = np.concatenate(((0.0,), np.cumsum(steps))) / max(float(steps.sum()), 1e-12)
    # a path that ends by rounding before its end would still turn while it docks
    share[-1] = 1.0
    along = np.column_stack((route, start[2] + share * turn))
    return np.concatenate((start[None], along, (end[0], end[1], start[2] + turn) * np.ones((1, 3))))


def path_among_obstacles(
    problem: PlanningProblem, pose: FloatArray, start: FloatArray, end: FloatArray, radius: float
) -> FloatArray | None:
    """Return the shortest path (n, 2) in W of a disc between two places near the slider, round it and the obstacles, or None.

    Shortest paths on the visibility graph of the outlines, widened by the disc, within :data:`_NEARBY` of the slider's radius and
    the disc's diameter; among too many corners there is said to be none.
    """
    # not needed by most plans, and slow to import
    import networkx as nx

    reach = _NEARBY * (problem.slider.radius + 2 * radius)
    low, high = pose[:2] - reach, pose[:2] + reach
    if problem.bounds is not None:
        low, high = np.maximum(low, problem.bounds[:2] + radius), np.minimum(high, problem.bounds[2:] - radius)
    if not all((p >= low).all() and (p <= high).all() for p in (start, end)):
        return None
    near = [
        o for o in problem.obstacles if (o.max(axis=0) > low - 2 * radius).all() and (o.min(axis=0) < high + 2 * radius).all()
    ]
    slider = shapely.Polygon(transform_points(pose, problem.slider.vertices))
    blocked = _widened(shapely.union_all([slider, *(shapely.Polygon(o) for o in near)]), radius)
    inner = shapely.buffer(blocked, -CLEARANCE / 4)
    corners = np.unique(shapely.get_coordinates(blocked), axis=0)
    corners = corners[((corners >= low) & (corners <= high)).all(axis=1)]
    if len(corners) > _MOST_CORNERS:
        return None
    places = np.concatenate((start[None], end[None], corners))
    i, j = np.triu_indices(len(places), 1)
    lines = shapely.linestrings(np.stack((places[i], places[j]), axis=1))
    shapely.prepare(inner)
    seen = ~shapely.intersects(inner, lines)
    graph = nx.Graph()
    graph.add_nodes_from(range(len(places)))
    lengths = np.round(np.linalg.norm(places[i] - places[j], axis=1) / _ALIKE) * _ALIKE
    graph.add_weighted_edges_from(zip(i[seen].tolist(), j[seen].tolist(), lengths[seen].tolist(), strict=True))
    try:
        return places[nx.shortest_path(graph, 0, 1, weight="weight")]
    except nx.NetworkXNoPath:
        return None


def route_path(routes: Routes, route: int, pose: FloatArray) -> FloatArray:
    """Return the pusher's poses (n, 3) in W along one of the known paths, for a slider at ``pose``."""
    contacts = len(routes.docks)
    i, j = divmod(route // 2, contacts)
    points = routes.points[routes.first[route] : routes.first[route + 1]]
    return compose(pose, docking_path((routes.docks[i], routes.docks[j]), points))


def _widened(shape: shapely.Geometry, radius: float) -> shapely.Geometry:
    """All places nearer than ``radius`` and a little: arcs are replaced by lines, none of which comes nearer."""
    wanted = radius + CLEARANCE
    reach = wanted / math.cos(math.pi / (4 * _QUARTER))
    while True:
        wide = shapely.buffer(shape, reach, quad_segs=_QUARTER)
        # how many lines stand for an arc is the library's choice: what counts is how near they come
        missing = wanted - float(shapely.distance(shapely.boundary(wide), shape))
        if missing <= CLEARANCE / 2:
            return wide
        reach += missing


def _length(route: FloatArray) -> float:
    return float(np.hypot(*np.diff(route, axis=0).T).sum()) if len(route) else math.inf


def _both_paths(around: shapely.Polygon, start: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return both paths (n, 2) between two places round a convex outline, counter-clockwise first; empty where one crosses it."""
    string = shapely.union_all([around, shapely.Point(start), shapely.Point(end)]).convex_hull
    ring = shapely.get_coordinates(shapely.normalize(string).exterior)[:-1]
    if shapely.LinearRing(ring).is_ccw:
        ring = ring[::-1]
    a, b = (int(np.argmin(np.linalg.norm(ring - p, axis=1))) for p in (start, end))
    clockwise = np.roll(ring, -a, axis=0)
    cut = (b - a) % len(ring)
    other = np.roll(ring[::-1], a + 1, axis=0)
    sides = (
        np.concatenate((start[None], other[1 : len(ring) - cut], end[None])),
        np.concatenate((start[None], clockwise[1:cut], end[None])),
    )
    core = shapely.buffer(around, -CLEARANCE / 4)
    return tuple(route if not shapely.intersects(core, shapely.LineString(route)) else route[:0] for route in sides)  # type: ignore[return-value]
