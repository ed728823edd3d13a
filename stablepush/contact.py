"""Contacts of a pusher with a slider, and their composite wrench cone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from stablepush._arrays import LEAST_POSITIVE, FloatArray, check_array, check_number, read_only
from stablepush.errors import InputError
from stablepush.planar import unit, wrench_from_force
from stablepush.plausibility import note_friction
from stablepush.slider import Slider

#: Rounding slack on the inner product of unit vectors when facets of a cone are found.
_FACET_SLACK = 1e-12
#: Rays that are this close (rad) to a plane or to each other span no more than it: friction this small is none.
_FLAT = 1e-7
#: Mean normals shorter than this are rounding.
_CANCELLED = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class PushContact:
    """Point contacts with Coulomb friction that act together; two on one edge are a line contact.

    Parameters
    ----------
    points : array-like, shape (n, 2)
        Contact points in the body frame B, in m. Their order has no meaning.
    normals : array-like, shape (n, 2) or (2,)
        Normals pointing into the slider; they are normalised.
    mu : float
        Coefficient of friction between pusher and slider.
    """

    points: FloatArray
    normals: FloatArray
    mu: float

    def __init__(self, points: ArrayLike, normals: ArrayLike, mu: float) -> None:
        p = check_array(points, "contact.points", (None, 2))
        if len(p) == 0:
            raise InputError("contact.points: expected at least one point")
        if np.ndim(normals) == 1 and np.shape(normals) == (2,):
            normals = np.tile(np.asarray(normals), (len(p), 1))
        n = check_array(normals, "contact.normals", (None, 2))
        if len(n) != len(p):
            raise InputError(f"contact.normals: expected {len(p)} normals, one a point, got {len(n)}")
        for i, j in combinations(range(len(p)), 2):
            if np.abs(p[i] - p[j]).max() < LEAST_POSITIVE:
                raise InputError(f"contact.points: expected distinct points, points {i} and {j} are equal")
        if (np.abs(n).max(axis=1) < LEAST_POSITIVE).any():
            raise InputError("contact.normals: expected normals of positive length")
        object.__setattr__(self, "points", read_only(p))
        object.__setattr__(self, "normals", read_only(unit(n)))
        object.__setattr__(self, "mu", check_number(mu, "contact.mu", at_least=0.0))
        note_friction(self.mu, "contact.mu")

    @classmethod
    def on_edge(cls, slider: Slider, edge: int, center: float, width: float, mu: float) -> PushContact:
        """Return two fingers on an edge of the slider.

        ``center`` (m) is the way along the edge from its first vertex to the point midway between the fingers, ``width``
        (m) their distance; a width of zero gives one finger.
        """
        start, end = slider.edge(edge)
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        middle = check_number(center, "center")
        half = check_number(width, "width", at_least=0.0) / 2
        slack = 1e-9 * length
        if middle - half < -slack or middle + half > length + slack:
            raise InputError(
                f"center, width: expected fingers on edge {edge}, 0 to {length:g} m along it, "
                f"got {middle - half:g} to {middle + half:g}"
            )
        offsets = [middle] if half == 0 else [middle - half, middle + half]
        points = np.array([start + s * along for s in offsets])
        return cls(points, np.tile((-along[1], along[0]), (len(points), 1)), mu)

    @property
    def frame(self) -> FloatArray:
        """Pose (3,) of the pusher frame in B: origin midway between the points, x axis along the mean inward normal.

        Along the first point's normal where the normals cancel out, as those of fingers that hold the slider between them do.
        """
        mean = self.normals.mean(axis=0)
        normal = unit(mean) if np.linalg.norm(mean) > _CANCELLED else self.normals[0]
        return np.array((*self.points.mean(axis=0), np.arctan2(normal[1], normal[0])))

    @property
    def radius(self) -> float:
        """Distance (m) from the origin of B to the farthest contact point."""
        return float(np.linalg.norm(self.points, axis=1).max())

    def rays(self, rho: float) -> FloatArray:
        """Return unit generators (2n, 3) of the composite cone in ``(fx, fy, tau/rho)``.

        The edges ``n + mu t`` and ``n - mu t`` of every friction cone, ``t`` being ``n`` turned left; (n, 3) without friction.
        """
        tangents = np.stack((-self.normals[:, 1], self.normals[:, 0]), axis=-1)
        signs = (1.0, -1.0) if self.mu > 0 else (0.0,)
        forces = np.concatenate([self.normals + s * self.mu * tangents for s in signs])
        wrenches = wrench_from_force(np.concatenate([self.points] * len(signs)), forces)
        return unit(wrenches / (1.0, 1.0, rho))

    def cone(self, rho: float) -> WrenchCone:
        """Return the composite wrench cone of the contacts, normalised by ``rho`` (m)."""
        return WrenchCone.from_rays(self.rays(rho))


@dataclass(frozen=True, slots=True, eq=False)
class ConeArcs:
    """Arcs ``cos(phi) first + sin(phi) second``, ``0 <= phi <= angles``, of the unit sphere: (m, 3), (m, 3), (m,)."""

    first: FloatArray
    second: FloatArray
    angles: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class WrenchCone:
    """A polyhedral cone of normalised wrenches ``(fx, fy, tau/rho)``.

    ``normals`` (m, 3) are the unit facet normals, pointing inwards: a wrench is inside when no ``a_i · F`` is negative.
    ``facets`` (m, 2, 3) holds the two extreme rays of each facet. A flat cone (one contact point, or no friction) is the
    intersection of opposite half-spaces; the whole space has no facet. ``rays`` (n, 3) generate the cone.
    """

    normals: FloatArray
    facets: FloatArray
    rank: int
    rays: FloatArray

    @classmethod
    def from_rays(cls, rays: FloatArray) -> WrenchCone:
        """Return the cone generated by unit rays (n, 3): facets are planes through two rays with all rays on one side."""
        rank = int(np.linalg.matrix_rank(rays, tol=_FLAT))
        if rank < 3:
            return cls._flat(rays, rank)
        normals: list[FloatArray] = []
        facets: list[FloatArray] = []
        first, second = np.triu_indices(len(rays), 1)
        across = np.cross(rays[first], rays[second])
        sizes = np.linalg.norm(across, axis=1)
        kept = sizes >= _FLAT
        planes, slacks = across[kept] / sizes[kept, None], _FACET_SLACK + 1e-15 / sizes[kept]
        heights = planes @ rays.T
        for sign in (1.0, -1.0):
            # the normal of two nearly parallel rays is known only so well
            for i in np.flatnonzero((sign * heights >= -slacks[:, None]).all(axis=1)):
                a = sign * planes[i]
                if any(a @ b > 1 - slacks[i] for b in normals):
                    continue
                normals.append(a)
                facets.append(_extreme_pair(rays[sign * heights[i] <= slacks[i]], a))
        return cls(read_only(np.reshape(normals, (-1, 3))), read_only(np.reshape(facets, (-1, 2, 3))), rank, rays)

    @classmethod
    def _flat(cls, rays: FloatArray, rank: int) -> WrenchCone:
        """Half-spaces of a ray, a plane sector, a line or a plane: each direction off the span comes with both signs."""
        basis = np.linalg.svd(rays)[2]
        off = basis[rank:]
        normals = [*off, *-off]
        edges = [rays[[0, 0]]] * len(normals)
        for ray in rays:
            inward = rays[0] if rank == 1 else np.cross(off[0], ray)
            for a in (inward, -inward):
                if (rays @ a >= -_FLAT).all() and not any(a @ b > 1 - _FLAT for b in normals):
                    normals.append(a)
                    edges.append(np.stack((ray, ray)))
        return cls(read_only(np.array(normals)), read_only(np.array(edges)), rank, rays)

    @property
    def is_solid_and_pointed(self) -> bool:
        """True if the cone has an interior and contains no line: then its facets bound one patch of the unit sphere."""
        if self.rank < 3 or len(self.normals) < 3:
            return False
        axis = self.normals.sum(axis=0)
        return bool((self.facets @ axis > _FACET_SLACK).all())

    @property
    def widest_margin(self) -> float:
        """Largest margin (rad) of any wrench: the angular radius of the largest circle that the facets leave on the unit sphere.

        Its middle is as far from two facets as from each other, or from three; 0 for a flat cone, pi/2 for the whole space.
        """
        if len(self.normals) == 0:
            return math.pi / 2
        candidates = [self.normals, self.rays]
        for count in (2, 3):
            for group in combinations(self.normals, count):
                # the point of the group's span that is equally far from each of them
                equal = np.linalg.lstsq(np.array(group), np.ones(count), rcond=_FLAT)[0]
                candidates.append(equal[None])
        points = np.concatenate(candidates)
        points = points[np.linalg.norm(points, axis=1) > _FLAT]
        return max(0.0, float(self.margin(points).max()))

    def arcs(self) -> ConeArcs:
        """Return the arcs on the unit sphere that bound the cone, head to tail with the cone on the left; a flat cone's own."""
        if self.rank == 3:
            chain = _chain(self.facets)
            start, end = chain[:, 0], chain[:, 1]
            return ConeArcs(start, unit(end - (end * start).sum(axis=1, keepdims=True) * start), _angles(start, end))
        first, second = np.linalg.svd(self.rays)[2][:2]
        if self.rank == 1:
            ends = np.array([s * self.rays[0] for s in (1.0, -1.0) if (self.rays @ self.rays[0] * s > 0).any()])
            return ConeArcs(ends, np.broadcast_to(second, ends.shape), np.zeros(len(ends)))
        angles = np.sort(np.arctan2(self.rays @ second, self.rays @ first))
        gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
        widest = int(np.argmax(gaps))
        # rays that leave less than half of their plane open span all of it
        span = 2 * np.pi - gaps[widest] if gaps[widest] >= np.pi - _FLAT else 2 * np.pi
        low = angles[(widest + 1) % len(angles)]
        start = np.cos(low) * first + np.sin(low) * second
        return ConeArcs(start[None], (np.cos(low) * second - np.sin(low) * first)[None], np.array([span]))

    def margin(self, wrenches: ArrayLike) -> FloatArray:
        """Return ``min_i arcsin(a_i · F/|F|)`` (rad) of normalised wrenches (..., 3): negative outside the cone.

        The whole space has the margin pi/2.
        """
        if len(self.normals) == 0:
            return np.full(np.shape(wrenches)[:-1], np.pi / 2)
        heights = unit(wrenches) @ self.normals.T
        return np.asarray(np.arcsin(np.clip(heights.min(axis=-1), -1.0, 1.0)))


def _extreme_pair(rays: FloatArray, normal: FloatArray) -> FloatArray:
    """The two rays (2, 3) of a plane that are farthest apart, in the order that keeps the cone on the left."""
    angles = rays @ rays.T
    i, j = np.unravel_index(int(np.argmin(angles)), angles.shape)
    pair = rays[[i, j]]
    (a, b, c), (d, e, f) = pair.tolist()
    turn = normal @ (b * f - c * e, c * d - a * f, a * e - b * d)
    return pair if turn >= 0 else pair[::-1]


def _chain(facets: FloatArray) -> FloatArray:
    """Order facets (m, 2, 3) head to tail, so that their outer rays run once round the cone."""
    rest = list(facets)
    chain = [rest.pop(0)]
    while rest:
        following = int(np.argmin([np.linalg.norm(f[0] - chain[-1][1]) for f in rest]))
        chain.append(rest.pop(following))
    return np.array(chain)


def _angles(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(first, second), axis=1), (first * second).sum(axis=1)))
