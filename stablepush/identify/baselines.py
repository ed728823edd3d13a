"""The older methods from pokes to friction that the paper names: pressures on a grid, and an ellipsoid from a pressure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.optimize
from numpy.typing import ArrayLike

from stablepush.core import LEAST_POSITIVE, FloatArray, InputError, SolverError, check_choice, read_only
from stablepush.geometry import unit
from stablepush.identify.pairs import Pairs
from stablepush.identify.pressure import predict_loads
from stablepush.identify.surface import surface_from_scaled
from stablepush.objects import Slider, SupportDistribution
from stablepush.surfaces import IdealLimitSurface, PolynomialLimitSurface

METHODS = ("least-squares", "linear-program")
#: Singular values below this share of the largest count as zero: measured loads do not determine what lies below their scatter.
LEAST_SINGULAR = 0.01
#: Cells along the longer side of the outline's bounding box, if no spacing is given.
DEFAULT_CELLS = 12


@dataclass(frozen=True, slots=True, eq=False)
class GridPressure:
    """Friction loads on a grid under the outline.

    ``points`` (k, 2) in m, in B; ``loads`` (k,): friction load ``mu*N`` of each cell in N, which least squares may make negative;
    ``residual``: root mean square of ``F - predicted`` over the pairs, in N of the normalised load; ``surface``: the ideal
    limit surface of the loads, negative ones taken as zero.
    """

    points: FloatArray
    loads: FloatArray
    residual: float
    surface: IdealLimitSurface

    @property
    def negative_share(self) -> float:
        """Sum of the negative loads over the sum of all sizes. Nothing presses upwards, so this is an error of the method."""
        return float(-np.minimum(self.loads, 0).sum() / np.abs(self.loads).sum())


def fit_pressure_grid(
    wrenches: ArrayLike,
    twists: ArrayLike,
    slider: Slider,
    method: str = "linear-program",
    spacing: float | None = None,
) -> GridPressure:
    """Identify the pressure on a grid of cells under the outline from loads and slip twists.

    The load of a twist is linear in the pressure, ``F(V) = Σ_k m_k (e_k(V), x_k × e_k(V))`` with ``e_k`` the unit velocity of
    cell ``k``. ``"least-squares"``: the ``m`` of least norm among those of least squared error, of any sign (Yoshikawa and Kurisu
    1991). ``"linear-program"``: ``m >= 0`` with the least sum of absolute errors, hinged at the centre of mass: ``Σ m_k x_k = 0``
    (Lynch 1993).

    Parameters
    ----------
    wrenches, twists : array-like, shape (n, 3)
        Loads (N, N·m) and slip twists in B; only the direction of a twist counts.
    slider : Slider
        Outline, with the centre of mass at the origin of B.
    method : {"linear-program", "least-squares"}
    spacing : float, optional
        Side of a cell in m; a twelfth of the outline's extent if not given.
    """
    check_choice(method, "method", METHODS)
    if not isinstance(slider, Slider):
        raise InputError("slider", "expected a Slider", type(slider).__name__)
    pairs = Pairs.from_data(wrenches, twists, slider, None)
    if not len(pairs):
        raise InputError("wrenches, twists", "expected at least one pair")
    side = float(np.ptp(slider.vertices, axis=0).max()) / DEFAULT_CELLS if spacing is None else spacing
    points = SupportDistribution.from_polygon(slider.vertices, side).points
    count = len(points)
    # one support a cell with unit load: its loads are the columns of the linear map
    columns = predict_loads(points[:, None] / pairs.rho, np.ones((count, 1)), pairs.directions)
    matrix = columns.transpose(1, 2, 0).reshape(-1, count)
    measured = (pairs.loads * pairs.force_scale).ravel()
    loads = (
        np.linalg.lstsq(matrix, measured, LEAST_SINGULAR)[0]
        if method == "least-squares"
        else _least_absolute(matrix, measured, points)
    )
    if not (loads > 0).any():
        raise SolverError(
            "pressure grid: no pressure under the outline explains the pairs; is the origin of B inside the outline?"
        )
    residual = float(np.sqrt(((matrix @ loads - measured) ** 2).mean()))
    positive = np.maximum(loads, 0.0)
    surface = IdealLimitSurface(SupportDistribution(points, positive), float(positive.sum()), pairs.rho)
    return GridPressure(read_only(points), read_only(np.asarray(loads, dtype=np.float64)), residual, surface)


def _least_absolute(matrix: FloatArray, measured: FloatArray, points: FloatArray) -> FloatArray:
    """Minimise ``|matrix m - measured|_1`` over ``m >= 0`` with their mean at the origin."""
    rows, count = matrix.shape
    cost = np.concatenate((np.zeros(count), np.ones(2 * rows)))
    # matrix m - over + under = measured
    balance = np.concatenate((matrix, -np.eye(rows), np.eye(rows)), axis=1)
    moment = np.concatenate((points.T, np.zeros((2, 2 * rows))), axis=1)
    result = scipy.optimize.linprog(
        cost,
        A_eq=np.concatenate((balance, moment)),
        b_eq=np.concatenate((measured, np.zeros(2))),
        bounds=(0, None),
        method="highs",
    )
    if not result.success:
        raise SolverError(f"pressure grid: {result.message}")
    return np.asarray(result.x[:count])


def ellipsoid_from_pressure(support: SupportDistribution, friction_load: float) -> PolynomialLimitSurface:
    """Return Howe and Cutkosky's ellipsoid (1996) of a known pressure: ``|f|²/f_max² + τ_c²/τ_max² = 1``.

    ``f_max`` is the whole friction load, the force of a translation. ``τ_c = τ - c × f`` is the torque about the centre of
    friction ``c``, the rotation about which takes a pure torque: the geometric median of the pressure, where ``τ_max = Σ m_k
    |x_k - c|`` is least.

    Parameters
    ----------
    support : SupportDistribution
        Pressure (m, in B).
    friction_load : float
        Total ``mu*N`` in N.
    """
    ideal = IdealLimitSurface(support, friction_load)
    c = _geometric_median(support)
    largest_torque = float(ideal.loads @ np.linalg.norm(support.points - c, axis=1))
    rho = ideal.characteristic_length
    # τ_c = τ - c_x f_y + c_y f_x, in the normalised load
    torque = np.array((c[1], -c[0], rho)) / largest_torque
    form = np.diag((1.0, 1.0, 0.0)) / friction_load**2 + np.outer(torque, torque)
    xx, xy, xz, yy, yz, zz = form[np.triu_indices(3)]
    coefficients = friction_load**2 * np.array((xx, 2 * xy, 2 * xz, yy, 2 * yz, zz))
    provenance = {"model": "ellipsoid", "source": "Howe and Cutkosky 1996"}
    return surface_from_scaled(coefficients, 2, rho, friction_load, provenance=provenance)


def _geometric_median(support: SupportDistribution) -> FloatArray:
    """Point (2,) with the least weighted sum of distances: the sum is convex, and a support point may have it."""
    points, weights = support.points[support.weights > 0], support.weights[support.weights > 0]

    def cost(c: FloatArray) -> float:
        return float(weights @ np.linalg.norm(points - c, axis=1))

    costs = np.array([cost(c) for c in points])
    least = points[costs <= costs.min() * (1 + 1e-9)].mean(axis=0)
    # points of a line may share the least sum, and then all between them do: the middle keeps the symmetry
    best = least if cost(least) <= costs.min() * (1 + 1e-9) else points[int(np.argmin(costs))]
    off = points - best
    distance = np.linalg.norm(off, axis=1)
    here = distance < LEAST_POSITIVE
    pull = (weights[~here, None] * unit(off[~here])).sum(axis=0)
    # optimal at a support point: the others pull less than it weighs
    if np.linalg.norm(pull) <= weights[here].sum() + 1e-9 * weights.sum():
        return np.asarray(best)
    start = best + 1e-3 * support.characteristic_length * unit(pull)
    size = support.characteristic_length

    def gradient(c: FloatArray) -> FloatArray:
        return np.asarray(-(weights[:, None] * unit(points - c * size)).sum(axis=0))

    found = scipy.optimize.minimize(
        lambda c: cost(c * size) / size, start / size, jac=gradient, method="BFGS", options={"gtol": 1e-12}
    )
    return np.asarray(found.x * size)
