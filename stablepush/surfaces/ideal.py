"""The ideal limit surface of Coulomb friction at support points (Goyal, Ruina, Papadopoulos 1991)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import (
    LEAST_POSITIVE,
    ConvergenceError,
    FloatArray,
    InputError,
    Node,
    check_array,
    check_number,
    check_vectors,
    read_only,
)
from stablepush.geometry import normalize_twist, normalize_wrench, unit
from stablepush.objects import SupportDistribution
from stablepush.surfaces.protocol import LimitSurface

#: Support points this close, in units of the characteristic length, are one.
_COINCIDENT = 1e-9
#: Shares of the load below this are none.
_LEAST_SHARE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class IdealLimitSurface(LimitSurface):
    """Limit surface of isotropic Coulomb friction at support points.

    The load of a twist is ``F(V) = Σ m_k (e_k, x_k × e_k)`` where ``e_k`` is the unit velocity of point ``k`` and ``m_k = mu
    N_k`` its share of the friction load; the support function is ``h(V) = Σ m_k |v_k|``. A rotation about a support point
    leaves that point's friction free: those loads fill a facet, of which :meth:`wrench` returns the centre.

    Parameters
    ----------
    support : SupportDistribution
        Support points (m, in B) and their shares; at least two points must carry load.
    friction_load : float
        Total ``mu*N`` in N.
    characteristic_length : float, optional
        ``rho`` in m; ``sqrt(sum m |x|^2 / sum m)`` if not given.
    ensemble : array-like, shape (n, k), optional
        Equally likely friction loads (N) of the points, where they are uncertain.
    """

    kind: ClassVar[str] = "support"

    support: SupportDistribution
    friction_load: float
    characteristic_length: float = field()  # or the property of the base would be its default
    ensemble: FloatArray | None = field(repr=False)

    def __init__(
        self,
        support: SupportDistribution,
        friction_load: float,
        characteristic_length: float | None = None,
        ensemble: ArrayLike | None = None,
    ) -> None:
        rho = support.characteristic_length if characteristic_length is None else characteristic_length
        loaded = support.points[support.weights >= _LEAST_SHARE]
        least = max(LEAST_POSITIVE, 2 * _COINCIDENT * check_number(rho, "characteristic_length", at_least=0.0))
        if float(np.linalg.norm(loaded - loaded[0], axis=1).max()) < least:
            raise InputError("support", "expected at least two different points that carry load", f"all of it within {least:g} m")
        object.__setattr__(self, "support", support)
        object.__setattr__(self, "friction_load", check_number(friction_load, "friction_load", positive=True))
        object.__setattr__(self, "characteristic_length", check_number(rho, "characteristic_length", positive=True))
        rows = None if ensemble is None else check_array(ensemble, "ensemble", (None, len(support.points)))
        if rows is not None and ((rows < 0).any() or not len(rows)):
            raise InputError("ensemble", "expected rows of loads >= 0")
        object.__setattr__(self, "ensemble", None if rows is None else read_only(rows))

    @property
    def loads(self) -> FloatArray:
        """Friction loads ``m_k`` (n,) of the support points, in N."""
        return self.support.weights * self.friction_load

    @property
    def point_loads(self) -> tuple[FloatArray, FloatArray]:
        """Support points (k, 2) in m and their friction loads (k,) in N."""
        return self.support.points, self.loads

    def members(self) -> Sequence[IdealLimitSurface]:
        """Return the surfaces of the ensemble; none if there is no ensemble."""
        points, rho = self.support.points, self.characteristic_length
        rows = () if self.ensemble is None else self.ensemble
        return tuple(IdealLimitSurface(SupportDistribution(points, row), float(row.sum()), rho) for row in rows)

    def to_json(self) -> dict[str, Any]:
        """Return the ``model/1`` of the surface, without its format and kind."""
        return {
            "points": self.support.points.tolist(),
            "loads": self.loads.tolist(),
            "characteristic_length": self.characteristic_length,
            **({} if self.ensemble is None else {"ensemble": self.ensemble.tolist()}),
        }

    @classmethod
    def from_json(cls, node: Node) -> Self:
        """Read the value of a ``model/1`` of this kind."""
        node.expect_keys("format", "kind", "points", "loads", "characteristic_length", "ensemble")
        points = node["points"].array(None, 2)
        loads = node["loads"].array(None)
        if (loads < 0).any():
            node["loads"].fail("expected loads >= 0", f"{loads.min():g}")
        if loads.sum() < LEAST_POSITIVE:
            node["loads"].fail(f"expected a sum of at least {LEAST_POSITIVE:g}", f"{loads.sum():g}")
        rho_node = node.get("characteristic_length")
        given = None if rho_node is None else rho_node.number(positive=True)
        rows = node.get("ensemble")
        ensemble = None if rows is None else rows.array(None, len(points))
        for k, row in enumerate(() if ensemble is None else ensemble):
            if (row < 0).any() or row.sum() < LEAST_POSITIVE:
                rows.fail(f"expected loads >= 0 with a sum of at least {LEAST_POSITIVE:g}", f"row {k}")  # type: ignore[union-attr]
            # each row is a surface of its own
            rows.checked(lambda row=row: cls(SupportDistribution(points, row), float(row.sum()), given))  # type: ignore[misc, union-attr]
        return node.checked(lambda: cls(SupportDistribution(points, loads), float(loads.sum()), given, ensemble))

    def wrench(self, twists: ArrayLike) -> FloatArray:
        """Return the loads (..., 3) ``F(V)`` of twists (..., 3); only the direction of a twist counts."""
        from stablepush.surfaces.kernels.support_points import AT_REST, sum_loads

        rho = self.characteristic_length
        v = normalize_twist(check_vectors(twists, "twists", 3), rho)
        flat = np.ascontiguousarray(unit(v).reshape(-1, 3))
        if not flat.any(axis=1).all():
            raise InputError("twists", "expected twists that are not zero")
        result = np.empty_like(flat)
        sum_loads(np.ascontiguousarray(self.support.points / rho), self.loads, flat, 0.0, AT_REST, result)
        result[:, 2] *= rho
        return result.reshape(v.shape)

    def value(self, wrenches: ArrayLike) -> FloatArray:
        """Return the gauge ``H(F) = max_V F·V/h(V)`` (...) of wrenches (..., 3): 1 on the surface, of degree one in F."""
        f = normalize_wrench(check_vectors(wrenches, "wrenches", 3), self.characteristic_length)
        size = np.linalg.norm(f, axis=-1)
        power = np.ones(size.shape)
        nonzero = size > 0
        if nonzero.any():
            power[nonzero] = self._slip(unit(f[nonzero]))[1]
        return np.asarray(size / power)

    def twist(self, wrenches: ArrayLike) -> FloatArray:
        """Return the slip twists (..., 3) ``argmax F·V/h(V)`` of wrenches (..., 3), of unit length in ``(vx, vy, rho*omega)``."""
        f = unit(normalize_wrench(check_vectors(wrenches, "wrenches", 3), self.characteristic_length))
        if not f.any(axis=-1).all():
            raise InputError("wrenches", "expected wrenches that are not zero")
        slip, _ = self._slip(f.reshape(-1, 3))
        return (unit(slip) / (1.0, 1.0, self.characteristic_length)).reshape(f.shape)

    def _slip(self, wrenches: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Twists (n, 3) that minimise ``h(V)`` on ``F·V = 1`` for unit normalised loads (n, 3), and their ``h`` (n,)."""
        from stablepush.surfaces.kernels.h_inv import TOLERANCE
        from stablepush.surfaces.kernels.support_points import minimize_power

        points, loads = _distinct(self.support.points / self.characteristic_length, self.loads)
        twists = np.empty_like(wrenches)
        powers = np.empty(len(wrenches))
        residuals = np.empty(len(wrenches))
        minimize_power(points, loads, np.ascontiguousarray(wrenches), twists, powers, residuals)
        if (residuals > TOLERANCE).any():
            raise ConvergenceError(
                f"slip twist: {int((residuals > TOLERANCE).sum())} of {len(wrenches)} loads did not converge "
                f"(worst {residuals.max():.1e})"
            )
        return twists, powers


def _distinct(points: FloatArray, loads: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (k, 2) that carry a load, those that coincide taken together: of two in one place only one would rest."""
    from scipy.spatial import cKDTree

    carrying = loads > 0
    points, loads = np.ascontiguousarray(points[carrying]), np.array(loads[carrying])
    pairs = cKDTree(points).query_pairs(_COINCIDENT, output_type="ndarray")
    if not len(pairs):
        return points, loads
    first = np.arange(len(points))
    for a, b in sorted(map(sorted, pairs)):
        first[b] = first[a]
    total = np.bincount(first, loads, minlength=len(points))
    return np.ascontiguousarray(points[total > 0]), np.asarray(total[total > 0], dtype=np.float64)
