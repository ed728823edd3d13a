"""Another limit surface is one class and one entry point."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from conftest import small_scene, triangle

import stablepush as sp
from stablepush.core import plugins


@dataclass(frozen=True, slots=True, eq=False)
class Ellipsoid(sp.LimitSurface):
    """``H(F) = (fx² + fy²)/f² + (tau/rho)²/f²``: what a laboratory may add."""

    kind: ClassVar[str] = "ellipsoid"

    characteristic_length: float = field()
    force: float

    def value(self, wrenches):
        return (np.asarray(wrenches) ** 2 / (1, 1, self.characteristic_length**2)).sum(axis=-1) / self.force**2

    def twist(self, wrenches):
        slip = np.asarray(wrenches) / (1, 1, self.characteristic_length)
        return slip / np.linalg.norm(slip, axis=-1, keepdims=True) / (1, 1, self.characteristic_length)

    def wrench(self, twists):
        v = np.asarray(twists) * (1, 1, self.characteristic_length)
        return self.force * v / np.linalg.norm(v, axis=-1, keepdims=True) * (1, 1, self.characteristic_length)

    def to_json(self):
        return {"characteristic_length": self.characteristic_length, "force": self.force}

    @classmethod
    def from_json(cls, node):
        return cls(node["characteristic_length"].number(positive=True), node["force"].number(positive=True))


@pytest.fixture
def installed(monkeypatch):
    entry = SimpleNamespace(name="ellipsoid", load=lambda: Ellipsoid)
    kept = plugins.entry_points
    found = {"stablepush.surfaces": [entry]}
    monkeypatch.setattr(plugins, "entry_points", lambda group, **name: found.get(group) or kept(group=group, **name))
    return Ellipsoid(0.05, 4.0)


def quadratic(surface):
    """The same surface as a polynomial."""
    return sp.PolynomialLimitSurface(np.array((1, 0, 0, 1, 0, 1)) / surface.force**2, 2, surface.characteristic_length)


def test_files_take_it(installed, tmp_path):
    sp.save_model(installed, tmp_path / "model.json")
    again = sp.load_model(tmp_path / "model.json")
    assert isinstance(again, Ellipsoid)
    assert (again.characteristic_length, again.force) == (0.05, 4.0)
    (tmp_path / "model.json").write_text('{"format": "model/1", "kind": "ellipsoid", "characteristic_length": 0.05, "force": -1}')
    with pytest.raises(sp.InputError, match="force: expected a number > 0"):
        sp.load_model(tmp_path / "model.json")


def test_regions_planners_and_slides_take_it(installed):
    contact = sp.PushContact.on_edge(triangle(), 0, 0.05, 0.05, 0.6)
    mine, known = sp.stable_region(installed, contact), sp.stable_region(quadratic(installed), contact)
    assert mine.solid_angle() == pytest.approx(known.solid_angle(), rel=1e-9)
    problem = sp.PlanningProblem(triangle(), installed, [contact], (0, 0, 0), (0.3, 0.1, 0.2))
    result = sp.plan(problem, time_limit=60, refinement_budget=0)
    assert result.solved
    assert sp.check_plan(problem, result).valid
    slides = [sp.simulate_free_sliding(s, triangle(), (0.1, 0, 1.0)).poses[-1] for s in (installed, quadratic(installed))]
    np.testing.assert_allclose(*slides, atol=1e-6)


def test_simulation_says_what_it_lacks(installed):
    with pytest.raises(sp.InputError, match="surface: expected a surface of support points or a polynomial one, got Ellipsoid"):
        sp.push_twist(installed, sp.PushContact(((0, -0.05),), (0, 1), 0.5), (0, 0.01, 0))


def test_what_is_no_limit_surface_is_refused_at_once():
    """One that only has the methods, too: regions and planners would ask it for more later."""

    class Duck:
        characteristic_length = 0.05

        def wrench(self, twists):
            return twists

    contact = small_scene().contacts[0]
    known = small_scene()
    for surface in (Duck(), None, "poly4-cvx"):
        for attempt in (
            lambda surface=surface: sp.StabilityOracle(surface, contact),
            lambda surface=surface: sp.stable_region(surface, contact),
            lambda surface=surface: sp.PlanningProblem(known.slider, surface, [contact], (0, 0, 0), (1, 0, 0)),
            lambda surface=surface: sp.simulate_free_sliding(surface, known.slider, (1, 0, 0), mu=0.3),
        ):
            with pytest.raises(sp.InputError, match="surface: expected a limit surface"):
                attempt()
