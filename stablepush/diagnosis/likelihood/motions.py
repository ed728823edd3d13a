"""The equations of a log without forces: measured against simulated final poses.

``log(p(θ, s)⁻¹ q) = noise`` in ``(x, y, rho θ)`` for the measured final pose ``q`` of a push and its final pose ``p`` when it is
simulated again with effects ``θ`` on a surface ``s``: the nominal pressure moved and stretched about its centre (an affine map).
The clearances of the fingers are added to these.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stablepush.core import BoolArray, FloatArray, first_least
from stablepush.diagnosis.likelihood.equations import SIZES, Demands, Fitted, Values, robust_variance
from stablepush.diagnosis.likelihood.replay import MOVING, Replay, pose_errors
from stablepush.diagnosis.likelihood.system import System
from stablepush.diagnosis.rows.observations import Observations
from stablepush.io import Rig
from stablepush.objects import SupportDistribution
from stablepush.surfaces import IdealLimitSurface

#: Prior standard deviations of a shift of the pressure (over the radius of gyration) and of its stretches; differences for them.
_PRIOR = (0.2, 0.2, 0.2, 0.2, 0.2)
_SMALL = (0.02, 0.02, 0.05, 0.05, 0.05)
#: Cells along each side in which the nominal pressure is gathered.
_CELLS = 5
#: Share of what the prior lets the surface move a final pose that counts as noise, before what a free pressure leaves is known.
_SHARE = 0.1
#: A shift over the characteristic length, and each stretch of the pressure, may be as much as this.
_MOST_MOVED = 0.6
#: Friction of the fingers, where it is not known, that is tried to begin with.
_CONTACT_MUS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15)


class Motions(System):
    """The whitened equations of a log without forces. ``loads`` stand for the surface: shift (2,) of the pressure over ``rho``,
    and stretches along x, along y and askew.

    Attributes
    ----------
    pushes : list of Replay
        Those that can be simulated.
    spread : array, shape (3n,)
        Noise in m of the components of the final poses.
    """

    # every residual is a simulation of all pushes
    steps, few, tolerance = 5, 4, 1e-3
    # final poses depend nonlinearly on effects: a single step is a poor test, so the gain of a full fit may decide
    demands = Demands(4.0, 12.0, 3.0, 0.01, 1.5)

    def __init__(self, observations: Observations, rig: Rig, pushes: list[Replay]) -> None:
        super().__init__(observations, rig)
        self.has_surface = True
        self.known_scale = True
        believed = self.believed.points
        self._surface = IdealLimitSurface(_coarse(believed.support), believed.friction_load, self.rho)
        self.believed = replace(self.believed, points=self._surface)
        self.nominal = np.zeros(len(_SMALL))
        if rig.contact_friction is None:
            self.nuisance = (*self.nuisance, "contact-friction")
            self.mu = self._likely_contact_mu(pushes)
        self._slopes: dict[str, FloatArray] = {}
        self._fits: dict[Any, Fitted] = {}
        #: What fits begin at, slopes about it, and fits that were made: before one was settled on.
        self._first = self.about, self._slopes, self._fits
        self._found: dict[Any, FloatArray] = {}
        self.pushes, self.final_pose_noise = self.predictable(pushes)
        #: How far (m, for each component of a final pose) the surface moves it within its prior: the final pose of a push
        #: that slips depends on friction, that of a push that sticks follows the pusher.
        self.reach = np.linalg.norm(self._slope("", _SMALL) * _PRIOR, axis=1)
        self.spread = np.hypot(self.final_pose_noise.ravel(), _SHARE * self.reach)
        self.trial = np.concatenate((np.repeat([p.trial for p in self.pushes], 3), self.trial)).astype(int)

    def _likely_contact_mu(self, pushes: list[Replay]) -> float:
        """Friction of the fingers that minimises the pose errors of the nominal simulation: the start of fits."""
        table = self.table(self.nominal, {})
        errors = [np.linalg.norm(pose_errors(pushes, table, self.rig.slider, mu, {}), axis=1) for mu in _CONTACT_MUS]
        return _CONTACT_MUS[first_least([np.nan_to_num(m, nan=10 * self.rho).sum() for m in errors], 1e-6 * len(pushes))]

    def surface(self, loads: FloatArray) -> IdealLimitSurface:
        """Return the nominal pressure moved and stretched."""
        ideal, (x, y, along, across, askew) = self._surface, np.clip(loads, -_MOST_MOVED, _MOST_MOVED)
        center = ideal.support.center
        stretch = np.array(((1 + along, askew), (askew, 1 + across)))
        points = center + self.rho * np.array((x, y)) + (ideal.support.points - center) @ stretch
        return IdealLimitSurface(SupportDistribution(points, ideal.support.weights), ideal.friction_load, self.rho)

    def moved_center(self, loads: FloatArray, changes: FloatArray) -> tuple[FloatArray, FloatArray]:
        # the first two loads are the shift over rho
        return self.rho * np.clip(loads[:2], -_MOST_MOVED, _MOST_MOVED), self.rho * np.sqrt((changes[:2] ** 2).sum(axis=1))

    def pose_errors(self, loads: FloatArray, values: Values) -> FloatArray:
        """Return pose errors (n, 3): measured minus simulated final poses, in ``(x, y, rho θ)`` of the simulated frame, in m."""
        key = loads.tobytes(), tuple((id, values[id].tobytes()) for id in sorted(values) if values[id].any())
        if key not in self._found:
            found = self.simulated_errors(self.pushes, loads, values)
            # what cannot be simulated is as far off as nothing else
            self._found[key] = np.nan_to_num(found, nan=10 * self.rho)
        return self._found[key]

    def residual(self, loads: FloatArray, values: Values) -> FloatArray:
        return np.concatenate((self.pose_errors(loads, values).ravel() / self.spread, super().residual(loads, values)))

    def columns(self, id: str, loads: FloatArray, values: Values, size: int) -> FloatArray:
        ends = np.zeros((3 * len(self.pushes), size))
        if id in MOVING:
            ends[:, : SIZES[id]] = self._slope(id, (MOVING[id],) * SIZES[id]) / self.spread[:, None]
        return np.concatenate((ends, self.clearance_columns(id, values.get(id), size)))

    def base(self, values: Values, free: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
        count = len(self.nominal) if free else 0
        slopes = self._slope("", _SMALL)[:, :count] / self.spread[:, None]
        clearances = np.zeros((len(self.trial) - len(slopes), count))
        precision = np.diag(1 / np.array(_PRIOR)[:count] ** 2)
        return np.eye(len(self.nominal))[:, :count], np.concatenate((slopes, clearances)), precision

    def fit(self, effects: Sequence[str], free: bool, chosen: BoolArray | None = None, start: Fitted | None = None) -> Fitted:
        """As :meth:`Equations.fit`, from several starts, of which the one counts that fits best.

        Final poses depend nonlinearly on effects and surface: a step may lead away from where a smaller model fits.
        """
        if start is not None:
            return super().fit(effects, free, chosen, start)
        key = tuple(effects), free, None if chosen is None else chosen.tobytes()
        if key not in self._fits:
            tried = list(self._tried(effects, free, chosen))
            self._fits[key] = max(tried, key=lambda fitted: _density_of(fitted, chosen))
        return self._fits[key]

    def _tried(self, effects: Sequence[str], free: bool, chosen: BoolArray | None) -> Iterator[Fitted]:
        """Fits from where they begin; of effects on a free surface from the fit without the last of them, and from where they are
        on a fixed one; and of what lacks effects of the fit that was settled on from where fits began before."""
        first = self._slopes is self._first[1]
        if first and free and effects:
            yield super().fit(effects, True, chosen, self.fit(effects[:-1], True, chosen))
        else:
            yield super().fit(effects, free, chosen)
        if first and free and (effects or self.nuisance):
            yield super().fit(effects, True, chosen, super().fit(effects, False, chosen))
        if not first and self.about is not None and not set(self.about.values) <= {*effects, *self.nuisance}:
            now = self.about, self._slopes, self._fits
            self.about, self._slopes, self._fits = self._first
            yield self.fit(effects, free, chosen)
            self.about, self._slopes, self._fits = now

    def begin(self, fitted: Fitted) -> None:
        """Let fits begin at this one, now and when others have been settled on."""
        self.settle(fitted)
        self._first = self.about, self._slopes, self._fits

    def _slope(self, id: str, small: tuple[float, ...]) -> FloatArray:
        """Derivatives (3n, d) of the final poses, by differences about the nominal simulation or the last fit that was
        settled on: the fits use these."""
        if id not in self._slopes:
            found = []
            for k, size in enumerate(small):
                step = np.zeros(len(small))
                step[k] = size
                # to both sides: what makes a finger slip one way may make it stick the other way
                found.append((self._nearby(id, -step) - self._nearby(id, step)).ravel() / (2 * size))
            self._slopes[id] = np.stack(found, axis=-1)
        return self._slopes[id]

    def _nearby(self, id: str, step: FloatArray) -> FloatArray:
        """Pose errors at a step in the surface, or in the parameters of an effect, from where fits begin."""
        loads, values = (self.nominal, {}) if self.about is None else (self.about.loads, self.about.values)
        if not id:
            return self.pose_errors(loads + step, values)
        return self.pose_errors(loads, {**values, id: values.get(id, np.zeros(len(step))) + step})

    def settle(self, fitted: Fitted) -> None:
        super().settle(fitted)
        self._slopes, self._fits = {}, {}

    def trust(self, spread: FloatArray) -> None:
        """Set the noise of the components of the final poses; fits made with another noise are dropped."""
        self.spread = spread
        self._fits.clear()


def _density_of(fitted: Fitted, chosen: BoolArray | None) -> float:
    """Log density of the trials that a fit was made to."""
    density = fitted.density
    return float((density if chosen is None else density[chosen[: len(density)]]).sum())


def _coarse(support: SupportDistribution) -> SupportDistribution:
    """Return a few points for many: the centres of those that share a cell."""
    points, weights = support.points, support.weights
    if len(points) <= _CELLS**2:
        return support
    low = points.min(axis=0)
    cells = np.minimum((points - low) / np.maximum(np.ptp(points, axis=0), 1e-9) * _CELLS + 1e-9, _CELLS - 1).astype(int)
    _, cell = np.unique(cells @ (_CELLS, 1), return_inverse=True)
    total = np.bincount(cell, weights)
    centers = np.stack([np.bincount(cell, weights * points[:, k]) / total for k in range(2)], axis=-1)
    return SupportDistribution(centers, total)


def motions_of(observations: Observations, rig: Rig, pushes: list[Replay]) -> Motions:
    """Return the equations of a log without forces; the noise of final poses is at least that of measured poses, and what a
    free pressure leaves of them: of those that the surface hardly moves, and of the others.

    Where friction of the fingers is not known fits begin at what it is like, with the slopes there.
    """
    system = Motions(observations, rig, pushes)
    if not system.pushes:
        return system
    plain = system.fit([], True)
    left = plain.residual[: 3 * len(system.pushes)] * system.spread
    reach, noise = system.reach, system.final_pose_noise.ravel()
    # a final pose that the surface moves by less than a thousandth of its noise counts as not moved
    stuck = reach <= np.maximum(np.median(reach), 1e-3 * noise)
    still = noise * max(1.0, float(np.sqrt(robust_variance((left[stuck] / noise[stuck]) ** 2))))
    moved = np.maximum(left[~stuck] ** 2 - still[~stuck] ** 2, 0.0) / np.maximum(reach[~stuck], 1e-12) ** 2
    share = np.sqrt(robust_variance(moved)) if len(moved) else 0.0
    system.trust(np.hypot(still, float(share) * reach))
    if "contact-friction" in system.nuisance:
        system.begin(plain)
        system.begin(system.fit([], True))
    if rig.noise is None:
        system.final_pose_noise = system.spread.reshape(-1, 3)
    return system
