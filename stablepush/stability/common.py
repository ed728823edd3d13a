"""The motions that are stable in each of several cases: surfaces, contacts and centres of mass that are not known exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from stablepush.core import BoolArray, FloatArray, read_only
from stablepush.geometry import normalize_twist, unit
from stablepush.objects import PushContact
from stablepush.stability.kernels.chart import (
    SphericalPolygons,
    disc_from_twists,
    hemisphere,
    only_polygons,
    spherical_polygons_from_disc,
    whole_disc,
)
from stablepush.stability.region import EXTENT_RADII, StableRegion, common_intervals, stable_region
from stablepush.surfaces import LimitSurface

#: Turning (of a unit twist) that is none: such twists are translations.
_STILL = 1e-9
#: Slack (rad) at the ends of an interval of translations.
_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class Case:
    """A limit surface and a contact about a centre of mass that lies at ``origin`` (2,) in B (m).

    The surface is in the frame that has its origin there and its axes along B; the contact is in B.
    """

    surface: LimitSurface
    contact: PushContact
    origin: FloatArray

    @cached_property
    def region(self) -> StableRegion:
        """The stable region in that frame."""
        contact = PushContact(self.contact.points - self.origin, self.contact.normals, self.contact.mu)
        return stable_region(self.surface, contact)

    @cached_property
    def discs(self) -> list[shapely.Geometry]:
        """The stable motions of B in the charts of both senses, counter-clockwise first."""
        loop = self.region.loop
        if self.region.curve is not None:
            return [shapely.Polygon()] * 2
        if loop is None:
            return [whole_disc()] * 2
        moved = _moved(loop, self.origin, self.surface.characteristic_length)
        return [hemisphere(moved, sense) for sense in (1, -1)]


def common_region(cases: Sequence[Case], name: str = "common", within: StableRegion | None = None) -> StableRegion:
    """Return the motions of B that are stable in every case: the intersection of the exact regions, as polygons on the sphere.

    The twist of a frame at ``d`` is ``(vx - omega d_y, vy + omega d_x, omega)``. The map is linear, so it takes the great circles
    of one region to those of another frame, and leaves translations as they are. Membership is by the polygons, to
    :data:`~stablepush.stability.region.BOUNDARY_TOLERANCE`. ``within``: a region that this function returned, which the result
    is to be a part of.

    Raises as :func:`stablepush.stable_region` does.
    """
    rho = cases[0].surface.characteristic_length
    discs = [case.discs for case in cases]
    held = [case.region.translation_intervals for case in cases]
    if within is not None and isinstance(within.motions, _Common):
        discs.append([within.motions.counter_clockwise, within.motions.clockwise])
        held.append(within.translation_intervals)
    left, right = (only_polygons(shapely.intersection_all(both)) for both in zip(*discs, strict=True))
    intervals = common_intervals(held, len(held))
    reach = max(rho, *(case.contact.radius for case in cases))
    motions = _Common(rho, left, right, np.reshape(intervals, (-1, 2)))
    return StableRegion(name, rho, EXTENT_RADII * reach, tuple(intervals), motions)


def _moved(loop: FloatArray, origin: FloatArray, rho: float) -> FloatArray:
    """Unit normalised twists (n, 3) of a frame at ``origin``, as those of B."""
    turned = loop[:, 2:] / rho * np.array((origin[1], -origin[0]))
    return unit(loop + np.column_stack((turned, np.zeros(len(loop)))))


@dataclass(frozen=True, slots=True, eq=False)
class _Common:
    """Motions that polygons of the two charts hold, and translations of intervals (n, 2) of directions (rad)."""

    rho: float
    counter_clockwise: shapely.Geometry
    clockwise: shapely.Geometry
    intervals: FloatArray

    def __post_init__(self) -> None:
        shapely.prepare((self.counter_clockwise, self.clockwise))
        read_only(self.intervals)

    def accepts(self, twists: FloatArray) -> BoolArray:
        v = unit(normalize_twist(twists, self.rho))
        good = np.zeros(len(v), dtype=bool)
        for sense, disc in ((1, self.counter_clockwise), (-1, self.clockwise)):
            rows = np.flatnonzero(sense * v[:, 2] > _STILL)
            good[rows] = shapely.contains_xy(disc, *disc_from_twists(v[rows], sense).T)
        still = np.flatnonzero(np.abs(v[:, 2]) <= _STILL)
        angles = np.arctan2(v[still, 1], v[still, 0])
        for low, high in self.intervals:
            good[still] |= np.mod(angles - low + _SLACK, 2 * np.pi) <= high - low + 2 * _SLACK
        return good

    def spherical_polygons(self, sense: int) -> SphericalPolygons:
        return spherical_polygons_from_disc(self.counter_clockwise if sense > 0 else self.clockwise, sense)
