"""A centre of mass that is known to lie in a box."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray, InputError

#: Least distance from an edge of the hull, over the length of the edge.
_INSIDE = 1e-9


def box_corners(com_tolerance: ArrayLike) -> FloatArray:
    """Return the corners (k, 2), in m, of the box of half widths ``com_tolerance`` about the origin, each once."""
    try:
        tolerance = np.atleast_1d(np.asarray(com_tolerance, dtype=np.float64))
    except (TypeError, ValueError):
        raise InputError("com_tolerance", "expected one or two half widths >= 0 in m", repr(com_tolerance)) from None
    if tolerance.shape not in ((1,), (2,)) or not np.isfinite(tolerance).all() or (tolerance < 0).any():
        raise InputError("com_tolerance", "expected one or two half widths >= 0 in m", repr(com_tolerance))
    box = np.broadcast_to(tolerance, (2,))
    return np.unique(np.array(((1, 1), (-1, 1), (-1, -1), (1, -1))) * box, axis=0)


def require_inside(hull: FloatArray, centers: FloatArray) -> None:
    """Raise an :class:`InputError` unless all centres of mass (k, 2) are inside of the hull (n, 2) of the support."""
    edges = np.roll(hull, -1, axis=0) - hull
    away = centers[:, None] - hull
    height = edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0]
    if len(hull) < 3 or (height < _INSIDE * (edges**2).sum(axis=1)).any():
        raise InputError("slider", "expected the centre of mass, with its tolerance, inside the hull of the support")
