"""The friction that the operator believes in: support points, and the limit surface that stands in their place, if any."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stablepush.core import LEAST_POSITIVE, FloatArray
from stablepush.geometry import normalize_twist, normalize_wrench
from stablepush.identify import predict_loads, sample_loads, support_for
from stablepush.io import Rig
from stablepush.mechanics import TableFriction
from stablepush.objects import Slider, SupportDistribution
from stablepush.surfaces import IdealLimitSurface, LimitSurface
from stablepush.surfaces.kernels import sum_loads

#: Cells along the outline's longer side on which a pressure lies that nothing is known of.
CELLS = 5
#: Modes of an ensemble with less than this share of the standard deviation of the first are left out, and the most that are kept.
_LEAST_MODE, _MOST_MODES = 0.05, 10
#: Speed (m/s) below which points have friction in proportion to their speed.
_CREEP = 1e-9
#: Points that carry a smaller share of the load carry none.
_LEAST_SHARE = 1e-6
#: What keeps loads of either sign small, over the mean square of the friction of a point.
_RIDGE = 1e-4
#: Members of an ensemble that stand for it.
_MEMBERS = 60


@dataclass(frozen=True, slots=True, eq=False)
class Nominal:
    """The nominal friction of the table.

    ``points`` are support points whose friction it is, in N; of a limit surface that is not the friction of points, ``model``,
    they are those that come nearest to it. Effects change the friction of the points, and the model's by as much:
    ``F(V; theta) = F_model(V) + F_points(V; theta) - F_points(V; 0)``. ``load``: the force (N) that the model's unit is.
    """

    points: IdealLimitSurface
    model: LimitSurface | None = None
    load: float = 1.0

    def loads_on(self, points: FloatArray) -> FloatArray:
        """Return the friction loads (k,) of points (k, 2), which hold those of the nominal pressure."""
        loads = np.zeros(len(points))
        at, which = np.nonzero((np.abs(points[:, None] - self.points.support.points[None]) < LEAST_POSITIVE).all(axis=2))
        own, first = np.unique(which, return_index=True)
        loads[at[first]] = self.points.friction_load * self.points.support.weights[own]
        return loads

    def beyond_points(self, twists: FloatArray) -> FloatArray:
        """Return what the model's loads (n, 3) of twists differ by from those of the points."""
        found = np.zeros_like(twists)
        moving = np.abs(twists).max(axis=1) > 0
        if self.model is not None and moving.any():
            found[moving] = self.load * self.model.wrench(twists[moving]) - self.points.wrench(twists[moving])
        return found

    def spread(
        self, points: FloatArray, loads: FloatArray, twists: FloatArray, noise: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return what noise (n, 3), one standard deviation, of twists (n, 3) makes of their loads: two second moments (n, 3, 3).

        Of the model, if there is one, else of points (k, 2) with friction loads (k,). The first are by ``dF/dV``, from
        differences; next to a facet of the limit surface they are far too large. The second are squares of what loads at
        ``±sqrt(3)`` deviations along each axis differ by from those of the twists, a sixth of each (the unscented transform,
        Julier and Uhlmann 2004): they hold for slow motions, too, which noise may turn into any direction.
        """
        size = np.maximum(np.linalg.norm(twists[:, :2], axis=1), 1e-6)
        length = max(1e-3, float(np.sqrt((points**2).sum(axis=1).mean())))
        linear, full = np.zeros((2, len(twists), 3, 3))
        central = self._load(points, loads, twists)
        for k, scale in enumerate((1.0, 1.0, 1.0 / length)):
            unit = np.eye(3)[k]
            small, far = 0.02 * scale * size, np.sqrt(3.0) * noise[:, k]
            ahead, behind = (self._load(points, loads, twists + s * small[:, None] * unit) for s in (1, -1))
            slope = (ahead - behind) * (noise[:, k] / (2 * small))[:, None]
            linear += slope[:, :, None] * slope[:, None, :]
            for s in (1, -1):
                off = self._load(points, loads, twists + s * far[:, None] * unit) - central
                full += off[:, :, None] * off[:, None, :] / 6.0
        return linear, full

    def _load(self, points: FloatArray, loads: FloatArray, twists: FloatArray) -> FloatArray:
        if self.model is not None:
            return self.load * self.model.wrench(twists)
        return _friction_of(points, loads, twists)

    def table(self, changed: IdealLimitSurface, **effects: object) -> TableFriction:
        """Return the friction of the table where the friction of the points has become that of others."""
        if self.model is None:
            return TableFriction(changed, **effects)  # type: ignore[arg-type]
        return TableFriction(self.model, self.load, self.points, changed, **effects)  # type: ignore[arg-type]

    def modes(self, points: FloatArray) -> FloatArray:
        """Return what the pokes behind a model leave open: changes (k, q) of the loads of points (k, 2), one deviation each.

        The principal components of the surfaces of the model's ensemble, each taken for loads of the points.
        """
        members = () if self.model is None else self.model.members()
        if len(members) < 2:
            return np.zeros((len(points), 0))
        design, twists = self.design(points)
        chosen = members[:: max(1, len(members) // _MEMBERS)]
        loads = np.array([self._scaled(member, twists) for member in chosen])
        spread = np.array([self._nearest(design, row) for row in loads - loads.mean(axis=0)]) / np.sqrt(len(loads) - 1)
        _, sizes, rows = np.linalg.svd(spread, full_matrices=False)
        kept = (sizes > _LEAST_MODE * sizes[0])[:_MOST_MODES]
        return np.asarray((sizes[: len(kept), None] * rows[: len(kept)])[kept].T)

    def design(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return loads (3n, k) in ``(fx, fy, tau/rho)`` by 1 N at each point, and the motions (n, 3) that have them."""
        rho = self.points.characteristic_length
        _, twists = sample_loads(self.points, 1.0)
        return unit_loads(points, twists, rho), twists

    def _scaled(self, surface: LimitSurface, twists: FloatArray) -> FloatArray:
        return normalize_wrench(self.load * surface.wrench(twists), self.points.characteristic_length).ravel()

    def _nearest(self, design: FloatArray, loads: FloatArray) -> FloatArray:
        """Friction loads (k,) by least squares, kept from growing by a ridge."""
        gram = design.T @ design
        return np.asarray(
            np.linalg.solve(gram + _RIDGE * float(np.trace(gram)) / len(gram) * np.eye(len(gram)), design.T @ loads)
        )


def unit_loads(points: FloatArray, twists: FloatArray, rho: float) -> FloatArray:
    """Return loads (3n, k) of twists (n, 3) in ``(fx, fy, tau/rho)``, by 1 N of friction at each of points (k, 2)."""
    ones = np.ones((len(points), 1))
    return np.asarray(
        predict_loads(points[:, None] / rho, ones, normalize_twist(twists, rho)).transpose(1, 2, 0).reshape(-1, len(points))
    )


def _friction_of(points: FloatArray, loads: FloatArray, twists: FloatArray) -> FloatArray:
    """Loads (n, 3) of twists by points (k, 2) with friction loads (k,)."""
    wrenches = np.empty_like(twists)
    sum_loads(points, np.ascontiguousarray(loads), np.ascontiguousarray(twists), _CREEP, 0.0, wrenches)
    return wrenches


def nominal_of(rig: Rig) -> Nominal:
    """Return the nominal friction of a rig; of 1 N where neither a model nor friction and mass say how much it is."""
    slider, weight = rig.slider, (rig.slider.mass or 0.0) * rig.gravity
    total = (rig.support_friction or 0.0) * weight
    if rig.model is None:
        side = float(np.ptp(slider.vertices, axis=0).max())
        support = slider.support or SupportDistribution.from_polygon(slider.vertices, side / (2 * CELLS))
        return Nominal(IdealLimitSurface(support, total or 1.0, slider.characteristic_length))
    load = total if rig.model.force_unit == "mu*N" else 1.0
    ideal = support_for(rig.model, Slider(slider.vertices, slider.mass), load)
    carrying = ideal.support.weights > _LEAST_SHARE * ideal.support.weights.sum()
    support = SupportDistribution(ideal.support.points[carrying], ideal.support.weights[carrying])
    points = IdealLimitSurface(support, ideal.friction_load, slider.characteristic_length)
    return Nominal(points, None if rig.model.point_loads is not None else rig.model, load)
