"""What tests share: the lab's data where it is present, a zoo of surfaces and contacts, logs of a rig to diagnose."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

import stablepush as sp
from stablepush.effects import CATALOGUE, parse_effect

#: Characteristic length in m of the pairs of :func:`pairs`.
RHO = 0.05
SQUARE = sp.Slider(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)))
SQUARE_PUSH = sp.PushContact(((-0.25, -0.5), (0.25, -0.5)), (0, 1), 0.5)

# tests assert no times: the first call of a compiled function takes long
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

LAB_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def lab() -> Path:
    folder = LAB_DATA / "zhou2016"
    if not folder.is_dir():
        pytest.skip("the lab's logs are not beside the project")
    return folder


@pytest.fixture(scope="session")
def practice() -> Path:
    folder = LAB_DATA / "practice"
    if not folder.is_dir():
        pytest.skip("the practice logs are not beside the project")
    return folder


def power_form(directions: np.ndarray, degree: int) -> np.ndarray:
    """Coefficients of ``Σ (l·F)^d``, which is convex, and SOS-convex, for every set of directions (n, 3)."""
    exponents = sp.monomial_exponents(degree)
    factorial = np.concatenate(([1], np.cumprod(np.arange(1, degree + 1))))
    multinomial = factorial[degree] / factorial[exponents].prod(axis=1)
    return np.asarray((multinomial * (directions[:, None, :] ** exponents).prod(axis=-1)).sum(axis=0))


def triangle() -> sp.Slider:
    """The lab's right triangle, COM at the origin."""
    return sp.Slider(np.array(((0.0, 0.0), (0.15, 0.0), (0.0, 0.15))) - 0.05, 1.5)


def three_feet() -> sp.SupportDistribution:
    return sp.SupportDistribution(((-0.02, -0.02), (0.04, -0.02), (-0.02, 0.04)), (1, 1, 1))


def surface_zoo() -> dict[str, object]:
    rng = np.random.default_rng(1)
    exponents = sp.monomial_exponents(4)
    axes = np.where((exponents == 4).any(axis=1), 1.0, 0.0)
    tiny = power_form(rng.normal(size=(9, 3)), 4)
    return {
        "quadratic": sp.PolynomialLimitSurface(power_form(rng.normal(size=(5, 3)), 2), 2, 0.05),
        "quartic": sp.PolynomialLimitSurface(power_form(rng.normal(size=(12, 3)), 4), 4, 0.05),
        "sextic": sp.PolynomialLimitSurface(power_form(rng.normal(size=(20, 3)), 6), 6, 0.05),
        # Hessian singular along the axes
        "x4+y4+z4": sp.PolynomialLimitSurface(axes, 4, 0.05),
        # facets: two steep directions and a hint of a third
        "flat": sp.PolynomialLimitSurface(
            power_form(np.array(((1.0, 0.1, 0.0), (0.0, 1.0, 0.1), (0.02, 0.0, 0.05), (0.01, 0.02, 0.0))), 4), 4, 0.05
        ),
        "kilonewtons": sp.PolynomialLimitSurface(tiny * 1e-12, 4, 0.5),
        "millinewtons": sp.PolynomialLimitSurface(tiny * 1e12, 4, 0.005),
        "three feet": sp.IdealLimitSurface(three_feet(), 5.0),
        "ring": sp.IdealLimitSurface(sp.SupportDistribution.ring(0.05, 36), 3.0),
        "patch": sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(triangle().vertices, 0.02), 4.0),
    }


POLYNOMIALS = ("quadratic", "quartic", "sextic", "x4+y4+z4", "flat", "kilonewtons", "millinewtons")
IDEALS = ("three feet", "ring", "patch")


def random_twists(n: int, rho: float, seed: int = 0) -> np.ndarray:
    """Twists of random direction, of unit length in ``(vx, vy, rho*omega)``."""
    v = np.random.default_rng(seed).normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True) / (1.0, 1.0, rho)


def small_scene(**changes: object) -> sp.PlanningProblem:
    """Two fingers push the triangle past a wall."""
    settings: dict[str, object] = {
        "slider": triangle(),
        "surface": sp.IdealLimitSurface(three_feet(), 5.0),
        "contacts": [sp.PushContact.on_edge(triangle(), 0, 0.05, 0.05, 0.9)],
        "start": (0.2, 0.2, 0.0),
        "goal": (0.9, 0.3, -1.5),
        "obstacles": [((0.45, 0.0), (0.55, 0.0), (0.55, 0.5), (0.45, 0.5))],
        "bounds": (0.0, 0.0, 1.2, 1.0),
        "pusher": ((-0.03, -0.03), (0.0, -0.03), (0.0, 0.03), (-0.03, 0.03)),
        "min_margin": 0.02,
    }
    return sp.PlanningProblem(**{**settings, **changes})  # type: ignore[arg-type]


@pytest.fixture(scope="session")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files for all commands; tests copy what they break."""
    return make_files(tmp_path_factory.mktemp("rig with ünicode"))


def make_files(folder: Path) -> Path:
    """Make files for all commands with the commands themselves."""
    from stablepush.cli import main
    from stablepush.demo import demo_pokes, demo_slider
    from stablepush.io import write_json
    from stablepush.io.formats import contact_to_json, slider_to_json
    from stablepush.planning.problem import save_scene

    sp.write_pushlog(demo_pokes(12), folder / "log")
    assert main(["fit", str(folder / "log"), "-o", str(folder / "model.json")]) == 0
    contact = sp.PushContact.on_edge(demo_slider(), 0, 0.16 / 3, 0.05, 0.9)
    write_json(folder / "contact.json", contact_to_json(contact))
    write_json(folder / "slider.json", slider_to_json(demo_slider()))
    (folder / "cors.csv").write_text("name,cor_x,cor_y,sense\nfar,-2,0,1\nnear,0,0.01,1\nright,2,0,-1\n")
    save_scene(small_scene(), folder / "scene.json")
    assert main(["plan", str(folder / "scene.json"), "-o", str(folder / "plan.json")]) == 0
    return folder


def one_line(capsys: pytest.CaptureFixture[str], arguments: list[object], *words: object) -> None:
    """The command exits with 2 and one line on standard error that holds the words."""
    from stablepush.cli import main

    code = main([str(a) for a in arguments])
    captured = capsys.readouterr()
    assert code == 2, captured
    assert captured.out == ""
    assert captured.err.count("\n") == 1, captured.err
    assert captured.err.startswith("stablepush: error: ")
    for word in words:
        assert str(word) in captured.err, captured.err


LOAD, MASS = 3.5, 1.2
QUIET = sp.Noise(0.02, 5e-5, 5e-4)
FORCES = ("fx", "fy", "tau")


def pressure():
    """Spread over the outline: with three feet many pushes turn about one, whose load the motion then does not tell."""
    return sp.SupportDistribution.from_polygon(0.9 * triangle().vertices, 0.03)


def make_rig(*effects, noise=QUIET, two=False, **options):
    slider = sp.Slider(triangle().vertices, MASS, pressure())
    pusher = sp.Pusher.two_fingers(0.05, 0.005) if two else sp.Pusher.finger(0.005)
    surface = sp.IdealLimitSurface(pressure(), LOAD)
    return sp.VirtualRig(slider, surface, 0.5, pusher, [parse_effect(e) for e in effects], noise, **options)


def make_log(*effects, count=40, rows=7, seed=0, **options):
    rig = make_rig(*effects, **options)
    return rig.execute(sp.random_pushes(rig.slider, rig.pusher, count, seed=seed), rows=rows, seed=seed).log


def edited(log, drop=(), **rig):
    samples = {name: values for name, values in log.samples.items() if name not in drop}
    return sp.PushLog(replace(log.rig, **rig), log.trials, samples)


def check_schema(report):
    value = json.loads(json.dumps(report.to_json(), allow_nan=False))
    assert value["format"] == "diagnosis/1"
    assert value["verdict"] in ("none", "absorbed", "named", "ambiguous", "unknown")
    assert {e["effect"] for e in value["ranking"]} == set(CATALOGUE)
    probabilities = [e["probability"] for e in value["ranking"]]
    assert probabilities == sorted(probabilities, reverse=True)
    assert all(0 <= p <= 1 for p in probabilities)
    for entry in value["ranking"]:
        assert (entry["reason"] is None) == entry["identifiable"]
        known = {p.name: p for p in CATALOGUE[entry["effect"]].parameters}
        for name, parameter in entry["parameters"].items():
            assert parameter["unit"] == known[name].unit
            # a drift of several logs is each log's own
            several = known[name].size == 1 and np.ndim(parameter["estimate"]) == 1 and len(value.get("logs", ())) > 1
            count = len(value["logs"]) if several else known[name].size
            assert np.shape(parameter["ci95"]) == ((2,) if count == 1 else (count, 2))
    for entry in value["shrink"]:
        assert entry["channel"] in value["channels"]
        assert entry["ci95"][0] <= entry["ci95"][1]
    if value["verdict"] in ("none", "absorbed", "unknown"):
        assert value["effects"] == []
    if value["verdict"] == "ambiguous":
        assert len(value["effects"]) >= 2
    check_evidence(report)
    return value


def check_evidence(report):
    """Something is said of every effect: for what is named, against what is not."""
    assert set(report.evidence) == set(CATALOGUE)
    for entry in report.ranking:
        id = entry.effect
        supporting, opposing, unseen = report.evidence[id]
        if id in report.named:
            assert supporting, (id, opposing)
            assert report.verdict == "ambiguous" or all("family-wise" in clause for clause in opposing), (id, opposing)
        elif unseen:
            assert (supporting, opposing) == ([], []), id
            fitted_along = "cannot be judged" in unseen
            assert entry.identifiable == fitted_along, (id, unseen)
            assert fitted_along or unseen == f"not identifiable from this log: {entry.reason}"
        else:
            assert entry.identifiable and opposing, (id, supporting)
            assert not supporting or id == "model-capacity" or report.verdict == "unknown", (id, supporting)


def pairs(n, noise=0.0, seed=0):
    surface = sp.IdealLimitSurface(three_feet(), 5.0)
    twists = random_twists(n, RHO, seed)
    loads = surface.wrench(twists)
    rng = np.random.default_rng(seed + 1)
    return loads + noise * 5 * rng.normal(size=loads.shape) * (1, 1, RHO), twists


def two_edges(**changes):
    contacts = [sp.PushContact.on_edge(triangle(), e, c, 0.05, 0.9) for e, c in ((0, 0.05), (2, 0.1))]
    settings = {"contacts": contacts, "obstacles": (), "bounds": (0, 0.05, 1.4, 0.37), "goal": (1.0, 0.2, 0.0)}
    return small_scene(**{**settings, "switch_cost": 2.0, **changes})


def grid(size=4.0, n=41):
    line = np.linspace(-size, size, n)
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)


def counts(region):
    return sum(int(region.contains(grid(), sense).sum()) for sense in (1, -1))
