"""What a limit surface offers to oracles, regions, planners, simulation and files."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, Self

from numpy.typing import ArrayLike

from stablepush.core import FloatArray, InputError, Node


class LimitSurface(ABC):
    """A limit surface ``H(F) = 1``; methods take and return arrays (..., 3) in B.

    Another surface is a class derived from this one and an entry point in the group ``stablepush.surfaces`` under its
    :attr:`kind`. Regions, planners and files then take it; simulation does where it has point loads or a scaled Hessian.
    """

    __slots__ = ()

    #: What a ``model/1`` file calls it.
    kind: ClassVar[str]
    #: Whether :meth:`twist` and :meth:`wrench` are inverse to each other, as for the gradient of a convex ``H``. Regions need it.
    is_dual: ClassVar[bool] = True

    @property
    @abstractmethod
    def characteristic_length(self) -> float:
        """``rho`` in m."""

    @property
    def force_unit(self) -> str:
        """Unit of the forces, ``"N"`` or ``"mu*N"``."""
        return "N"

    @property
    def degree(self) -> int:
        """Degree of homogeneity of ``H``, with ``H(s F) = s^degree H(F)``."""
        return 1

    @abstractmethod
    def value(self, wrenches: ArrayLike) -> FloatArray:
        """Return ``H(F)`` (...): 1 on the surface."""

    @abstractmethod
    def twist(self, wrenches: ArrayLike) -> FloatArray:
        """Return slip twists of wrenches, of unit length in ``(vx, vy, rho*omega)``."""

    @abstractmethod
    def wrench(self, twists: ArrayLike) -> FloatArray:
        """Return ``H_inv``: loads on the surface for twists."""

    def members(self) -> Sequence[LimitSurface]:
        """Return the surfaces that the data of a fit leave likely; none without an ensemble."""
        return ()

    @property
    def point_loads(self) -> tuple[FloatArray, FloatArray] | None:
        """Support points (k, 2) in m and their friction loads (k,), for a surface that is the sum of their friction."""
        return None

    def scaled_hessian(self) -> tuple[FloatArray, FloatArray, float]:
        """Return second derivatives of a polynomial ``H`` for the kernels; see :meth:`PolynomialLimitSurface.scaled_hessian`."""
        raise InputError("surface", "expected a surface of support points or a polynomial one", type(self).__name__)

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """Return the ``model/1`` of the surface, without its format and kind."""

    @classmethod
    @abstractmethod
    def from_json(cls, node: Node) -> Self:
        """Read the value of a ``model/1`` of this kind; raises :class:`InputError` with file and key."""


def check_surface(surface: object, name: str) -> LimitSurface:
    """Return what is a limit surface; another raises an :class:`InputError` that names the argument."""
    if not isinstance(surface, LimitSurface):
        raise InputError(name, "expected a limit surface, a LimitSurface", type(surface).__name__)
    return surface
