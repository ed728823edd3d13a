"""Which model fits pokes best: angles on pairs that were left out of the fit, by folds that are drawn several times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray, InputError, check_seed, check_vectors, first_least, read_only, run_parallel
from stablepush.geometry import angle_between, normalize_twist
from stablepush.identify.fit import MODELS, fit_limit_surface
from stablepush.identify.pairs import Pairs, SlipPairs, given_pairs
from stablepush.objects import Slider

#: Mean errors (rad) that differ by no more are alike.
_ALIKE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class CrossValidation:
    """Errors of models on pairs that they were not fitted to.

    Attributes
    ----------
    models : tuple of str
    errors : array, shape (models, pairs)
        Angle (rad), in ``(vx, vy, rho*omega)``, between measured and predicted twist of each pair, mean over the repeats.
    """

    models: tuple[str, ...]
    errors: FloatArray

    @property
    def means(self) -> FloatArray:
        """Mean error (models,) in rad."""
        return np.asarray(self.errors.mean(axis=1))

    @property
    def best(self) -> str:
        """The model whose mean error is least; the first of those that are as good to 1e-6 rad, which solvers leave."""
        return self.models[first_least(self.means, _ALIKE)]

    def behind(self, model: str) -> tuple[float, float]:
        """Return by how much (rad) a model errs more than the best, and half the 95 % interval of that difference, from its
        scatter between pairs."""
        if model not in self.models:
            raise InputError("model", f"expected one of {', '.join(self.models)}", repr(model))
        difference = self.errors[self.models.index(model)] - self.errors[first_least(self.means, _ALIKE)]
        return float(difference.mean()), float(1.96 * difference.std(ddof=1) / np.sqrt(len(difference)))


def cross_validate(  # noqa: PLR0913
    wrenches: ArrayLike | SlipPairs,
    twists: ArrayLike | None = None,
    models: Sequence[str] = ("poly4-cvx", "quadratic", "poly4"),
    slider: Slider | None = None,
    characteristic_length: float | None = None,
    *,
    folds: int = 5,
    repeats: int = 4,
    seed: int | None = None,
    processes: int | None = 1,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> CrossValidation:
    """Compare models on the same pairs: each pair is predicted by fits that did not see it.

    Parameters
    ----------
    wrenches, twists : array-like, shape (n, 3)
        As :func:`fit_limit_surface` takes them.
    models : sequence of str
        Of those that :func:`fit_limit_surface` knows.
    slider, characteristic_length
        For every fit; a model that does not know a slider takes its characteristic length alone.
    folds, repeats : int
        Parts that the pairs are cut into, at random and ``repeats`` times.
    seed : int, optional
        Of the cuts and of the fits; 0 if not given.
    processes, scheduler
        Where the fits are made, see :func:`stablepush.core.parallel.run_parallel`; the result does not depend on it.
    progress : callable, optional
        Called with the number of fits done and planned.
    """
    seed = check_seed(0 if seed is None else seed)
    models = tuple(models)
    for name, number in (("folds", folds), ("repeats", repeats)):
        if isinstance(number, bool) or not isinstance(number, int | np.integer):
            raise InputError(name, "expected a whole number", repr(number))
    for model in models:
        if model not in MODELS:
            raise InputError("models", f"expected some of {', '.join(MODELS)}", repr(model))
    if not models:
        raise InputError("models", "expected at least one")
    wrenches, twists = given_pairs(wrenches, twists)
    loads, motions = check_vectors(wrenches, "wrenches", 3), check_vectors(twists, "twists", 3)
    # checks what the pairs are, and gives the length that all fits share
    rho = Pairs.from_data(loads, motions, slider, characteristic_length).rho
    if not 2 <= folds <= len(loads):
        raise InputError("folds", f"expected from 2 to the number of pairs, {len(loads)}", folds)
    if repeats < 1:
        raise InputError("repeats", "expected at least 1", repeats)
    rng = np.random.default_rng(seed)
    tests = [rows for _ in range(repeats) for rows in np.array_split(rng.permutation(len(loads)), folds)]
    jobs = [(loads, motions, rows, model, slider, rho, seed) for model in models for rows in tests]
    errors = np.zeros((len(models), len(loads)))
    for done, found in enumerate(run_parallel(_held_out, jobs, processes, scheduler=scheduler), 1):
        row, part = divmod(done - 1, len(tests))
        errors[row, tests[part]] += found / repeats
        if progress is not None:
            progress(done, len(jobs))
    return CrossValidation(models, read_only(errors))


def _held_out(
    wrenches: FloatArray, twists: FloatArray, rows: np.ndarray, model: str, slider: Slider | None, rho: float, seed: int
) -> FloatArray:
    train = np.setdiff1d(np.arange(len(wrenches)), rows)
    try:
        fit = fit_limit_surface(wrenches[train], twists[train], model, slider, rho, seed)
    except InputError as error:
        raise error.within(f"{model}, without the pairs {', '.join(map(str, rows))}") from None
    return np.asarray(angle_between(normalize_twist(fit.surface.twist(wrenches[rows]), rho), normalize_twist(twists[rows], rho)))
