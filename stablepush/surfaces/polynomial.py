"""Limit surfaces that are level sets of homogeneous polynomials (Zhou, Paolini, Bagnell, Mason 2016)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stablepush.core import (
    LARGEST_MAGNITUDE,
    LEAST_POSITIVE,
    ConvergenceError,
    FloatArray,
    InputError,
    Node,
    check_choice,
    check_number,
    check_vectors,
    read_only,
)
from stablepush.geometry import normalize_wrench, unit
from stablepush.surfaces.monomials import gradient_operator, hessian_operator, monomial_exponents, monomials
from stablepush.surfaces.protocol import LimitSurface

#: What ``force_unit`` may be: forces in newton, or in units of the maximal friction force mu*N.
FORCE_UNITS = ("N", "mu*N")
#: Degrees that a polynomial may have.
DEGREES = (2, 4, 6, 8, 10)
#: Keys of its ``model/1``, besides those of every model and the unit, which may be left out.
_KEYS = (
    *("degree", "characteristic_length", "exponents", "coefficients"),
    *("certificate", "covariance", "ensemble", "provenance"),
)
#: Directions in which an ensemble is looked at, how far its second derivatives may be below zero by rounding, and rows at once.
_DIRECTIONS, _ROUNDING, _AT_ONCE = 200, 1e-6, 200


@dataclass(frozen=True, slots=True, eq=False)
class PolynomialLimitSurface(LimitSurface):
    """The 1-level set of ``H(F) = sum_m a_m fx^i fy^j (tau/rho)^k`` of even degree ``i + j + k = d``.

    During slip the load ``F`` lies on ``H = 1`` and the twist is along the gradient: ``(vx, vy, rho*omega) ∝ ∇H``, where the
    gradient is taken in the normalised load. Degree 2 is the ellipsoid.

    Parameters
    ----------
    coefficients : array-like, shape (m,)
        Coefficients ``a_m`` in the order of :attr:`exponents` (:func:`stablepush.monomial_exponents`).
    degree : int
        Even degree, 2 to 10.
    characteristic_length : float
        ``rho`` in m.
    force_unit : {"N", "mu*N"}
        Unit of the forces for which ``H = 1`` is the surface.
    certificate : Certificate, optional
        Proof that ``H`` is SOS-convex (:func:`stablepush.certify`).
    covariance : array-like, shape (m, m), optional
        Covariance of the coefficients.
    ensemble : array-like, shape (k, m), optional
        Coefficients of equally likely convex surfaces, from which probabilities are counted.
    provenance : mapping, optional
        Where the surface comes from; any JSON object.
    """

    kind: ClassVar[str] = "polynomial"

    coefficients: FloatArray
    degree: int = field()
    characteristic_length: float = field()  # or the property of the base would be its default
    force_unit: str = field()
    # not shown: a surface is its coefficients
    certificate: Mapping[str, Any] | None = field(repr=False)
    covariance: FloatArray | None = field(repr=False)
    ensemble: FloatArray | None = field(repr=False)
    provenance: Mapping[str, Any] = field(repr=False)
    _gradient: FloatArray = field(repr=False)
    _hessian: FloatArray = field(repr=False)
    _scaled: tuple[FloatArray, FloatArray, float] | None = field(repr=False)

    def __init__(
        self,
        coefficients: ArrayLike,
        degree: int,
        characteristic_length: float,
        *,
        force_unit: str = "N",
        certificate: Mapping[str, Any] | None = None,
        covariance: ArrayLike | None = None,
        ensemble: ArrayLike | None = None,
        provenance: Mapping[str, Any] | None = None,
    ) -> None:
        if degree not in DEGREES:
            raise InputError("degree", "expected an even number from 2 to 10", degree)
        exponents = monomial_exponents(degree)
        a = check_vectors(coefficients, "coefficients", len(exponents))
        if a.ndim != 1:
            raise InputError("coefficients", f"expected shape ({len(exponents)},)", f"{a.shape}")
        if not a.any():
            raise InputError("coefficients", "expected at least one that is not zero")
        _check_size(a, degree, "coefficients")
        check_choice(force_unit, "force_unit", FORCE_UNITS)
        if covariance is not None:
            covariance = check_vectors(covariance, "covariance", len(a))
            if covariance.shape != (len(a), len(a)):
                raise InputError("covariance", f"expected shape ({len(a)}, {len(a)})", f"{covariance.shape}")
            covariance = read_only(covariance)
        if ensemble is not None:
            ensemble = check_vectors(ensemble, "ensemble", len(a))
            if ensemble.ndim != 2 or not len(ensemble):
                raise InputError("ensemble", f"expected shape (n, {len(a)})", f"{ensemble.shape}")
            for i, row in enumerate(ensemble):
                _check_size(row, degree, f"ensemble: row {i}")
            bent = np.flatnonzero(_bent(ensemble, degree))
            if len(bent):
                raise InputError("ensemble", f"expected convex surfaces, row {bent[0]} is not")
            ensemble = read_only(ensemble)
        rho = check_number(characteristic_length, "characteristic_length", positive=True)
        object.__setattr__(self, "coefficients", read_only(a))
        object.__setattr__(self, "degree", int(degree))
        object.__setattr__(self, "characteristic_length", rho)
        object.__setattr__(self, "force_unit", force_unit)
        object.__setattr__(self, "certificate", None if certificate is None else MappingProxyType(dict(certificate)))
        object.__setattr__(self, "covariance", covariance)
        object.__setattr__(self, "ensemble", ensemble)
        object.__setattr__(self, "provenance", MappingProxyType(dict(provenance or {})))
        object.__setattr__(self, "_gradient", read_only(gradient_operator(degree) @ a))
        object.__setattr__(self, "_hessian", read_only(hessian_operator(degree) @ a))
        object.__setattr__(self, "_scaled", None)

    def __reduce__(self) -> tuple[Any, ...]:
        # read-only views of mappings cannot be sent to another process
        certificate = None if self.certificate is None else dict(self.certificate)
        given = (self.covariance, self.ensemble, dict(self.provenance))
        return _rebuilt, (self.coefficients, self.degree, self.characteristic_length, self.force_unit, certificate, *given)

    def to_json(self) -> dict[str, Any]:
        """Return the ``model/1`` of the surface, without its format and kind."""
        return {
            "degree": self.degree,
            "characteristic_length": self.characteristic_length,
            "force_unit": self.force_unit,
            "exponents": self.exponents.tolist(),
            "coefficients": self.coefficients.tolist(),
            "certificate": None if self.certificate is None else dict(self.certificate),
            "covariance": None if self.covariance is None else self.covariance.tolist(),
            "ensemble": None if self.ensemble is None else self.ensemble.tolist(),
            "provenance": dict(self.provenance),
        }

    @classmethod
    def from_json(cls, node: Node) -> Self:
        """Read the value of a ``model/1`` of this kind."""
        node.expect_keys("format", "kind", "force_unit", *_KEYS)
        degree = node["degree"].integer(at_least=2)
        if degree not in DEGREES:
            node["degree"].fail("expected an even number from 2 to 10", degree)
        rho = node["characteristic_length"].number(positive=True)
        coefficients = _coefficients(node, degree)
        certificate, provenance = (
            None if entry.value is None else entry.object() for entry in (node["certificate"], node["provenance"])
        )
        covariance_node = node["covariance"]
        size = len(coefficients)
        covariance = None if covariance_node.value is None else covariance_node.array(size, size)
        ensemble_node = node.get("ensemble")
        ensemble = None if ensemble_node is None else ensemble_node.array(None, size)
        unit_node = node.get("force_unit")
        force_unit = "N" if unit_node is None else unit_node.text(FORCE_UNITS)
        return node.checked(
            lambda: cls(
                coefficients,
                degree,
                rho,
                force_unit=force_unit,
                certificate=certificate,
                covariance=covariance,
                ensemble=ensemble,
                provenance=provenance,
            )
        )

    @property
    def exponents(self) -> NDArray[np.int64]:
        """Exponents (m, 3) of ``fx``, ``fy`` and ``tau/rho``, in the order of the coefficients."""
        return monomial_exponents(self.degree)

    def members(self) -> list[PolynomialLimitSurface]:
        """Return the surfaces of the ensemble; none if there is no ensemble."""
        if self.ensemble is None:
            return []
        return [
            PolynomialLimitSurface(a, self.degree, self.characteristic_length, force_unit=self.force_unit) for a in self.ensemble
        ]

    def value(self, wrenches: ArrayLike) -> FloatArray:
        """Return ``H(F)`` (...) of wrenches (..., 3) ``(fx, fy, tau)``: below 1 at rest, 1 during slip."""
        f = self._normalized(wrenches)
        return np.asarray(monomials(f, self.degree) @ self.coefficients)

    def gradient(self, wrenches: ArrayLike) -> FloatArray:
        """Return ``∇H`` (..., 3) with respect to the normalised load ``(fx, fy, tau/rho)``."""
        f = self._normalized(wrenches)
        return np.asarray(monomials(f, self.degree - 1) @ self._gradient.T)

    def twist(self, wrenches: ArrayLike) -> FloatArray:
        """Return the slip twists (..., 3) ``(vx, vy, omega)`` of wrenches, of unit length in ``(vx, vy, rho*omega)``.

        Only the direction of a wrench counts. A zero wrench has no slip direction and is an error.
        """
        from stablepush.surfaces.kernels.h_inv import unit_gradients

        f = unit(self._normalized(wrenches))
        if not f.any(axis=-1).all():
            raise InputError("wrenches", "expected wrenches that are not zero")
        slip = np.empty_like(f)
        exponents = monomial_exponents(self.degree - 1)
        unit_gradients(self._gradient, exponents, np.ascontiguousarray(f.reshape(-1, 3)), slip.reshape(-1, 3))
        return np.asarray(slip / (1.0, 1.0, self.characteristic_length))

    def wrench(self, twists: ArrayLike) -> FloatArray:
        """Return ``H_inv``: the loads (..., 3) on ``H = 1`` whose slip twists are along the given ones (..., 3).

        ``F = argmax V·F`` over ``H <= 1``, found as the minimiser of ``H(F) - V·F`` by damped Newton, then scaled onto the
        level set; accurate to 1e-9 rad in the direction of the twist. Raises :class:`ConvergenceError` where a surface is
        not convex and a twist has no such load, and where it reaches beyond 1e6 along an axis.
        """
        from stablepush.surfaces.kernels.h_inv import polynomial_inverter

        v = check_vectors(twists, "twists", 3)
        flat = np.ascontiguousarray(v.reshape(-1, 3))
        # column by column: numpy is slow to reduce a short last axis
        if not ((flat[:, 0] != 0) | (flat[:, 1] != 0) | (flat[:, 2] != 0)).all():
            raise InputError("twists", "expected twists that are not zero")
        hessian, axes, size = self.scaled_hessian()
        loads = np.empty_like(flat)
        worst, missed = polynomial_inverter(self.degree)(hessian, self.characteristic_length, flat, axes, loads)
        if missed:
            raise ConvergenceError(
                f"H_inv: {missed} of {len(flat)} twists have no load to 1e-9 (worst {worst:.1e}); is the surface convex?"
            )
        loads *= size
        return loads.reshape(v.shape)

    def scaled_hessian(self) -> tuple[FloatArray, FloatArray, float]:
        """Return what the kernels of ``H_inv`` take: second derivatives (6, m) of ``H`` for loads in units of a size, the squared
        half axes (3,) of the surface in that unit, and the size: the largest half axis, in the surface's unit of force.

        H along the axes sets the scale: coefficients of newtons and of kilonewtons run the same iterations. Raises
        :class:`ConvergenceError` for a surface that is not bounded along every axis.
        """
        if self._scaled is not None:
            return self._scaled
        pure = self.coefficients[(self.exponents == self.degree).any(axis=1)]
        if not (pure > 0).all():
            raise ConvergenceError("H_inv: the surface is not bounded along every axis, so twists have no load on it")
        half_axes = pure ** (-1.0 / self.degree)
        size = float(half_axes.max())
        if size > LARGEST_MAGNITUDE:
            raise ConvergenceError(f"H_inv: the surface is all but unbounded along an axis, up to a load of {size:g}")
        scaled = np.ascontiguousarray(self._hessian * size**self.degree), (half_axes / size) ** 2, size
        object.__setattr__(self, "_scaled", scaled)
        return scaled

    def _normalized(self, wrenches: ArrayLike) -> FloatArray:
        return normalize_wrench(check_vectors(wrenches, "wrenches", 3), self.characteristic_length)


def _coefficients(node: Node, degree: int) -> np.ndarray:
    """Coefficients in the library's order, whatever order the file has; monomials that it leaves out are zero."""
    exponents = node["exponents"].array(None, 3)
    given = node["coefficients"].array(None)
    if len(exponents) != len(given):
        node["coefficients"].fail(f"expected {len(exponents)} numbers, one for each exponent", len(given))
    place = {tuple(row): i for i, row in enumerate(monomial_exponents(degree).tolist())}
    coefficients = np.zeros(len(place))
    seen: set[int] = set()
    for entry, row, value in zip(node["exponents"].items(), exponents.tolist(), given, strict=True):
        index = place.get(tuple(row))
        if index is None:
            entry.fail(f"expected three whole numbers >= 0 with the sum {degree}", entry.value)
        if index in seen:
            entry.fail(f"expected every monomial once, {entry.value} stands twice")
        seen.add(index)
        coefficients[index] = value
    return coefficients


def _check_size(coefficients: FloatArray, degree: int, name: str) -> None:
    """Refuse surfaces whose loads cannot be distinguished from zero, or from a slip of units."""
    low, high, largest = LARGEST_MAGNITUDE**-degree, LEAST_POSITIVE**-degree, np.abs(coefficients).max()
    if not low <= largest <= high:
        raise InputError(name, f"expected the largest to be from {low:g} to {high:g}", f"{largest:g}")


def _bent(coefficients: FloatArray, degree: int) -> NDArray[np.bool_]:
    """Which of several polynomials (n, m) are seen not to be convex: along one of many directions ``H`` is not above zero, or
    bends down."""
    k = np.arange(_DIRECTIONS) + 0.5
    up, around = 1 - 2 * k / _DIRECTIONS, np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - up**2)
    points = np.stack((flat * np.cos(around), flat * np.sin(around), up), axis=-1)
    values = monomials(points, degree)
    second = np.einsum("pn,enm->pem", monomials(points, degree - 2), hessian_operator(degree), optimize=True)
    found = np.zeros(len(coefficients), dtype=bool)
    # a part at a time: memory stays small whatever a file brings
    for rows in np.array_split(np.arange(len(coefficients)), 1 + len(coefficients) // _AT_ONCE):
        xx, xy, xz, yy, yz, zz = np.moveaxis(np.einsum("pem,sm->spe", second, coefficients[rows], optimize=True), -1, 0)
        bends = np.linalg.eigvalsh(np.stack((xx, xy, xz, xy, yy, yz, xz, yz, zz), axis=-1).reshape(*xx.shape, 3, 3))
        low, high = bends[..., 0].min(axis=1), bends[..., 2].max(axis=1)
        found[rows] = (low < -_ROUNDING * np.abs(high)) | ((coefficients[rows] @ values.T).min(axis=1) <= 0)
    return found


def _rebuilt(
    coefficients: FloatArray,
    degree: int,
    rho: float,
    force_unit: str,
    certificate: Mapping[str, Any] | None,
    covariance: FloatArray | None,
    ensemble: FloatArray | None,
    provenance: Mapping[str, Any],
) -> PolynomialLimitSurface:
    """The surface that was sent to this process."""
    return PolynomialLimitSurface(
        coefficients,
        degree,
        rho,
        force_unit=force_unit,
        certificate=certificate,
        covariance=covariance,
        ensemble=ensemble,
        provenance=provenance,
    )
