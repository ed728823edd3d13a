"""The page to try pushes on: its own mechanics against the library's, and what it holds."""

import json
import re

import numpy as np
import pytest
import scipy.optimize
from conftest import one_line, small_scene, triangle

import stablepush as sp
from stablepush.cli import main
from stablepush.geometry import twist_from_cor
from stablepush.views import scene_html


def page_of(problem, **given):
    """The data of a page, and its script up to where it looks for the document."""
    text = scene_html(problem, **given)
    code = text[text.index("// Loads of twists") : text.index("const svg =")]
    return json.loads(re.search(r"const data = (.*);\n", text)[1]), code


def fitted():
    slider = triangle()
    ideal = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), 3.0)
    twists = np.random.default_rng(0).normal(size=(20, 3)) / (1, 1, ideal.characteristic_length)
    return sp.fit_limit_surface(ideal.wrench(twists), twists, slider=slider, seed=0).surface


@pytest.mark.parametrize("surface", [None, "quartic", "quadratic"])
@pytest.mark.parametrize("points", [1, 2])
def test_loads_and_margins_of_the_page_are_those_of_the_library(surface, points):
    racer = pytest.importorskip("py_mini_racer", reason="mini-racer is not installed")
    problem = small_scene()
    if points == 1:
        problem = problem.with_changes(contacts=[sp.PushContact([(0.0, -0.05)], [(0, 1)], 0.6)])
    if surface == "quartic":
        problem = problem.with_changes(surface=fitted())
    if surface == "quadratic":
        problem = problem.with_changes(surface=sp.PolynomialLimitSurface((0.1, 0, 0, 0.12, 0, 0.2), 2, 0.04))
    data, code = page_of(problem)
    rho = problem.surface.characteristic_length
    cors = np.random.default_rng(1).normal(scale=0.2, size=(200, 2))
    twists = np.concatenate([twist_from_cor(cors, sense) for sense in (1, -1)])
    context = racer.MiniRacer()
    names = {"S": data["surface"], "C": data["scene"]["contacts"][0], "V": (twists * (1, 1, rho)).tolist()}
    given = "".join(f"const {name} = {json.dumps(value)};" for name, value in names.items())
    asked = "V.map((v) => { const f = loadOf(S, v); return [...f, marginOf(coneOf(C, S.rho), f).margin]; })"
    told = context.eval(f"{code}{given}JSON.stringify({asked})")
    found = np.array(json.loads(told))
    assert found[:, :3] == pytest.approx(problem.surface.wrench(twists) / (1, 1, rho), abs=1e-9)
    if points == 2:
        oracle = sp.StabilityOracle(problem.surface, problem.contacts[0])
        assert found[:, 3] == pytest.approx(oracle.margin(twists), abs=1e-9)
    else:
        # the cone of one finger is flat: nothing is inside
        assert (found[:, 3] <= 1e-9).all()


def test_what_gives_first_is_said_by_the_facet():
    racer = pytest.importorskip("py_mini_racer", reason="mini-racer is not installed")
    problem = small_scene()
    data, code = page_of(problem)
    contact = problem.contacts[0]
    context = racer.MiniRacer()
    context.eval(code + f"const K = coneOf({json.dumps(data['scene']['contacts'][0])}, {data['surface']['rho']});")

    def words(force, place):
        load = [*force, (place[0] * force[1] - place[1] * force[0]) / data["surface"]["rho"]]
        return context.eval(f"whatGives(K, {json.dumps(load)}, 2)")

    (left, right), middle = contact.points, contact.points.mean(axis=0)
    # a force beyond the second finger: the first one would have to pull
    assert words((0.0, 1.0), right + 0.3 * (right - left)) == "finger 1 lets go"
    assert words((0.0, 1.0), left - 0.3 * (right - left)) == "finger 2 lets go"
    assert words((1.2, 1.0), middle) == "both fingers slip to one side"
    assert words((0.3, -1.0), middle) == "the load pulls: no finger can"


def test_what_gives_is_the_face_of_the_cone_with_the_nearest_load():
    """Of 2,000 loads, against non-negative least squares over the edges of the fingers' friction cones."""
    racer = pytest.importorskip("py_mini_racer", reason="mini-racer is not installed")
    problem = small_scene()
    data, code = page_of(problem)
    contact, rho = problem.contacts[0], data["surface"]["rho"]
    loads = np.random.default_rng(3).normal(size=(2000, 3))
    loads /= np.linalg.norm(loads, axis=1)[:, None]
    context = racer.MiniRacer()
    context.eval(code + f"const K = coneOf({json.dumps(data['scene']['contacts'][0])}, {rho}), L = {json.dumps(loads.tolist())};")
    told = json.loads(context.eval("JSON.stringify(L.map((f) => [marginOf(K, f).margin, whatGives(K, f, 2)]))"))
    edges = []
    for point, normal in zip(contact.points, contact.normals, strict=True):
        for side in (1, -1):
            force = normal + side * contact.mu * np.array((-normal[1], normal[0]))
            ray = np.array((*force, (point[0] * force[1] - point[1] * force[0]) / rho))
            edges.append(ray / np.linalg.norm(ray))
    words = {
        (): "the load pulls: no finger can", (0, 1): "finger 2 lets go", (2, 3): "finger 1 lets go",
        (0, 2): "both fingers slip to one side", (1, 3): "both fingers slip to one side",
        (0, 3): "the fingers slip, each to its side", (1, 2): "the fingers slip, each to its side",
        (0,): "finger 2 lets go, finger 1 slips", (1,): "finger 2 lets go, finger 1 slips",
        (2,): "finger 1 lets go, finger 2 slips", (3,): "finger 1 lets go, finger 2 slips",
    }  # fmt: skip
    outside = 0
    for load, (margin, said) in zip(loads, told, strict=True):
        if margin < -1e-9:
            shares, _ = scipy.optimize.nnls(np.array(edges).T, load)
            pulls = (contact.normals @ load[:2] <= 0).all()
            assert said == words[() if pulls else tuple(np.flatnonzero(shares > 1e-12))]
            outside += 1
    assert 1500 < outside < 2000


def test_the_page_holds_the_scene_and_says_what_it_leaves_out(tmp_path, capsys):
    problem = small_scene()
    result = sp.plan(problem, refinement_budget=0)
    data, _ = page_of(problem, result=result)
    assert len(data["plan"]) == len(result.pushes)
    inside = sp.stable_region(problem.surface, problem.contacts[0]).contains(np.array([data["cor"]]), data["sense"])
    assert inside.all()
    at, plan, page = tmp_path / "scene.json", tmp_path / "plan.json", tmp_path / "page.html"
    at.write_text(json.dumps(data["scene"]), encoding="utf-8")
    sp.save_plan(result, plan)
    # what it saves is a scene
    assert sp.check_plan(sp.load_scene(at), result).valid
    assert main(["view", str(at), str(plan), "-o", str(page)]) == 0
    assert "open it in a browser" in capsys.readouterr().out
    assert "http" not in page.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
    tilted = problem.with_changes(slider=sp.Slider(problem.slider.vertices, 1.2), effects=[sp.parse_effect("tilt:slope=0.03/0")])
    assert "effects that this page does not reckon with: tilt" in scene_html(tilted)
    one_line(capsys, ["view", at, tmp_path / "none.json", "-o", page], "none.json: cannot read")
    three = problem.with_changes(contacts=[sp.PushContact([(-0.03, -0.05), (0, -0.05), (0.03, -0.05)], [(0, 1)] * 3, 0.5)])
    with pytest.raises(sp.InputError, match=r"contacts\[0\]: expected one or two points"):
        scene_html(three)
