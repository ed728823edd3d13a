"""What effects do to the load of a slider is one law: the diagnosis fits what the rig obeys, also where several act."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

import stablepush as sp
from stablepush.diagnosis.likelihood.forward import ForwardModel
from stablepush.effects import Effect
from stablepush.effects.table import table_friction

SLIDER = sp.Slider.centered([(0, 0), (0.16, 0), (0, 0.16)], mass=1.2)
SUPPORT = sp.SupportDistribution.from_polygon(SLIDER.vertices, 0.02)
LOAD, GRAVITY, MANY = 3.0, 9.81, 200


def lobes(ratio, direction):
    share = (ratio**2 - 1) / (ratio**2 + 1)
    return np.array((share * math.cos(2 * direction), share * math.sin(2 * direction)))


#: An effect of the rig, and what the diagnosis fits of it.
TABLE = [
    (Effect("anisotropy-world", {"ratio": 1.2, "direction": 0.3}), lobes(1.2, 0.3)),
    (Effect("anisotropy-object", {"ratio": 1.2, "direction": 1.1}), lobes(1.2, 1.1)),
    (Effect("speed-dependence", {"slope": 0.1}), np.array((0.1,))),
    (Effect("spatial-variation", {"gradient": (0.5, -0.4)}), np.array((0.5, -0.4))),
    (Effect("tilt", {"slope": (0.03, -0.02)}), np.array((0.03, -0.02))),
]
SETS = [chosen for count in (1, 2, 3, len(TABLE)) for chosen in itertools.combinations(TABLE, count)]


@pytest.mark.parametrize("chosen", SETS, ids=lambda chosen: "+".join(effect.id for effect, _ in chosen))
def test_the_diagnosis_fits_the_law_that_the_rig_obeys(chosen):
    rng = np.random.default_rng(0)
    twists, poses = rng.normal(size=(MANY, 3)) * (0.02, 0.02, 0.3), rng.normal(size=(MANY, 3)) * (0.2, 0.2, 1.5)
    surface = sp.IdealLimitSurface(SUPPORT, LOAD, SLIDER.characteristic_length)
    rig = table_friction(SLIDER, surface, {effect.id: effect for effect, _ in chosen}, 1.0, GRAVITY)
    rows = SimpleNamespace(
        pusher=np.full((MANY, 3), np.nan), pose=poses, twist=twists, acceleration=np.zeros((MANY, 3)),
        place=np.full((MANY, 2, 2), np.nan), order=np.linspace(0, 1, MANY), computed_moments=False,
    )  # fmt: skip
    model = ForwardModel(
        rows, SUPPORT.points, SLIDER.mass * GRAVITY, SLIDER.radius_of_gyration**2, SUPPORT.center, np.zeros((MANY, 3))
    )
    load = LOAD * SUPPORT.weights / SUPPORT.weights.sum()
    predicted = model.predict(load, {effect.id: values for effect, values in chosen})
    np.testing.assert_allclose(predicted, rig.wrench(twists, poses), rtol=1e-9, atol=1e-9)
