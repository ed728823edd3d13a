"""Stable regions: the set of rotation centres about which a push holds, with its boundary.

The stable set lives on the sphere of unit twists, of which the planes of counter-clockwise and of clockwise CORs are two
charts that meet in the translations. It is the image of the wrench cone under the map from loads to slip twists, so its
boundary is the image of the cone's facets: no inversion and no grid is needed, and any limit surface will do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
import shapely.geometry
from numpy.typing import ArrayLike

from stablepush._arrays import BoolArray, FloatArray, check_number, check_sense
from stablepush.contact import PushContact
from stablepush.errors import InputError, UnsupportedContactError
from stablepush.models import GaussianProcessSurface, LimitSurface
from stablepush.oracle import StabilityOracle
from stablepush.planar import normalize_twist, unit

#: Largest angle (rad) on the sphere of unit twists between the boundary and the chord that stands for it.
BOUNDARY_TOLERANCE = 1e-5
#: Unbounded regions are cut at this many times the radius of slider or contact.
EXTENT_RADII = 100.0

_FIRST_SAMPLES = 33
_MOST_ROUNDS = 14


@dataclass(frozen=True, slots=True, eq=False)
class StableRegion:
    """A closed set of stable rotation centres of both senses, and of stable translations.

    Attributes
    ----------
    name : str
        How the region was found: ``"model"``, ``"conservative"``.
    default_extent : float
        Half side (m) of the square about the origin of B at which :meth:`polygons` cuts.
    translations : tuple of two floats, or None
        Interval of stable translation directions, as angles (rad) in B with ``lower <= upper``; None if there is none.
    """

    name: str
    default_extent: float
    translations: tuple[float, float] | None
    _contains: Callable[[FloatArray, FloatArray], BoolArray]
    _loops: Callable[[float], Sequence[FloatArray]]

    def contains(self, cors: ArrayLike, sense: ArrayLike) -> BoolArray:
        """Return whether CORs (..., 2) in B (m) with ``sense`` (+1 or -1, a scalar or an array) lie in the region; never cut."""
        c = np.asarray(cors, dtype=np.float64)
        s = np.broadcast_to(check_sense(sense), c.shape[:-1])
        return self._contains(c, s)

    def polygons(self, sense: int, extent: float | None = None) -> list[shapely.Polygon]:
        """Return the region of one sense as polygons in the COR plane (m, in B), cut at ``|x|, |y| <= extent`` (m)."""
        sign = float(check_sense(sense))
        size = self.default_extent if extent is None else check_number(extent, "extent", above=0.0)
        parts: list[shapely.Polygon] = []
        for loop in self._loops(size):
            # |c_x|, |c_y| <= E in homogeneous coordinates: c = (-vy, vx)/omega
            twists = sign * loop
            for row in ((1, 0, size), (-1, 0, size), (0, 1, size), (0, -1, size)):
                twists = clip_loop(twists, np.array(row, dtype=np.float64))
            if len(twists) < 3:
                continue
            cors = np.stack((-twists[:, 1], twists[:, 0]), axis=-1) / twists[:, 2:]
            valid = shapely.make_valid(shapely.Polygon(cors))
            parts += [g for g in shapely.get_parts(valid) if isinstance(g, shapely.Polygon)]
            parts += [p for g in shapely.get_parts(valid) if isinstance(g, shapely.MultiPolygon) for p in shapely.get_parts(g)]
        merged = shapely.union_all(parts)
        pieces = [p for p in shapely.get_parts(merged) if isinstance(p, shapely.Polygon)]
        return [p for p in pieces if p.area > 1e-15 * size * size]


def stable_region(surface: LimitSurface, contact: PushContact) -> StableRegion:
    """Return the stable region of a limit surface and a contact.

    Its boundary on the sphere of unit twists ``(vx, vy, rho*omega)`` is traced to :data:`BOUNDARY_TOLERANCE`; membership asks the
    oracle and is exact.

    Raises
    ------
    InputError
        If the surface is a Gaussian process.
    UnsupportedContactError
        If the wrench cone is flat (one contact point, no friction) or holds a line (opposed contacts): its region then has
        no interior, or no boundary curve.
    """
    if isinstance(surface, GaussianProcessSurface):
        raise InputError(
            "surface: expected a limit surface; the slip and the loads of a Gaussian process do not agree, so it has no stable "
            "region (ask StabilityOracle about single motions)"
        )
    oracle = StabilityOracle(surface, contact)
    if not oracle.cone.is_solid_and_pointed:
        raise UnsupportedContactError(
            "stable region: expected contacts whose wrench cone has an interior and holds no line, such as two points with "
            "friction on one edge; ask StabilityOracle about single motions of this contact"
        )
    rho = surface.characteristic_length
    loop = np.concatenate([_trace(surface, *facet)[:-1] for facet in _chain(oracle.cone.facets)])
    radius = max(contact.radius, rho)
    return StableRegion(
        name="model",
        default_extent=EXTENT_RADII * radius,
        translations=_translation_interval(oracle, loop),
        _contains=oracle.is_stable_cor,
        _loops=lambda extent: (loop / (1.0, 1.0, rho),),
    )


def _chain(facets: FloatArray) -> list[FloatArray]:
    """Order facets (m, 2, 3) head to tail, so that their outer rays run once round the cone."""
    rest = list(facets)
    chain = [rest.pop(0)]
    while rest:
        following = int(np.argmin([np.linalg.norm(f[0] - chain[-1][1]) for f in rest]))
        chain.append(rest.pop(following))
    return chain


def _trace(surface: LimitSurface, start: FloatArray, end: FloatArray) -> FloatArray:
    """Slip twists (n, 3), normalised to unit length, along the facet between two rays, dense enough to be joined by chords."""
    rho = surface.characteristic_length

    def slip(shares: FloatArray) -> FloatArray:
        loads = (1 - shares[:, None]) * start + shares[:, None] * end
        return unit(normalize_twist(surface.twist(loads * (1.0, 1.0, rho)), rho))

    shares = np.linspace(0.0, 1.0, _FIRST_SAMPLES)
    twists = slip(shares)
    coarse = np.ones(len(shares) - 1, dtype=bool)
    for _ in range(_MOST_ROUNDS):
        gaps = np.flatnonzero(coarse)
        middle_shares = (shares[gaps] + shares[gaps + 1]) / 2
        middle = slip(middle_shares)
        chord = unit(twists[gaps] + twists[gaps + 1])
        bent = np.linalg.norm(middle - chord, axis=1) > BOUNDARY_TOLERANCE
        shares = np.insert(shares, gaps + 1, middle_shares)
        twists = np.insert(twists, gaps + 1, middle, axis=0)
        # only the halves of gaps that bent are looked at again
        flags = np.zeros(len(shares) - 1, dtype=bool)
        first_half = gaps[bent] + np.flatnonzero(bent)
        flags[first_half] = flags[first_half + 1] = True
        coarse = flags
        if not bent.any():
            break
    return twists


def _translation_interval(oracle: StabilityOracle, loop: FloatArray) -> tuple[float, float] | None:
    """Stable directions between the places where the boundary passes through translation; the widest if several."""
    following = np.roll(loop, -1, axis=0)
    crossing = np.flatnonzero((loop[:, 2] < 0) != (following[:, 2] < 0))
    if not len(crossing):
        return None
    a, b = loop[crossing], following[crossing]
    share = a[:, 2] / (a[:, 2] - b[:, 2])
    at = a + share[:, None] * (b - a)
    angles = np.sort(np.arctan2(at[:, 1], at[:, 0]))
    ends = np.append(angles[1:], angles[0] + 2 * np.pi)
    middles = (angles + ends) / 2
    stable = oracle.is_stable(np.stack((np.cos(middles), np.sin(middles), np.zeros_like(middles)), axis=-1))
    if not stable.any():
        return None
    widest = int(np.argmax(np.where(stable, ends - angles, -1.0)))
    return float(angles[widest]), float(ends[widest])


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


def regions_to_json(regions: Sequence[StableRegion], extent: float | None = None) -> dict[str, Any]:
    """Return regions as ``regions/1``: GeoJSON polygons in the COR plane of B (m) for each sense, cut at ``extent`` (m)."""
    return {
        "format": "regions/1",
        "regions": [
            {
                "name": region.name,
                "extent": region.default_extent if extent is None else extent,
                "translations": None if region.translations is None else list(region.translations),
                **{
                    word: [shapely.geometry.mapping(p) for p in region.polygons(sense, extent)]
                    for word, sense in (("counter_clockwise", 1), ("clockwise", -1))
                },
            }
            for region in regions
        ],
    }
