"""Stable regions that hold whatever the pressure under the slider is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import BoolArray, FloatArray, UnsupportedContactError, check_number
from stablepush.geometry import unit, wrap_angle
from stablepush.objects import PushContact, Slider
from stablepush.stability.center_of_mass import box_corners, require_inside
from stablepush.stability.kernels.chart import SphericalPolygons, clip_loop, square_of_cors, twists_from_homogeneous
from stablepush.stability.region import EXTENT_RADII, FAR, Interval, StableRegion

#: Slack of the closed inequalities, relative to the size of their terms: rounding must not open the set.
_SLACK = 1e-12


def lynch_mason_region(
    slider: Slider, contact: PushContact, *, com_tolerance: ArrayLike = 0.0, characteristic_length: float | None = None
) -> StableRegion:
    """Return the CORs that Lynch and Mason's procedure STABLE (1996) accepts for a line contact.

    With the support polygon's vertices ``v`` and ``r = max |v|``, the left and right ends ``p_l, p_r`` of the contact and
    the edges ``f_l = n + mu t``, ``f_r = n - mu t`` of its friction cones, a counter-clockwise COR ``c`` is accepted if
    ``c·f_l >= max v·f_l``, ``c·f_r <= min v·f_r``, ``|c - p_l| <= |c|`` and ``c·p_r <= -r²``; for clockwise ones left and
    right change places. A translation is accepted if the force along it through the COM lies in the composite cone. The
    support polygon is the hull of the slider's support points if it has them, else of its outline; ``r`` is taken over it,
    not over the contacts.

    ``com_tolerance``: half widths (m), one or two, of a box about the origin of B in which the centre of mass may lie. About a
    centre ``z`` the conditions are those of ``c - z``, ``p - z`` and ``v - z``. The first two do not change. The third is
    ``(p_l - z)·c >= (|p_l|² - |z|²)/2`` and is asked without ``|z|²``, which makes it linear in ``z``. The last is convex in
    ``z``. So the four corners of the box decide for all of it.

    ``characteristic_length`` (m) is that of the sphere of unit twists on which the region is drawn and
    its solid angle taken, the slider's if not given; which motions are in the region does not depend on it.

    Raises
    ------
    UnsupportedContactError
        If the contact is not at least two points on a line with one common normal across it.
    InputError
        If ``com_tolerance`` is not one or two lengths >= 0, or its box is not inside the hull of the support.
    """
    left, right, normal = _line_contact(contact)
    tangent = np.array((-normal[1], normal[0]))
    edges = (normal + contact.mu * tangent, normal - contact.mu * tangent)
    vertices = slider.support_vertices
    corners = box_corners(com_tolerance)
    if len(corners) > 1:
        require_inside(vertices, corners)
    planes = {
        1.0: _half_planes(vertices, left, right, *edges, corners),
        -1.0: _half_planes(vertices, right, left, *edges[::-1], corners),
    }

    rho = slider.characteristic_length
    if characteristic_length is not None:
        rho = check_number(characteristic_length, "characteristic_length", positive=True)
    interval = _translations(contact, normal, corners)
    return StableRegion(
        name="conservative",
        characteristic_length=rho,
        default_extent=EXTENT_RADII * max(slider.radius, contact.radius),
        translation_intervals=() if interval is None else (interval,),
        motions=_HalfPlanes(planes, interval, slider.radius, rho),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _HalfPlanes:
    """CORs between half-planes ``a·c >= b`` of each sense, and translations in an interval of angles."""

    planes: Mapping[float, tuple[FloatArray, FloatArray]]
    interval: Interval | None
    radius: float
    rho: float

    def accepts(self, twists: FloatArray) -> BoolArray:
        good = np.zeros(len(twists), dtype=bool)
        for sign, (rows, offsets) in self.planes.items():
            # a·c >= b for c = (-vy, vx)/omega, times |omega|
            turning = sign * twists[:, 2] > 0
            v = sign * twists[turning]
            size = np.linalg.norm(rows, axis=1) * (np.linalg.norm(v[:, :2], axis=1) + self.radius * v[:, 2])[:, None]
            height = np.stack((-v[:, 1], v[:, 0]), axis=-1) @ rows.T - offsets * v[:, 2:]
            good[turning] = (height >= -_SLACK * size).all(axis=1)
        still = twists[:, 2] == 0
        if self.interval is not None and still.any():
            low, high = self.interval
            angle = np.arctan2(twists[still, 1], twists[still, 0])
            good[still] = np.mod(angle - low + _SLACK, 2 * np.pi) <= high - low + 2 * _SLACK
        return good

    def spherical_polygons(self, sense: int) -> SphericalPolygons:
        return [[_ring(*self.planes[float(sense)], FAR * self.radius, sense) * (1.0, 1.0, self.rho)]]


def _line_contact(contact: PushContact) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Left and right end (2,) and normal (2,) of a line contact; left is along the normal turned counter-clockwise."""
    normal = contact.normals[0]
    heights = contact.points @ normal
    spread = np.ptp(contact.points @ (-normal[1], normal[0]))
    if len(contact.points) < 2 or not contact.has_one_normal or np.ptp(heights) > 1e-9 * max(spread, contact.radius):
        raise UnsupportedContactError(
            "STABLE: expected a line contact, at least two points on a line with one common normal across it"
        )
    order = np.argsort(contact.points @ (-normal[1], normal[0]))
    return contact.points[order[-1]], contact.points[order[0]], unit(normal)


def _half_planes(
    vertices: FloatArray, near: FloatArray, far: FloatArray, f_near: FloatArray, f_far: FloatArray, centers: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rows ``a`` and offsets ``b`` of the conditions ``a·c >= b`` for all centres of mass (k, 2); ``near`` is the end on the
    side of the COR."""
    rows, offsets = [f_near, -f_far], [float((vertices @ f_near).max()), -float((vertices @ f_far).min())]
    for z in centers:
        r_squared = float(((vertices - z) ** 2).sum(axis=1).max())
        # |c - p| <= |c - z| follows from (p - z)·c >= |p|²/2; (p - z)·(c - z) <= -r²
        rows += [near - z, z - far]
        offsets += [float(near @ near) / 2, r_squared - float((far - z) @ z)]
    return np.array(rows), np.array(offsets)


def _ring(rows: FloatArray, offsets: FloatArray, extent: float, sense: int) -> FloatArray:
    """Body twists (n, 3) round the CORs ``c`` with ``rows c >= offsets`` and ``|c_x|, |c_y| <= extent`` (m)."""
    points = square_of_cors(extent)
    for a, b in zip(rows, offsets, strict=True):
        points = clip_loop(points, np.array((*a, -b)))
    return twists_from_homogeneous(points, sense)


def _translations(contact: PushContact, normal: FloatArray, centers: FloatArray) -> tuple[float, float] | None:
    """Directions (rad) whose force through every COM ``z`` (k, 2) lies in the composite cone: ``a·(d, z x d) >= 0``."""
    base = float(np.arctan2(normal[1], normal[0]))
    low, high = -np.pi / 2, np.pi / 2
    rho = contact.radius or 1.0
    for a in contact.cone(rho).normals:
        for x, y in a[:2] + a[2] / rho * np.stack((-centers[:, 1], centers[:, 0]), axis=-1):
            if np.hypot(x, y) > _SLACK:
                middle = float(wrap_angle(np.arctan2(y, x) - base))
                low, high = max(low, middle - np.pi / 2), min(high, middle + np.pi / 2)
    # without friction one direction is left, known to rounding
    return (base + low, base + max(low, high)) if low <= high + _SLACK else None
