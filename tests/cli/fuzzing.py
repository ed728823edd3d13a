"""A fuzzer of everything that is read: valid files are broken at random, and every reader and command has to take or refuse them.

    python tests/cli/fuzzing.py [--inputs 1000] [--seed 0] [--readers model pushlog ...] [--keep FOLDER]

Refusing means :class:`stablepush.StablepushError` with a message that names the file; for a command exit code 2 and one line on
standard error. Anything else is a crash, and so is a warning of Python's; more than :data:`PATIENCE` seconds is a hang. Bytes,
JSON values and cells of tables are changed, cut out, repeated, scaled and swapped, and replaced by what has broken readers.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import shutil
import signal
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from breaking import broken

import stablepush as sp

#: Seconds after which a reader, or a command, is said to hang.
PATIENCE = 60.0


class HangError(Exception):
    """Something took longer than :data:`PATIENCE`."""


@dataclass
class Tally:
    """What became of the inputs of a reader."""

    taken: int = 0
    refused: int = 0
    crashes: list[str] = field(default_factory=list)
    hangs: int = 0
    slowest: float = 0.0

    @property
    def inputs(self) -> int:
        return self.taken + self.refused + len(self.crashes) + self.hangs


@contextlib.contextmanager
def patience(seconds: float) -> Iterator[None]:
    def stop(*_: object) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def seeds(folder: Path) -> dict[str, Path]:
    """Write one valid input of every kind."""
    from stablepush.demo import demo_pokes, demo_slider
    from stablepush.io import write_json
    from stablepush.io.formats import contact_to_json, slider_to_json

    sp.write_pushlog(demo_pokes(6), folder / "log")
    log = sp.read_pushlog(folder / "log")
    loads, twists, _ = log.pairs()
    slider = demo_slider()
    sp.save_model(sp.fit_limit_surface(loads, twists, slider=slider).surface, folder / "polynomial.json")
    points = sp.SupportDistribution([[0.0, 0.03], [-0.03, -0.02], [0.03, -0.02]], [1, 2, 3])
    sp.save_model(sp.IdealLimitSurface(points, 3.0), folder / "support.json")
    contact = sp.PushContact.on_edge(slider, 0, 0.16 / 3, 0.05, 0.9)
    write_json(folder / "contact.json", contact_to_json(contact))
    write_json(folder / "slider.json", slider_to_json(slider))
    (folder / "cors.csv").write_text("cor_x,cor_y,sense\n-2,0,1\n0,0.01,1\n2,0,-1\n", encoding="utf-8")
    (folder / "pushes.csv").write_text("edge,along,direction,way,x,y,theta\n0,0.03,0.1,0.02,0,0,1\n1,0.02,0,0.02,0,0,0\n")
    scene = json.loads((Path(__file__).parents[2] / "examples" / "scenes" / "tight-turn.json").read_text(encoding="utf-8"))
    write_json(folder / "scene.json", {**scene, "model": "polynomial.json"})
    problem = sp.load_scene(folder / "scene.json")
    result = sp.plan(problem, refinement_budget=0)
    sp.save_plan(result, folder / "plan.json")
    sp.save_trajectory(sp.sample_plan(problem, result, rate=5, acceleration=0.1), folder / "trajectory.csv")
    (folder / "table").mkdir()
    recording(folder / "table" / "t.csv")
    (folder / "small.map").write_text("type octile\nheight 4\nwidth 6\nmap\n......\n.@@T..\n.@@..W\nS..G@@\n", encoding="utf-8")
    (folder / "raw").mkdir()
    (folder / "raw" / "raw.txt").write_text(raw_log(3), encoding="utf-8")
    found = {p.stem: p for p in folder.iterdir() if p.is_file()} | {
        "table": folder / "table" / "t.csv",
        "log": folder / "log",
        "raw": folder / "raw" / "raw.txt",
    }
    if find_spec("mujoco") and find_spec("cryptography"):
        found["check"] = blind_check(folder / "check")
    if find_spec("pyarrow"):
        found["parquet"] = in_parquet(folder / "log", folder / "parquet")
    if find_spec("rosbags"):
        found["bag"] = folder / "bag"
        sp.save_rosbag(sp.load_trajectory(found["trajectory"]), found["bag"])
    return found


def recording(path: Path) -> None:
    """A table of recorded pushes, in one record, and its mapping beside it."""
    from stablepush.geometry import compose, exp, transform_points

    lines = ["push,clock,x,y,yaw,tx,ty,fx,fy"]
    for k in range(3):
        clock = np.arange(60) / 40
        body = compose(np.array((0.1 * k, 0.0, 0.3)), exp(np.array((0.002, 0.02, 0.1)) * np.maximum(clock - 0.5, 0)[:, None]))
        tips = transform_points(body, np.array(((0.01, -0.035),)))[:, 0]
        force = np.where((clock >= 0.5)[:, None], np.column_stack((-np.sin(body[:, 2]), np.cos(body[:, 2]))) * 2.0, 0.0)
        lines += [f"p{k},{','.join(map(repr, row))}" for row in np.column_stack((clock + 9 * k, body, tips, force)).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    names = {
        "trial": "push",
        "t": "clock",
        "x": "x",
        "y": "y",
        "theta": "yaw",
        "tip_x": "tx",
        "tip_y": "ty",
        "fx": "fx",
        "fy": "fy",
    }
    slider = {
        "format": "slider/1",
        "vertices": [[-0.05, -0.03], [0.05, -0.03], [0.05, 0.03], [-0.05, 0.03]],
        "mass": 0.8,
        "support": None,
    }
    mapping = {"slider": slider, "finger_radius": 0.005, "friction": {"support": None, "contact": 0.5}, "columns": names}
    # JSON is YAML
    (path.parent / "mapping.yaml").write_text(json.dumps(mapping), encoding="utf-8")


def in_parquet(log: Path, folder: Path) -> Path:
    """A log whose samples are Parquet."""
    import pyarrow
    import pyarrow.parquet

    shutil.copytree(log, folder)
    (folder / "samples.csv").unlink()
    columns = sp.read_pushlog(log).samples
    table = {name: pyarrow.array(values, from_pandas=True) for name, values in columns.items()}
    pyarrow.parquet.write_table(pyarrow.table(table), folder / "samples.parquet")
    return folder


def blind_check(folder: Path) -> Path:
    """A blind check of one short log."""
    from stablepush.blind.check import BlindCheck

    check = BlindCheck(folder, sets=1, pushes=4, seed=3)
    check.seal(lambda *_: None)
    check.diagnose(lambda *_: None)
    check.score(lambda *_: None)
    return folder


def files_in(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def raw_log(pushes: int) -> str:
    """Pokes as the Manipulation Lab's robot wrote them down."""
    lines = [str(pushes)]
    for i in range(pushes):
        lines += ["500 0 10 1 0 0 0", "515 1 10 0.9995 0 0 0.0316", "12"]
        lines += [f"{1000 + 30 * i + k / 10} {-0.01 - (0.5 * (k > 1)):.4f} {-0.5 * (k > 1):.4f}" for k in range(12)]
        lines += ["3", *(f"{1000 + 30 * i + k} {495 + k} 30 50 1 0 0 0" for k in range(3))]
    return "\n".join(lines) + "\n"


def readers(at: dict[str, Path]) -> dict[str, tuple[list[Path], Callable[[], object]]]:
    """Files that are broken, and what reads them."""
    from stablepush.io.importers import find_sources, import_source

    found: dict[str, tuple[list[Path], Callable[[], object]]] = {
        "model, polynomial": ([at["polynomial"]], lambda: sp.load_model(at["polynomial"])),
        "model, support": ([at["support"]], lambda: sp.load_model(at["support"])),
        "slider": ([at["slider"]], lambda: sp.load_slider(at["slider"])),
        "contact": ([at["contact"]], lambda: sp.load_contact(at["contact"])),
        "scene": ([at["scene"]], lambda: sp.load_scene(at["scene"])),
        "plan": ([at["plan"]], lambda: sp.load_plan(at["plan"])),
        "pushlog": (files_in(at["log"]), lambda: sp.read_pushlog(at["log"]).pairs()),
        "trajectory": ([at["trajectory"]], lambda: sp.load_trajectory(at["trajectory"])),
        "list of pushes": (
            [at["pushes"]], lambda: sp.read_commands(at["pushes"], sp.load_scene(at["scene"]), 0.005),
        ),
        "raw log of the lab": ([at["raw"]], lambda: [import_source(source) for source in find_sources(at["raw"].parent)]),
        "table of recordings": (
            [at["table"], at["table"].parent / "mapping.yaml"],
            lambda: [import_source(s) for s in find_sources(at["table"], mapping=at["table"].parent / "mapping.yaml")],
        ),
        "grid map": ([at["small"]], lambda: sp.load_movingai_map(at["small"], 0.1)),
    }  # fmt: skip
    if "parquet" in at:
        found["pushlog, parquet"] = [at["parquet"] / "samples.parquet"], lambda: sp.read_pushlog(at["parquet"]).pairs()
    if "bag" in at:
        found["ROS bag"] = files_in(at["bag"]), lambda: sp.load_rosbag(at["bag"])
    return found


def commands(at: dict[str, Path], out: Path) -> dict[str, tuple[list[Path], list[object]]]:
    """Files that are broken, and arguments of the command that reads them."""
    drawn = out.with_suffix(".png")
    model, contact, slider, scene, plan = (at[k] for k in ("polynomial", "contact", "slider", "scene", "plan"))
    log, quick = files_in(at["log"]), ["--time-limit", "0.5", "--refinement-budget", "0"]
    found: dict[str, tuple[list[Path], list[object]]] = {
        "import": ([at["raw"], slider], ["import", at["raw"], "--slider", slider, "-o", out.with_suffix(".log")]),
        "import, table": (
            [at["table"], at["table"].parent / "mapping.yaml"],
            ["import", at["table"], "--mapping", at["table"].parent / "mapping.yaml", "-o", out.with_suffix(".log")],
        ),
        "classify": ([model, contact, at["cors"]], ["classify", model, "--contact", contact, "--cors", at["cors"], "-o", out]),
        "check": ([scene, plan], ["check", scene, plan]),
        "plan": ([scene], ["plan", scene, *quick, "-o", out]),
        "slide": ([model, slider], ["slide", model, "--slider", slider, "--twist", "0.3", "-0.1", "2", "-o", out]),
        "map": (
            [model, contact, slider],
            ["map", model, "--contact", contact, "--slider", slider, "-o", drawn],
        ),
        "contacts": (
            [model, slider],
            ["contacts", model, "--slider", slider, "--contact-mu", "0.5", "--width", "0.05", "--places", "3", "-o", out],
        ),
        "compare": ([scene], ["compare", scene, *quick, "--csv", out]),
        "trajectory": ([scene, plan], ["trajectory", scene, plan, "-o", out]),
        "fit": (log, ["fit", at["log"], "--model", "quadratic", "-o", out]),
        "diagnose": (log, ["diagnose", at["log"], "--json", out]),
        "simulate": ([scene, plan], ["simulate", scene, plan, "-o", out.with_suffix(".log")]),
    }
    if "check" in at:
        found["blind"] = [p for p in files_in(at["check"]) if p.name != "lock"], ["blind", "-o", at["check"]]
    return found


def judged(tally: Tally, files: list[Path], run: Callable[[], bool]) -> None:
    """Count what becomes of an input; ``run`` returns whether it was taken."""
    began = time.perf_counter()
    try:
        with patience(PATIENCE):
            taken = run()
        tally.taken += taken
        tally.refused += not taken
    except sp.StablepushError as error:
        # the place is what a user needs: a file, or the folder it is in
        if any(str(file) in str(error) or str(file.parent) in str(error) for file in files):
            tally.refused += 1
        else:
            tally.crashes.append(f"no file in: {error}")
    except HangError:
        tally.hangs += 1
    except KeyboardInterrupt:
        raise
    except BaseException:
        tally.crashes.append(traceback.format_exc(limit=-2))
    tally.slowest = max(tally.slowest, time.perf_counter() - began)


def by_command(arguments: list[object], out: Path) -> bool:
    """Run a command; whether it took its input. Raises on what no command may do; ``out`` is what it writes."""
    from stablepush.cli import main

    said, complained = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
        code = main([str(a) for a in arguments])
    assert code in (0, 1, 2), f"exit code {code}"
    lines = complained.getvalue().splitlines()
    if code == 2:
        assert len(lines) == 1 and lines[0].startswith("stablepush: error: "), complained.getvalue()
        left = [path.name for path in out.parent.glob("*out*")]
        assert not left, f"left behind: {left}"
        assert str(out.parent / "bad") in lines[0], f"no file in: {lines[0]}"
    assert "Traceback" not in complained.getvalue()
    return code != 2


def fuzz(inputs: int, seed: int, only: list[str] | None = None, keep: Path | None = None) -> dict[str, Tally]:
    """Break valid inputs of readers, ``inputs`` of each, and a tenth as many of commands."""
    tallies: dict[str, Tally] = {}
    with warnings.catch_warnings(), tempfile.TemporaryDirectory(prefix="fuzz ünicode ") as place:
        warnings.simplefilter("error")
        # what looks like another unit is taken, with a note
        warnings.simplefilter("ignore", sp.StablepushWarning)
        folder = Path(place)
        (folder / "good").mkdir()
        good = seeds(folder / "good")
        at = {name: folder / "bad" / path.relative_to(folder / "good") for name, path in good.items()}
        shutil.copytree(folder / "good", folder / "bad")
        out = folder / "out.json"
        whole: dict[str, tuple[int, list[Path], Callable[[], bool]]] = {}
        for name, (files, read) in readers(at).items():
            whole[name] = (inputs, files, lambda read=read: read() is not None or True)
        for name, (files, arguments) in commands(at, out).items():
            whole[f"stablepush {name}"] = (max(1, inputs // 10), files, lambda a=arguments: by_command(a, out))
        for number, (name, (count, files, run)) in enumerate(whole.items()):
            if only is not None and name not in only:
                continue
            rng = np.random.default_rng([seed, number])
            tally = tallies[name] = Tally()
            assert run(), f"{name}: what is to be broken is refused"
            for _ in range(count):
                for left in (out, out.with_suffix(".png")):
                    left.unlink(missing_ok=True)
                shutil.rmtree(out.with_suffix(".log"), ignore_errors=True)
                broken(files[int(rng.integers(len(files)))], rng)
                before = len(tally.crashes) + tally.hangs
                judged(tally, files, run)
                if keep is not None and len(tally.crashes) + tally.hangs > before:
                    shutil.copytree(folder / "bad", keep / f"{name} {tally.inputs}", dirs_exist_ok=True)
                shutil.rmtree(folder / "bad")
                shutil.copytree(folder / "good", folder / "bad")
    return tallies


def show(tallies: dict[str, Tally]) -> None:
    print(f"{'':<24s}{'inputs':>9s}{'taken':>9s}{'refused':>9s}{'crashes':>9s}{'hangs':>9s}{'slowest/s':>11s}")
    for name, t in tallies.items():
        print(f"{name:<24s}{t.inputs:>9d}{t.taken:>9d}{t.refused:>9d}{len(t.crashes):>9d}{t.hangs:>9d}{t.slowest:>11.2f}")
    for name, t in tallies.items():
        for text, count in Counter(t.crashes).most_common(5):
            print(f"\n{name}, {count} times:\n{text}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=1000, help="of each reader; commands get a tenth")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--readers", nargs="*", help="only these")
    parser.add_argument("--keep", type=Path, help="folder for inputs that crashed or hung")
    options = parser.parse_args()
    show(fuzz(options.inputs, options.seed, options.readers, options.keep))


if __name__ == "__main__":
    main()
