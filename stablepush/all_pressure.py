"""What holds for every pressure distribution with the known centre of mass, exactly (:mod:`stablepush._envelope`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush._arrays import BoolArray, FloatArray, check_number, check_vectors, read_only
from stablepush._chart import Rings, disc_from_twists, make_polygons, only_polygons, rim, rings_from_disc
from stablepush.contact import PushContact
from stablepush.errors import InputError
from stablepush.planar import unit
from stablepush.region import EXTENT_RADII, Interval, StableRegion, cut_parts, everywhere
from stablepush.slider import Slider

#: A load may leave the cone by this much, for a friction load of one, and still count as on its boundary.
CERTIFICATE_TOLERANCE = 1e-10
_FIRST_AZIMUTHS = 65
#: The boundary of one facet is refined where the load is no farther than this (of the friction load) outside the others, and
#: everywhere to gaps (rad) in which it does not change by as much.
_FAR_OUTSIDE, _WIDE = 0.02, 0.05
_MOST_ROUNDS = 8
#: How near (rad) to the boundary its vertices lie, on the inner side.
_ANGLE_TOLERANCE = 1e-8


@dataclass(frozen=True, slots=True, eq=False)
class WorstPressure:
    """The pressure distribution that comes nearest to breaking a push, or breaks it.

    Attributes
    ----------
    height : float
        Least ``a·F`` over all facets ``a`` of the cone and all pressures, for a friction load of one; the push can break if and
        only if it is negative. ``a`` and ``F`` are normalised by the radius of the support.
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
    """Support polygon, places of the COM and facets of the cone, in units of the support's radius."""

    def __init__(self, slider: Slider, contact: PushContact, com_tolerance: ArrayLike) -> None:
        vertices = slider.support_vertices
        if len(vertices) < 3:
            raise InputError("slider: expected support points that are not all on a line")
        tolerance = np.atleast_1d(np.asarray(com_tolerance, dtype=np.float64))
        if tolerance.shape not in ((1,), (2,)) or not np.isfinite(tolerance).all() or (tolerance < 0).any():
            raise InputError(f"com_tolerance: expected one or two half widths >= 0 in m, got {com_tolerance!r}")
        box = np.broadcast_to(tolerance, (2,))
        self.rho = float(np.linalg.norm(vertices, axis=1).max())
        self.vertices = np.ascontiguousarray(vertices / self.rho)
        corners = np.unique(np.array(((1, 1), (-1, 1), (-1, -1), (1, -1))) * box, axis=0)
        self.coms = np.ascontiguousarray(corners / self.rho)
        self.first = self._triangle()
        self.cone = contact.cone(self.rho)
        self.facets = np.ascontiguousarray(self.cone.normals)

    def _triangle(self) -> FloatArray:
        """Three vertices (3, 2) whose triangle holds the first place of the COM; every place must be inside the polygon."""
        v = self.vertices
        edges = np.roll(v, -1, axis=0) - v
        for z in self.coms:
            height = edges[:, 0] * (z[1] - v[:, 1]) - edges[:, 1] * (z[0] - v[:, 0])
            if (height < 1e-9 * np.linalg.norm(edges, axis=1)).any():
                raise InputError("slider: expected the centre of mass, with its tolerance, inside the hull of the support")
        found = []
        for i in range(1, len(v) - 1):
            corners = v[[0, i, i + 1]]
            shares = np.linalg.solve(np.vstack((corners.T, np.ones(3))), np.append(self.coms[0], 1.0))
            found.append((float(shares.min()), i))
        i = max(found)[1]
        return np.ascontiguousarray(v[[0, i, i + 1]])

    def normalized(self, twists: FloatArray) -> FloatArray:
        v = unit(twists * (1.0, 1.0, self.rho))
        if not v.any(axis=1).all():
            raise InputError("twists: expected twists that are not zero")
        return np.ascontiguousarray(v)

    def holds(self, twists: FloatArray, facets: FloatArray, level: float = -CERTIFICATE_TOLERANCE) -> BoolArray:
        """Whether ``a·F >= level`` under every pressure, for unit normalised twists (n, 3) and all facets ``a`` (m, 3)."""
        from stablepush._envelope import envelopes

        lower, upper = np.empty(len(twists)), np.empty(len(twists))
        envelopes(self.vertices, self.coms, self.first, facets, twists, level, lower, upper)
        return np.asarray(lower >= level)

    def rim(self, facet: FloatArray) -> FloatArray:
        """Vectors (k, 2) with which the direction of a translation must make no more than a right angle."""
        # the load of a translation d is d at the COM z: a·(d, z × d) = (a_xy + a_tau J z)·d
        return facet[:2] + facet[2] * np.stack((-self.coms[:, 1], self.coms[:, 0]), axis=-1)


def all_pressure_region(
    slider: Slider, contact: PushContact, *, mu: tuple[float, float] | None = None, com_tolerance: ArrayLike = 0.0
) -> StableRegion:
    """Return the motions for which a push is stable under every pressure distribution with the slider's centre of mass.

    A motion ``V`` is in it if and only if for every facet ``a`` of the composite wrench cone ``min Σ m g(x) >= 0`` over ``m >= 0,
    Σ m = 1, Σ m x = COM``, with ``g(x) = (a_x - a_tau y, a_y + a_tau x)·v(x)/|v(x)|``. The minimum is found exactly over the
    whole support polygon, the hull of the slider's support points or of its outline: membership is proven to 1e-10 of the
    friction load. Lynch and Mason's STABLE (1996) is a part of this region.

    For one facet the accepted twists are star-shaped about ``a`` on the unit sphere (friction is the gradient of a convex
    function), so the boundary is one root an azimuth, traced to :data:`stablepush.region.BOUNDARY_TOLERANCE`; its
    vertices are accepted.

    Parameters
    ----------
    slider : Slider
    contact : PushContact
    mu : pair of floats, optional
        Interval of the friction coefficient at the contact; the cone grows with it, so its lower end decides. The contact's
        own if not given.
    com_tolerance : float or array-like, shape (2,)
        Half widths (m) of a box about the origin of B in which the centre of mass may lie.

    Raises
    ------
    InputError
        If the support is a segment or a point, or the centre of mass is not inside it.
    """
    if mu is not None:
        try:
            low, high = mu
        except (TypeError, ValueError):
            raise InputError(f"mu: expected an interval of two numbers, got {mu!r}") from None
        if check_number(low, "mu", at_least=0.0) > check_number(high, "mu", at_least=0.0):
            raise InputError(f"mu: expected the lower end first, got {mu!r}")
        contact = PushContact(contact.points, contact.normals, low)
    support = _Support(slider, contact, com_tolerance)
    extent = EXTENT_RADII * max(slider.radius, contact.radius)

    def accepts(twists: FloatArray) -> BoolArray:
        return support.holds(support.normalized(twists), support.facets)

    def rings(sense: int) -> Rings:
        if not support.cone.is_solid_and_pointed:
            return []
        parts = [
            _facet_disc(support, facet, boundary, sense) for facet, boundary in zip(support.facets, boundaries(), strict=True)
        ]
        return rings_from_disc(shapely.intersection_all(parts), sense)

    known: list[FloatArray] = []

    def boundaries() -> list[FloatArray]:
        if not known:
            known.extend(_trace(support, facet, np.delete(support.facets, i, axis=0)) for i, facet in enumerate(support.facets))
        return known

    if len(support.facets) == 0:
        return StableRegion("all-pressure", support.rho, extent, ((0.0, 2 * np.pi),), accepts, everywhere(extent, support.rho))
    return StableRegion("all-pressure", support.rho, extent, _translations(support), accepts, rings)


def worst_pressure(slider: Slider, contact: PushContact, twist: ArrayLike, *, com_tolerance: ArrayLike = 0.0) -> WorstPressure:
    """Return the pressure distribution that does most to break a push with body twist (3,).

    It has at most three points. The bounds of its ``height`` are proven, one by this distribution, the other by duality
    (:func:`all_pressure_region` has the equations).
    """
    from stablepush._envelope import envelope

    support = _Support(slider, contact, com_tolerance)
    v = support.normalized(check_vectors(twist, "twist", 3).reshape(1, 3))[0]
    if len(support.facets) == 0:
        raise InputError(
            "contact: expected a wrench cone with facets; these contacts balance every load, and nothing breaks them"
        )
    best: tuple[float, float, FloatArray, FloatArray, FloatArray] | None = None
    for facet in support.facets:
        columns, weights = np.empty((4, 4)), np.empty(4)
        lower, upper = envelope(support.vertices, support.coms, support.first, facet, v, False, 0.0, columns, weights)
        if best is None or lower < best[0]:
            best = (lower, upper, facet, columns, weights)
    assert best is not None
    lower, upper, facet, columns, weights = best
    used = (columns[:, 3] == 1) & (weights > 0)
    points, shares = columns[used, :2], weights[used]
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


def _trace(support: _Support, facet: FloatArray, others: FloatArray) -> FloatArray:
    """Unit normalised twists (n, 3) once round the motions whose load stays inside one facet under every pressure.

    Friction is ``F = ∂h/∂V`` of a convex ``h``, so ``a·F`` grows along ``a``: on the great circle from ``a`` to ``-a`` a
    motion is inside up to one place.
    """
    from stablepush._envelope import edges

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
    for _ in range(_MOST_ROUNDS):
        parts = cut_parts(twists, np.zeros(len(twists), dtype=int))
        # what is far outside other facets is no boundary of the region
        near = support.holds(twists, others, -_FAR_OUTSIDE)
        coarse = np.ceil(np.linalg.norm(np.diff(twists, axis=0), axis=1) / _WIDE).astype(int)
        parts = np.where(near[:-1] | near[1:], np.maximum(parts, coarse), coarse)
        gaps = np.flatnonzero(parts > 1)
        if not len(gaps):
            break
        extra = parts[gaps] - 1
        at = np.repeat(gaps, extra)
        share = (1 + np.arange(len(at)) - np.repeat(np.cumsum(extra) - extra, extra)) / parts[at]
        new = azimuth[at] + (azimuth[at + 1] - azimuth[at]) * share
        guess = angles[at] + (angles[at + 1] - angles[at]) * share
        room = 0.05 * np.abs(angles[at + 1] - angles[at]) + 1e-5
        new_angles, new_twists = edge(new, guess - room, guess + room)
        twists = np.insert(twists, at + 1, new_twists, axis=0)
        azimuth, angles = np.insert(azimuth, at + 1, new), np.insert(angles, at + 1, new_angles)
    return twists[:-1]


def _facet_disc(support: _Support, facet: FloatArray, boundary: FloatArray, sense: int) -> shapely.Geometry:
    """In the chart of one hemisphere, the motions whose load stays inside one facet under every pressure."""
    inside = sense * boundary[:, 2] >= 0
    if inside.all() or not inside.any():
        # the boundary keeps to the hemisphere of its facet
        return (
            make_polygons(_closed(disc_from_twists(boundary, sense)))
            if inside.all() and sense * facet[2] > 0
            else shapely.Polygon()
        )
    enters = np.flatnonzero(inside & ~np.roll(inside, 1))
    parts = []
    for start in enters:
        chain = np.roll(boundary, -start, axis=0)
        kept = np.roll(inside, -start)
        length = len(kept) if kept.all() else int(np.argmin(kept))
        ends = [_on_rim(boundary[start - 1], boundary[start]), _on_rim(chain[length - 1], chain[length % len(chain)])]
        parts.append((ends[0], chain[:length], ends[1]))
    if len(parts) != 1:
        parts = [max(parts, key=lambda part: len(part[1]))]
    begin, chain, end = parts[0]
    angle = [float(np.arctan2(*disc_from_twists(p[None], sense)[0][::-1])) for p in (end, begin)]
    # of the two arcs of the rim the stable one: its middle makes an acute angle with every bound
    span = (angle[1] - angle[0]) % (2 * np.pi)
    arcs = [rim(angle[0], angle[0] + span), rim(angle[0], angle[0] + span - 2 * np.pi)]
    middles = [angle[0] + span / 2, angle[0] + span / 2 - np.pi]
    heights = [float((support.rim(facet) @ (sense * np.sin(m), -sense * np.cos(m))).min()) for m in middles]
    ring = np.concatenate((disc_from_twists(np.concatenate((begin[None], chain)), sense), arcs[int(np.argmax(heights))]))
    return only_polygons(make_polygons(_closed(ring)))


def _closed(ring: FloatArray) -> FloatArray:
    return np.concatenate((ring, ring[:1]))


def _on_rim(a: FloatArray, b: FloatArray) -> FloatArray:
    """Where the chord between two twists (3,) passes through translation."""
    share = a[2] / (a[2] - b[2]) if a[2] != b[2] else 0.0
    at = unit(a + share * (b - a))
    return np.asarray(at * (1.0, 1.0, 0.0))


def _translations(support: _Support) -> tuple[Interval, ...]:
    """Directions (rad) that keep within a right angle of every bound; between neighbouring ends all are alike."""
    bounds = np.concatenate([support.rim(facet) for facet in support.facets])
    bounds = bounds[np.linalg.norm(bounds, axis=1) > 1e-12]
    if not len(bounds):
        return ((0.0, 2 * np.pi),)
    across = np.arctan2(bounds[:, 1], bounds[:, 0])
    ends = np.unique(np.mod(np.concatenate((across - np.pi / 2, across + np.pi / 2)), 2 * np.pi))

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
