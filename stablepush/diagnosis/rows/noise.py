"""What noise of the readings, and turns about a support point, leave open of the wrench of a row."""

from __future__ import annotations

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.rows.observations import Observations
from stablepush.geometry import rotate_vectors
from stablepush.io import Noise

#: How far (in units of the position noise) a rotation centre may be from a support point that it is taken to be at.
_PIVOT = 4.0
#: Odds that a row turns about one of all support points: the facets of a limit surface are flat.
_TURNS = 0.3


def of_readings(o: Observations, noise: Noise, place: FloatArray) -> FloatArray:
    """Return the covariances (n, 3, 3) of the rows' wrenches by the noise of the readings.

    The sensor is at the pusher, at ``place`` (n, 2) in W. A laboratory computes the moment about the tracked origin from the
    force and its arm ``a``, as measured: ``tau = moment + a x f``; and it turns the force into B by the measured heading.
    """
    arm = rotate_vectors(-o.pose[:, 2], place - o.pose[:, :2])
    load = np.zeros((len(arm), 3, 2))
    load[:, 0, 0] = load[:, 1, 1] = noise.force
    load[:, 2, 0], load[:, 2, 1] = -arm[:, 1] * noise.force, arm[:, 0] * noise.force
    turned = noise.angle * np.stack((o.wrench[:, 1], -o.wrench[:, 0], np.zeros(len(arm))), axis=-1)
    covariance = load @ load.transpose(0, 2, 1) + turned[:, :, None] * turned[:, None, :]
    force = (o.wrench[:, :2] ** 2).sum(axis=1)
    covariance[:, 2, 2] += noise.moment**2 + noise.position**2 * force
    return np.asarray(covariance)


def of_turns(
    o: Observations, points: FloatArray, loads: FloatArray, motion_noise: FloatArray, noise: Noise, rho: float
) -> FloatArray:
    """Return the covariances (n, 3, 3) of the rows' wrenches by turns about one of points (k, 2) with friction loads (k,).

    The friction of that point then may have any direction: the motion does not show it.
    """
    covariance = np.zeros((len(o.time), 3, 3))
    carrying = np.flatnonzero(loads)
    for (x, y), load in zip(points[carrying], loads[carrying], strict=True):
        velocity = o.twist[:, :2] + o.twist[:, 2:] * (-y, x)
        beside = _PIVOT * noise.position * o.twist[:, 2]
        jitter = motion_noise[:, 0] ** 2 + (motion_noise[:, 2] * np.hypot(x, y)) ** 2 + beside**2
        # the odds, by Bayes' rule, that a row which seems to turn beside the point turns about it: noise has moved the velocity
        # of the point from none, or it is any that the turn gives to points within rho
        odds = _TURNS / len(carrying) * (rho * o.twist[:, 2]) ** 2 / (2 * jitter)
        odds = odds * np.exp(-0.5 * (velocity**2).sum(axis=1) / jitter)
        unknown = load**2 * odds / (1 + odds)
        for arm in (np.array((1.0, 0.0, -y)), np.array((0.0, 1.0, x))):
            covariance += unknown[:, None, None] * np.outer(arm, arm)
    return covariance
