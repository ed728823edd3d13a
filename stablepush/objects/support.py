"""Where and how much a slider presses on the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike

from stablepush.core import LEAST_POSITIVE, FloatArray, InputError, check_array, check_number, read_only

#: Points that a repr lists at most.
_SHOWN = 8


@dataclass(frozen=True, slots=True, eq=False)
class SupportDistribution:
    """Pressure of a slider on the table, concentrated at points.

    Parameters
    ----------
    points : array-like, shape (n, 2)
        Support points in the body frame, in m.
    weights : array-like, shape (n,)
        Non-negative shares of the normal load; they are normalised to sum to one.
    """

    points: FloatArray
    weights: FloatArray

    def __repr__(self) -> str:
        if len(self.points) > _SHOWN:
            x, y = self.center
            return f"SupportDistribution({len(self.points)} points, centre ({x:.4g}, {y:.4g}) m)"
        return f"SupportDistribution(points={self.points.tolist()}, weights={self.weights.tolist()})"

    def __init__(self, points: ArrayLike, weights: ArrayLike) -> None:
        p = check_array(points, "support.points", (None, 2))
        w = check_array(weights, "support.weights", (None,))
        if len(p) == 0:
            raise InputError("support.points", "expected at least one point")
        if len(p) != len(w):
            raise InputError("support.weights", f"expected {len(p)} weights, one a point", len(w))
        if (w < 0).any():
            raise InputError("support.weights", "expected weights >= 0", f"{w.min():g}")
        # areas of cells may be weights
        if w.max() < LEAST_POSITIVE**2:
            raise InputError("support.weights", f"expected one of at least {LEAST_POSITIVE**2:g}, the largest is {w.max():g}")
        w = w / w.max()
        object.__setattr__(self, "points", read_only(p))
        object.__setattr__(self, "weights", read_only(w / w.sum()))

    @classmethod
    def from_polygon(cls, vertices: ArrayLike, spacing: float) -> SupportDistribution:
        """Return uniform pressure over a polygon, cut into square cells of side ``spacing`` (m).

        Each cell is represented by the centroid and the area of its part inside the polygon, so that total load and
        centre of pressure are exact at every spacing.
        """
        outline = check_array(vertices, "vertices", (None, 2))
        step = check_number(spacing, "spacing", positive=True)
        polygon = shapely.Polygon(outline)
        low, high = outline.min(axis=0), outline.max(axis=0)
        counts = np.maximum(1, np.ceil((high - low) / step - 1e-9)).astype(int)
        if counts.prod() > 4_000_000:
            raise InputError("spacing", "expected a spacing that gives at most 4 million cells", f"{step:g}")
        corners = low + np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(-1, 2) * step
        cells = shapely.intersection(shapely.box(*corners.T, *(corners + step).T), polygon)
        area = shapely.area(cells)
        # slivers that rounding leaves along the outline carry nothing
        inside = area > 1e-9 * area.max()
        return cls(shapely.get_coordinates(shapely.centroid(cells[inside])), area[inside])

    @classmethod
    def ring(cls, radius: float, n: int) -> SupportDistribution:
        """Return ``n`` equal support points on a circle of ``radius`` (m) about the origin, the first on the x axis."""
        r = check_number(radius, "radius", positive=True)
        if n < 1:
            raise InputError("n", "expected at least one point", n)
        angles = 2 * np.pi * np.arange(n) / n
        return cls(r * np.stack((np.cos(angles), np.sin(angles)), axis=-1), np.ones(n))

    @property
    def center(self) -> FloatArray:
        """Centre of pressure (2,), in m."""
        return np.asarray(self.weights @ self.points)

    @property
    def characteristic_length(self) -> float:
        """``rho = sqrt(sum m |x|^2 / sum m)`` (m), the radius of gyration of the pressure about the origin of B."""
        return float(np.sqrt(self.weights @ (self.points**2).sum(axis=1)))
