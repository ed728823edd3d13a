"""The pushed object: a rigid outline on the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush._arrays import LEAST_POSITIVE, FloatArray, check_array, check_zero_or_positive, read_only
from stablepush.errors import InputError
from stablepush.support import SupportDistribution


@dataclass(frozen=True, slots=True, eq=False)
class Slider:
    """A slider with a simple polygonal outline.

    Parameters
    ----------
    vertices : array-like, shape (n, 2)
        Outline in the body frame B (m), counter-clockwise; the origin of B is the projection of the centre of mass.
    mass : float, optional
        Mass in kg.
    support : SupportDistribution, optional
        Pressure that is believed to act under the slider.
    """

    vertices: FloatArray
    mass: float | None
    support: SupportDistribution | None

    def __init__(self, vertices: ArrayLike, mass: float | None = None, support: SupportDistribution | None = None) -> None:
        object.__setattr__(self, "vertices", read_only(check_outline(vertices, "slider.vertices")))
        object.__setattr__(self, "mass", None if mass is None else check_zero_or_positive(mass, "slider.mass"))
        object.__setattr__(self, "support", support)

    @property
    def polygon(self) -> shapely.Polygon:
        """The outline as a shapely polygon in B."""
        return shapely.Polygon(self.vertices)

    @property
    def radius(self) -> float:
        """Distance (m) from the origin of B to the farthest point of the outline."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @property
    def radius_of_gyration(self) -> float:
        """Radius of gyration (m) of a mass spread evenly over the outline, about the origin of B.

        ``k^2 = (1/A) ∫ |x|^2 dA``, by Green's theorem over the edges.
        """
        p, q = self.vertices, np.roll(self.vertices, -1, axis=0)
        cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        second = (cross * ((p * p).sum(axis=1) + (p * q).sum(axis=1) + (q * q).sum(axis=1))).sum() / 12
        return float(np.sqrt(second / (cross.sum() / 2)))

    @property
    def support_vertices(self) -> FloatArray:
        """Vertices (n, 2) of the convex hull of all places that can press on the table (m, in B), counter-clockwise.

        The hull of the support points if the slider has a support, else of the outline. Two points or one remain when
        the support is a segment or a point.
        """
        points = self.vertices if self.support is None else self.support.points
        hull = shapely.orient_polygons(shapely.convex_hull(shapely.MultiPoint(points)))
        coordinates = shapely.get_coordinates(hull)
        return coordinates[:-1] if isinstance(hull, shapely.Polygon) else coordinates

    @property
    def characteristic_length(self) -> float:
        """``rho`` (m): the radius of gyration of the nominal pressure, of an even one over the outline if unknown."""
        rho = self.radius_of_gyration if self.support is None else self.support.characteristic_length
        return rho if rho > 0 else self.radius_of_gyration

    def edge(self, index: int) -> tuple[FloatArray, FloatArray]:
        """Return the ends (2,), (2,) of an edge: from vertex ``index`` to the next, in B."""
        n = len(self.vertices)
        if not 0 <= index < n:
            raise InputError(f"edge: expected 0 to {n - 1}, got {index}")
        return self.vertices[index], self.vertices[(index + 1) % n]


def check_outline(vertices: ArrayLike, name: str) -> FloatArray:
    """Return the vertices of a simple, counter-clockwise polygon (n, 2), or say what is wrong with them."""
    outline = check_simple_polygon(vertices, name)
    if signed_area(outline) < 0:
        raise InputError(f"{name}: expected counter-clockwise order, got a clockwise outline")
    return outline


def check_simple_polygon(vertices: ArrayLike, name: str) -> FloatArray:
    """Return the vertices (n, 2) of a simple polygon of either orientation, or say what is wrong with them."""
    outline = check_array(vertices, name, (None, 2))
    if len(outline) < 3:
        raise InputError(f"{name}: expected at least 3 vertices, got {len(outline)}")
    lengths = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
    if (lengths == 0).any():
        edge = int(np.argmin(lengths))
        raise InputError(f"{name}: expected distinct neighbouring vertices, edge {edge} has zero length")
    if not shapely.LinearRing(outline).is_simple:
        raise InputError(f"{name}: expected edges that do not cross or touch")
    if abs(signed_area(outline)) < LEAST_POSITIVE**2:
        raise InputError(f"{name}: expected an area of at least {LEAST_POSITIVE**2:g} m^2")
    return outline


def signed_area(outline: FloatArray) -> float:
    """Area (m^2) of a polygon (n, 2), negative if it runs clockwise."""
    following = np.roll(outline, -1, axis=0)
    return float((outline[:, 0] * following[:, 1] - outline[:, 1] * following[:, 0]).sum() / 2)
