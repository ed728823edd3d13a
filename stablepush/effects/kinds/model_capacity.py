"""The nominal surface cannot represent the measured loads and motions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from stablepush.core import EffectError
from stablepush.effects.kind import EffectKind, Parameter

if TYPE_CHECKING:
    from stablepush.objects import Slider
    from stablepush.surfaces import IdealLimitSurface, LimitSurface

#: Models of the degrees that a support may follow instead of the nominal surface.
_MODELS = {2: "quadratic", 4: "poly4-cvx", 6: "poly6-cvx"}


class ModelCapacity(EffectKind):
    number, id = 16, "model-capacity"
    what = "the nominal surface cannot represent the measured loads and motions"
    needs = "forces and motions of many different pushes"
    unseen = "needs forces of motions all round the limit surface"
    remedy = "fit a surface to more pokes"
    says = "The nominal surface cannot represent the measured loads and motions"
    parameters = (
        Parameter("facets", "support points", None, 3.0, 8.0, least=3.0, most=1000.0, whole=True),
        Parameter("degree", "degree of the polynomial", None, 2.0, 6.0, least=2.0, most=6.0, whole=True),
    )
    instead = "another surface is the scene's model"

    def other_shape(
        self,
        slider: Slider,
        surface: LimitSurface,
        numbers: Mapping[str, Sequence[float]],
        load: float,
        points: IdealLimitSurface | None,
    ) -> tuple[LimitSurface, float]:
        # the surface of another kind that comes nearest to the nominal one: a few support points, or a polynomial
        # fits load solvers: not before they are needed
        from stablepush.identify import sample_loads, support_for
        from stablepush.objects import SupportDistribution
        from stablepush.surfaces import IdealLimitSurface

        facets, degree = (numbers.get(name, (None,))[0] for name in ("facets", "degree"))
        if (facets is None) == (degree is None):
            raise EffectError("effect model-capacity", "expected either facets or degree")
        if degree is not None:
            if degree not in _MODELS:
                raise EffectError(
                    "effect model-capacity: degree", f"expected one of {', '.join(map(str, _MODELS))}", f"{degree:g}"
                )
            from stablepush.identify import fit_limit_surface

            loads, twists = sample_loads(surface, load)
            rho = surface.characteristic_length
            fitted = fit_limit_surface(loads, twists, model=_MODELS[int(degree)], characteristic_length=rho).surface
            return fitted, float(fitted.provenance["force_scale_N"]) if fitted.force_unit == "mu*N" else 1.0
        ideal = support_for(surface, slider, load) if points is None else points
        # as many even feet on a circle, about the same centre, as far from it on average
        count = int(facets or 0)
        places, weights = ideal.support.points, ideal.support.weights
        angles = 2 * np.pi * (np.arange(count) + 0.25) / count
        radius = math.sqrt(float(weights @ ((places - ideal.support.center) ** 2).sum(axis=1) / weights.sum()))
        feet = ideal.support.center + radius * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
        feet_on = SupportDistribution(feet, np.ones(count))
        return IdealLimitSurface(feet_on, ideal.friction_load, surface.characteristic_length), load
