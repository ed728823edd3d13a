"""Identify a limit surface from pairs of loads and slip twists (Zhou et al. 2016, section III)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from itertools import product
from operator import add

import numpy as np
from numpy.typing import ArrayLike

from stablepush._arrays import LARGEST_MAGNITUDE, FloatArray, check_number, check_vectors, read_only
from stablepush.errors import InputError
from stablepush.identify.certificate import Certificate, certify
from stablepush.identify.moments import Moments
from stablepush.identify.sos import sos_convex_program
from stablepush.models.monomials import gradient_rows
from stablepush.models.polynomial import PolynomialLimitSurface
from stablepush.planar import angle_between, normalize_twist, normalize_wrench, unit
from stablepush.slider import Slider

#: Model names: degree, and whether SOS-convexity is imposed.
MODELS = {"poly4-cvx": (4, True), "poly4": (4, False), "poly6-cvx": (6, True), "quadratic": (2, True)}

#: Candidate weights of slip and level residuals against |a|², for loads of median length one: from a prior that outweighs
#: the pairs to one that only settles what they leave open, as noise-free pairs want it.
ETA_1 = (0.1, 1.0, 10.0, 100.0, 1000.0)
ETA_2 = (0.1, 1.0, 10.0, 100.0, 1000.0)

#: Folds of the cross-validation; with fewer than this many pairs the middle weights are taken instead.
FOLDS = 5

#: Loads below this (N) are no friction of an object on a table.
LEAST_FORCE = 1e-9

#: Largest coefficient that a model file may hold: beyond it the surface is stored in units of the friction force.
_LARGEST_COEFFICIENT = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """An identified surface with what is needed to trust it.

    Attributes
    ----------
    surface : PolynomialLimitSurface
    model : str
    status : str
        The solver's word on the final solve; ``"solved"`` where no iterative solver is involved.
    solve_time : float
        Time in the solver for the final solve, in s.
    total_time : float
        Wall time of the whole identification, cross-validation included, in s.
    eta1, eta2 : float
        Chosen weights of slip and level residuals.
    cross_validation_error : float or None
        Mean angle (rad) between predicted and measured twists of held-out pairs at the chosen weights; it was minimised over
        the weights, so it flatters a little. None with too few pairs.
    angle_errors : array, shape (n,)
        Angle (rad) between predicted and measured twist of each pair used.
    level_errors : array, shape (n,)
        ``H(F) - 1`` of each pair used.
    certificate : Certificate or None
        Proof of SOS-convexity, in units of the scaled loads; None for ``poly4``.
    """

    surface: PolynomialLimitSurface
    model: str
    status: str
    solve_time: float
    total_time: float
    eta1: float
    eta2: float
    cross_validation_error: float | None
    angle_errors: FloatArray
    level_errors: FloatArray
    certificate: Certificate | None


@dataclass(frozen=True, slots=True, eq=False)
class _Estimate:
    coefficients: FloatArray
    gram: FloatArray | None
    status: str
    solve_time: float


def fit_limit_surface(
    wrenches: ArrayLike,
    twists: ArrayLike,
    model: str = "poly4-cvx",
    slider: Slider | None = None,
    characteristic_length: float | None = None,
    seed: int | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Fit:
    """Identify ``H`` from loads and slip twists by the paper's convex program.

    ``minimise |a|² + Σ_i (eta1 α_i + eta2 β_i)`` with ``α_i = |∇H(F_i) - (∇H(F_i)·V_i)V_i|²`` and ``β_i = (H(F_i) - 1)²``,
    subject to SOS-convexity for the ``-cvx`` models and the quadratic. ``eta1, eta2`` are chosen by five-fold
    cross-validation of the angle between predicted and measured twists; the final solve uses all pairs.

    Parameters
    ----------
    wrenches : array-like, shape (n, 3)
        Loads ``(fx, fy, tau)`` in N and N·m, in B.
    twists : array-like, shape (n, 3)
        Slip twists ``(vx, vy, omega)`` in B; only their directions count.
    model : {"poly4-cvx", "poly4", "poly6-cvx", "quadratic"}
    slider : Slider, optional
        Gives the characteristic length if that is not given.
    characteristic_length : float, optional
        ``rho`` in m; without it and without a slider ``sqrt(2) rms(tau) / rms(|f|)``.
    seed : int, optional
        Seed of the split into folds; 0 if not given, so that a fit can be repeated.
    progress : callable, optional
        Called with the number of solves done and planned.

    Raises
    ------
    InputError
        Wrong shapes, zero loads or twists, or loads that mostly oppose the motion.
    SolverError
        The solver found no certified solution.
    """
    started = time.perf_counter()
    if model not in MODELS:
        raise InputError(f"model: expected one of {', '.join(MODELS)}, got {model!r}")
    degree, convex = MODELS[model]
    f, v = _check_pairs(wrenches, twists)
    rho = _characteristic_length(f, slider, characteristic_length)
    loads = normalize_wrench(f, rho)
    force_scale = float(np.median(np.linalg.norm(loads, axis=1)))
    if not LEAST_FORCE <= force_scale <= LARGEST_MAGNITUDE:
        raise InputError(
            f"wrenches: expected loads of {LEAST_FORCE:g} to {LARGEST_MAGNITUDE:g} N, their median is {force_scale:g} N"
        )
    loads = loads / force_scale
    directions = unit(normalize_twist(v, rho))

    folds = _folds(len(loads), seed)
    planned = len(ETA_1) * len(ETA_2) * len(folds) + 1
    done = 0

    def estimate(moments: Moments, eta1: float, eta2: float) -> _Estimate:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, planned)
        return _solve(moments, eta1, eta2, degree, convex)

    parts = [Moments.from_pairs(loads[fold], directions[fold], degree) for fold in folds]
    if folds:
        eta1, eta2, error = _cross_validate(estimate, parts, folds, loads, directions, degree)
        moments = reduce(add, parts)
    else:
        eta1, eta2, error = ETA_1[len(ETA_1) // 2], ETA_2[len(ETA_2) // 2], None
        moments = Moments.from_pairs(loads, directions, degree)
    best = estimate(moments, eta1, eta2)

    certificate = None if best.gram is None else certify(best.coefficients, best.gram, degree)
    surface = _surface(best, certificate, degree, rho, force_scale, model, len(loads))
    gradient = gradient_rows(loads, degree) @ best.coefficients
    level = surface.value(f if surface.force_unit == "N" else f / force_scale)
    return Fit(
        surface=surface,
        model=model,
        status=best.status,
        solve_time=best.solve_time,
        total_time=time.perf_counter() - started,
        eta1=eta1,
        eta2=eta2,
        cross_validation_error=error,
        angle_errors=read_only(angle_between(gradient, directions)),
        level_errors=read_only(level - 1),
        certificate=certificate,
    )


def _check_pairs(wrenches: ArrayLike, twists: ArrayLike) -> tuple[FloatArray, FloatArray]:
    f = check_vectors(wrenches, "wrenches", 3)
    v = check_vectors(twists, "twists", 3)
    if f.ndim != 2 or f.shape != v.shape:
        raise InputError(f"wrenches, twists: expected two arrays of shape (n, 3), got {f.shape} and {v.shape}")
    if len(f) == 0:
        raise InputError("wrenches, twists: expected at least one pair")
    for name, array in (("wrenches", f), ("twists", v)):
        if not array.any(axis=1).all():
            raise InputError(f"{name}: expected no zero rows, row {int(np.argmin(array.any(axis=1)))} is zero")
    opposed = int(((f * v).sum(axis=1) < 0).sum())
    if 2 * opposed > len(f):
        raise InputError(
            f"wrenches, twists: {opposed} of {len(f)} pairs have F·V < 0; expected the load that the pusher applies, "
            "which drives the motion (is the sign of the force turned round?)"
        )
    return f, v


def _characteristic_length(f: FloatArray, slider: Slider | None, given: float | None) -> float:
    if given is not None:
        return check_number(given, "characteristic_length", above=0.0)
    if slider is not None:
        return slider.characteristic_length
    force = np.sqrt((f[:, :2] ** 2).sum(axis=1).mean())
    torque = np.sqrt((f[:, 2] ** 2).mean())
    if force == 0 or torque == 0:
        raise InputError("characteristic_length: expected a value or a slider, as the pairs lack forces or torques")
    return float(np.sqrt(2) * torque / force)


def _folds(count: int, seed: int | None) -> list[np.ndarray]:
    if count < FOLDS:
        return []
    order = np.random.default_rng(0 if seed is None else seed).permutation(count)
    return [np.sort(part) for part in np.array_split(order, FOLDS)]


def _cross_validate(
    estimate: Callable[[Moments, float, float], _Estimate],
    parts: list[Moments],
    folds: list[np.ndarray],
    loads: FloatArray,
    directions: FloatArray,
    degree: int,
) -> tuple[float, float, float]:
    """Return the weights with the least mean angle (rad) over held-out pairs, and that angle."""
    rest = [reduce(add, (part for j, part in enumerate(parts) if j != i)) for i in range(len(parts))]
    rows = [gradient_rows(loads[fold], degree) for fold in folds]
    best = (ETA_1[0], ETA_2[0], np.inf)
    for eta1, eta2 in product(ETA_1, ETA_2):
        angles = [
            angle_between(rows[i] @ estimate(rest[i], eta1, eta2).coefficients, directions[fold]) for i, fold in enumerate(folds)
        ]
        error = float(np.concatenate(angles).mean())
        if error < best[2]:
            best = (eta1, eta2, error)
    return best


def _solve(moments: Moments, eta1: float, eta2: float, degree: int, convex: bool) -> _Estimate:
    quadratic = np.eye(len(moments.target)) + eta1 * moments.slip + eta2 * moments.level
    linear = eta2 * moments.target
    if convex:
        solution = sos_convex_program(degree).solve(quadratic, linear)
        return _Estimate(solution.coefficients, solution.gram, solution.status, solution.solve_time)
    started = time.perf_counter()
    coefficients = np.asarray(np.linalg.solve(quadratic, linear), dtype=np.float64)
    return _Estimate(coefficients, None, "solved", time.perf_counter() - started)


def _surface(
    best: _Estimate,
    certificate: Certificate | None,
    degree: int,
    rho: float,
    force_scale: float,
    model: str,
    pairs: int,
) -> PolynomialLimitSurface:
    """Bring the coefficients back to newtons, and the certificate with them."""
    to_newton = force_scale ** (-degree)
    force_unit = "N"
    if np.abs(best.coefficients).max() * to_newton > _LARGEST_COEFFICIENT:
        to_newton, force_unit = 1.0, "mu*N"
    entry = None
    if certificate is not None:
        entry = certificate.to_json()
        entry["min_eigenvalue"] *= to_newton
        entry["residual"] *= to_newton
        entry["gram"] = (certificate.gram * to_newton).tolist()
    return PolynomialLimitSurface(
        best.coefficients * to_newton,
        degree,
        rho,
        force_unit=force_unit,
        certificate=entry,
        provenance={"model": model, "pairs": pairs, "force_scale_N": force_scale},
    )
