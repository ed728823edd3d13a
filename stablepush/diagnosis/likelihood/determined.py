"""Which rows have a motion that determines the load.

Next to a facet of the limit surface (a turn about a support point), and of slow motions, noise moves the predicted load far.
"""

from __future__ import annotations

import numpy as np

from stablepush.core import BoolArray, FloatArray
from stablepush.diagnosis.likelihood.system import System

#: Share of a load that noise of the motion may leave open, for rows that count in the root mean squares of the wrench.
_OPEN = 0.3
#: Share of the rows that must have such a motion, for the others to be left out.
_ENOUGH = 0.2


def size(system: System, wrenches: FloatArray) -> FloatArray:
    """Return the squared size (n,) of wrenches in ``(fx, fy, tau/rho)``, in N²."""
    return np.asarray(((wrenches / (1, 1, system.rho)) ** 2).sum(axis=1))


def determined_rows(system: System) -> BoolArray:
    """Return which rows (n,) have a motion that determines the load, within the noise; all, if those are few.

    In a turn about a support point the friction of that point may be any: what is left of such a row says little of a simulation.
    So may all friction be in a motion so slow that noise decides its direction.
    """
    left_open = variance(system, system.covariance - system.reading_covariance)
    found = left_open <= _OPEN**2 * size(system, system.model.predict(system.nominal, {}))
    return np.asarray(found if found.mean() >= _ENOUGH else np.ones_like(found))


def variance(system: System, covariance: FloatArray) -> FloatArray:
    """Return the traces (n,) in N² of covariances (n, 3, 3) of wrenches in ``(fx, fy, tau/rho)``."""
    return np.asarray((np.einsum("nii->ni", covariance) / np.array((1.0, 1.0, system.rho)) ** 2).sum(axis=1))
