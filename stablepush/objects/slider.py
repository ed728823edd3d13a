"""The pushed object: a rigid outline on the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import (
    LEAST_POSITIVE,
    FloatArray,
    InputError,
    check_array,
    check_count,
    check_number,
    note_mass,
    note_part,
    note_pressure,
    note_size,
    read_only,
)
from stablepush.objects.support import SupportDistribution

#: Least radius (m) of a slider: poses and overlaps are resolved to 1e-6 m, and pushes are simulated in steps of 1/400 of it.
_LEAST_RADIUS = 1e-5
#: Least distance of the origin of B from the edges of the outline's hull, in radii of the slider: nearer to an edge, all of the
#: pressure would have to be on it, and the friction of the others could not be computed.
_LEAST_INSIDE = 1e-6
#: An outline that is wider (m) is one in mm.
_MILLIMETRES = 6.0


@dataclass(frozen=True, slots=True, eq=False)
class Slider:
    """A slider with a simple polygonal outline.

    Parameters
    ----------
    vertices : array-like, shape (n, 2)
        Outline in the body frame B (m), counter-clockwise. The origin of B is the projection of the centre of mass, so it lies
        inside the outline's hull; :meth:`centered` moves an outline there.
    mass : float, optional
        Mass in kg.
    support : SupportDistribution, optional
        Pressure that is believed to act under the slider.

    Raises
    ------
    InputError
        For an outline that is no simple counter-clockwise polygon about the origin, or a mass that is not positive.
    """

    vertices: FloatArray
    mass: float | None
    support: SupportDistribution | None

    def __init__(self, vertices: ArrayLike, mass: float | None = None, support: SupportDistribution | None = None) -> None:
        outline = check_outline(vertices, "slider.vertices")
        radius = float(np.linalg.norm(outline, axis=1).max())
        if radius < _LEAST_RADIUS:
            raise InputError("slider.vertices", f"expected a radius of at least {_LEAST_RADIUS:g} m", f"{radius:g} m")
        _require_origin(outline, "slider.vertices")
        object.__setattr__(self, "vertices", read_only(outline))
        object.__setattr__(self, "mass", None if mass is None else check_number(mass, "slider.mass", positive=True))
        object.__setattr__(self, "support", support)
        note_size(self.radius, "slider.vertices")
        if self.support is not None:
            note_part(self.support.points, self.radius, "slider.support")
            note_pressure(self.support.center, self.radius, "slider.support.weights")
        if self.mass is not None:
            note_mass(self.mass, self.polygon.convex_hull.area, "slider.mass")

    @classmethod
    def centered(cls, vertices: ArrayLike, mass: float | None = None) -> Slider:
        """Return a slider whose outline (n, 2), in m in any frame of the user's, is moved until its centroid is the origin of B.

        The centroid of the area is the centre of mass of a flat body of even thickness and density.
        """
        outline = check_outline(vertices, "vertices")
        return cls(outline - shapely.get_coordinates(shapely.Polygon(outline).centroid)[0], mass)

    @classmethod
    def rectangle(
        cls, width: float, height: float, mass: float | None = None, support: SupportDistribution | None = None
    ) -> Slider:
        """Return a rectangle about the origin, ``width`` along x and ``height`` along y (m); edge 0 is the lower one."""
        half = np.array((check_number(width, "width", positive=True), check_number(height, "height", positive=True))) / 2
        return cls(half * ((-1, -1), (1, -1), (1, 1), (-1, 1)), mass, support)

    @classmethod
    def regular_polygon(cls, n: int, radius: float, mass: float | None = None) -> Slider:
        """Return a regular polygon of ``n`` vertices on a circle of ``radius`` (m) about the origin, the first on the x axis."""
        if check_count(n, "n", most=10_000) < 3:
            raise InputError("n", "expected at least 3 vertices", n)
        angles = 2 * np.pi * np.arange(n) / n
        return cls(check_number(radius, "radius", positive=True) * np.stack((np.cos(angles), np.sin(angles)), axis=-1), mass)

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
        """``rho`` (m), the radius of gyration of the nominal pressure, of an even one over the outline if unknown."""
        rho = self.radius_of_gyration if self.support is None else self.support.characteristic_length
        return rho if rho >= LEAST_POSITIVE else self.radius_of_gyration

    def edge(self, index: int) -> tuple[FloatArray, FloatArray]:
        """Return the ends (2,), (2,) of an edge: from vertex ``index`` to the next, in B."""
        n = len(self.vertices)
        if not 0 <= index < n:
            raise InputError("edge", f"expected 0 to {n - 1}", index)
        return self.vertices[index], self.vertices[(index + 1) % n]


def _require_origin(outline: FloatArray, name: str) -> None:
    """Refuse an outline (n, 2) whose hull does not hold the origin."""
    hull = shapely.get_coordinates(shapely.orient_polygons(shapely.convex_hull(shapely.MultiPoint(outline))))
    along = np.diff(hull, axis=0)
    # the distance of the origin from each edge's line, positive to the left of it
    inside = (along[:, 1] * hull[:-1, 0] - along[:, 0] * hull[:-1, 1]) / np.linalg.norm(along, axis=1)
    if inside.min() < _LEAST_INSIDE * np.linalg.norm(outline, axis=1).max():
        x, y = shapely.get_coordinates(shapely.Polygon(outline).centroid)[0]
        metres = " and divide by 1000: vertices are in m" if np.ptp(outline, axis=0).max() > _MILLIMETRES else ""
        raise InputError(
            name,
            "expected the origin, which is the centre of mass, inside the outline's hull; if the density is uniform, "
            f"subtract ({x:.6g}, {y:.6g}) from every vertex, as Slider.centered does{metres}",
        )


def check_outline(vertices: ArrayLike, name: str) -> FloatArray:
    """Return the vertices of a simple, counter-clockwise polygon (n, 2), or say what is wrong with them."""
    outline = check_simple_polygon(vertices, name)
    if signed_area(outline) < 0:
        raise InputError(name, "expected counter-clockwise order", "a clockwise outline")
    return outline


def check_simple_polygon(vertices: ArrayLike, name: str) -> FloatArray:
    """Return the vertices (n, 2) of a simple polygon of either orientation, or say what is wrong with them.

    Last vertices that repeat the first, as rings of GeoJSON, Shapely and DXF have it, are left out.
    """
    outline = check_array(vertices, name, (None, 2))
    while len(outline) > 3 and np.linalg.norm(outline[-1] - outline[0]) < LEAST_POSITIVE:
        outline = outline[:-1]
    if len(outline) < 3:
        raise InputError(name, "expected at least 3 vertices", len(outline))
    too_small = InputError(
        name,
        f"expected vertices off one line: an area of at least {LEAST_POSITIVE**2:g} m^2, and {LEAST_POSITIVE:g} m times its "
        "perimeter",
    )
    if np.ptp(outline, axis=0).prod() < LEAST_POSITIVE**2:
        raise too_small
    lengths = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
    if (lengths < LEAST_POSITIVE).any():
        edge = int(np.argmin(lengths))
        raise InputError(name, f"expected distinct neighbouring vertices, edge {edge} has zero length")
    if not shapely.LinearRing(outline).is_simple:
        raise InputError(name, "expected edges that do not cross or touch")
    if abs(signed_area(outline)) < max(LEAST_POSITIVE**2, LEAST_POSITIVE * lengths.sum()):
        raise too_small
    return outline


def signed_area(outline: FloatArray) -> float:
    """Area (m^2) of a polygon (n, 2), negative if it runs clockwise."""
    following = np.roll(outline, -1, axis=0)
    return float((outline[:, 0] * following[:, 1] - outline[:, 1] * following[:, 0]).sum() / 2)
