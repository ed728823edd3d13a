"""Where a log shows its fingers: their places on the outline, clearances and slip, and which of them are off."""

from __future__ import annotations

import numpy as np

from stablepush.core import BoolArray, FloatArray
from stablepush.geometry import compose, contacts_on_outline, inverse, transform_points
from stablepush.io import PushLog, distinct

#: Fingers farther (m) than this from where fingers usually are, beside the outline, do not touch it; nor do those that are
#: farther from it than the other length. Where contact points are logged, they decide, and the other length alone counts.
_TOUCH, _NEAR = 3e-3, 8e-3
#: Only one finger is off if its clearance differs from zero, and from that of the other finger, by this many standard errors, and
#: the clearance of the other is less than this share of its own.
_ONE, _OTHER = 6.0, 0.2
#: And by at least this (m).
_LEAST_OFF = 2e-4
#: Largest radius (m) of fingers where the rig does not state it.
_WIDEST = 0.03


def fingers_of(
    log: PushLog,
    trial: np.ndarray,
    time: FloatArray,
    pose: FloatArray,
    twist: FloatArray,
    pusher: FloatArray,
    points: FloatArray,
) -> tuple[float | None, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Radius, normals, places, clearances and slip of the fingers, from the pusher's poses, else from the contact points that are
    logged."""
    n = len(pose)
    normal, place = np.full((n, 2, 2), np.nan), np.full((n, 2, 2), np.nan)
    clearance, slip = np.full((n, 2), np.nan), np.full(n, np.nan)
    radius = log.rig.finger_radius
    if log.rig.contact_kind == "held":
        return radius, normal, place, clearance, slip
    outline = log.rig.slider.vertices
    places = finger_places(log)
    if not places.any() or np.isnan(places).any():
        # how the pusher is turned does not matter to what sits in its origin: one finger, or the middle of two that are flush
        places = np.zeros((1, 2))
        pusher = np.where(np.isfinite(pusher) | (np.arange(3) < 2), pusher, 0.0)
    known = np.isfinite(pusher).all(axis=1)
    if known.any():
        relative = compose(inverse(pose[known]), pusher[known])
        centers = transform_points(relative, places)
        for k in range(len(places)):
            near, inward, away = contacts_on_outline(outline, centers[:, k])
            clearance[known, k], normal[known, k], place[known, k] = away, inward, near
        if radius is None:
            near_by = np.abs(clearance) < _WIDEST
            radius = max(0.0, float(np.median(clearance[near_by]))) if near_by.any() else None
        clearance -= radius or 0.0
        touching = _touching(clearance, place, points)
        for k in range(2):
            clearance[~touching[:, k], k] = np.nan
            normal[~touching[:, k], k], place[~touching[:, k], k] = np.nan, np.nan
    elif np.isfinite(points).any():
        for k in range(2):
            there = np.isfinite(points[:, k]).all(axis=1)
            if there.any():
                near, inward, _ = contacts_on_outline(outline, points[there, k])
                normal[there, k], place[there, k] = inward, near
    slip = _slip(trial, time, pose, pusher, (place, normal), radius)
    return radius, normal, place, clearance, slip


def _touching(clearance: FloatArray, place: FloatArray, points: FloatArray) -> BoolArray:
    """Which fingers (n, 2) touch: those at the clearance that most rows have, or that a logged contact point belongs to."""
    # fingers of a radius that is not quite the nominal one
    near_by = np.abs(clearance) < _NEAR
    usual = float(np.median(clearance[near_by])) if near_by.any() else 0.0
    seen = np.asarray(np.isfinite(points).all(axis=2))
    if not seen.any():
        return np.asarray(np.abs(clearance - usual) < _TOUCH)
    # a logged contact point belongs to the finger whose place is nearest; fingers without one are open
    owned = np.zeros(clearance.shape, dtype=bool)
    for c in range(2):
        away = np.linalg.norm(np.nan_to_num(place, nan=np.inf) - points[:, None, c], axis=2)
        away[~np.isfinite(away)] = np.inf
        rows_seen = np.flatnonzero(seen[:, c])
        owned[rows_seen, away[rows_seen].argmin(axis=1)] = True
    return np.asarray(owned & near_by)


def _slip(
    trial: np.ndarray,
    time: FloatArray,
    pose: FloatArray,
    pusher: FloatArray,
    contact: tuple[FloatArray, FloatArray],
    radius: float | None,
) -> FloatArray:
    """Slip (n,) in m/s along the outline, from the places of neighbouring rows. ``contact``: places and normals (n, 2, 2).

    Rolling moves the contact, too; the turn of the pusher shows that.
    """
    (place, normal), slip = contact, np.full(len(pose), np.nan)
    for t in np.unique(trial):
        rows = np.flatnonzero(trial == t)
        for k in (0, 1):
            good = rows[np.isfinite(place[rows, k]).all(axis=1)]
            if len(good) < 3 or not distinct(time[good]).all():
                continue
            rate = np.gradient(place[good, k], time[good], axis=0)
            tangent = np.stack((-normal[good, k, 1], normal[good, k, 0]), axis=-1)
            along = (rate * tangent).sum(axis=1)
            if radius and np.isfinite(pusher[good, 2]).all():
                turn = np.gradient(np.unwrap(pusher[good, 2]) - np.unwrap(pose[good, 2]), time[good])
                along = along + radius * turn if np.isfinite(turn).all() else along
            # the slider slips against the finger the other way round
            slip[good] = np.where(np.isfinite(slip[good]), 0.5 * (slip[good] - along), -along)
    return slip


def fingers_off(log: PushLog, trial: np.ndarray, clearance: FloatArray) -> tuple[float, float]:
    """Which fingers, left and right of where the pusher faces, are off, 1 or 0: both, unless by the medians of the trials one is
    and the other is not."""
    middle, error = np.zeros(2), np.full(2, np.inf)
    if log.rig.finger_radius is None:
        # the radius is then what most rows have: neither finger is known to be as it should be
        return 1.0, 1.0
    for k in range(2):
        trials = np.unique(trial[np.isfinite(clearance[:, k])])
        if len(trials) > 2:
            by_trial = np.array([np.nanmedian(clearance[trial == t, k]) for t in trials])
            middle[k] = np.median(by_trial)
            noise = log.rig.noise.position if log.rig.noise is not None else 0.0
            spread = max(noise, 1.4826 * float(np.median(np.abs(by_trial - middle[k]))), 1e-9)
            error[k] = 1.2533 * spread / np.sqrt(len(trials))
    for k in range(2):
        other = middle[1 - k]
        apart = min(abs(middle[k]) / error[k], abs(middle[k] - other) / float(np.hypot(*error)))
        known = np.isfinite(error).all() and abs(middle[k]) > _LEAST_OFF
        if known and apart > _ONE and abs(other) < _OTHER * abs(middle[k]):
            return (1.0, 0.0) if k == 0 else (0.0, 1.0)
    return 1.0, 1.0


def finger_places(log: PushLog) -> FloatArray:
    """Return where the fingers are in the pusher's frame, left and right of its axis, in m: (2, 2), or (1, 2) for one; NaN if the
    log does not show it."""
    if log.rig.contact_kind != "two-point":
        return np.zeros((1, 2))
    return np.outer((1.0, -1.0), (0.0, _half_spacing(log)))


def _half_spacing(log: PushLog) -> float:
    """Half the distance (m) between two fingers, from the contact points that are logged; NaN if they do not show it."""
    poses, pushers = log.columns("x", "y", "theta"), log.columns("px", "py", "ptheta")
    points = log.columns("c1x", "c1y", "c2x", "c2y").reshape(-1, 2, 2)
    both = np.isfinite(points).all(axis=(1, 2))
    if both.any():
        return float(np.median(np.linalg.norm(points[both, 0] - points[both, 1], axis=1))) / 2
    # fingers that never touch together are beside the pusher's axis, each behind its contact; the logged one is always on the
    # same side
    beside: list[FloatArray] = []
    for k in range(2):
        known = np.isfinite(np.column_stack((poses, pushers, points[:, k]))).all(axis=1)
        if known.any():
            near, inward, _ = contacts_on_outline(log.rig.slider.vertices, points[known, k])
            centers = (near - (log.rig.finger_radius or 0.0) * inward)[:, None]
            seen = transform_points(compose(inverse(pushers[known]), poses[known]), centers)[:, 0, 1]
            beside.append(seen * np.sign(np.median(seen)))
    return float(np.median(np.concatenate(beside))) if beside else np.nan
