"""Is a push stable? The load of a motion against the composite wrench cone of the contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import BoolArray, FloatArray
from stablepush.geometry import normalize_wrench, twist_from_cor
from stablepush.objects import PushContact, WrenchCone
from stablepush.surfaces import LimitSurface, check_surface

#: Stable sets are closed; a margin (rad) this far below zero is on the boundary, to the accuracy of H_inv.
BOUNDARY_SLACK = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class StabilityOracle:
    """Tells which motions keep the slider stuck to the pusher.

    A motion ``V`` is stable when the load that it takes, ``F = H_inv(V)``, can be applied by the contacts without slipping or
    breaking: ``F`` lies in the composite wrench cone (Lynch and Mason 1996; Zhou et al. 2016, section V-A).
    """

    surface: LimitSurface
    contact: PushContact
    cone: WrenchCone

    def __init__(self, surface: LimitSurface, contact: PushContact) -> None:
        object.__setattr__(self, "surface", check_surface(surface, "surface"))
        object.__setattr__(self, "contact", contact)
        object.__setattr__(self, "cone", contact.cone(surface.characteristic_length))

    def margin(self, twists: ArrayLike) -> FloatArray:
        """Return the margin (...) in rad of body twists (..., 3): the angle from the load to the nearest facet of the cone.

        ``min_i arcsin(a_i · F/|F|)`` in ``(fx, fy, tau/rho)``; negative outside. Translations are twists like any other.
        """
        loads = normalize_wrench(self.surface.wrench(twists), self.surface.characteristic_length)
        return self.cone.margin(loads)

    def is_stable(self, twists: ArrayLike) -> BoolArray:
        """Return whether body twists (..., 3) are stable (...)."""
        return np.asarray(self.margin(twists) >= -BOUNDARY_SLACK)

    def probability(self, twists: ArrayLike) -> FloatArray | None:
        """Return the share (...) of the surface's ensemble that calls body twists (..., 3) stable; None without an ensemble."""
        members = self.surface.members()
        if not members:
            return None
        votes = [StabilityOracle(member, self.contact).is_stable(twists) for member in members]
        return np.asarray(np.mean(votes, axis=0))

    def is_stable_cor(self, cors: ArrayLike, sense: ArrayLike) -> BoolArray:
        """Return whether rotations about CORs (..., 2) in B (m) with sense +1 or -1 are stable."""
        return self.is_stable(twist_from_cor(cors, sense))
