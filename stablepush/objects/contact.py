"""Contacts of a pusher with a slider."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import LEAST_POSITIVE, FloatArray, InputError, check_array, check_number, note_friction, read_only
from stablepush.geometry import unit, wrench_from_force
from stablepush.objects.slider import Slider
from stablepush.objects.wrench_cone import WrenchCone

#: Mean normals shorter than this are rounding.
_CANCELLED = 1e-9
#: Normals that differ by less are one.
_SAME_NORMAL = 1e-9


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
            raise InputError("contact.points", "expected at least one point")
        if np.ndim(normals) == 1 and np.shape(normals) == (2,):
            normals = np.tile(np.asarray(normals), (len(p), 1))
        n = check_array(normals, "contact.normals", (None, 2))
        if len(n) != len(p):
            raise InputError("contact.normals", f"expected {len(p)} normals, one a point", len(n))
        for i, j in combinations(range(len(p)), 2):
            if np.abs(p[i] - p[j]).max() < LEAST_POSITIVE:
                raise InputError("contact.points", f"expected distinct points, points {i} and {j} are equal")
        if (np.abs(n).max(axis=1) < LEAST_POSITIVE).any():
            raise InputError("contact.normals", "expected normals of positive length")
        object.__setattr__(self, "points", read_only(p))
        object.__setattr__(self, "normals", read_only(unit(n)))
        object.__setattr__(self, "mu", check_number(mu, "contact.mu", at_least=0.0))
        note_friction(self.mu, "contact.mu")

    @classmethod
    def on_edge(cls, slider: Slider, edge: int, center: float, width: float, mu: float) -> PushContact:
        """Return two fingers on an edge of the slider.

        ``center`` (m) is the arc length along the edge from its first vertex to the point midway between the fingers, ``width``
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
                "center, width",
                f"expected fingers on edge {edge}, 0 to {length:g} m along it",
                f"{middle - half:g} to {middle + half:g}",
            )
        offsets = [middle] if half == 0 else [middle - half, middle + half]
        points = np.array([start + s * along for s in offsets])
        return cls(points, np.tile((-along[1], along[0]), (len(points), 1)), mu)

    @property
    def frame(self) -> FloatArray:
        """Pose (3,) of the pusher frame in B, its origin midway between the points, its x axis along the mean inward normal.

        Along the first point's normal where the normals cancel out, as those of fingers that hold the slider between them do.
        """
        mean = self.normals.mean(axis=0)
        normal = unit(mean) if np.linalg.norm(mean) > _CANCELLED else self.normals[0]
        return np.array((*self.points.mean(axis=0), np.arctan2(normal[1], normal[0])))

    @property
    def has_one_normal(self) -> bool:
        """Whether all points share a normal, as fingers on one edge do."""
        return bool(np.abs(self.normals - self.normals[0]).max() < _SAME_NORMAL)

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
        return _cone(self, float(rho))


@lru_cache(maxsize=64)
def _cone(contact: PushContact, rho: float) -> WrenchCone:
    """The cone of a contact, which never changes: the surfaces of an ensemble ask for it one after the other."""
    return WrenchCone.from_rays(read_only(contact.rays(rho)))
