"""The probability of a region, given the ensemble of surfaces from the posterior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from stablepush.core import BoolArray, FloatArray, InputError, brief, check_count, check_number, read_only
from stablepush.objects import PushContact
from stablepush.stability.kernels.chart import (
    SphericalPolygons,
    add_coverage,
    grid_places,
    only_polygons,
    spherical_polygons_from_disc,
)
from stablepush.stability.oracle import StabilityOracle
from stablepush.stability.region import EXTENT_RADII, StableRegion, common_intervals, stable_region
from stablepush.surfaces import LimitSurface

#: Slack of a share of surfaces: k of n must pass for p = k/n.
_SLACK = 1e-9
#: Rows and columns of the grid that tells which pieces of boundaries matter: finer ones leave fewer, and take longer.
_CELLS = 128


@dataclass(frozen=True, slots=True, eq=False)
class ProbabilityMap:
    """Probability of stability on a grid of CORs.

    ``x`` (n,), ``y`` (n,): places (m, in B); ``counter_clockwise``, ``clockwise`` (n, n): share of the ensemble's surfaces
    for which the COR ``(x[j], y[i])`` is stable.
    """

    x: FloatArray
    y: FloatArray
    counter_clockwise: FloatArray
    clockwise: FloatArray

    def __repr__(self) -> str:
        return brief(self)


def probability_map(surface: LimitSurface, contact: PushContact, extent: float, cells: int = 400) -> ProbabilityMap:
    """Return the probability of stability at ``cells x cells`` CORs in the square ``|x|, |y| <= extent`` (m) about the origin
    of B.

    The exact region of every surface of the ensemble is drawn into the grid by scan lines: no ``H_inv`` is needed.

    Raises
    ------
    InputError
        If the surface has no ensemble.
    UnsupportedContactError
        As :func:`stablepush.stable_region` does.
    """
    size = check_number(extent, "extent", positive=True)
    check_count(cells, "cells", most=10_000)
    regions = _member_regions(surface, contact)
    places = grid_places(size, cells)
    shares = []
    for sense in (1, -1):
        counts = np.zeros((cells, cells + 1))
        for region in regions:
            for polygon in region.polygons(sense, size):
                add_coverage(counts, polygon, size)
        shares.append(read_only(np.cumsum(counts, axis=1)[:, :-1] / len(regions)))
    return ProbabilityMap(read_only(places), read_only(places.copy()), *shares)


def chance_region(surface: LimitSurface, contact: PushContact, probability: float = 0.9) -> StableRegion:
    """Return the motions that are stable with at least the given probability, by the ensemble of a surface.

    A motion is in it if at least the share ``probability`` of the surfaces calls it stable. Its boundary consists of pieces
    of the exact boundaries of the surfaces' own regions.

    Raises
    ------
    InputError
        If the surface has no ensemble, or the probability is not above 0 and at most 1.
    UnsupportedContactError
        As :func:`stablepush.stable_region` does.
    """
    level = check_number(probability, "probability")
    if not 0 < level <= 1:
        raise InputError("probability", "expected a number above 0 and up to 1", repr(probability))
    regions = _member_regions(surface, contact)
    needed = max(1, int(np.ceil(level * len(regions) - _SLACK)))
    oracle = StabilityOracle(surface, contact)
    rho = surface.characteristic_length

    return StableRegion(
        name=f"probability {level:g}",
        characteristic_length=rho,
        default_extent=EXTENT_RADII * max(contact.radius, rho),
        translation_intervals=common_intervals([region.translation_intervals for region in regions], needed),
        motions=_ProbablyStable(oracle, regions, needed),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _ProbablyStable:
    """Motions that at least ``needed`` surfaces of an ensemble call stable."""

    oracle: StabilityOracle
    regions: Sequence[StableRegion]
    needed: int

    def accepts(self, twists: FloatArray) -> BoolArray:
        share = self.oracle.probability(twists)
        assert share is not None
        return np.asarray(share >= self.needed / len(self.regions) - _SLACK)

    def spherical_polygons(self, sense: int) -> SphericalPolygons:
        return spherical_polygons_from_disc(_covered([region.disc(sense) for region in self.regions], self.needed), sense)


def _member_regions(surface: LimitSurface, contact: PushContact) -> list[StableRegion]:
    members = surface.members()
    if not members:
        raise InputError("probability", "expected a limit surface with an ensemble, as a convex fit leaves it")
    return [stable_region(member, contact) for member in members]


def _covered(discs: list[shapely.Geometry], needed: int) -> shapely.Geometry:
    """The part of the chart that at least so many polygons cover: faces of the arrangement of their boundaries, counted.

    Of the boundaries only what can part enough from too few is taken (:func:`_deciding`): between two faces that are joined by
    leaving out the rest, the answer is the same.
    """
    discs = [disc for disc in discs if not disc.is_empty]
    segments = _deciding(discs, needed) if len(discs) >= needed else np.zeros((0, 4))
    lines = shapely.union_all(shapely.multilinestrings(shapely.linestrings(segments.reshape(-1, 2, 2))))
    faces = shapely.get_parts(shapely.polygonize([lines]))
    if not len(faces):
        return shapely.Polygon()
    inner = shapely.get_coordinates(shapely.point_on_surface(faces))
    shapely.prepare(discs)
    count = np.sum([shapely.contains_xy(disc, *inner.T) for disc in discs], axis=0)
    return only_polygons(shapely.coverage_union_all(faces[count >= needed]))


def _deciding(discs: list[shapely.Geometry], needed: int) -> FloatArray:
    """Pieces (n, 4) of the polygons' boundaries, ``x, y`` of both ends, without those in cells of a grid of which it is known
    that enough polygons cover them, or too few: polygons that cover a cell whole always do, those with a boundary in it may."""
    polygons, of_polygon = shapely.get_parts(discs, return_index=True)
    rings, of_ring = shapely.get_rings(polygons, return_index=True)
    of_ring = of_polygon[of_ring]
    places, of_place = shapely.get_coordinates(rings, return_index=True)
    together = of_place[1:] == of_place[:-1]
    segments = np.concatenate((places[:-1], places[1:]), axis=1)[together]
    owner = of_ring[of_place[:-1][together]]
    extent = float(np.abs(places).max()) * (1 + 1e-6)

    # the cells of the box about a piece, and a little more
    ends = (segments.reshape(-1, 2, 2) + extent) * (_CELLS / (2 * extent))
    first = np.maximum(ends.min(axis=1) - 1e-6, 0).astype(int)
    sides = np.minimum(ends.max(axis=1) + 1e-6, _CELLS - 1).astype(int) - first + 1
    many = sides.prod(axis=1)
    piece = np.repeat(np.arange(len(many)), many)
    step = np.arange(len(piece)) - np.repeat(np.cumsum(many) - many, many)
    column, row = first[piece, 0] + step % sides[piece, 0], first[piece, 1] + step // sides[piece, 0]
    touched = np.zeros((len(discs), _CELLS, _CELLS), dtype=bool)
    touched[owner[piece], row, column] = True

    whole = np.zeros((_CELLS, _CELLS), dtype=int)
    for disc, its in zip(discs, touched, strict=True):
        counts = np.zeros((_CELLS, _CELLS + 1))
        for polygon in shapely.get_parts(disc):
            add_coverage(counts, polygon, extent)
        whole += (np.cumsum(counts, axis=1)[:, :-1] > 0.5) & ~its
    open_cells = (whole < needed) & (whole + touched.sum(axis=0) >= needed)
    kept = np.zeros(len(segments), dtype=bool)
    kept[piece[open_cells[row, column]]] = True
    found = segments[kept]
    # parts of the rim that polygons share are taken once
    backward = (found[:, 0] > found[:, 2]) | ((found[:, 0] == found[:, 2]) & (found[:, 1] > found[:, 3]))
    return np.unique(np.where(backward[:, None], found[:, [2, 3, 0, 1]], found), axis=0)
