"""A baseline without physics: sums of squared-exponential kernels from loads to twists and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import (
    ConvergenceError,
    FloatArray,
    InputError,
    Node,
    brief,
    check_array,
    check_number,
    check_vectors,
    read_only,
)
from stablepush.geometry import normalize_twist, normalize_wrench, unit
from stablepush.surfaces.protocol import LimitSurface

#: Size (of a unit twist, or N) of a mean below which it says nothing.
_SILENT = 1e-9
#: Sums of kernels, and how many coefficients each has for an input.
_KERNEL_SUMS = {"slip": 3, "log_size": 1, "load": 3}


@dataclass(frozen=True, slots=True, eq=False)
class KernelSum:
    """``g(x) = Σ_i c_i exp(-|x - x_i|²/(2 l²))``: inputs ``x_i`` (n, 3), coefficients ``c_i`` (n, k), length ``l``."""

    inputs: FloatArray
    coefficients: FloatArray
    length: float

    def __init__(self, inputs: ArrayLike, coefficients: ArrayLike, length: float) -> None:
        x = check_array(inputs, "inputs", (None, 3))
        c = check_array(coefficients, "coefficients", (None, None))
        if len(x) != len(c) or not len(x):
            raise InputError("coefficients", f"expected {len(x)} rows, one an input", len(c))
        object.__setattr__(self, "inputs", read_only(x))
        object.__setattr__(self, "coefficients", read_only(c))
        object.__setattr__(self, "length", check_number(length, "length", positive=True))

    def __call__(self, x: FloatArray) -> FloatArray:
        """Return ``g`` (..., k) at points (..., 3)."""
        square = ((x[..., None, :] - self.inputs) ** 2).sum(axis=-1)
        return np.asarray(np.exp(-0.5 * square / self.length**2) @ self.coefficients)


@dataclass(frozen=True, slots=True, eq=False)
class GaussianProcessSurface(LimitSurface):
    """Means of Gaussian processes that stand for a limit surface (the paper's baseline).

    ``slip`` takes unit normalised loads to twists, ``log_size`` unit normalised loads to the logarithm of their size over
    ``mean_size`` (N), ``load`` unit normalised twists to normalised loads in N. Nothing makes the three agree or the surface
    convex.
    """

    kind: ClassVar[str] = "gp"
    is_dual: ClassVar[bool] = False

    slip: KernelSum
    log_size: KernelSum
    load: KernelSum
    mean_size: float
    characteristic_length: float = field()  # or the property of the base would be its default
    provenance: Mapping[str, Any]

    def __repr__(self) -> str:
        return brief(self)

    def __init__(
        self,
        slip: KernelSum,
        log_size: KernelSum,
        load: KernelSum,
        mean_size: float,
        characteristic_length: float,
        *,
        provenance: Mapping[str, Any] | None = None,
    ) -> None:
        for (name, width), kernel in zip(_KERNEL_SUMS.items(), (slip, log_size, load), strict=True):
            if kernel.coefficients.shape[1] != width:
                raise InputError(name, f"expected {width} coefficients an input", f"{kernel.coefficients.shape[1]}")
        object.__setattr__(self, "slip", slip)
        object.__setattr__(self, "log_size", log_size)
        object.__setattr__(self, "load", load)
        object.__setattr__(self, "mean_size", check_number(mean_size, "mean_size", positive=True))
        object.__setattr__(
            self, "characteristic_length", check_number(characteristic_length, "characteristic_length", positive=True)
        )
        object.__setattr__(self, "provenance", MappingProxyType(dict(provenance or {})))

    def to_json(self) -> dict[str, Any]:
        """Return the ``model/1`` of the surface, without its format and kind."""
        sums = {name: getattr(self, name) for name in _KERNEL_SUMS}
        return {
            "characteristic_length": self.characteristic_length,
            "mean_size": self.mean_size,
            **{
                name: {"inputs": k.inputs.tolist(), "coefficients": k.coefficients.tolist(), "length": k.length}
                for name, k in sums.items()
            },
            "provenance": dict(self.provenance),
        }

    @classmethod
    def from_json(cls, node: Node) -> Self:
        """Read the value of a ``model/1`` of this kind."""
        node.expect_keys("format", "kind", "characteristic_length", "mean_size", "provenance", *_KERNEL_SUMS)
        sums: dict[str, KernelSum] = {}
        for name, width in _KERNEL_SUMS.items():
            entry = node[name]
            entry.expect_keys("inputs", "coefficients", "length")
            inputs, coefficients = entry["inputs"].array(None, 3), entry["coefficients"].array(None, width)
            length = entry["length"].number(positive=True)
            sums[name] = entry.checked(partial(KernelSum, inputs, coefficients, length))
        size, rho = node["mean_size"].number(positive=True), node["characteristic_length"].number(positive=True)
        provenance = node["provenance"]
        origin = None if provenance.value is None else provenance.object()
        return node.checked(lambda: cls(sums["slip"], sums["log_size"], sums["load"], size, rho, provenance=origin))

    def value(self, wrenches: ArrayLike) -> FloatArray:
        """Return the size (...) of wrenches (..., 3) over the size that slips in their direction: 1 on the surface."""
        f = normalize_wrench(check_vectors(wrenches, "wrenches", 3), self.characteristic_length)
        size = np.linalg.norm(f, axis=-1)
        slipping = self.mean_size * np.exp(self.log_size(unit(f))[..., 0])
        return np.asarray(size / slipping)

    def twist(self, wrenches: ArrayLike) -> FloatArray:
        """Return the slip twists (..., 3) of wrenches (..., 3), of unit length in ``(vx, vy, rho*omega)``."""
        f = unit(normalize_wrench(check_vectors(wrenches, "wrenches", 3), self.characteristic_length))
        if not f.any(axis=-1).all():
            raise InputError("wrenches", "expected wrenches that are not zero")
        return unit(_nonzero(self.slip(f), "wrenches")) / (1.0, 1.0, self.characteristic_length)

    def wrench(self, twists: ArrayLike) -> FloatArray:
        """Return the loads (..., 3) of twists (..., 3)."""
        v = unit(normalize_twist(check_vectors(twists, "twists", 3), self.characteristic_length))
        if not v.any(axis=-1).all():
            raise InputError("twists", "expected twists that are not zero")
        return np.asarray(_nonzero(self.load(v), "twists") * (1.0, 1.0, self.characteristic_length))


def _nonzero(vectors: FloatArray, asked: str) -> FloatArray:
    """Far from all that it has seen the mean of a process is zero, which is no answer."""
    silent = np.linalg.norm(vectors, axis=-1) < _SILENT
    if silent.any():
        raise ConvergenceError(
            f"Gaussian process: {int(silent.sum())} of {silent.size} {asked} are too far from all pairs that it knows"
        )
    return vectors
