"""Identify a limit surface from pairs of loads and slip twists (Zhou et al. 2016, section III)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import scipy.special
from numpy.typing import ArrayLike

from stablepush._arrays import LARGEST_MAGNITUDE, FloatArray, check_number, check_vectors, read_only
from stablepush.errors import InputError
from stablepush.identify.certificate import Certificate, certify
from stablepush.identify.moments import Moments
from stablepush.identify.pressure import PressureEnsemble, PressureSampler
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

#: With a slider: weight (in pairs) of the pseudo pairs of its likely pressures, the candidate weights of a measured pair beside
#: it, and the weight of either against |a|². Measured pairs have shaped the pressures already, so zero is a candidate.
PRIOR_PAIRS, PAIR_WEIGHTS, PRIOR_SCALE = 10.0, (0.0, 0.1, 0.3, 1.0, 3.0), 1e4
#: Twists at which the likely pressures are asked for their loads.
PSEUDO_PAIRS = 400
#: Surfaces of the ensemble that comes with a fit.
MEMBERS = 50

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
    prior_weight : float
        Weight of the pairs that stand for the slider's likely pressures, in pairs; 0 where no prior is used.
    pressures : PressureEnsemble or None
        Pressure distributions that the pokes leave likely, all alike; None where no prior is used.
    remarks : tuple of str
        What a user should know: pokes that contradict the prior, say.
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
    prior_weight: float = 0.0
    pressures: PressureEnsemble | None = None
    remarks: tuple[str, ...] = ()


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
        Outline and centre of mass as prior knowledge; gives the characteristic length if that is not given.
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
    plain = [_Weights(a, b) for a, b in product(ETA_1, ETA_2)]
    middle = _Weights(ETA_1[len(ETA_1) // 2], ETA_2[len(ETA_2) // 2])
    sampler = None
    candidates = plain
    remarks = []
    if slider is not None and convex and degree > 2:
        try:
            sampler = PressureSampler(slider.vertices, seed=0 if seed is None else seed)
            sampler.prior()
        except InputError as reason:
            sampler = None
            remarks.append(f"the slider is not used as a prior: {reason}")
    if sampler is not None:
        candidates = [_Weights(PRIOR_SCALE * w, PRIOR_SCALE * w, PRIOR_PAIRS) for w in PAIR_WEIGHTS] + plain
    planned = len(candidates) * len(folds) + 1
    done = 0

    def estimate(part: _Part, weights: _Weights) -> _Estimate:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, planned)
        return _solve(part, weights, degree, convex)

    def part_of(rows: np.ndarray) -> _Part:
        pressures = None if sampler is None else sampler.posterior(loads[rows], directions[rows], rho)
        return _Part.from_pairs(loads[rows], directions[rows], pressures, rho, degree)

    everything = np.arange(len(loads))
    weights, error = (candidates[0] if sampler is not None else middle), None
    if folds:
        errors = np.empty((len(candidates), len(loads)))
        for fold in folds:
            part = part_of(np.setdiff1d(everything, fold))
            rows = gradient_rows(loads[fold], degree)
            for c, candidate in enumerate(candidates):
                errors[c, fold] = angle_between(rows @ estimate(part, candidate).coefficients, directions[fold])
        chosen = _choose(errors, with_prior=0 if sampler is None else len(PAIR_WEIGHTS))
        weights, error = candidates[chosen], float(errors[chosen].mean())
    whole = part_of(everything)
    best = estimate(whole, weights)
    if sampler is not None and weights.prior == 0:
        remarks.append(
            "the pokes contradict every pressure under the outline with the centre of mass at the origin: "
            "the fit follows the pokes (is the outline, the centre of mass or the sign of a moment wrong?)"
        )

    certificate = None if best.gram is None else certify(best.coefficients, best.gram, degree)
    ensemble = []
    if weights.prior and whole.pressures is not None:
        draws = whole.pressures.wrenches(_asked(), rho)[:: max(1, len(whole.pressures.loads) // MEMBERS)]
        # each draw has been weighed by the pokes; weighing those in again would make the draws agree too much
        alone = _Weights(0.0, 0.0, PRIOR_PAIRS)
        ensemble = [
            _solve(_Part(whole.pairs, Moments.from_pairs(draw, _asked(), degree), None), alone, degree, convex).coefficients
            for draw in draws
        ]
    surface = _surface(best, ensemble, certificate, degree, rho, force_scale, model, len(loads))
    gradient = gradient_rows(loads, degree) @ best.coefficients
    level = surface.value(f if surface.force_unit == "N" else f / force_scale)
    return Fit(
        surface=surface,
        model=model,
        status=best.status,
        solve_time=best.solve_time,
        total_time=time.perf_counter() - started,
        eta1=weights.eta1,
        eta2=weights.eta2,
        cross_validation_error=error,
        angle_errors=read_only(angle_between(gradient, directions)),
        level_errors=read_only(level - 1),
        certificate=certificate,
        prior_weight=weights.prior,
        pressures=None if whole.pressures is None else whole.pressures.scaled(force_scale),
        remarks=tuple(remarks),
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


@dataclass(frozen=True, slots=True)
class _Weights:
    """Weights of slip and level residuals of measured pairs, and of the prior in pairs (0: none)."""

    eta1: float
    eta2: float
    prior: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """Moments of some of the pairs, and of pseudo pairs from the pressures that those leave likely."""

    pairs: Moments
    pseudo: Moments | None
    pressures: PressureEnsemble | None

    @classmethod
    def from_pairs(
        cls, loads: FloatArray, directions: FloatArray, pressures: PressureEnsemble | None, rho: float, degree: int
    ) -> _Part:
        pairs = Moments.from_pairs(loads, directions, degree)
        if pressures is None:
            return cls(pairs, None, None)
        # the ideal surface is linear in the pressure: the mean of the loads is that of the mean pressure
        pseudo = Moments.from_pairs(pressures.wrenches(_asked(), rho).mean(axis=0), _asked(), degree)
        return cls(pairs, pseudo, pressures)


@cache
def _asked() -> FloatArray:
    """Unit normalised twists (n, 3) at which pressures are asked for their loads."""
    return read_only(unit(np.random.default_rng(0).normal(size=(PSEUDO_PAIRS, 3))))


def _choose(errors: FloatArray, with_prior: int) -> int:
    """Return the candidate to use, from errors (c, n) over held-out pairs.

    Of the first ``with_prior`` candidates, which use a prior and lean on it less and less, the first that is not worse than the
    best of them by more than the standard error of the difference (Breiman et al. 1984). It gives way to a candidate without
    a prior only if that is better at the 5 % level (paired t test): a prior is given up for evidence, not for luck.
    """
    mean = errors.mean(axis=1)
    if not with_prior:
        return int(np.argmin(mean))
    count = errors.shape[1]
    differences = errors[:with_prior] - errors[int(np.argmin(mean[:with_prior]))]
    chosen = int(np.argmax(differences.mean(axis=1) <= differences.std(axis=1, ddof=1) / np.sqrt(count)))
    plain = with_prior + int(np.argmin(mean[with_prior:]))
    gain = errors[chosen] - errors[plain]
    needed = float(scipy.special.stdtrit(count - 1, 0.975)) * gain.std(ddof=1) / np.sqrt(count)
    return plain if gain.mean() > needed else chosen


def _solve(part: _Part, weights: _Weights, degree: int, convex: bool) -> _Estimate:
    quadratic = np.eye(len(part.pairs.target)) + weights.eta1 * part.pairs.slip + weights.eta2 * part.pairs.level
    linear = weights.eta2 * part.pairs.target
    if weights.prior and part.pseudo is not None:
        share = PRIOR_SCALE * weights.prior / part.pseudo.count
        quadratic = quadratic + share * (part.pseudo.slip + part.pseudo.level)
        linear = linear + share * part.pseudo.target
    if convex:
        solution = sos_convex_program(degree).solve(quadratic, linear)
        return _Estimate(solution.coefficients, solution.gram, solution.status, solution.solve_time)
    started = time.perf_counter()
    coefficients = np.asarray(np.linalg.solve(quadratic, linear), dtype=np.float64)
    return _Estimate(coefficients, None, "solved", time.perf_counter() - started)


def _surface(
    best: _Estimate,
    ensemble: list[FloatArray],
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
    if max(np.abs(a).max() for a in (best.coefficients, *ensemble)) * to_newton > _LARGEST_COEFFICIENT:
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
        covariance=np.cov(np.array(ensemble) * to_newton, rowvar=False) if ensemble else None,
        ensemble=np.array(ensemble) * to_newton if ensemble else None,
        provenance={"model": model, "pairs": pairs, "force_scale_N": force_scale},
    )
