"""An equal-area chart of one half of the sphere of unit twists, in which stable regions are planar polygons.

Unit twists ``(vx, vy, rho*omega)`` that turn one way form a hemisphere; its rim are the translations. Lambert's azimuthal map
takes it to a disc of radius ``sqrt(2)``: the pole, rotation about the origin of B, to the centre, a COR to a point in the
direction in which it lies, translations to the rim. Areas are solid angles, and nothing is at infinity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely

from stablepush.core import BoolArray, ConvergenceError, FloatArray
from stablepush.geometry import unit

#: Largest gap (rad) between neighbours on a boundary, a whole part of the rim: great circles are that near to straight, to 1e-5.
_GAP = 2 * np.pi / 800
RIM = float(np.sqrt(2.0))
#: Area (sr) that rounding makes where a boundary touches itself.
DUST = 1e-12


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


def new_places(parts: np.ndarray) -> tuple[np.ndarray, FloatArray]:
    """For gaps that are to be cut into parts (n,): in which gap each new place (k,) lies, and what share of it lies before."""
    extra = parts - 1
    at = np.repeat(np.arange(len(parts)), extra)
    step = 1 + np.arange(len(at)) - np.repeat(np.cumsum(extra) - extra, extra)
    return at, step / parts[at]


def dense(points: FloatArray) -> FloatArray:
    """Fill a chain (n, 3) of unit twists along great circles, so that no gap is wider than the chart forgives.

    Along the rim the places are those of one division of the whole rim: regions that share a part of it share its chords.
    """
    angles = 2 * np.arcsin(np.minimum(np.linalg.norm(np.diff(points, axis=0), axis=1) / 2, 1.0))
    still = np.abs(points[:, 2]) < 1e-12
    along_rim = still[:-1] & still[1:] & (angles > 0)
    parts = np.maximum(1, np.ceil(angles / _GAP)).astype(int)
    parts[along_rim] = 1
    at, share = new_places(parts)
    angle = np.maximum(angles[at], 1e-9)
    between = unit(np.sin((1 - share) * angle)[:, None] * points[at] + np.sin(share * angle)[:, None] * points[at + 1])
    begins = np.arctan2(points[:-1, 1], points[:-1, 0])
    ends = begins + np.remainder(np.diff(np.arctan2(points[:, 1], points[:, 0])) + np.pi, 2 * np.pi) - np.pi
    # a place of the division, but for rounding, is not between
    lows, highs = np.minimum(begins, ends) + 1e-12, np.maximum(begins, ends) - 1e-12
    for i in np.flatnonzero(along_rim & (np.ceil(highs / _GAP) > np.floor(lows / _GAP) + 1)):
        begin, end = begins[i], ends[i]
        inner = _division(lows[i], highs[i])
        inner = inner if end > begin else inner[::-1]
        at = np.append(at, np.full(len(inner), i))
        between = np.concatenate((between, np.stack((np.cos(inner), np.sin(inner), 0 * inner), axis=-1)))
    return np.insert(points, at + 1, between, axis=0)


def _division(low: float, high: float) -> FloatArray:
    """Angles (rad) strictly between two at which the rim is divided."""
    return _GAP * np.arange(np.floor(low / _GAP) + 1, np.ceil(high / _GAP))


#: Polygons on the sphere: rings (n, 3) of normalised twists, joined by great circles; the first of each is the outer one. A ring
#: encloses no two opposite twists, so that it meets a great circle in arcs shorter than half of it.
SphericalPolygons = Sequence[Sequence[FloatArray]]


def hemisphere(loop: FloatArray, sense: int) -> shapely.Geometry:
    """Return, in the chart, the part of a hemisphere that lies to the left of a closed boundary (n, 3) of unit twists.

    The boundary and the rim cut the disc into faces, each of which belongs or does not (:func:`encloses`).
    """
    inside = sense * loop[:, 2] >= 0
    lines = []
    if inside.all():
        lines.append(disc_from_twists(dense(np.concatenate((loop, loop[:1]))), sense))
    else:
        for start in np.flatnonzero(inside & ~np.roll(inside, 1)):
            order = np.arange(start, start + len(loop)) % len(loop)
            length = int(np.argmin(inside[order]))
            chain = loop[order[:length]]
            ends = (_on_rim(loop[start - 1], chain[0]), _on_rim(loop[order[length]], chain[-1]))
            lines.append(disc_from_twists(dense(np.concatenate((ends[0][None], chain, ends[1][None]))), sense))
    # the rim passes through the ends of the pieces, to the last digit
    ends_in_chart = np.array([line[k] for line in lines for k in (0, -1)]).reshape(-1, 2)
    circle = _rim(np.arctan2(ends_in_chart[:, 1], ends_in_chart[:, 0]) if not inside.all() else np.zeros(0))
    for line in lines:
        for k in (0, -1):
            nearest = circle[int(np.argmin(np.abs(circle - line[k]).sum(axis=1)))]
            if np.abs(nearest - line[k]).sum() < 1e-9:
                line[k] = nearest
    if len(lines) == 1 and not inside.all():
        sides = _sides(lines[0], circle)
        if all(side.is_valid and side.area > DUST for side in sides):
            place = np.array(sides[0].representative_point().coords)
            return sides[0] if encloses(loop, twists_from_disc(place, sense))[0] else sides[1]
    net = shapely.union_all([shapely.LineString(line) for line in (*lines, np.concatenate((circle, circle[:1])))])
    faces = [face for face in shapely.get_parts(shapely.polygonize([net])) if face.area > DUST]
    places = np.array([face.representative_point().coords[0] for face in faces]).reshape(-1, 2)
    kept = encloses(loop, twists_from_disc(places, sense))
    return only_polygons(shapely.union_all([face for face, good in zip(faces, kept, strict=True) if good]))


def _sides(line: FloatArray, circle: FloatArray) -> tuple[shapely.Polygon, shapely.Polygon]:
    """The two parts of the disc that a line (n, 2) makes that begins and ends at places of the rim."""
    first, last = (int(np.argmin(np.abs(circle - end).sum(axis=1))) for end in (line[0], line[-1]))
    order = np.roll(circle, -last, axis=0)
    at = (first - last) % len(circle)
    # from the end of the line on to its begin, either way round
    return shapely.Polygon(np.concatenate((line, order[1:at]))), shapely.Polygon(np.concatenate((line, order[:at:-1])))


def encloses(loop: FloatArray, twists: FloatArray) -> BoolArray:
    """Return whether unit twists (k, 3) lie to the left of a closed boundary (n, 3) that encloses no two opposite ones.

    Seen from a twist, the boundary then turns once round it, counter-clockwise; it turns not at all, or the other way, round one
    that is outside.
    """
    x, y, z = twists.T
    # two axes at right angles to each twist, from its product with the x or the y axis, whichever is not along it
    along = np.abs(x) >= 0.7
    first = unit(np.column_stack((np.where(along, -z, 0.0), np.where(along, 0.0, z), np.where(along, x, -y))))
    fx, fy, fz = first.T
    second = np.column_stack((y * fz - z * fy, z * fx - x * fz, x * fy - y * fx))
    angle = np.arctan2(loop @ second.T, loop @ first.T)
    turn = np.roll(angle, -1, axis=0) - angle
    whole = (np.remainder(turn + np.pi, 2 * np.pi) - np.pi).sum(axis=0)
    return np.asarray(whole > np.pi)


def whole_disc() -> shapely.Polygon:
    """Return the chart of a whole hemisphere."""
    return shapely.Polygon(_rim(np.zeros(0)))


def _rim(more: FloatArray) -> FloatArray:
    """Places (n, 2) round the rim, at the division that all regions share and at other angles (rad)."""
    angles = np.unique(np.concatenate((_division(-np.pi - _GAP / 2, np.pi - _GAP / 2), more)))
    return RIM * np.stack((np.cos(angles), np.sin(angles)), axis=-1)


def _on_rim(a: FloatArray, b: FloatArray) -> FloatArray:
    """Where the chord between two twists (3,) passes through translation."""
    share = a[2] / (a[2] - b[2]) if a[2] != b[2] else 0.0
    return np.asarray(unit((a + share * (b - a)) * (1.0, 1.0, 0.0)))


def disc_polygons(rings: SphericalPolygons, sense: int) -> shapely.Geometry:
    """Return, in the chart, what polygons on the sphere hold of a hemisphere."""

    def place(ring: FloatArray) -> FloatArray:
        half = clip_loop(ring, np.array((0.0, 0.0, float(sense))))
        if len(half) < 3:
            return half[:0, :2]
        half = unit(half)
        return disc_from_twists(dense(np.concatenate((half, half[:1]))), sense)

    parts = shapely.get_parts(only_polygons(shapely.union_all([_polygon(polygon, place) for polygon in rings])))
    return shapely.union_all([part for part in parts if part.area > DUST])


def cor_polygons(rings: SphericalPolygons, sense: int, rho: float, extent: float) -> list[shapely.Polygon]:
    """Return polygons on the sphere as polygons of CORs of one sense (m, in B), cut at ``|x|, |y| <= extent`` (m)."""

    def place(ring: FloatArray) -> FloatArray:
        # |c_x|, |c_y| <= E in homogeneous coordinates: c = (-vy, vx)/omega
        twists = sense * ring / (1.0, 1.0, rho)
        for row in ((1, 0, extent), (-1, 0, extent), (0, 1, extent), (0, -1, extent)):
            twists = clip_loop(twists, np.array(row, dtype=np.float64))
        with np.errstate(divide="ignore", invalid="ignore"):
            cors = np.stack((-twists[:, 1], twists[:, 0]), axis=-1) / twists[:, 2:]
        if not np.isfinite(cors).all():
            raise ConvergenceError("stable region: its boundary runs through itself; is the surface convex?")
        return np.concatenate((cors, cors[:1]))

    merged = shapely.union_all([_polygon(polygon, place) for polygon in rings])
    return [p for p in shapely.get_parts(only_polygons(merged)) if p.area > 1e-15 * extent * extent]


def spherical_polygons_from_disc(disc: shapely.Geometry, sense: int) -> SphericalPolygons:
    """Return polygons of the chart as polygons on the sphere."""

    def twists(ring: shapely.LinearRing) -> FloatArray:
        found = twists_from_disc(shapely.get_coordinates(ring)[:-1], sense)
        # the rim is on it, not nearly so
        found[np.abs(found[:, 2]) < 1e-12, 2] = 0.0
        return found

    parts = [part for part in shapely.get_parts(only_polygons(disc)) if not part.is_empty]
    return [[twists(ring) for ring in (part.exterior, *part.interiors)] for part in parts]


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
    dust = DUST * min(1.0, max((p.area for p in flat), default=0.0))
    parts = [p for p in flat if p.area > dust]
    return parts[0] if len(parts) == 1 else shapely.union_all(parts)


def square_of_cors(extent: float) -> FloatArray:
    """Return homogeneous CORs (4, 3), ``(c_x, c_y, 1)``, round the square ``|c_x|, |c_y| <= extent``."""
    return np.array(((-extent, -extent, 1.0), (extent, -extent, 1.0), (extent, extent, 1.0), (-extent, extent, 1.0)))


def twists_from_homogeneous(cors: FloatArray, sense: float) -> FloatArray:
    """Return body twists (n, 3) about homogeneous CORs (n, 3)."""
    return np.asarray(sense * cors[:, (1, 0, 2)] * (1.0, -1.0, 1.0))


def grid_places(extent: float, cells: int) -> FloatArray:
    """Return the middles (n,) of cells that divide ``-extent`` to ``extent``."""
    return np.asarray(extent * ((2 * np.arange(cells) + 1) / cells - 1))


def add_coverage(counts: FloatArray, polygon: shapely.Polygon, extent: float) -> None:
    """Add one to the cells of a grid over ``|x|, |y| <= extent`` whose middles a polygon covers.

    ``counts`` (n, n + 1) holds differences along the rows: their running sum is the number of polygons. Where the boundary
    crosses the line through a row's middles, all cells to the right of the crossing change by the sign of the crossing.
    """
    rows = counts.shape[0]
    scale = rows / (2 * extent)
    for number, ring in enumerate((polygon.exterior, *polygon.interiors)):
        points = shapely.get_coordinates(ring)
        inward = 1.0 if ring.is_ccw == (number == 0) else -1.0
        # in units of cells, middles at whole numbers
        q = (points + extent) * scale - 0.5
        low, high = np.minimum(q[:-1, 1], q[1:, 1]), np.maximum(q[:-1, 1], q[1:, 1])
        first, last = np.maximum(np.ceil(low), 0).astype(int), np.minimum(np.ceil(high), rows).astype(int)
        many = np.maximum(last - first, 0)
        edge = np.repeat(np.arange(len(many)), many)
        row = first[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(many) - many, many)
        a, b = q[edge], q[edge + 1]
        column = a[:, 0] + (row - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
        # a boundary that runs counter-clockwise goes down on the left of what it encloses
        sign = np.where(b[:, 1] < a[:, 1], inward, -inward)
        np.add.at(counts, (row, np.clip(np.ceil(column), 0, rows).astype(int)), sign)
