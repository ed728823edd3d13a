"""What physics knows before the first poke: pressure distributions over the outline, with the known centre of mass.

A draw is a set of 3 to 12 support points, uniform over the outline, whose shares are Dirichlet weights tilted exponentially,
``q_k ∝ g_k exp(λ·x_k)``, until their mean is the centre of mass, the origin of B. Each draw has an ideal limit surface.
Pokes weigh the draws: the load that a draw predicts for a measured twist, up to one scale, misses the measured load by a Student
error of :data:`LOAD_ERROR` of its size. Plain weighting leaves two or three of thousands of draws after 20 pokes; so the
pokes are brought in by degrees (sequential Monte Carlo, Del Moral, Doucet and Jasra 2006): temper until half of the draws'
weight is gone, resample, move every draw by Metropolis steps, and so on.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, fields, replace

import numpy as np
import shapely

from stablepush.core import FloatArray, InputError, read_only
from stablepush.geometry import unit

#: Scale of the load's error relative to its size, of a Student distribution with four degrees of freedom: scatter within a
#: poke is 9 % on the published logs, and friction is not quite Coulomb's.
LOAD_ERROR = 0.15
#: Scatter (rad) of the twist's direction, each way: the path of a poke is a chord, and the tracking of its ends not exact.
TWIST_ERROR = 0.05
_SCATTER_WEIGHTS = np.array((1, 0.5, 0.5, 0.5, 0.5)) / 3
#: The centre of mass is the origin of B.
NO_BOX = np.zeros(2)
#: Numbers of support points of a draw.
FEWEST_POINTS, MOST_POINTS = 3, 12
#: Metropolis steps for each draw after each resampling; share of the draws' weight that is left before one.
_MOVES, _LEAST_WEIGHT = 12, 0.5
#: Newton steps of the tilt, and how near (of the outline's radius) its mean must come to the centre of mass.
_TILT_STEPS, _TILT_TOLERANCE = 40, 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class PressureEnsemble:
    """Equally likely pressure distributions.

    ``points`` (m, 12, 2): support points (m, in B); ``shares`` (m, 12): their shares of the load, zero for unused points;
    ``loads`` (m,): total friction load ``mu*N`` in N, one without pokes. ``ancestors``: different draws of the prior that
    they come from, and ``acceptance``: share of Metropolis steps taken after the last resampling; both measure how well the
    draws are mixed.
    """

    points: FloatArray
    shares: FloatArray
    loads: FloatArray
    ancestors: int
    acceptance: float

    def wrenches(self, twists: FloatArray, rho: float) -> FloatArray:
        """Return the normalised loads (m, n, 3) of unit normalised twists (n, 3)."""
        return predict_loads(self.points / rho, self.shares * self.loads[:, None], twists)

    def scaled(self, factor: float) -> PressureEnsemble:
        """Return the same pressures with their friction loads times ``factor``."""
        return replace(self, loads=read_only(self.loads * factor))


def predict_loads(points: FloatArray, loads: FloatArray, twists: FloatArray) -> FloatArray:
    """Ideal loads (m, n, 3) of m supports with points (m, k, 2) and friction loads (m, k), for twists (n, 3), all normalised."""
    from stablepush.surfaces.kernels import sum_loads_of_many

    result = np.empty((len(points), 3, len(twists)))
    # copies: code is compiled once, for arrays that may be written
    sum_loads_of_many(np.array(points, order="C"), np.array(loads, order="C"), np.array(twists.T, order="C"), result)
    return result.transpose(0, 2, 1)


class PressureSampler:
    """Draws pressure distributions over an outline, and from them those that pokes leave likely."""

    def __init__(self, outline: FloatArray, com_box: FloatArray = NO_BOX, seed: int = 0, count: int = 400) -> None:
        self._polygon = shapely.Polygon(outline)
        shapely.prepare(self._polygon)
        self._low, self._high = outline.min(axis=0), outline.max(axis=0)
        self._radius = float(np.linalg.norm(outline, axis=1).max())
        self._box = com_box
        self._count = count
        self._seed = seed

    def of_folds(self) -> PressureSampler:
        """Return a sampler of half as many draws."""
        result = copy.copy(self)
        result._count = max(1, self._count // 2)
        return result

    def prior(self) -> PressureEnsemble:
        """Return draws that no poke has weighed."""
        state = self._first(np.random.default_rng(self._seed))
        return PressureEnsemble(read_only(state.points), read_only(state.shares), np.ones(self._count), self._count, 1.0)

    def posterior(self, loads: FloatArray, twists: FloatArray, rho: float) -> PressureEnsemble:
        """Return draws given normalised loads (n, 3) and unit normalised twists (n, 3)."""
        if not len(loads):
            return self.prior()
        rng = np.random.default_rng(self._seed)
        state = self._first(rng)
        pokes = _Pokes.of(loads, twists, rho)
        scale, likelihood = pokes.weigh(state, state.good)
        power, ancestors, taken = 0.0, np.arange(self._count), 0.0
        while power < 1.0:
            step = _temper(likelihood, 1.0 - power)
            power += step
            weights = np.exp(step * (likelihood - likelihood.max()))
            chosen = _systematic(weights / weights.sum(), rng)
            state, scale, likelihood = state.take(chosen), scale[chosen], likelihood[chosen]
            ancestors, taken = ancestors[chosen], 0.0
            for _ in range(_MOVES):
                proposed, ratio = self._propose(state, rng)
                new_scale, new_likelihood = pokes.weigh(proposed, np.isfinite(ratio))
                accepted = np.log(rng.random(self._count)) < power * (new_likelihood - likelihood) + ratio
                state = state.replace(accepted, proposed)
                scale = np.where(accepted, new_scale, scale)
                likelihood = np.where(accepted, new_likelihood, likelihood)
                taken += float(accepted.mean()) / _MOVES
        left = len(np.unique(ancestors))
        return PressureEnsemble(read_only(state.points), read_only(state.shares), read_only(scale), left, taken)

    def _first(self, rng: np.random.Generator) -> _State:
        """Draw from the prior: draws whose points do not surround the centre of mass are drawn again."""
        parts: list[_State] = []
        have = 0
        for _ in range(200):
            used = rng.integers(FEWEST_POINTS, MOST_POINTS + 1, size=self._count)
            active = np.arange(MOST_POINTS) < used[:, None]
            points = self._uniform(self._count * MOST_POINTS, rng).reshape(-1, MOST_POINTS, 2)
            center = self._box * rng.uniform(-1, 1, size=(self._count, 2))
            state = self._tilted(points, rng.exponential(size=active.shape), active, center)
            parts.append(state.take(np.flatnonzero(state.good)))
            have += len(parts[-1].good)
            if have >= self._count:
                return _State.join(parts).take(np.arange(self._count))
        raise InputError("slider", "expected the centre of mass, the origin of B, well inside the hull of the outline")

    def _uniform(self, count: int, rng: np.random.Generator) -> FloatArray:
        found: list[FloatArray] = []
        have = 0
        while have < count:
            tried = rng.uniform(self._low, self._high, size=(2 * count, 2))
            found.append(tried[shapely.contains_xy(self._polygon, *tried.T)])
            have += len(found[-1])
        return np.concatenate(found)[:count]

    def _propose(self, state: _State, rng: np.random.Generator) -> tuple[_State, FloatArray]:
        """Move one point, draw one afresh, or change all raw shares; returns the log ratio of the prior, -inf if impossible."""
        count = len(state.good)
        rows = np.arange(count)
        column = (rng.random(count) * state.active.sum(axis=1)).astype(int)
        points, raw = state.points.copy(), state.raw.copy()
        kind = rng.random(count)
        near = points[rows, column] + rng.normal(size=(count, 2)) * (self._radius * 10 ** rng.uniform(-2, -0.5, size=(count, 1)))
        fresh = self._uniform(count, rng)
        place = np.where((kind < 0.5)[:, None], near, fresh)
        moved = kind < 0.7
        points[rows[moved], column[moved]] = place[moved]
        # raw shares are exponential variates; a step in their logarithm has the Jacobian of the product
        change = rng.normal(size=raw.shape) * (10 ** rng.uniform(-1.5, 0, size=(count, 1)))
        change[moved] = 0.0
        raw = raw * np.exp(change)
        # where the centre of mass is not certain, every other proposal moves that as well
        again = rng.random(count) < 0.5
        center = np.where(again[:, None], self._box * rng.uniform(-1, 1, size=(count, 2)), state.center)
        proposed = self._tilted(points, raw, state.active, center)
        ratio = ((state.raw - raw + change) * state.active).sum(axis=1)
        inside = np.ones(count, dtype=bool)
        inside[moved] = shapely.contains_xy(self._polygon, *place[moved].T)
        return proposed, np.where(inside & proposed.good, ratio, -np.inf)

    def _tilted(self, points: FloatArray, raw: FloatArray, active: np.ndarray, center: FloatArray) -> _State:
        """Return draws whose shares ``q ∝ raw exp(λ·x)`` have the mean ``center``."""
        from stablepush.identify.kernels.pressure_draws import tilt_shares

        shares, good = np.empty(active.shape), np.empty(len(points), dtype=bool)
        scaled, scaled_center = points / self._radius, np.ascontiguousarray(center / self._radius)
        tilt_shares(scaled, raw, active, scaled_center, _TILT_TOLERANCE, _TILT_STEPS, shares, good)
        return _State(points, raw, active, center, shares, good)


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """Draws: support points (m, k, 2), raw shares and which are used (m, k), centre of mass (m, 2), tilted shares (m, k)."""

    points: FloatArray
    raw: FloatArray
    active: np.ndarray
    center: FloatArray
    shares: FloatArray
    good: np.ndarray

    def take(self, rows: np.ndarray) -> _State:
        return _State(*(getattr(self, name)[rows] for name in _PARTS))

    def replace(self, rows: np.ndarray, other: _State) -> _State:
        """Return this state with some rows (m,) of ``other``."""
        both = ((getattr(self, name), getattr(other, name)) for name in _PARTS)
        return _State(*(np.where(rows.reshape(-1, *(1,) * (old.ndim - 1)), new, old) for old, new in both))

    @staticmethod
    def join(parts: list[_State]) -> _State:
        return _State(*(np.concatenate([getattr(p, name) for p in parts]) for name in _PARTS))


_PARTS = tuple(field.name for field in fields(_State))


def _scattered(twists: FloatArray) -> FloatArray:
    """Twists (n, 5, 3) that stand for a measured one (n, 3) and its error: itself and four at ``sqrt(3) TWIST_ERROR`` from it.

    With the weights :data:`_SCATTER_WEIGHTS` they have the moments of a normal error up to the third (unscented transform,
    Julier and Uhlmann 1997).
    """
    helper = np.where(np.abs(twists[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    first = unit(np.cross(twists, helper))
    second = np.cross(twists, first)
    step = np.sqrt(3.0) * TWIST_ERROR
    return unit(twists[:, None] + step * np.stack((0 * first, first, -first, second, -second), axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class _Pokes:
    """What draws are weighed by: normalised loads (n, 3), and the twists (3, q n) that they may belong to."""

    loads: FloatArray
    twists: FloatArray
    rho: float

    @classmethod
    def of(cls, loads: FloatArray, twists: FloatArray, rho: float) -> _Pokes:
        """Pokes with normalised loads (n, 3) and unit normalised twists (n, 3)."""
        scattered = _scattered(twists).transpose(2, 1, 0).reshape(3, -1)
        # copies: code is compiled once, for arrays that may be written
        return cls(np.array(loads, order="C"), np.array(scattered, order="C"), rho)

    def weigh(self, draws: _State | PressureEnsemble, possible: np.ndarray) -> tuple[FloatArray, FloatArray]:
        """Friction load (m,) that fits each draw to the pokes best, and its log likelihood (m,), -inf if it is not possible.

        The likelihood of a pair is the mean over the twists that it may have had of a Student density of the load's error.
        """
        from stablepush.identify.kernels.pressure_draws import weigh

        scales, likelihoods = np.empty(len(possible)), np.empty(len(possible))
        points, given = draws.points / self.rho, (self.twists, self.loads, _SCATTER_WEIGHTS, LOAD_ERROR)
        weigh(points, draws.shares, possible, *given, scales, likelihoods)
        return scales, likelihoods


def _temper(likelihood: FloatArray, most: float) -> float:
    """Largest step of the likelihood's power, up to ``most``, that leaves half of the effective sample size (bisection)."""

    def left(step: float) -> float:
        weights = np.exp(step * (likelihood - likelihood.max()))
        return float(weights.sum() ** 2 / (weights**2).sum() / len(weights))

    if left(most) >= _LEAST_WEIGHT:
        return most
    low, high = 0.0, most
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if left(middle) >= _LEAST_WEIGHT else (low, middle)
    return max(low, 1e-6)


def _systematic(weights: FloatArray, rng: np.random.Generator) -> np.ndarray:
    """Systematic resampling: rows (m,) in proportion to their weights."""
    count = len(weights)
    places = (rng.random() + np.arange(count)) / count
    return np.minimum(np.searchsorted(np.cumsum(weights), places), count - 1)
