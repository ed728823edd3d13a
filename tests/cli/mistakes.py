"""Mistakes that everybody makes once, and what the program says.

    python tests/cli/mistakes.py            a table: what was typed, exit code, seconds, what is printed

Each case changes the files of a rig that works, and calls a command. ``code`` is its exit code, ``words`` stand on standard error
(or, for answers, on standard output).
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

Values = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Mistake:
    """A mistake: in a file (``change`` of its JSON, or ``text`` instead of it) or in the ``arguments`` of a command."""

    what: str
    arguments: str
    code: int
    words: tuple[str, ...]
    file: str = ""
    change: Callable[[Values], object] | None = None
    text: str = ""


def scaled(value: Any, factor: float) -> Any:
    return (np.array(value) * factor).tolist()


def in_millimetres(scene: Values) -> None:
    """All lengths of a scene, as a drawing in mm has them."""
    scene["slider"]["vertices"] = scaled(scene["slider"]["vertices"], 1e3)
    model = scene["model"]
    model["points"], model["characteristic_length"] = scaled(model["points"], 1e3), 1e3 * model["characteristic_length"]
    for contact in scene["contacts"]:
        contact["points"] = scaled(contact["points"], 1e3)
    scene["pusher"]["outline"] = scaled(scene["pusher"]["outline"], 1e3)
    scene["obstacles"] = [scaled(outline, 1e3) for outline in scene["obstacles"]]
    scene["bounds"] = scaled(scene["bounds"], 1e3)
    for name in ("start", "goal"):
        scene[name] = scaled(scene[name][:2], 1e3) + scene[name][2:]


def box(x: float, y: float, half: float = 0.15) -> list[list[float]]:
    return [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]


def a_finger(scene: Values) -> None:
    contact = scene["contacts"][0]
    contact["points"], contact["normals"] = contact["points"][:1], contact["normals"][:1]


CORNER = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.04], [0.04, 0.04], [0.04, 0.1], [0.0, 0.1]]
PLAN = "plan {scene} -o {out} --refinement-budget 0"
EXECUTE = "simulate {scene} {plan} -o {out}"
MAP = "map {model} --contact {contact} --slider {slider} -o {out}"
CLASSIFY = "classify {model} --contact {contact} --cors {cors} -o {out}"
SLIDE = "slide {model} --slider {slider} --twist 0.3 -0.1 2 -o {out}"
CORS = "cor_x,cor_y,sense\n"

MISTAKES = (
    Mistake(
        "outline in mm",
        MAP,
        0,
        ("note", "radius of 119.3 m", "millimetres"),
        "slider",
        lambda v: v.update(vertices=scaled(v["vertices"], 1e3)),
    ),
    Mistake(
        "outline in mm, in a scene in m",
        PLAN,
        1,
        ("note", "slider.vertices", "millimetres", "start"),
        "scene",
        lambda v: v["slider"].update(vertices=scaled(v["slider"]["vertices"], 1e3)),
    ),
    Mistake("whole scene in mm", PLAN, 0, ("note", "slider.vertices", "bounds", "goal", "millimetres"), "scene", in_millimetres),
    Mistake("mass of 0", MAP, 2, ("slider.json", "mass", "> 0"), "slider", lambda v: v.update(mass=0)),
    Mistake(
        "mass of 800 kg, in g", SLIDE, 0, ("note", "mass", "800 kg", "grams", "0.8 kg"), "slider", lambda v: v.update(mass=800)
    ),
    Mistake(
        "min_margn",
        PLAN,
        2,
        ("scene.json", "min_margn", "min_margin"),
        "scene",
        lambda v: v.update(min_margn=v.pop("min_margin")),
    ),
    Mistake(
        "obstacle for obstacles", PLAN, 2, ("obstacle", '"obstacles"'), "scene", lambda v: v.update(obstacle=v.pop("obstacles"))
    ),
    Mistake("Speed for speed", PLAN, 2, ("Speed", '"speed"'), "scene", lambda v: v.update(Speed=v.pop("speed"))),
    Mistake(
        "point for points",
        CLASSIFY,
        2,
        ("contact.json", "point", '"points"'),
        "contact",
        lambda v: v.update(point=v.pop("points")),
    ),
    Mistake(
        "a key that nothing reads", PLAN, 0, ("note", "comment", "ignored"), "scene", lambda v: v.update(comment="first try")
    ),
    Mistake(
        "goal heading of 90 'rad'",
        PLAN,
        0,
        ("note", "goal[2]", "90 rad", "degrees", "1.571"),
        "scene",
        lambda v: v.update(goal=[0.9, 0.3, 90]),
    ),
    Mistake(
        "tolerance of 3 'rad'", PLAN, 0, ("note", "tolerance[1]", "degrees"), "scene", lambda v: v.update(tolerance=[0.01, 3])
    ),
    Mistake("min_margin of 3 'rad'", PLAN, 1, ("note", "min_margin", "degrees"), "scene", lambda v: v.update(min_margin=3)),
    Mistake("speed of 50 'm/s'", PLAN, 0, ("note", "speed", "50 m/s", "millimetres"), "scene", lambda v: v.update(speed=50)),
    Mistake("speed of 1e6 m/s", PLAN, 1, ("note", "speed"), "scene", lambda v: v.update(speed=1e6)),
    Mistake(
        "contact in mm",
        PLAN,
        1,
        ("note", "contacts[0].points", "millimetres"),
        "scene",
        lambda v: v["contacts"][0].update(points=scaled(v["contacts"][0]["points"], 1e3)),
    ),
    Mistake("friction of 30, an angle", CLASSIFY, 0, ("note", "mu", "30", "degrees"), "contact", lambda v: v.update(mu=30)),
    Mistake(
        "L-shape whose origin is a corner",
        MAP,
        2,
        ("slider.json", "vertices", "origin", "Slider.centered"),
        "slider",
        lambda v: v.update(vertices=CORNER),
    ),
    Mistake("outline drawn clockwise", MAP, 2, ("slider.json", "clockwise"), "slider", lambda v: v["vertices"].reverse()),
    Mistake(
        "outline whose first vertex stands twice",
        MAP,
        2,
        ("slider.json", "zero length"),
        "slider",
        lambda v: v["vertices"].insert(0, v["vertices"][0]),
    ),
    Mistake(
        "slider of 1 µm",
        MAP,
        2,
        ("slider.json", "radius of at least"),
        "slider",
        lambda v: v.update(vertices=scaled(v["vertices"], 1e-5)),
    ),
    Mistake(
        "goal inside an obstacle",
        PLAN,
        1,
        ("goal", "collision with obstacle 1"),
        "scene",
        lambda v: v["obstacles"].append(box(0.9, 0.3)),
    ),
    Mistake("goal outside of the bounds", PLAN, 1, ("goal", "out of bounds"), "scene", lambda v: v.update(goal=[5, 5, 0])),
    Mistake(
        "start inside an obstacle",
        PLAN,
        1,
        ("start", "collision with obstacle 1"),
        "scene",
        lambda v: v["obstacles"].append(box(0.2, 0.2)),
    ),
    Mistake(
        "no room for the pusher at the goal", PLAN, 1, ("goal", "pusher"), "scene", lambda v: v.update(goal=[0.9, 0.052, 0.0])
    ),
    Mistake("one finger", PLAN, 1, ("no contact has a stable push",), "scene", a_finger),
    Mistake(
        "no friction at the fingers", PLAN, 1, ("no contact has a stable push",), "scene", lambda v: v["contacts"][0].update(mu=0)
    ),
    Mistake("margin that no push has", PLAN, 1, ("min_margin", "at most"), "scene", lambda v: v.update(min_margin=1.2)),
    Mistake(
        "surface that no torque moves",
        MAP,
        2,
        ("model.json", "not bounded along every axis"),
        "model",
        lambda v: v.update(
            coefficients=[0.0 if e[2] else c for c, e in zip(v["coefficients"], v["exponents"], strict=True)], ensemble=None
        ),
    ),
    Mistake(
        "rotation centres in mm",
        CLASSIFY,
        0,
        ("note", "cors.csv", "millimetres"),
        "cors",
        text=CORS + "-120,15,1\n80,40,-1\n250,0,-1\n",
    ),
    Mistake("rotation centres without a sense", CLASSIFY, 2, ("cors.csv", "column sense"), "cors", text="cor_x,cor_y\n0.1,0.2\n"),
    Mistake(
        "twist in mm/s", "slide {model} --slider {slider} --twist 300 -100 2 -o {out}", 0, ("note", "--twist", "millimetres")
    ),
    Mistake("finger of 5 'm'", EXECUTE + " --finger-radius 5", 0, ("note", "--finger-radius", "millimetres")),
    Mistake("tilt with one number, without values", EXECUTE + " --effect tilt", 2, ("tilt:slope=0.05/0.05",)),
    Mistake("sensor heading 5 'rad'", EXECUTE + " --effect force-rotation:angle=5", 0, ("note", "force-rotation", "degrees")),
    Mistake(
        "an effect too strong during the plan",
        EXECUTE + " --effect spatial-variation:gradient=-2/0",
        2,
        ("error: push", "effects"),
    ),
    Mistake("an output without a name", "plan {scene} -o ''", 2, ("-o", 'got ""')),
    Mistake("a folder for a plan", "plan {scene} -o {folder}", 2, ("is a directory",)),
    Mistake("a slider for a scene", "plan {slider} -o {out}", 2, ("slider.json", "format", "scene/1")),
    Mistake("a scene that is not there", "plan {folder}/scne.json -o {out}", 2, ("scne.json", "No such file")),
    Mistake("a planner that is not there", PLAN + " --planner rrt", 2, ("rrt", "ompl-rrt")),
    Mistake("a comma for a point", PLAN + " --time-limit 1,5", 2, ("1,5",)),
    Mistake(
        "a trailing comma in JSON",
        PLAN,
        2,
        ("scene.json: line", "column", "expected JSON"),
        "scene",
        text='{"format": "scene/1",\n}',
    ),
    Mistake(
        "NaN in JSON", PLAN, 2, ("scene.json", "start[0]", "finite"), "scene", lambda v: v.update(start=[float("nan"), 0, 0])
    ),
)


def tried(mistake: Mistake, rig: Path, folder: Path) -> tuple[int, str, str, float]:
    """Make a mistake with a copy of what it spoils: exit code, standard output and error, seconds."""
    from stablepush.cli import main

    places = {name: rig / file for name, file in FILES.items()} | {"out": folder / "out", "folder": folder}
    if mistake.file:
        good = places[mistake.file]
        places[mistake.file] = folder / good.name
        text = mistake.text
        if mistake.change is not None:
            value = json.loads(good.read_text())
            mistake.change(value)
            text = json.dumps(value)
        places[mistake.file].write_text(text)
    arguments = ["" if part == "''" else part.format(**places) for part in mistake.arguments.split(" ")]
    out, err, began = io.StringIO(), io.StringIO(), time.perf_counter()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(arguments)
    return code, out.getvalue(), err.getvalue(), time.perf_counter() - began


FILES = {
    "model": "model.json", "contact": "contact.json", "cors": "cors.csv", "slider": "slider.json", "scene": "scene.json",
    "plan": "plan.json",
}  # fmt: skip


def main() -> None:
    from conftest import make_files

    with tempfile.TemporaryDirectory() as place:
        rig = Path(place) / "rig"
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            make_files(rig)
        for number, mistake in enumerate(MISTAKES):
            folder = Path(place) / str(number)
            folder.mkdir()
            code, out, err, seconds = tried(mistake, rig, folder)
            said = " / ".join((err or out).strip().replace(str(folder) + "/", "").replace(str(rig) + "/", "").splitlines())
            print(f"{mistake.what} | {code} | {seconds:.2f} s | {said}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
