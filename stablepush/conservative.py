"""Stable regions that hold whatever the pressure under the slider is."""

from __future__ import annotations

import numpy as np

from stablepush._arrays import BoolArray, FloatArray
from stablepush.contact import PushContact
from stablepush.errors import UnsupportedContactError
from stablepush.planar import unit
from stablepush.region import EXTENT_RADII, StableRegion, clip_loop
from stablepush.se2 import wrap_angle
from stablepush.slider import Slider

#: Slack of the closed inequalities, relative to the size of their terms: rounding must not open the set.
_SLACK = 1e-12


def lynch_mason_region(slider: Slider, contact: PushContact) -> StableRegion:
    """Return the CORs that Lynch and Mason's procedure STABLE (1996) accepts for a line contact.

    With the support polygon's vertices ``v`` and ``r = max |v|``, the left and right ends ``p_l, p_r`` of the contact and
    the edges ``f_l = n + mu t``, ``f_r = n - mu t`` of its friction cones, a counter-clockwise COR ``c`` is accepted if
    ``c·f_l >= max v·f_l``, ``c·f_r <= min v·f_r``, ``|c - p_l| <= |c|`` and ``c·p_r <= -r²``; for clockwise ones left and
    right change places. A translation is accepted if the force along it through the COM lies in the composite cone. The
    support polygon is the hull of the slider's support points if it has them, else of its outline; ``r`` is taken over it,
    not over the contacts.

    Raises
    ------
    UnsupportedContactError
        If the contact is not at least two points on a line with one common normal across it.
    """
    left, right, normal = _line_contact(contact)
    tangent = np.array((-normal[1], normal[0]))
    edges = (normal + contact.mu * tangent, normal - contact.mu * tangent)
    vertices = slider.support_vertices
    planes = {
        1.0: _half_planes(vertices, left, right, *edges),
        -1.0: _half_planes(vertices, right, left, *reversed(edges)),
    }

    def contains(cors: FloatArray, sense: FloatArray) -> BoolArray:
        accepted = {}
        for sign, (rows, offsets) in planes.items():
            size = np.linalg.norm(rows, axis=1) * (np.linalg.norm(cors, axis=-1, keepdims=True) + slider.radius)
            accepted[sign] = (cors @ rows.T - offsets >= -_SLACK * size).all(axis=-1)
        return np.asarray(np.where(sense > 0, accepted[1.0], accepted[-1.0]))

    extent = EXTENT_RADII * max(slider.radius, contact.radius)
    return StableRegion(
        name="conservative",
        default_extent=extent,
        translations=_translations(contact, normal),
        _contains=contains,
        _loops=lambda size: [_loop(rows, offsets, sign, size) for sign, (rows, offsets) in planes.items()],
    )


def _line_contact(contact: PushContact) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Left and right end (2,) and normal (2,) of a line contact; left is along the normal turned counter-clockwise."""
    normal = contact.normals[0]
    heights = contact.points @ normal
    spread = np.ptp(contact.points @ (-normal[1], normal[0]))
    if (
        len(contact.points) < 2
        or np.abs(contact.normals - normal).max() > 1e-9
        or np.ptp(heights) > 1e-9 * max(spread, contact.radius)
    ):
        raise UnsupportedContactError(
            "STABLE: expected a line contact, at least two points on a line with one common normal across it"
        )
    order = np.argsort(contact.points @ (-normal[1], normal[0]))
    return contact.points[order[-1]], contact.points[order[0]], unit(normal)


def _half_planes(
    vertices: FloatArray, near: FloatArray, far: FloatArray, f_near: FloatArray, f_far: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rows ``a`` and offsets ``b`` of the four conditions ``a·c >= b``; ``near`` is the end on the side of the COR."""
    r_squared = float((vertices**2).sum(axis=1).max())
    rows = np.array((f_near, -f_far, near, -far))
    # |c - p| <= |c| is p·c >= |p|²/2
    offsets = np.array(((vertices @ f_near).max(), -(vertices @ f_far).min(), float(near @ near) / 2, r_squared))
    return rows, offsets


def _loop(rows: FloatArray, offsets: FloatArray, sign: float, extent: float) -> FloatArray:
    """Closed loop of twists (n, 3) round the intersection of the half-planes with the square of half side ``extent`` (m)."""
    points = np.array(((-extent, -extent, 1.0), (extent, -extent, 1.0), (extent, extent, 1.0), (-extent, extent, 1.0)))
    for a, b in zip(rows, offsets, strict=True):
        points = clip_loop(points, np.array((*a, -b)))
    return sign * points[:, (1, 0, 2)] * (1.0, -1.0, 1.0)


def _translations(contact: PushContact, normal: FloatArray) -> tuple[float, float] | None:
    """Directions (rad) whose force through the COM, the origin of B, lies in the composite cone: ``a·(d, 0) >= 0``."""
    base = float(np.arctan2(normal[1], normal[0]))
    low, high = -np.pi / 2, np.pi / 2
    for a in contact.cone(contact.radius or 1.0).normals:
        if np.linalg.norm(a[:2]) > _SLACK:
            middle = float(wrap_angle(np.arctan2(a[1], a[0]) - base))
            low, high = max(low, middle - np.pi / 2), min(high, middle + np.pi / 2)
    return (base + low, base + high) if low <= high else None
