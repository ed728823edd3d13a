"""Inertia and friction of a body that slides freely, in coordinates in which its kinetic energy is ``|U|²/2``."""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import FloatArray, InputError, check_number, check_zero_or_positive
from stablepush.objects import Slider
from stablepush.surfaces import LimitSurface
from stablepush.surfaces.kernels import sum_loads

#: Support points this much slower than the slider, in the norm of U, have friction in proportion to their speed.
_CREEP = 1e-7
#: So many support points take as long again as what else an evaluation takes (measured: 25,600 points 3.8 times as long).
_CHEAP_POINTS = 10_000


class Body:
    """Inertia and friction of a slider, in the coordinates U."""

    def __init__(self, surface: LimitSurface, slider: Slider, mu: float | None, gravity: float) -> None:
        if slider.mass is None or slider.mass <= 0:
            raise InputError("slider.mass", "expected a mass > 0 in kg, which free sliding needs")
        check_number(gravity, "gravity", positive=True)
        self.surface, self.mass = surface, slider.mass
        self.inertia = slider.mass * slider.radius_of_gyration**2
        self.roots = np.sqrt((self.mass, self.mass, self.inertia))
        self.load = 1.0
        if mu is not None:
            check_zero_or_positive(mu, "mu")
        if surface.force_unit == "mu*N":
            if mu is None:
                raise InputError("mu", "expected the friction of the support, since the forces of the model are in units of mu*N")
            self.load = mu * self.mass * gravity
        self.points, self.loads = surface.point_loads or (np.zeros((0, 2)), np.zeros(0))
        #: Time that an evaluation takes, in that of few points.
        self.cost = 1 + len(self.points) // _CHEAP_POINTS

    def friction(self, directions: FloatArray) -> FloatArray:
        """Friction load ``G = (fx/√m, fy/√m, tau/√I)`` (n, 3) of unit vectors U (n, 3)."""
        twists = directions / self.roots
        if len(self.points):
            return self._wrench_of_points(twists) / self.roots
        return self.load * self.surface.wrench(twists) / self.roots

    def _wrench_of_points(self, twists: FloatArray) -> FloatArray:
        """Load (n, 3) of Coulomb friction that grows with the speed of points that all but rest: no jump, no chatter."""
        loads = np.empty_like(twists)
        sum_loads(self.points, self.loads, np.ascontiguousarray(twists), _CREEP / math.sqrt(self.mass), 0.0, loads)
        return loads

    def turning(self, direction: FloatArray) -> FloatArray:
        """``c`` (3,) of a unit vector U."""
        omega = direction[2] / self.roots[2]
        return np.array((-omega * direction[1], omega * direction[0], 0.0))
