"""Identify a limit surface from pairs of loads and slip twists (Zhou et al. 2016, section III)."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple
from warnings import catch_warnings, simplefilter

import numpy as np
import scipy.special
from numpy.typing import ArrayLike

from stablepush.core import (
    FloatArray,
    InputError,
    SolverError,
    check_choice,
    check_seed,
    check_vectors,
    first_least,
    in_threads,
    read_only,
    shown_as,
)
from stablepush.geometry import angle_between, normalize_twist
from stablepush.identify.certificate import Certificate, certify
from stablepush.identify.estimator import Estimator, NormLoss, NormWeights, Part, SquaredLoss, SquaredWeights
from stablepush.identify.gp import fit_gaussian_process
from stablepush.identify.pairs import LARGEST_RATIO, Pairs, SlipPairs, given_pairs
from stablepush.identify.posterior import draw_coefficients
from stablepush.identify.pressure import PressureEnsemble, PressureSampler
from stablepush.identify.program import PROVABLE, Estimate
from stablepush.identify.surface import surface_from_scaled
from stablepush.objects import Slider
from stablepush.surfaces import GaussianProcessSurface, PolynomialLimitSurface, gradient_rows, monomials

#: Polynomial models: degree, and whether SOS-convexity is imposed. A Gaussian process is the other.
POLYNOMIALS = {"poly4-cvx": (4, True), "poly4": (4, False), "poly6-cvx": (6, True), "quadratic": (2, True)}
MODELS = (*POLYNOMIALS, "gp")
#: Models that take a slider as prior knowledge.
WITH_PRIOR = ("poly4-cvx", "poly6-cvx")
LOSSES = ("squared", "published", "norm")

#: Folds of the cross-validation; with fewer than this many pairs the middle weights are taken instead.
FOLDS = 5

#: Share of Metropolis steps below which the likely pressures are reported as poorly mixed.
LEAST_ACCEPTANCE = 0.02

#: Median of H over the pairs below which a fit under the norm loss has collapsed towards zero.
COLLAPSED = 1e-2
#: Candidates whose errors (rad) differ by no more, which is what solvers leave, are as good as each other: the first is taken.
_ALIKE = 1e-6

#: Median angle (rad) between predicted and measured twists from which loads and twists do not seem to belong together.
_WRONG_FRAMES = np.radians(25.0)

#: A robust weight below which a pair is reported as an outlier; a pair that fits has weight 1 to 1.75.
OUTLIER_WEIGHT = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """An identified surface with what is needed to trust it.

    Attributes
    ----------
    surface : PolynomialLimitSurface or GaussianProcessSurface
    model : str
    status : str
        The solver's word on the final solve; ``"solved"`` where no iterative solver is involved.
    solve_time : float
        Time in the solver for the final solve, in s.
    total_time : float
        Wall time of the whole identification, cross-validation included, in s.
    weights : mapping
        Chosen weights: ``eta1, eta2, prior`` of the squared loss, ``w_force, w_reg`` of the norm loss.
    validation_error : float or None
        Mean angle (rad) between predicted and measured twists of held-out pairs at the chosen weights; it was minimised over
        the weights, so it flatters a little. None with too few pairs.
    angle_errors : array, shape (n,)
        Angle (rad) between predicted and measured twist of each pair.
    level_errors : array, shape (n,)
        ``H(F) - 1`` of each pair; ``H`` has the degree of the model, for ``gp`` it is a ratio of sizes.
    pair_weights : array, shape (n,)
        Robust weight of each pair: far below one for an outlier, zero if it was left out or held out.
    certificate : Certificate or None
        Proof of SOS-convexity, in units of the scaled loads; None for ``poly4`` and ``gp``.
    pressures : PressureEnsemble or None
        Pressure distributions that the pokes leave likely, all alike; None where no prior is used.
    warnings : tuple of str
        What a user should know: pokes that contradict the prior or leave the surface open, outliers, slips of units.
    wrenches, twists : array, shape (n, 3)
        The pairs that were given, in B (N, N·m; m/s, rad/s).
    """

    _repr_html_ = shown_as("fit")

    surface: PolynomialLimitSurface | GaussianProcessSurface
    model: str
    status: str
    solve_time: float
    total_time: float
    weights: Mapping[str, float]
    validation_error: float | None
    angle_errors: FloatArray = field(repr=False)
    level_errors: FloatArray = field(repr=False)
    pair_weights: FloatArray = field(repr=False)
    certificate: Certificate | None = field(default=None, repr=False)
    pressures: PressureEnsemble | None = field(default=None, repr=False)
    warnings: tuple[str, ...] = ()
    wrenches: FloatArray = field(default_factory=lambda: np.zeros((0, 3)), repr=False)
    twists: FloatArray = field(default_factory=lambda: np.zeros((0, 3)), repr=False)

    @property
    def prior_weight(self) -> float:
        """Weight of the pairs that stand for the slider's likely pressures, in pairs; 0 where no prior is used."""
        return self.weights.get("prior", 0.0)


def fit_limit_surface(  # noqa: PLR0913
    wrenches: ArrayLike | SlipPairs,
    twists: ArrayLike | None = None,
    model: str = "poly4-cvx",
    slider: Slider | None = None,
    characteristic_length: float | None = None,
    seed: int | None = None,
    *,
    loss: str = "squared",
    validation_indices: ArrayLike | None = None,
    robust: bool = True,
    com_tolerance: ArrayLike = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> Fit:
    """Identify ``H`` from loads and slip twists by a convex program that builds on the paper's.

    ``minimise |a - a0|² + Σ_i w_i (eta1 α_i + eta2 β_i)`` with ``α_i = |∇H(F_i) - (∇H(F_i)·V_i)V_i|²`` and ``β_i = (H(F_i) -
    1)²``, subject to SOS-convexity for the ``-cvx`` models and the quadratic. ``eta1, eta2`` are chosen by five-fold
    cross-validation of the angle between predicted and measured twists; the final solve uses all pairs. ``w_i`` are robust
    weights.

    ``a0`` is the power of an ellipsoid fitted to the same pairs, and ``|·|`` Bombieri's norm in coordinates in which that
    ellipsoid is a sphere (:class:`SquaredLoss`). With a slider, pressure distributions under its outline that have its centre
    of mass and that the pairs leave likely (:class:`PressureSampler`) add 400 pairs of their mean surface, worth ten of the
    measured; how much a measured pair counts beside them is then what the folds choose. Only outline and origin of the slider
    are used, not the support that it claims. Last, the coefficients are scaled so that the loads lie on ``H = 1`` on average.

    Parameters
    ----------
    wrenches : array-like, shape (n, 3), or SlipPairs
        Pairs of loads and twists, or loads ``(fx, fy, tau)`` in N and N·m, in B. With a slider ``n`` may be 0: the fit is then
        what the prior expects, in units of the friction load.
    twists : array-like, shape (n, 3)
        With loads: slip twists ``(vx, vy, omega)`` in B; only their directions count.
    model : {"poly4-cvx", "poly4", "poly6-cvx", "quadratic", "gp"}
        ``"gp"`` is the paper's baseline, a Gaussian process without physics; it needs scikit-learn.
    slider : Slider, optional
        Outline and centre of mass as prior knowledge; gives the characteristic length if that is not given.
    characteristic_length : float, optional
        ``rho`` in m; without it and without a slider ``sqrt(2) rms(tau) / rms(|f|)``.
    seed : int, optional
        Seed of the split into folds, of the pressures and of the ensemble; 0 if not given, so that a fit can be repeated.
    loss : {"squared", "published", "norm"}
        ``"squared"``: as above. ``"published"``: the paper's equation, ``a0 = 0`` and every ``w_i = 1``, without the slider.
        ``"norm"``: as in the authors' code (:class:`NormLoss`), without the slider: norms instead of squares, over all pairs
        at once for the ``-cvx`` models, of every pair for ``poly4`` and ``quadratic``.
    validation_indices : array-like of int, optional
        Rows that choose the weights and are not used otherwise, as in the paper's experiments, instead of folds.
    robust : bool
        Whether pairs that do not fit get less weight.
    com_tolerance : float or array-like, shape (2,)
        Half widths (m) of a box about the origin of B in which the centre of mass may lie, for the slider's prior.
    progress : callable, optional
        Called with the number of solves done and planned: from several threads, one at a time.

    Raises
    ------
    InputError
        Wrong shapes, zero loads or twists, loads that mostly oppose the motion, or units that cannot be right.
    SolverError
        No solver found a solution.
    """
    started = time.perf_counter()
    wrenches, twists = given_pairs(wrenches, twists)
    check_choice(model, "model", MODELS)
    check_choice(loss, "loss", LOSSES)
    seed = 0 if seed is None else check_seed(seed)
    if slider is not None and not isinstance(slider, Slider):
        raise InputError("slider", "expected a Slider", type(slider).__name__)
    box = _com_box(com_tolerance)
    pairs = Pairs.from_data(wrenches, twists, slider, characteristic_length)
    train, tests = _split(len(pairs), validation_indices, seed, pairs.usable)
    takes_prior = loss == "squared" and model in WITH_PRIOR
    warnings = _warnings_about_request(pairs, slider, bool(box.any()), takes_prior)
    if model == "gp":
        return _fit_gp(pairs, train, started, warnings)
    degree, convex = POLYNOMIALS[model]
    sampler = None
    if slider is not None and takes_prior:
        sampler, doubts = _sampler(slider, box, seed, com_tolerance)
        warnings += doubts
    warnings += pairs.take(train).warnings(1 if sampler is not None else _needed(degree), slider)
    estimator: Estimator
    if loss == "norm":
        estimator = NormLoss(degree, convex, pairs.force_scale)
    else:
        published = loss == "published"
        estimator = SquaredLoss(degree, convex, sampler, robust and not published, "zero" if published else "ellipsoid")
    solves = _Solves(estimator, len(estimator.candidates) * len(tests) + 1, progress)
    solved = _solved(solves, pairs, train, tests, validation_indices is None, degree)
    warnings += _warnings_about_solution(solved, solves, sampler, pairs, train, degree)
    level = _level(solved.best.coefficients, pairs.take(train), solved.whole.pair_weights, degree) if loss == "squared" else 1.0
    of_members = (degree, convex, seed, level)
    surface, certificate, ensemble_warnings = _surface(solved, estimator, pairs, of_members, (model, len(train), loss))
    gradient = gradient_rows(pairs.loads, degree) @ (level * solved.best.coefficients)
    angle_errors = angle_between(gradient, pairs.directions)
    warnings += [*_warnings_about_frames(angle_errors[pairs.usable]), *ensemble_warnings]
    pair_weights = np.zeros(len(pairs))
    pair_weights[train] = solved.whole.pair_weights
    pressures = solved.whole.pressures
    f = np.asarray(wrenches, dtype=np.float64)
    return Fit(
        surface=surface,
        model=model,
        status=solved.best.status,
        solve_time=solved.best.solve_time,
        total_time=time.perf_counter() - started,
        weights=asdict(solved.weights),
        validation_error=solved.error,
        angle_errors=read_only(angle_errors),
        level_errors=read_only(surface.value(f if surface.force_unit == "N" else f / pairs.force_scale) - 1),
        pair_weights=read_only(pair_weights),
        certificate=certificate,
        pressures=None if pressures is None or not solved.weights.prior else pressures.scaled(pairs.force_scale),
        warnings=tuple(warnings),
        wrenches=read_only(f),
        twists=read_only(np.asarray(twists, dtype=np.float64)),
    )


def _warnings_about_request(pairs: Pairs, slider: Slider | None, boxed: bool, takes_prior: bool) -> list[str]:
    """Refuse what a fit cannot take, and tell what it leaves out."""
    if boxed and (slider is None or not takes_prior):
        raise InputError(
            "com_tolerance",
            f"expected a slider and a model that takes it as prior knowledge ({' or '.join(WITH_PRIOR)} with the squared loss)",
        )
    if not len(pairs) and not takes_prior:
        raise InputError(
            "wrenches, twists", f"expected at least one pair; without any, only {' and '.join(WITH_PRIOR)} have a prior"
        )
    warnings: list[str] = []
    if len(pairs.usable) < len(pairs):
        left_out = np.setdiff1d(np.arange(len(pairs)), pairs.usable)
        warnings.append(
            f"{len(left_out)} of {len(pairs)} pairs are left out, the first of them number {left_out[0]}, counted from 0: "
            f"their loads are more than {LARGEST_RATIO:g} times larger or smaller than the median"
        )
    if slider is not None and not takes_prior:
        warnings.append("this fit has no prior: of the slider it uses only the characteristic length")
    return warnings


def _sampler(slider: Slider, box: FloatArray, seed: int, com_tolerance: ArrayLike) -> tuple[PressureSampler | None, list[str]]:
    """The likely pressures under a slider; None, and why, if there are none."""
    try:
        sampler = PressureSampler(slider.vertices, box, seed)
        sampler.prior()
    except InputError as reason:
        if box.any() and _has_prior(slider, seed):
            raise InputError("com_tolerance", "expected a box inside the slider's outline", com_tolerance) from None
        return None, [f"the slider is not used as a prior: {reason}"]
    return sampler, []


class _Solves:
    """Solves of an estimator, from several threads, that tell their progress one at a time."""

    def __init__(self, estimator: Estimator, planned: int, progress: Callable[[int, int], None] | None) -> None:
        self.estimator, self._planned, self._progress = estimator, planned, progress
        self.done = self.taken_over = 0
        self._counting, self._stopped = threading.Lock(), False

    def __call__(self, part: Part, weights: Any) -> Estimate:
        solution = self.estimator.solve(part, weights)
        with self._counting:
            self.done += 1
            self.taken_over += solution.taken_over
            if self._progress is not None and not self._stopped:
                try:
                    self._progress(self.done, self._planned)
                except BaseException:
                    # what else is under way must not call again
                    self._stopped = True
                    raise
        return solution


class _Solved(NamedTuple):
    """The best estimate from all training pairs, ``whole``, with the weights that folds chose, and the error on others."""

    best: Estimate
    whole: Part
    weights: Any
    error: float | None


def _solved(
    solves: _Solves, pairs: Pairs, train: np.ndarray, tests: Sequence[np.ndarray], in_folds: bool, degree: int
) -> _Solved:
    estimator = solves.estimator
    # what takes longest, drawing pressures, side by side
    of_folds = estimator.of_folds()
    folds = [(of_folds, np.setdiff1d(train, rows)) for rows in tests] if in_folds else []
    whole, *parts = in_threads(lambda job: job[0].prepare(pairs.take(job[1])), [(estimator, train), *folds])
    # rows that validate are no part of those to fit
    parts = parts or [whole] * len(tests)
    chosen, error = estimator.default, None
    if tests:
        errors = _held_out_errors(estimator, pairs, parts, tests, degree, solves)
        chosen = _choose(errors, estimator.with_prior)
        error = float(errors[chosen].mean())
    weights = estimator.candidates[chosen]
    best = solves(whole, weights)
    if isinstance(estimator, NormLoss) and isinstance(weights, NormWeights) and estimator.convex:
        best = estimator.solve(whole, weights, PROVABLE * float(np.abs(best.coefficients).max()))
    return _Solved(best, whole, weights, error)


def _surface(
    solved: _Solved, estimator: Estimator, pairs: Pairs, of_members: tuple[int, bool, int, float], named: tuple[str, int, str]
) -> tuple[PolynomialLimitSurface, Certificate | None, list[str]]:
    """The surface of an estimate, with its certificate and ensemble, and what is to be said of it.

    ``of_members``: degree, whether it is convex, seed of the ensemble, and factor on the coefficients; ``named``: model, number
    of pairs and loss.
    """
    (degree, convex, seed, level), (model, count, loss) = of_members, named
    best, weights = solved.best, solved.weights
    ensemble: list[FloatArray] = []
    if convex and isinstance(estimator, SquaredLoss) and isinstance(weights, SquaredWeights):
        ensemble = draw_coefficients(estimator, solved.whole, weights, best.coefficients, pairs.rho, seed)
    gram = None if best.gram is None else level * best.gram
    certificate = None if gram is None else certify(level * best.coefficients, gram, degree)
    with catch_warnings(record=True) as heard:
        simplefilter("always")
        surface = surface_from_scaled(
            level * best.coefficients,
            degree,
            pairs.rho,
            pairs.force_scale if len(pairs) else None,
            certificate=certificate,
            ensemble=[level * a for a in ensemble],
            provenance={"model": model, "pairs": count, "loss": loss, "prior": bool(weights.prior)},
        )
    return surface, certificate, [str(warning.message) for warning in heard]


def _warnings_about_solution(
    solved: _Solved, solves: _Solves, sampler: PressureSampler | None, pairs: Pairs, train: np.ndarray, degree: int
) -> list[str]:
    """What is to be said of an estimate."""
    best, whole, weights, _ = solved
    warnings = _warnings_about_prior(sampler, weights, whole)
    if solves.taken_over:
        warnings.append(f"the first solver failed in {solves.taken_over} of {solves.done} solves; the second one solved them")
    of_norms = isinstance(solves.estimator, NormLoss)
    if of_norms and np.median(monomials(pairs.loads, degree) @ best.coefficients) < COLLAPSED:
        warnings.append(
            "the penalty outweighs the pairs: the surface has a shape, but its size has no meaning (are the loads in N?)"
        )
    outliers = int((whole.pair_weights < OUTLIER_WEIGHT).sum())
    if outliers and not weights.prior:
        warnings.append(f"{outliers} of {len(train)} pairs are outliers and have little weight")
    return warnings


def _has_prior(slider: Slider, seed: int) -> bool:
    """Whether pressures can be drawn for a slider whose centre of mass is the origin."""
    try:
        PressureSampler(slider.vertices, np.zeros(2), seed).prior()
    except InputError:
        return False
    return True


def _held_out_errors(
    estimator: Estimator,
    pairs: Pairs,
    parts: Sequence[Part],
    tests: Sequence[np.ndarray],
    degree: int,
    solve: Callable[[Part, Any], Estimate],
) -> FloatArray:
    """Angles (rad) of pairs that were left out, (candidates, pairs), by fits to the other ``parts`` with every candidate for the
    weights."""
    errors = np.empty((len(estimator.candidates), len(pairs)))
    gradients = [gradient_rows(pairs.loads[rows], degree) for rows in tests]

    def judge(job: tuple[int, int]) -> None:
        fold, c = job
        rows = tests[fold]
        try:
            coefficients = solve(parts[fold], estimator.candidates[c]).coefficients
        except SolverError:
            # weights at which no solver finds a solution are the last to choose
            errors[c, rows] = np.pi
        else:
            errors[c, rows] = angle_between(gradients[fold] @ coefficients, pairs.directions[rows])

    jobs = list(itertools.product(range(len(tests)), range(len(estimator.candidates))))
    if estimator.solves_side_by_side:
        in_threads(judge, jobs)
    else:
        for job in jobs:
            judge(job)
    return errors[:, np.concatenate(tests)]


def _warnings_about_prior(sampler: PressureSampler | None, weights: Any, whole: Part) -> list[str]:
    """Warnings about the slider's prior."""
    warnings = []
    if sampler is not None and weights.prior == 0:
        warnings.append(
            "the pokes contradict every pressure under the outline with the centre of mass at the origin: "
            "the fit follows the pokes (is the outline, the centre of mass or the sign of a moment wrong?)"
        )
    if weights.prior and whole.pressures is not None and whole.pressures.acceptance < LEAST_ACCEPTANCE:
        warnings.append(f"only {whole.pressures.acceptance:.1%} of the Metropolis steps were accepted: the spread may be wrong")
    return warnings


def _warnings_about_frames(angle_errors: FloatArray) -> list[str]:
    """Warnings about pairs whose loads and motions do not belong together."""
    middle = float(np.median(angle_errors)) if len(angle_errors) else 0.0
    if len(angle_errors) < FOLDS or middle < _WRONG_FRAMES:
        return []
    off = f"the motions of half of the pairs are more than {np.degrees(middle):.0f} degrees off what the surface predicts"
    return [f"{off}: loads and motions may not be in the same frame (sign, axes, angle or units of the forces?)"]


def _level(coefficients: FloatArray, pairs: Pairs, weights: FloatArray, degree: int) -> float:
    """Factor of the coefficients for which the loads lie on the surface on average; directions and convexity stay.

    The weights are chosen by angles, which leave the scale free, and every residual and penalty shrinks it.
    """
    value = monomials(pairs.loads, degree) @ coefficients
    if not len(pairs) or not (value > 0).all():
        return 1.0
    # the size of a load on the surface, in its direction, is |F| H^(-1/d): its relative error has mean zero
    return float(weights.sum() / (weights @ value ** (1 / degree))) ** degree


def _com_box(tolerance: ArrayLike) -> FloatArray:
    box = check_vectors(np.atleast_1d(tolerance), "com_tolerance", np.atleast_1d(tolerance).shape[-1])
    if box.shape not in ((1,), (2,)) or (box < 0).any():
        raise InputError("com_tolerance", "expected one or two half widths >= 0 in m", repr(tolerance))
    return np.broadcast_to(box, (2,))


def _needed(degree: int) -> int:
    """Pairs of general position that settle the coefficients: each gives two equations for the slip and one for the level."""
    return -(-(degree + 1) * (degree + 2) // 6)


def _split(
    count: int, validation_indices: ArrayLike | None, seed: int, usable: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the rows to fit, and the sets of rows that validate."""
    if validation_indices is not None:
        try:
            rows = np.asarray(validation_indices)
        except ValueError:
            raise InputError("validation_indices", "expected a list of row numbers") from None
        if rows.ndim != 1 or not len(rows) or not np.issubdtype(rows.dtype, np.integer):
            raise InputError("validation_indices", "expected at least one row number")
        if rows.min() < 0 or rows.max() >= count or len(np.unique(rows)) != len(rows):
            raise InputError("validation_indices", f"expected different rows from 0 to {count - 1}")
        train, rows = np.setdiff1d(usable, rows), np.intersect1d(rows, usable)
        if not len(train) or not len(rows):
            raise InputError("validation_indices", "expected rows that leave some pairs to fit, and to validate")
        return train, [rows]
    if len(usable) < FOLDS:
        return usable, []
    order = np.random.default_rng(seed).permutation(usable)
    return usable, [np.sort(part) for part in np.array_split(order, FOLDS)]


def _choose(errors: FloatArray, with_prior: int) -> int:
    """Return the candidate to use, from errors (c, n) over held-out pairs.

    Of the first ``with_prior`` candidates, which use a prior and lean on it less and less, the first that is not worse than the
    best of them by more than the standard error of the difference (Breiman et al. 1984). It gives way to a candidate without
    a prior only if that is better at the 5 % level (paired t test): the prior is dropped only on significant evidence.
    """
    mean = errors.mean(axis=1)
    count = errors.shape[1]
    if not with_prior or count < 2:
        return first_least(mean[: with_prior or None], _ALIKE)
    differences = errors[:with_prior] - errors[first_least(mean[:with_prior], _ALIKE)]
    chosen = int(np.argmax(differences.mean(axis=1) <= differences.std(axis=1, ddof=1) / np.sqrt(count) + _ALIKE))
    plain = with_prior + first_least(mean[with_prior:], _ALIKE)
    gain = errors[chosen] - errors[plain]
    needed = float(scipy.special.stdtrit(count - 1, 0.975)) * gain.std(ddof=1) / np.sqrt(count)
    return plain if gain.mean() > needed + _ALIKE else chosen


def _fit_gp(pairs: Pairs, train: np.ndarray, started: float, warnings: list[str]) -> Fit:
    surface, elapsed = fit_gaussian_process(pairs.take(train))
    f = pairs.loads * pairs.force_scale * (1.0, 1.0, pairs.rho)
    slip = normalize_twist(surface.twist(f), pairs.rho)
    return Fit(
        surface=surface,
        model="gp",
        status="solved",
        solve_time=elapsed,
        total_time=time.perf_counter() - started,
        weights={},
        validation_error=None,
        angle_errors=read_only(angle_between(slip, pairs.directions)),
        level_errors=read_only(surface.value(f) - 1),
        pair_weights=read_only(np.isin(np.arange(len(pairs)), train).astype(float)),
        warnings=(*warnings, "a Gaussian process is no limit surface: nothing makes it convex, nor its slip and its loads agree"),
        wrenches=read_only(f),
        twists=read_only(pairs.directions / (1.0, 1.0, pairs.rho)),
    )
