"""What a limit surface offers to oracles, regions, planners and simulation."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from numpy.typing import ArrayLike

from stablepush.core import FloatArray


@runtime_checkable
class LimitSurface(Protocol):
    """What every limit surface offers; all methods take and return arrays (..., 3) in B."""

    @property
    def characteristic_length(self) -> float:
        """``rho`` in m."""

    @property
    def force_unit(self) -> str:
        """``"N"`` or ``"mu*N"``."""

    def value(self, wrenches: ArrayLike) -> FloatArray:
        """``H(F)``: 1 on the surface."""

    def twist(self, wrenches: ArrayLike) -> FloatArray:
        """Slip twists of wrenches, of unit length in ``(vx, vy, rho*omega)``."""

    def wrench(self, twists: ArrayLike) -> FloatArray:
        """``H_inv``: loads on the surface for twists."""
