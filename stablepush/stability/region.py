"""Stable regions: the set of motions under which a push holds, with its boundary.

The stable set lives on the sphere of unit twists, of which the planes of counter-clockwise and of clockwise CORs are two
charts that meet in the translations. It is the image of the wrench cone under the map from loads to slip twists, so its
boundary is the image of the cone's facets: no inversion and no grid is needed, and any limit surface will do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import shapely
import shapely.geometry
from numpy.typing import ArrayLike

from stablepush.core import (
    BoolArray,
    FloatArray,
    InputError,
    UnsupportedContactError,
    check_count,
    check_number,
    check_sense,
    check_vectors,
    order_with_ties,
    read_only,
    shown_as,
)
from stablepush.geometry import cor_from_twist, normalize_twist, twist_from_cor, wrap_angle
from stablepush.objects import PushContact, WrenchCone
from stablepush.stability.kernels.chart import (
    SphericalPolygons,
    add_coverage,
    cor_polygons,
    disc_polygons,
    encloses,
    hemisphere,
    new_places,
    spherical_polygons_from_disc,
    square_of_cors,
    twists_from_disc,
    twists_from_homogeneous,
)
from stablepush.stability.oracle import StabilityOracle
from stablepush.surfaces import LimitSurface, check_surface

#: Largest angle (rad) on the sphere of unit twists between the boundary and the polygon that stands for it.
BOUNDARY_TOLERANCE = 2e-5
#: Unbounded regions are cut at this many times the radius of slider or contact.
EXTENT_RADII = 100.0

_CHORD = 5e-6
#: Turning (of a unit twist) that is rounding.
_STILL = 1e-9
_FIRST_SAMPLES = 65
_MOST_ROUNDS = 12
_MOST_PARTS = 64

Interval = tuple[float, float]


class MotionSet(Protocol):
    """What a region is: which motions it holds, and its boundary."""

    def accepts(self, twists: FloatArray) -> BoolArray:
        """Return whether body twists (n, 3) are in the set."""

    def spherical_polygons(self, sense: int) -> SphericalPolygons:
        """Return the boundary of each piece of turns of a sense, as unit normalised twists."""


@dataclass(frozen=True, slots=True, eq=False)
class StableRegion:
    """A closed set of stable motions: rotations of both senses, and translations.

    Attributes
    ----------
    name : str
        How the region was found: ``"model"``, ``"conservative"``, ``"all-pressure"``, ``"probability 0.9"``.
    characteristic_length : float
        ``rho`` (m) of the sphere of unit twists ``(vx, vy, rho*omega)`` on which its boundary is known.
    default_extent : float
        Half side (m) of the square about the origin of B at which :meth:`polygons` cuts.
    translation_intervals : tuple of pairs of floats
        Intervals of stable translation directions, as angles (rad) in B with ``lower <= upper``, the widest first.
    motions : MotionSet
        The set itself.
    curve : array, shape (n, 3), or None
        Where the region has no interior (one finger, no friction, or a cone within a facet of an ideal surface), the unit
        twists ``(vx, vy, rho*omega)`` along it; one where a single motion is stable. The region then has no polygons.
    loop : array, shape (n, 3), or None
        Where the region is bounded by one closed curve that is known, the unit twists along it, with the region on their left.
    """

    _repr_html_ = shown_as("region")

    name: str
    characteristic_length: float
    default_extent: float
    translation_intervals: tuple[Interval, ...]
    motions: MotionSet = field(repr=False)
    curve: FloatArray | None = None
    loop: FloatArray | None = field(default=None, repr=False)
    _known: dict[int, SphericalPolygons] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        # intervals begin between -pi and pi, and nobody writes into the curve
        turn = 2 * np.pi
        shifts = [turn * np.ceil((-np.pi - low) / turn - 1e-12) for low, _ in self.translation_intervals]
        wrapped = tuple(
            (float(low + shift), float(high + shift))
            for (low, high), shift in zip(self.translation_intervals, shifts, strict=True)
        )
        object.__setattr__(self, "translation_intervals", wrapped)
        if self.curve is not None:
            object.__setattr__(self, "curve", read_only(self.curve))
        if self.loop is not None:
            object.__setattr__(self, "loop", read_only(self.loop))

    @property
    def translations(self) -> Interval | None:
        """The widest interval of stable translation directions, as angles (rad) in B with ``lower <= upper``; None without
        one."""
        return self.translation_intervals[0] if self.translation_intervals else None

    def contains_twists(self, twists: ArrayLike) -> BoolArray:
        """Return whether body twists (..., 3) lie in the region; translations are twists like any other."""
        v = check_vectors(twists, "twists", 3)
        if not v.any(axis=-1).all():
            raise InputError("twists", "expected twists that are not zero")
        return np.asarray(self.motions.accepts(v.reshape(-1, 3)).reshape(v.shape[:-1]))

    def contains(self, cors: ArrayLike, sense: ArrayLike) -> BoolArray:
        """Return whether CORs (..., 2) in B (m) with ``sense`` (+1 or -1, a scalar or an array) lie in the region; never cut."""
        try:
            twists = twist_from_cor(cors, sense)
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                "cors, sense", "expected shapes that go together", f"{np.shape(cors)} and {np.shape(sense)}"
            ) from None
        return self.contains_twists(twists)

    def disc(self, sense: int) -> shapely.Geometry:
        """Return the region of one sense in the equal-area chart of its hemisphere of unit twists, a disc of radius ``sqrt(2)``.

        A COR ``c`` lies at ``2 sin(theta/2)`` from the middle in its own direction, with ``tan(theta) = |c|/rho``; translations
        lie on the rim.
        """
        return disc_polygons(self._spherical_polygons_of(sense), _one_sense(sense))

    def polygons(self, sense: int, extent: float | None = None) -> list[shapely.Polygon]:
        """Return the region of one sense as polygons in the COR plane (m, in B), cut at ``|x|, |y| <= extent`` (m)."""
        size = self.default_extent if extent is None else check_number(extent, "extent", positive=True)
        return cor_polygons(self._spherical_polygons_of(sense), _one_sense(sense), self.characteristic_length, size)

    def raster(self, sense: int, extent: float, cells: int = 400) -> BoolArray:
        """Return which CORs at the middles of ``cells x cells`` squares, over ``|x|, |y| <= extent`` (m), are in the region.

        The polygons are drawn by scan lines: row ``i`` has the ``i``-th least ``y``. :meth:`contains` asks the oracle instead.
        """
        check_count(cells, "cells", most=10_000)
        counts = np.zeros((cells, cells + 1))
        for polygon in self.polygons(sense, extent):
            add_coverage(counts, polygon, extent)
        return np.asarray(np.cumsum(counts, axis=1)[:, :-1] > 0.5)

    def area(self, sense: int, extent: float | None = None) -> float:
        """Return the area (m²) of the region of one sense within ``|x|, |y| <= extent`` (m)."""
        return float(sum(p.area for p in self.polygons(sense, extent)))

    def solid_angle(self) -> float:
        """Return the solid angle (sr) of the whole region, both senses, on the sphere of unit twists: it needs no cut."""
        return float(self.disc(1).area + self.disc(-1).area)

    def tightest_turn(self, sense: int) -> FloatArray | None:
        """Return the COR (2,) of the region nearest to the origin of B (m), the tightest turn; None without one of that sense."""
        sign = _one_sense(sense)
        if self.curve is not None:
            turning = self.curve[self.curve[:, 2] * sign > _STILL]
            if not len(turning):
                return None
            return np.asarray(cor_from_twist(turning[np.argmax(np.abs(turning[:, 2]))] / (1, 1, self.characteristic_length))[0])
        disc = self.disc(sign)
        if disc.is_empty:
            return None
        nearest = shapely.get_coordinates(shapely.shortest_line(disc, shapely.Point(0.0, 0.0)))[0]
        twist = twists_from_disc(nearest, sign) / (1.0, 1.0, self.characteristic_length)
        return np.asarray(cor_from_twist(twist)[0]) if abs(twist[2]) * self.characteristic_length > _STILL else None

    def boundary_twists(self, sense: int) -> list[FloatArray]:
        """Return the boundary of one sense as rings (n, 3) of body twists, unit in ``(vx, vy, rho*omega)``."""
        return [
            ring / (1.0, 1.0, self.characteristic_length) for polygon in self._spherical_polygons_of(sense) for ring in polygon
        ]

    def _spherical_polygons_of(self, sense: int) -> SphericalPolygons:
        sign = _one_sense(sense)
        if sign not in self._known:
            self._known[sign] = self.motions.spherical_polygons(sign)
        return self._known[sign]


def _one_sense(sense: int) -> int:
    signs = check_sense(sense)
    if signs.ndim:
        raise InputError("sense", "expected one sense, +1 or -1")
    return int(signs)


#: CORs this many times the extent away are as good as translations.
FAR = 1e9


def all_turns(extent: float, rho: float, sense: int) -> SphericalPolygons:
    """Return the rings of all turns of a sense."""
    return [[twists_from_homogeneous(square_of_cors(FAR * extent), sense) * (1.0, 1.0, rho)]]


@dataclass(frozen=True, slots=True, eq=False)
class _StableMotions:
    """The motions that an oracle calls stable; ``boundary`` (n, 3): unit normalised twists, None for all motions."""

    oracle: StabilityOracle
    boundary: FloatArray | None
    extent: float

    def accepts(self, twists: FloatArray) -> BoolArray:
        return self.oracle.is_stable(twists)

    def spherical_polygons(self, sense: int) -> SphericalPolygons:
        if self.boundary is None:
            return all_turns(self.extent, self.oracle.surface.characteristic_length, sense)
        # a flat cone, or a rotation about one support point, has no interior
        if self.oracle.cone.rank < 3 or len(self.boundary) == 1:
            return []
        return spherical_polygons_from_disc(hemisphere(self.boundary, sense), sense)


def stable_region(surface: LimitSurface, contact: PushContact) -> StableRegion:
    """Return the stable region of a limit surface and a contact, of any kind.

    Its boundary on the sphere of unit twists ``(vx, vy, rho*omega)`` is traced to :data:`BOUNDARY_TOLERANCE`; membership asks the
    oracle and is exact. One finger, or fingers without friction, hold a curve of motions or a single one (``curve``); fingers
    that hold the slider between them allow every motion.

    Raises
    ------
    InputError
        If the surface is a Gaussian process.
    UnsupportedContactError
        If the wrench cone holds a line but not every wrench (opposed fingers without friction, and another): its region ends in
        opposite motions.
    """
    if not check_surface(surface, "surface").is_dual:
        raise InputError(
            "surface",
            f"expected a limit surface; the slip and the loads of a {type(surface).__name__} do not agree, "
            "so it has no stable region (ask StabilityOracle about single motions)",
        )
    # a surface on which motions have no load is refused here, too, though its boundary needs none
    surface.wrench(np.eye(3))
    oracle = StabilityOracle(surface, contact)
    rho = surface.characteristic_length
    cone, extent = oracle.cone, EXTENT_RADII * max(contact.radius, rho)
    if len(cone.normals) == 0:
        return StableRegion("model", rho, extent, ((0.0, 2 * np.pi),), _StableMotions(oracle, None, extent))
    if cone.rank == 3 and not cone.is_solid_and_pointed:
        raise UnsupportedContactError(
            "stable region: expected a wrench cone without a line in it, or all wrenches; these contacts can press against each "
            "other without holding the slider (ask StabilityOracle about single motions)"
        )
    boundary = trace_boundary(surface, cone)
    # translations up to rounding are translations
    boundary[np.abs(boundary[:, 2]) < _STILL, 2] = 0.0
    if cone.rank == 3 and np.ptp(boundary, axis=0).max() < _STILL:
        # all loads of the cone lie on one facet of an ideal surface: rotation about one support point
        boundary = boundary[:1]
    motions = _StableMotions(oracle, boundary, extent)
    if cone.rank < 3 or len(boundary) == 1:
        return StableRegion("model", rho, extent, _crossings(boundary), motions, boundary)
    return StableRegion("model", rho, extent, translation_intervals(boundary), motions, loop=boundary)


def trace_boundary(surface: LimitSurface, cone: WrenchCone) -> FloatArray:
    """Unit normalised slip twists (n, 3) along the boundary of a cone, once round with the cone on the left, or along a flat
    cone.

    Loads on a facet are ``cos(phi) e1 + sin(phi) e2``; steps in ``phi`` are refined until chords keep to the curve.
    """
    frames = cone.arcs()
    rho = surface.characteristic_length

    def slip(index: np.ndarray, share: FloatArray) -> FloatArray:
        angle = share * frames.angles[index]
        loads = np.cos(angle)[:, None] * frames.first[index] + np.sin(angle)[:, None] * frames.second[index]
        return normalize_twist(surface.twist(loads * (1.0, 1.0, rho)), rho)

    count = len(frames.angles)
    if not frames.angles.any():
        return slip(np.arange(count), np.zeros(count))
    index = np.repeat(np.arange(count), _FIRST_SAMPLES)
    share = np.tile(np.linspace(0.0, 1.0, _FIRST_SAMPLES), count)
    twists = slip(index, share)
    for _ in range(_MOST_ROUNDS):
        parts = cut_parts(twists, index)
        if parts.max() == 1:
            break
        at, before = new_places(parts)
        new = share[at] + (share[at + 1] - share[at]) * before
        twists = np.insert(twists, at + 1, slip(index[at], new), axis=0)
        share, index = np.insert(share, at + 1, new), np.insert(index, at + 1, index[at])
    # the end of a facet is the start of the next
    last = np.append(index[1:] != index[:-1], cone.rank == 3)
    return twists[~last]


def cut_parts(twists: FloatArray, index: np.ndarray) -> np.ndarray:
    """Into how many parts each gap between neighbours is to be cut, so that chords keep within the tolerance.

    A circle through a point and its two neighbours says how far the chords beside it miss the curve.
    """
    step = np.diff(twists, axis=0)
    length = np.sqrt(np.einsum("nc,nc->n", step, step))
    apart = index[1:] != index[:-1]
    before, after = length[:-1], length[1:]
    # height of the middle point over the chord of its neighbours
    chord = step[:-1] + step[1:]
    size = np.maximum(np.sqrt(np.einsum("nc,nc->n", chord, chord)), 1e-300)
    along = np.einsum("nc,nc->n", step[:-1], chord) / size
    height = np.sqrt(np.maximum(before * before - along * along, 0.0))
    height[apart[:-1] | apart[1:]] = 0.0
    miss = np.zeros(len(length))
    for gap, other, own, known in (
        (slice(0, -1), after, before, ~apart[1:]),
        (slice(1, None), before, after, ~apart[:-1]),
    ):
        ratio = own / np.maximum(other, 0.1 * own + 1e-300)
        # where the motion stood still before or after, on a facet of the surface, nothing is known of the gap
        guess = known * np.where(other < 0.01 * own, 0.05 * own, 0.25 * height * ratio)
        miss[gap] = np.maximum(miss[gap], guess)
    # a wide gap hides what its neighbours do not show
    parts = np.maximum(np.sqrt(miss / _CHORD), length / 0.2)
    parts = np.where(apart | (length < _CHORD), 1.0, np.ceil(parts))
    return np.minimum(parts, _MOST_PARTS).astype(int)


def translation_intervals(loop: FloatArray) -> tuple[Interval, ...]:
    """Directions that a closed boundary (n, 3) encloses, between the places where it passes through translation; widest first."""
    following = np.roll(loop, -1, axis=0)
    crossing = np.flatnonzero((loop[:, 2] < 0) != (following[:, 2] < 0))
    if not len(crossing):
        return ()
    a, b = loop[crossing], following[crossing]
    at = a + (a[:, 2] / (a[:, 2] - b[:, 2]))[:, None] * (b - a)
    angles = np.sort(np.arctan2(at[:, 1], at[:, 0]))
    ends = np.append(angles[1:], angles[0] + 2 * np.pi)
    middles = (angles + ends) / 2
    stable = encloses(loop, np.stack((np.cos(middles), np.sin(middles), np.zeros_like(middles)), axis=-1))
    found = [(float(low), float(high)) for low, high, good in zip(angles, ends, stable, strict=True) if good]
    return widest_first(found)


def widest_first(intervals: list[Interval]) -> tuple[Interval, ...]:
    """Intervals in the order of their width; of those as wide as each other the one that begins first, from -pi on."""
    ordered = sorted(intervals, key=lambda interval: float(wrap_angle(interval[0] + 1e-9)))
    return tuple(ordered[k] for k in order_with_ties([low - high for low, high in ordered], 1e-9))


def _crossings(curve: FloatArray) -> tuple[Interval, ...]:
    """Translations on a curve of motions: intervals where it runs along the rim, and of no width where it crosses it."""
    still = curve[:, 2] == 0
    found: list[Interval] = []
    for run in np.split(np.flatnonzero(still), np.flatnonzero(np.diff(np.flatnonzero(still)) > 1) + 1):
        if len(run):
            angles = np.unwrap(np.arctan2(curve[run, 1], curve[run, 0]))
            found.append((float(angles.min()), float(angles.max())))
    crossing = np.flatnonzero(curve[:-1, 2] * curve[1:, 2] < 0) if len(curve) > 2 else np.zeros(0, dtype=int)
    a, b = curve[crossing], curve[crossing + 1]
    at = a + (a[:, 2] / (a[:, 2] - b[:, 2]))[:, None] * (b - a) if len(crossing) else a
    found += [(float(angle), float(angle)) for angle in np.arctan2(at[:, 1], at[:, 0])]
    return widest_first(found)


def regions_to_json(regions: Sequence[StableRegion], extent: float | None = None) -> dict[str, Any]:
    """Return regions as ``regions/1``: GeoJSON polygons in the COR plane of B (m) for each sense, cut at ``extent`` (m)."""
    return {
        "format": "regions/1",
        "regions": [
            {
                "name": region.name,
                "extent": region.default_extent if extent is None else extent,
                "translations": [list(interval) for interval in region.translation_intervals],
                "characteristic_length": region.characteristic_length,
                "solid_angle": region.solid_angle(),
                **{
                    word: [shapely.geometry.mapping(p) for p in region.polygons(sense, extent)]
                    for word, sense in (("counter_clockwise", 1), ("clockwise", -1))
                },
                "curve": None if region.curve is None else (region.curve / (1.0, 1.0, region.characteristic_length)).tolist(),
            }
            for region in regions
        ],
    }


def common_intervals(intervals: list[tuple[Interval, ...]], needed: int) -> tuple[Interval, ...]:
    """Directions that at least so many sets of intervals hold, the widest first."""
    turn = 2 * np.pi
    ends = np.unique(np.mod([end for several in intervals for interval in several for end in interval], turn))
    if not len(ends):
        return ()
    following = np.append(ends[1:], ends[0] + turn)
    middle = (ends + following) / 2
    count = np.zeros(len(middle), dtype=int)
    for several in intervals:
        inside = np.zeros(len(middle), dtype=bool)
        for low, high in several:
            inside |= np.mod(middle - low, turn) <= high - low
        count += inside
    good = count >= needed
    if good.all():
        return ((0.0, turn),)
    found: list[Interval] = []
    # from the first gap on, so that no interval is cut
    start = int(np.argmin(good))
    for i in np.roll(np.arange(len(good)), -start):
        if not good[i]:
            continue
        shift = turn if i < start else 0.0
        low, high = float(ends[i] + shift), float(following[i] + shift)
        if found and abs(found[-1][1] - low) < 1e-12:
            found[-1] = (found[-1][0], high)
        else:
            found.append((low, high))
    return widest_first(found)
