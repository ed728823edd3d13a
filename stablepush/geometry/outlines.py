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


def contacts_on_outline(outline: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where round fingers with centres (n, 2) touch an outline: the nearest places (n, 2), the unit inward normals (n, 2)
    there, and the distances (n,) of the centres, negative inside.

    The normal is that of the edge, at a corner the direction from the centre.
    """
    near, where = nearest_on_outline(outline, points)
    inside = shapely.contains_xy(shapely.Polygon(outline), *points.T)
    offset = near - points
    away = np.linalg.norm(offset, axis=1)
    lengths = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
    ends = np.cumsum(lengths)
    edge = np.clip(np.searchsorted(ends, where + 1e-9, side="right"), 0, len(outline) - 1)
    along = (np.roll(outline, -1, axis=0) - outline) / lengths[:, None]
    inward = np.stack((-along[edge, 1], along[edge, 0]), axis=-1)
    start = ends[edge] - lengths[edge]
    corner = (np.abs(where - start) < 1e-9) | (np.abs(where - ends[edge]) < 1e-9)
    use = corner & (away > 1e-9) & ~inside
    inward[use] = offset[use] / away[use, None]
    return near, inward, np.where(inside, -away, away)
