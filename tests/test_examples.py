"""Every example runs alone, from any folder, and so does the Python of README and documentation."""

import importlib
import json
import os
import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import stablepush as sp

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples" / "gallery").glob("*.py"))


#: Studies that need no data, cut short, and the files that they leave.
STUDIES = {
    "figure3.py": (["--trials", "2", "--cases", "ring_noise_free"], ["figure3.json", "figure3.png"]),
    "online.py": (["--streams", "2"], ["online.json", "online.png"]),
}


def run(path, arguments, folder):
    done = subprocess.run(
        [sys.executable, "-W", "error", str(path), *arguments],
        check=False,
        cwd=folder,
        capture_output=True,
        text=True,
        env=os.environ,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path, tmp_path):
    run(path, [], tmp_path)
    pictures = list(tmp_path.glob("*.png"))
    assert len(pictures) == 1 and pictures[0].read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", STUDIES)
def test_study(name, tmp_path):
    arguments, files = STUDIES[name]
    assert run(ROOT / "examples" / "paper" / name, arguments, tmp_path).strip()
    assert sorted(f.name for f in (tmp_path / "paper").iterdir()) == files


def test_a_campaign_of_diagnoses_is_counted_and_drawn(tmp_path, monkeypatch):
    """What each log has and is called; of the probabilities near 0.3 half act, of those near 1 all."""
    rows = """effect,truth,seed,share,kind,verdict,named,closed,covered,seconds,probabilities
none,,0,0.15,one,absorbed,,0,,1,drift=0.300 tilt=0.010
drift,drift:rate=0.1,1,0.35,one,named,drift tilt,1,1,1,drift=0.990 tilt=0.300
tilt,tilt:slope=0.1/0,2,0.6,one,none,,0,,1,tilt=0.310 drift=0.010
checkerboard,,3,1,one,unknown,,0,,1,drift=0.990 tilt=0.990
pair,drift:rate=0.1 tilt:slope=0.1/0,4,0.15,one,named,drift tilt,1,1 1,1,drift=0.990 tilt=0.980
poses:drift,drift:rate=0.1,5,0.15,one,none,,0,,1,drift=0.310 tilt=0.020
"""
    (tmp_path / "rows.csv").write_text(rows, encoding="utf-8")
    folder = ROOT / "examples" / "diagnosis"
    run(folder / "campaign_figures.py", ["rows.csv", "-o", "figures"], tmp_path)
    assert sorted(f.name for f in (tmp_path / "figures").iterdir()) == ["confusion.png", "reliability.png"]
    monkeypatch.syspath_prepend(folder)
    campaign, figures = importlib.import_module("campaign"), importlib.import_module("campaign_figures")
    logs = campaign.read_rows(tmp_path / "rows.csv")
    counts = figures.confusion(logs)
    matrix = [(figures.TRUTHS[i], figures.CALLED[j], int(counts[i, j])) for i, j in np.argwhere(counts)]
    bins = [(round(said, 3), share, number) for said, share, _, _, number in figures.reliability(logs)]
    assert matrix == [
        ("drift", "drift", 1), ("drift", "tilt", 1), ("tilt", "none", 1), ("none", "absorbed", 1), ("checkerboard", "unknown", 1)
    ]  # fmt: skip
    assert bins == [(0.01, 0.0, 2), (0.02, 0.0, 1), (0.305, 0.5, 4), (0.987, 1.0, 3)]


def test_every_part_of_the_diagnosis_can_be_switched_off(monkeypatch):
    """What the ablation takes out is still called as it says, and is there again afterwards."""
    monkeypatch.syspath_prepend(ROOT / "examples" / "diagnosis")
    ablation = importlib.import_module("ablation")
    before = ablation.attribution.possible
    assert len(ablation.PARTS) >= 10
    for part in ablation.PARTS:
        with ablation.without(part):
            pass
    with ablation.without("plausibility off"):
        assert ablation.attribution.possible is not before
    assert ablation.attribution.possible is before


def test_the_readme_s_python_runs(tmp_path):
    """All blocks of it, and of the page of the library, one after the other, in a folder in which the demo has run."""
    from stablepush.demo import demo_pokes

    sp.write_pushlog(demo_pokes(), tmp_path / "stablepush-demo" / "pokes")
    assert blocks("README.md", tmp_path).strip()
    assert blocks(Path("docs") / "python.md", tmp_path).strip()


@pytest.mark.parametrize(
    "page", ["tutorial.md", "more.md", "robot.md", "choosing.md", "planning.md", "simulation.md", "extend.md"]
)
def test_a_page_s_python_runs(page, tmp_path):
    assert blocks(Path("docs") / page, tmp_path).strip()


def test_the_files_of_the_formats_page_are_read(tmp_path, capsys):
    from stablepush.cli import main

    text = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    parts = {part.split("`")[1]: part for part in text.split("\n## ")[1:]}
    found = {name: re.findall(r"```(?:json|text)\n(.*?)```", part, flags=re.DOTALL) for name, part in parts.items()}
    names = {"slider/1": ["slider.json"], "contact": ["contact.json"], "model/1": ["model.json"], "scene/1": ["scene.json"]}
    names |= {"plan/1": ["plan.json"], "pushlog/1": [f"log/{file}" for file in ("rig.json", "trials.csv", "samples.csv")]}
    (tmp_path / "log").mkdir()
    for format, files in names.items():
        for file, block in zip(files, found[format], strict=True):
            (tmp_path / file).write_text(block, encoding="utf-8")
    sp.load_model(tmp_path / "model.json")
    log = sp.read_pushlog(tmp_path / "log")
    assert len(log) == 2 and log.rig.noise.force == 0.05
    map_of = ["map", tmp_path / "model.json", "--contact", tmp_path / "contact.json", "--slider", tmp_path / "slider.json"]
    assert main([str(a) for a in (*map_of, "-o", tmp_path / "map.png")]) == 0
    scene, plan = tmp_path / "scene.json", tmp_path / "plan.json"
    # the plan is a path by hand, that does not reach the goal of the scene
    assert main(["check", str(scene), str(plan)]) == 1
    told = capsys.readouterr()
    assert "goal" in told.out + told.err
    near = json.loads(scene.read_text()) | {"goal": [0.2, 0.3, 0.0]}
    scene.write_text(json.dumps(near))
    assert main(["check", str(scene), str(plan)]) == 0, capsys.readouterr()


def test_the_page_of_effects_is_that_of_the_catalogue():
    from stablepush.effects import CATALOGUE

    text = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    sections = {part.split("`")[1]: part for part in text.split("\n### ")[1:]}
    assert set(sections) == set(CATALOGUE)
    for id, kind in CATALOGUE.items():
        for words in (f"\n{kind.what[0].upper()}{kind.what[1:]}.\n", f"needs:** {kind.needs}.\n", f"named:** {kind.remedy}.\n"):
            assert words in sections[id], id


def test_the_pictures_of_the_pages_are_there():
    for page in (ROOT / "docs").glob("*.md"):
        for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / name).is_file(), (page.name, name)


def blocks(page, folder):
    """Output of the Python blocks of a page, one after the other."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = re.findall(r"```(?:python|\{code-cell\} ipython3)\n(.*?)```", text, flags=re.DOTALL)
    assert found
    (folder / "block.py").write_text("\n".join(found), encoding="utf-8")
    return run(folder / "block.py", [], folder)


def test_the_reference_has_every_public_name():
    text = (ROOT / "docs" / "api.rst").read_text(encoding="utf-8")
    listed = re.findall(r":: stablepush\.(\w+)$", text, flags=re.MULTILINE)
    assert sorted(listed) == sorted(set(sp.__all__))


def test_the_picture_of_the_frames_is_true():
    """It is drawn from the library's own frames; a last digit may differ by processor."""
    number = re.compile(r"-?\d+\.\d")
    kept = (ROOT / "docs" / "frames.svg").read_text(encoding="utf-8")
    drawn = runpy.run_path(str(ROOT / "docs" / "frames.py"))["picture"]()
    assert number.sub("#", kept) == number.sub("#", drawn)
    found, expected = (np.array([float(x) for x in number.findall(text)]) for text in (kept, drawn))
    assert np.abs(found - expected).max() < 0.15


@pytest.mark.skipif(not (ROOT / "stablepush").is_dir(), reason="the sources are not here: an installed package is tested")
def test_the_picture_of_the_architecture_is_true():
    """It is drawn from the import rules, which name every module (``exhaustive``)."""
    drawing = runpy.run_path(str(ROOT / "docs" / "architecture.py"))
    rules = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    assert (ROOT / "docs" / "architecture.svg").read_text(encoding="utf-8") == drawing["picture"](rules)
    package = Path(sp.__file__).parent
    rooms = {path.parent for path in package.rglob("__init__.py")}
    described = {c["containers"][0]: c for c in rules if c["type"] == "layers"}
    # files of effects know nothing of each other, and none of them is listed
    alone = {modules.removesuffix(".*") for c in rules if c["type"] == "independence" for modules in c["modules"]}
    assert {".".join(room.relative_to(package.parent).parts) for room in rooms} == {*described, *alone}
    assert all(contract["exhaustive"] for contract in described.values())
