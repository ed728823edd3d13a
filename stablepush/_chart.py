"""An equal-area chart of one half of the sphere of unit twists, in which stable regions are planar polygons.

Unit twists ``(vx, vy, rho*omega)`` that turn one way form a hemisphere; its rim are the translations. Lambert's azimuthal map
takes it to a disc of radius ``sqrt(2)``: the pole, rotation about the origin of B, to the centre, a COR to a point in the
direction in which it lies, translations to the rim. Areas are solid angles, and nothing is at infinity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely

from stablepush._arrays import FloatArray
from stablepush.planar import unit

#: Largest gap (rad) between neighbours on a boundary, a whole part of the rim: great circles are that near to straight, to 1e-5.
_GAP = 2 * np.pi / 800
RIM = float(np.sqrt(2.0))


def disc_from_twists(twists: FloatArray, sense: int) -> FloatArray:
    """Return the places (n, 2) in the chart of unit normalised twists (n, 3) with ``sense * omega >= 0``."""
    v = sense * np.asarray(twists)
    stretch = np.sqrt(2.0 / (1.0 + np.clip(v[..., 2:], 0.0, 1.0)))
    return np.asarray(stretch * np.stack((-v[..., 1], v[..., 0]), axis=-1))


def twists_from_disc(places: FloatArray, sense: int) -> FloatArray:
    """Return the unit normalised twists (n, 3) at places (n, 2) in the chart."""
    q = np.asarray(places)
    square = np.minimum((q * q).sum(axis=-1, keepdims=True), 2.0)
    side = np.sqrt(1.0 - square / 4)
    return np.asarray(sense * np.concatenate((side * q[..., 1:], -side * q[..., :1], 1.0 - square / 2), axis=-1))


def clip_loop(points: FloatArray, half_space: FloatArray) -> FloatArray:
    """Clip a closed loop (n, 3) by ``half_space · p >= 0`` (Sutherland and Hodgman 1974, in homogeneous coordinates)."""
    if not len(points):
        return points
    height = points @ half_space
    following, following_height = np.roll(points, -1, axis=0), np.roll(height, -1)
    inside = height >= 0
    crosses = inside != (following_height >= 0)
    share = np.divide(height, height - following_height, out=np.zeros_like(height), where=crosses)
    cut = points + share[:, None] * (following - points)
    both = np.stack((points, cut), axis=1).reshape(-1, 3)
    return both[np.stack((inside, crosses), axis=1).ravel()]


def dense(points: FloatArray) -> FloatArray:
    """Fill a chain (n, 3) of unit twists along great circles, so that no gap is wider than the chart forgives.

    Along the rim the places are those of one division of the whole rim: regions that share a part of it share its chords.
    """
    steps = np.diff(points, axis=0)
    angles = 2 * np.arcsin(np.minimum(np.linalg.norm(steps, axis=1) / 2, 1.0))
    still = np.abs(points[:, 2]) < 1e-12
    along_rim = np.flatnonzero(still[:-1] & still[1:] & (angles > 0))
    counts = np.maximum(1, np.ceil(angles / _GAP)).astype(int)
    counts[along_rim] = 1
    at = np.repeat(np.arange(len(steps)), counts)
    share = (np.arange(len(at)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[at]
    angle = np.maximum(angles[at], 1e-9)
    filled = unit(np.sin((1 - share) * angle)[:, None] * points[at] + np.sin(share * angle)[:, None] * points[at + 1])
    starts = np.cumsum(counts) - counts
    for i in reversed(along_rim):
        begin, end = (float(np.arctan2(points[k, 1], points[k, 0])) for k in (i, i + 1))
        end = begin + float(np.remainder(end - begin + np.pi, 2 * np.pi) - np.pi)
        low, high = np.floor(min(begin, end) / _GAP) + 1, np.ceil(max(begin, end) / _GAP) - 1
        between = _GAP * np.arange(low, high + 1)
        between = between if end > begin else between[::-1]
        filled = np.insert(filled, starts[i] + 1, np.stack((np.cos(between), np.sin(between), 0 * between), axis=-1), axis=0)
    return np.concatenate((filled, points[-1:]))


#: Polygons on the sphere: rings (n, 3) of normalised twists, joined by great circles; the first of each is the outer one. A ring
#: encloses no two opposite twists, so that it meets a great circle in arcs shorter than half of it.
Rings = Sequence[Sequence[FloatArray]]


def disc_polygons(rings: Rings, sense: int) -> shapely.Geometry:
    """Return, in the chart, what polygons on the sphere hold of a hemisphere."""

    def place(ring: FloatArray) -> FloatArray:
        half = clip_loop(ring, np.array((0.0, 0.0, float(sense))))
        if len(half) < 3:
            return half[:0, :2]
        half = unit(half)
        return disc_from_twists(dense(np.concatenate((half, half[:1]))), sense)

    return shapely.union_all([_polygon(polygon, place) for polygon in rings])


def cor_polygons(rings: Rings, sense: int, rho: float, extent: float) -> list[shapely.Polygon]:
    """Return polygons on the sphere as polygons of CORs of one sense (m, in B), cut at ``|x|, |y| <= extent`` (m)."""

    def place(ring: FloatArray) -> FloatArray:
        # |c_x|, |c_y| <= E in homogeneous coordinates: c = (-vy, vx)/omega
        twists = sense * ring / (1.0, 1.0, rho)
        for row in ((1, 0, extent), (-1, 0, extent), (0, 1, extent), (0, -1, extent)):
            twists = clip_loop(twists, np.array(row, dtype=np.float64))
        cors = np.stack((-twists[:, 1], twists[:, 0]), axis=-1) / twists[:, 2:]
        return np.concatenate((cors, cors[:1]))

    merged = shapely.union_all([_polygon(polygon, place) for polygon in rings])
    return [p for p in shapely.get_parts(only_polygons(merged)) if p.area > 1e-15 * extent * extent]


def rings_from_disc(disc: shapely.Geometry, sense: int) -> Rings:
    """Return polygons of the chart as polygons on the sphere."""
    return [
        [twists_from_disc(shapely.get_coordinates(ring)[:-1], sense) for ring in (part.exterior, *part.interiors)]
        for part in shapely.get_parts(only_polygons(disc))
        if not part.is_empty
    ]


def _polygon(rings: Sequence[FloatArray], place: Callable[[FloatArray], FloatArray]) -> shapely.Geometry:
    outer, *holes = (make_polygons(place(ring)) for ring in rings)
    return shapely.difference(outer, shapely.union_all(holes)) if holes else outer


def make_polygons(ring: FloatArray) -> shapely.Geometry:
    """Return the polygons that a ring (n, 2) encloses, which may touch itself."""
    if len(ring) < 4:
        return shapely.Polygon()
    polygon = shapely.Polygon(ring)
    if polygon.is_valid:
        return polygon
    return only_polygons(shapely.make_valid(polygon))


def only_polygons(geometry: shapely.Geometry) -> shapely.Geometry:
    """Drop points, lines and dust from a geometry: parts of less area than rounding makes where a ring touches itself."""
    flat = [p for g in shapely.get_parts(geometry) for p in shapely.get_parts(g) if isinstance(p, shapely.Polygon)]
    dust = 1e-12 * max((p.area for p in flat), default=0.0)
    parts = [p for p in flat if p.area > dust]
    return parts[0] if len(parts) == 1 else shapely.union_all(parts)


def rim(low: float, high: float) -> FloatArray:
    """Return places (n, 2) along the rim from one angle (rad) in the chart to another."""
    first, last = sorted((low, high))
    inner = _GAP * np.arange(np.floor(first / _GAP) + 1, np.ceil(last / _GAP))
    angles = np.concatenate(((low,), inner if low <= high else inner[::-1], (high,)))
    return RIM * np.stack((np.cos(angles), np.sin(angles)), axis=-1)


def square_of_cors(extent: float) -> FloatArray:
    """Return homogeneous CORs (4, 3), ``(c_x, c_y, 1)``, round the square ``|c_x|, |c_y| <= extent``."""
    return np.array(((-extent, -extent, 1.0), (extent, -extent, 1.0), (extent, extent, 1.0), (-extent, extent, 1.0)))


def twists_from_homogeneous(cors: FloatArray, sense: float) -> FloatArray:
    """Return body twists (n, 3) about homogeneous CORs (n, 3)."""
    return np.asarray(sense * cors[:, (1, 0, 2)] * (1.0, -1.0, 1.0))
