"""Which rows have a motion that determines the load.

Next to a facet of the limit surface (a turn about a support point) a little noise of the motion moves the predicted load far.
"""

from __future__ import annotations

import numpy as np

from stablepush.core import BoolArray, FloatArray
from stablepush.diagnosis.system import System

#: A facet counts as this share of all friction at least: of many points, more than one turns its friction at a time.
_SMOOTH = 0.2
#: Share of a load that noise of the motion may leave open, for rows that count in the root mean squares of the wrench.
_OPEN = 0.3
#: Share of the rows that must have such a motion, for the others to be left out.
_ENOUGH = 0.2


def size(system: System, wrenches: FloatArray) -> FloatArray:
    """Return the squared size (n,) of wrenches in ``(fx, fy, tau/rho)``, in N²."""
    return np.asarray(((wrenches / (1, 1, system.rho)) ** 2).sum(axis=1))


def motion_spread(system: System) -> FloatArray:
    """Return how far (n,) in N, one standard deviation, noise of a row's motion moves the load that is predicted for it.

    Next to a facet of the limit surface (a turn about a support point) a little noise of the motion moves the load far, but not
    beyond the facet, whose radius is the load of that point.
    """
    motion = np.maximum(variance(system, system.covariance) - variance(system, system.reading_covariance), 0.0)
    loads = np.abs(system.of_last(system.nominal))
    most = max(float(loads.max()), _SMOOTH * float(loads.sum())) ** 2 + 1e-30
    return np.asarray(np.sqrt(motion * most / (motion + most)))


def determined_rows(system: System) -> BoolArray:
    """Return which rows (n,) have a motion that determines the load, within the noise; all, if those are few.

    In a turn about a support point the friction of that point may be any: what is left of such a row says little of a simulation.
    """
    found = motion_spread(system) <= _OPEN * np.sqrt(size(system, system.model.predict(system.nominal, {})))
    return np.asarray(found if found.mean() >= _ENOUGH else np.ones_like(found))


def variance(system: System, covariance: FloatArray) -> FloatArray:
    """Return the traces (n,) in N² of covariances (n, 3, 3) of wrenches."""
    return np.asarray((np.einsum("nii->ni", covariance) / np.array((1.0, 1.0, system.rho)) ** 2).sum(axis=1))
