"""Outlines: where they are nearest to points."""

from __future__ import annotations

import numpy as np
import shapely

from stablepush.core import FloatArray


def nearest_on_outline(outline: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the points (n, 2) of an outline that are nearest to points (n, 2), and their lengths (n,) along it from its first
    vertex; NaN where a point is.

    ``outline`` (m, 2): vertices of a polygon, the last is joined to the first.
    """
    ring, known = shapely.LinearRing(outline), np.isfinite(points).all(axis=1)
    near, along = np.full(points.shape, np.nan), np.full(len(points), np.nan)
    along[known] = shapely.line_locate_point(ring, shapely.points(points[known]))
    near[known] = shapely.get_coordinates(shapely.line_interpolate_point(ring, along[known]))
    return near, along
