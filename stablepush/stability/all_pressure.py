"""What holds for every pressure distribution with the known centre of mass, exactly (kernels in :mod:`.kernels.envelope`)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import BoolArray, ConvergenceError, FloatArray, InputError, check_array, check_number, first_least, read_only
from stablepush.geometry import unit
from stablepush.objects import PushContact, Slider
from stablepush.stability.center_of_mass import box_corners, require_inside
from stablepush.stability.kernels.chart import SphericalPolygons, hemisphere, new_places, spherical_polygons_from_disc, whole_disc
from stablepush.stability.region import EXTENT_RADII, Interval, StableRegion, all_turns, cut_parts

#: A load may leave the cone by this much, for a friction load of one, and still count as on its boundary.
CERTIFICATE_TOLERANCE = 1e-10
#: Shares of a worst pressure below this are rounding.
_NO_SHARE = 1e-12
_FIRST_AZIMUTHS = 65
#: The boundary of one facet is refined where the load is no farther than this (of the friction load) outside the others, and
#: everywhere to gaps (rad) in which it does not change by as much.
_FAR_OUTSIDE, _WIDE = 0.02, 0.05
_MOST_ROUNDS = 8
_MOST_POINTS = 20_000
#: A facet whose line passes the COM this closely (in characteristic lengths) bounds the sense of the turn, but for the COM's
#: own motion.
_TORQUE_ONLY = 1e-6
#: How near (rad) to the boundary its vertices lie, on the inner side.
_ANGLE_TOLERANCE = 1e-8


@dataclass(frozen=True, slots=True, eq=False)
class WorstPressure:
    """The pressure distribution that comes nearest to breaking a push, or breaks it.

    Attributes
    ----------
    height : float
        Least ``a·F`` over all facets ``a`` of the cone and all pressures, for a friction load of one; the push can break if and
        only if it is negative. ``a`` and ``F`` are normalised by the characteristic length.
    gap : float
        Distance between the proven bounds of ``height``.
    points, shares : array, shape (n, 2), (n,)
        Where the slider presses on the table (m, in B), and the shares of its load; their mean is the centre of mass.
    forces : array, shape (n, 2)
        Friction force at each point that the pusher must overcome, in units of the friction load: along the point's motion,
        or, at a point that is the COR and rests, where it does most harm.
    load : array, shape (3,)
        Their sum ``(fx, fy, tau)`` in B, per unit of friction load.
    """

    height: float
    gap: float
    points: FloatArray
    shares: FloatArray
    forces: FloatArray
    load: FloatArray

    @property
    def breaks(self) -> bool:
        """True if this pressure breaks the push."""
        return self.height < -CERTIFICATE_TOLERANCE


class _Support:
    """Support polygon, places of the COM and facets of the cone, in units of the characteristic length."""

    def __init__(self, slider: Slider, contact: PushContact, com_tolerance: ArrayLike, length: float | None) -> None:
        hull = slider.support_vertices
        if len(hull) < 3:
            raise InputError("slider", "expected support points that are not all on a line")
        # pressure lies on the outline itself, which need not be convex; support points may share their load within their hull
        vertices = slider.vertices if slider.support is None else hull
        corners = box_corners(com_tolerance)
        require_inside(hull, corners)
        self.rho = (
            slider.characteristic_length if length is None else check_number(length, "characteristic_length", positive=True)
        )
        self.vertices = np.ascontiguousarray(vertices / self.rho)
        self.coms = np.ascontiguousarray(corners / self.rho)
        self.first = self._triangle(hull / self.rho)
        self.cone = contact.cone(self.rho)
        self.facets = np.ascontiguousarray(self.cone.normals)

    def _triangle(self, v: FloatArray) -> FloatArray:
        """Three vertices (3, 2) of the hull whose triangle holds the first place of the COM."""
        found = []
        for i in range(1, len(v) - 1):
            corners = v[[0, i, i + 1]]
            shares = np.linalg.solve(np.vstack((corners.T, np.ones(3))), np.append(self.coms[0], 1.0))
            found.append((float(shares.min()), i))
        # of triangles that hold it as well as each other, the first
        i = 1 + first_least([-share for share, _ in found], CERTIFICATE_TOLERANCE)
        return np.ascontiguousarray(v[[0, i, i + 1]])

    def normalized(self, twists: FloatArray) -> FloatArray:
        v = unit(twists * (1.0, 1.0, self.rho))
        if not v.any(axis=1).all():
            raise InputError("twists", "expected twists that are not zero")
        return np.ascontiguousarray(v)

    def holds(self, twists: FloatArray, facets: FloatArray, level: float = -CERTIFICATE_TOLERANCE) -> BoolArray:
        """Whether ``a·F >= level`` under every pressure, for unit normalised twists (n, 3) and all facets ``a`` (m, 3)."""
        from stablepush.stability.kernels.envelope import envelopes

        lower, upper = np.empty(len(twists)), np.empty(len(twists))
        envelopes(self.vertices, self.coms, self.first, facets, twists, level, lower, upper)
        return np.asarray(lower >= level)

    def rim(self, facet: FloatArray) -> FloatArray:
        """Vectors (k, 2) with which the direction of a translation must make no more than a right angle."""
        # the load of a translation d is d at the COM z: a·(d, z × d) = (a_xy + a_tau J z)·d
        return facet[:2] + facet[2] * np.stack((-self.coms[:, 1], self.coms[:, 0]), axis=-1)


def all_pressure_region(
    slider: Slider,
    contact: PushContact,
    *,
    mu: tuple[float, float] | None = None,
    com_tolerance: ArrayLike = 0.0,
    characteristic_length: float | None = None,
) -> StableRegion:
    """Return the motions for which a push is stable under every pressure distribution with the slider's centre of mass.

    A motion ``V`` is in it if and only if for every facet ``a`` of the composite wrench cone ``min Σ m g(x) >= 0`` over ``m >= 0,
    Σ m = 1, Σ m x = COM``, with ``g(x) = (a_x - a_tau y, a_y + a_tau x)·v(x)/|v(x)|``. Pressure may lie anywhere on the hull
    of the slider's support points if it has them, else on its outline, convex or not. The minimum is found exactly over all
    of it: membership is proven to 1e-10 of the friction load. Lynch and Mason's STABLE (1996), which takes the hull, is a part of
    this region.

    For one facet the accepted twists are star-shaped about ``a`` on the unit sphere (friction is the gradient of a convex
    function), so the boundary is one root an azimuth, traced to :data:`.region.BOUNDARY_TOLERANCE`. The polygons
    are as near as that to the region, on either side; what is proven is the answer of ``contains``.

    Parameters
    ----------
    slider : Slider
    contact : PushContact
    mu : pair of floats, optional
        Interval of the friction coefficient at the contact; the cone grows with it, so its lower end decides. The contact's
        own if not given.
    com_tolerance : float or array-like, shape (2,)
        Half widths (m) of a box about the origin of B in which the centre of mass may lie.
    characteristic_length : float, optional
        ``rho`` (m) of the sphere on which the boundary is traced, for comparison with a surface's regions; the slider's if not
        given. Which motions are in the region does not depend on it.

    Raises
    ------
    InputError
        If the support is a segment or a point, or the centre of mass is not inside it.
    """
    if mu is not None:
        try:
            low, high = mu
        except (TypeError, ValueError):
            raise InputError("mu", "expected an interval of two numbers", repr(mu)) from None
        if check_number(low, "mu", at_least=0.0) > check_number(high, "mu", at_least=0.0):
            raise InputError("mu", "expected the lower end first", repr(mu))
        contact = PushContact(contact.points, contact.normals, low)
    support = _Support(slider, contact, com_tolerance, characteristic_length)
    extent = EXTENT_RADII * max(slider.radius, contact.radius)

    if len(support.facets) == 0:
        return StableRegion("all-pressure", support.rho, extent, ((0.0, 2 * np.pi),), _StableUnderAll(support, extent))
    return StableRegion("all-pressure", support.rho, extent, _translations(support), _StableUnderAll(support, extent))


@dataclass(frozen=True, slots=True, eq=False)
class _StableUnderAll:
    """Motions that are stable under every pressure of a support."""

    support: _Support
    extent: float
    _traced: list[FloatArray | None] = field(default_factory=list, repr=False)

    def accepts(self, twists: FloatArray) -> BoolArray:
        return self.support.holds(self.support.normalized(twists), self.support.facets)

    def spherical_polygons(self, sense: int) -> SphericalPolygons:
        facets = self.support.facets
        if len(facets) == 0:
            return all_turns(self.extent, self.support.rho, sense)
        if self.support.cone.rank < 3:
            return []
        if not self._traced:
            # the same curves bound turns of both senses
            self._traced.extend(_trace(self.support, facet, np.delete(facets, i, axis=0)) for i, facet in enumerate(facets))
        parts = [_facet_disc(self.support, facet, line, sense) for facet, line in zip(facets, self._traced, strict=True)]
        return spherical_polygons_from_disc(shapely.intersection_all(parts), sense)


def worst_pressure(
    slider: Slider,
    contact: PushContact,
    twist: ArrayLike,
    *,
    com_tolerance: ArrayLike = 0.0,
    characteristic_length: float | None = None,
) -> WorstPressure:
    """Return the pressure distribution that does most to break a push with body twist (3,).

    It has at most three points. The bounds of its ``height`` are proven, one by this distribution, the other by duality
    (:func:`all_pressure_region` has the equations).
    """
    from stablepush.stability.kernels.envelope import begin, envelope

    support = _Support(slider, contact, com_tolerance, characteristic_length)
    v = support.normalized(check_array(twist, "twist", (3,))[None])[0]
    if len(support.facets) == 0:
        raise InputError(
            "contact", "expected a wrench cone with facets; these contacts balance every load, and nothing breaks them"
        )
    best: tuple[float, float, FloatArray, FloatArray, FloatArray] | None = None
    for facet in support.facets:
        columns, weights = np.empty((4, 4)), np.empty(4)
        begin(support.first, support.coms, columns)
        lower, upper = envelope(support.vertices, support.coms, facet, v, 0.0, 0.0, columns, weights)
        if best is None or lower < best[0] - CERTIFICATE_TOLERANCE:
            best = (lower, upper, facet, columns, weights)
    assert best is not None
    lower, upper, facet, columns, weights = best
    used = (columns[:, 3] == 1) & (weights > _NO_SHARE)
    points, shares = columns[used, :2], weights[used] / weights[used].sum()
    velocity = np.stack((v[0] - v[2] * points[:, 1], v[1] + v[2] * points[:, 0]), axis=-1)
    harm = -np.stack((facet[0] - facet[2] * points[:, 1], facet[1] + facet[2] * points[:, 0]), axis=-1)
    rests = np.linalg.norm(velocity, axis=1) <= 1e-11 * abs(v[2])
    forces = shares[:, None] * unit(np.where(rests[:, None], harm, velocity))
    points = points * support.rho
    torque = float((points[:, 0] * forces[:, 1] - points[:, 1] * forces[:, 0]).sum())
    return WorstPressure(
        height=float(lower),
        gap=float(upper - lower),
        points=read_only(points),
        shares=read_only(shares),
        forces=read_only(forces),
        load=read_only(np.append(forces.sum(axis=0), torque)),
    )


def _trace(support: _Support, facet: FloatArray, others: FloatArray) -> FloatArray | None:
    """Unit normalised twists (n, 3) once round the motions whose load stays inside one facet under every pressure.

    None where ``a`` is a mere torque about the COM: friction's torque has the sense of the turn.

    Friction is ``F = ∂h/∂V`` of a convex ``h``, so ``a·F`` grows along ``a``: on the great circle from ``a`` to ``-a`` a
    motion is inside up to one place.
    """
    from stablepush.stability.kernels.envelope import edges

    if np.linalg.norm(support.rim(facet), axis=1).max() < _TORQUE_ONLY:
        return None
    helper = np.eye(3)[int(np.argmin(np.abs(facet)))]
    first = unit(helper - (helper @ facet) * facet)
    second = np.cross(facet, first)

    def edge(azimuth: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
        across = np.cos(azimuth)[:, None] * first + np.sin(azimuth)[:, None] * second
        angles = np.empty(len(azimuth))
        level = -CERTIFICATE_TOLERANCE
        edges(support.vertices, support.coms, support.first, facet, across, low, high, _ANGLE_TOLERANCE, level, angles)
        return angles, np.asarray(np.cos(angles)[:, None] * facet + np.sin(angles)[:, None] * across)

    azimuth = np.linspace(0.0, 2 * np.pi, _FIRST_AZIMUTHS)
    angles, twists = edge(azimuth, np.full(len(azimuth), np.pi / 3), np.full(len(azimuth), 2 * np.pi / 3))
    # what is far outside other facets is no boundary of the region
    near = support.holds(twists, others, -_FAR_OUTSIDE)
    for _ in range(_MOST_ROUNDS):
        parts = cut_parts(twists, np.zeros(len(twists), dtype=int))
        coarse = np.maximum(1, np.ceil(np.linalg.norm(np.diff(twists, axis=0), axis=1) / _WIDE)).astype(int)
        parts = np.where(near[:-1] | near[1:], np.maximum(parts, coarse), coarse)
        if parts.max() == 1:
            break
        if parts.sum() > _MOST_POINTS:
            raise ConvergenceError("all-pressure region: cannot trace its boundary: is a contact very near the centre of mass?")
        at, share = new_places(parts)
        new = azimuth[at] + (azimuth[at + 1] - azimuth[at]) * share
        guess = angles[at] + (angles[at + 1] - angles[at]) * share
        padding = 0.05 * np.abs(angles[at + 1] - angles[at]) + 1e-5
        new_angles, new_twists = edge(new, guess - padding, guess + padding)
        twists = np.insert(twists, at + 1, new_twists, axis=0)
        near = np.insert(near, at + 1, support.holds(new_twists, others, -_FAR_OUTSIDE))
        azimuth, angles = np.insert(azimuth, at + 1, new), np.insert(angles, at + 1, new_angles)
    return twists[:-1]


def _facet_disc(support: _Support, facet: FloatArray, boundary: FloatArray | None, sense: int) -> shapely.Geometry:
    """In the chart of one hemisphere, the motions whose load stays inside one facet under every pressure."""
    if boundary is None:
        # with all pressure at the COM only the little force is left, and its sign counts
        part = whole_disc() if sense * facet[2] > 0 else shapely.Polygon()
        for x, y in support.rim(facet):
            if np.hypot(x, y) >= CERTIFICATE_TOLERANCE:
                across = 4 * sense * unit(np.array((-y, x)))
                along = np.array((-across[1], across[0]))
                part = shapely.intersection(part, shapely.Polygon((along, -along, across - along, across + along)))
        return part
    return hemisphere(boundary, sense)


def _translations(support: _Support) -> tuple[Interval, ...]:
    """Directions (rad) that keep within a right angle of every bound; between neighbouring ends all are alike."""
    bounds = np.concatenate([support.rim(facet) for facet in support.facets])
    bounds = bounds[np.linalg.norm(bounds, axis=1) > 1e-12]
    if not len(bounds):
        return ((0.0, 2 * np.pi),)
    across = np.arctan2(bounds[:, 1], bounds[:, 0])
    ends = np.sort(np.mod(np.concatenate((across - np.pi / 2, across + np.pi / 2)), 2 * np.pi))
    # bounds that are opposite leave one direction, known from both of them
    ends = ends[np.diff(ends, append=ends[0] + 2 * np.pi) > 1e-12]

    def holds(angles: FloatArray) -> BoolArray:
        directions = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
        return np.asarray((directions @ unit(bounds).T >= -1e-12).all(axis=1))

    following = np.append(ends[1:], ends[0] + 2 * np.pi)
    open_parts = [(float(a), float(b)) for a, b, good in zip(ends, following, holds((ends + following) / 2), strict=True) if good]
    wide = [part for part in open_parts if part[1] - part[0] > 1e-12]
    if wide:
        # a convex cone of directions is one interval
        low = min(wide, key=lambda part: -((part[0] - wide[-1][1]) % (2 * np.pi)))[0]
        return ((low, low + sum(b - a for a, b in wide)),)
    return tuple((float(a), float(a)) for a in ends[holds(ends)])
