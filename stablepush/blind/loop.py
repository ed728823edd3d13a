"""Loops under seal: pokes, plans that are carried out with something wrong, diagnosis of their log, correction, new plans.

What is wrong sets in after the pokes, and is sealed. What diagnoses and plans sees a scene and a log. Plans to new goals are made
in four arms: ``old``, the surface of the pokes; ``wide``, the same with wide margins (``margin_weight=2``); ``corrected``; and
``true``, what the rig really is. Each is carried out in an engine that shares nothing with them.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stablepush.blind.instruments import write
from stablepush.blind.loop_rig import Push, Recorder, carry_out, tracked
from stablepush.blind.loop_worlds import CAUSES, FINGER, LOGGED, NOISE, SPOILING, LoopWorld, draw_loop
from stablepush.blind.score import share
from stablepush.blind.seal import Files, Ledger, complaint, digest, digest_of_folder, open_label, read_files, write_files
from stablepush.blind.worlds import GRAVITY
from stablepush.core import InputError, binomial_interval, run_parallel, scratch_folder
from stablepush.diagnosis import diagnose
from stablepush.effects import Effect, KnownEffect
from stablepush.geometry import compose
from stablepush.identify import fit_limit_surface
from stablepush.io import read_pushlog
from stablepush.objects import PushContact, Slider, SupportDistribution
from stablepush.planning import PlanningProblem, PlanResult, correct, load_scene, plan, save_scene
from stablepush.surfaces import IdealLimitSurface

Progress = Callable[[str, int, int], None]
ARMS = ("old", "wide", "corrected", "true")
#: Arrived: within so many m and rad of the goal.
NEAR = (0.01, math.radians(3.0))
#: Effort of a plan, and its time limit (s).
_EFFORT, _LIMIT = 2000, 60.0
#: Names that are right for a cause, besides itself.
_ALSO = {"contact-place": "contact-geometry", "nothing": ""}


def believed(world: LoopWorld) -> PlanningProblem:
    """The scene of a rig as its pokes have it, to the first goal."""
    slider = Slider(world.outline, world.mass)
    surface = fit_limit_surface(world.loads, world.twists, slider=slider, seed=0).surface
    contact = PushContact(world.points, np.tile(world.normal, (2, 1)), world.contact_mu)
    start, goal = world.tasks[0]
    low, high = world.tasks[..., :2].min(axis=(0, 1)) - 0.5, world.tasks[..., :2].max(axis=(0, 1)) + 0.5
    return PlanningProblem(
        slider, surface, [contact], start, goal, bounds=(*low, *high), tolerance=(0.005, 0.02), speed=0.03, finger_radius=FINGER
    )


def true_problem(world: LoopWorld, problem: PlanningProblem) -> PlanningProblem:
    """The scene of a rig as it is."""
    feet = SupportDistribution(world.feet + np.array(world.true("pressure-shift", (0.0, 0.0))), world.weights)
    surface = IdealLimitSurface(feet, world.mu * world.mass * GRAVITY)
    across = np.array((-world.normal[1], world.normal[0]))
    points = world.points + world.true("contact-place", 0.0) * across
    contact = PushContact(points, np.tile(world.normal, (2, 1)), world.true("contact-friction", world.contact_mu))
    effects = []
    if world.cause == "tilt":
        effects = [KnownEffect(Effect("tilt", {"slope": world.numbers["value"]}))]
    if world.cause == "anisotropy-world":
        ratio, direction = world.numbers["value"]
        effects = [KnownEffect(Effect("anisotropy-world", {"ratio": ratio, "direction": direction}))]
    back = np.array((*(-np.array(world.true("frame-offset", (0.0, 0.0)))), 0.0))
    return problem.with_changes(
        slider=Slider(world.outline, world.mass, feet), surface=surface, contacts=[contact], effects=effects,
        start=compose(problem.start, back), goal=compose(problem.goal, back),
        finger_radius=world.true("contact-geometry", FINGER),
    )  # fmt: skip


def _plan(problem: PlanningProblem, **asked: Any) -> PlanResult:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return plan(problem, time_limit=_LIMIT, refinement_budget=_EFFORT, **asked)


def _pushes(result: PlanResult) -> list[Push]:
    return [(np.array(push.start), np.array(push.twist), float(push.duration)) for push in result.pushes]


def made(number: int, engine: str, seed: int, key: bytes) -> tuple[int, Files]:
    """Return the files of a loop: scene, log of its first plans, and the sealed label."""
    from cryptography.fernet import Fernet

    world = draw_loop(seed, number)
    problem = believed(world)
    recorder = Recorder(world, np.random.default_rng([seed, number, 6]))
    for start, goal in world.tasks[:LOGGED]:
        result = _plan(problem.with_changes(start=start, goal=goal))
        if result.solved:
            recorder.add(*carry_out(world, engine, start, _pushes(result)), problem.speed)
    rig = {
        "format": "pushlog/1",
        "slider": {"format": "slider/1", "vertices": world.outline.tolist(), "mass": world.mass, "support": None},
        "friction": {"support": None, "contact": world.contact_mu}, "gravity": GRAVITY, "contact_kind": "two-point",
        "finger_radius": FINGER, "noise": dict(zip(("force", "position", "angle"), NOISE, strict=True)),
    }  # fmt: skip
    label = {"cause": world.cause, "numbers": world.numbers}
    with scratch_folder() as folder:
        save_scene(problem, folder / "scene.json")
        rig["model"] = json.loads((folder / "scene.json").read_text())["model"]
        write(folder / "log", rig, recorder.trials, recorder.samples)
        tasks = [[start.tolist(), goal.tolist()] for start, goal in world.tasks[LOGGED:]]
        (folder / "tasks.json").write_text(json.dumps(tasks), encoding="utf-8")
        (folder / "label.sealed").write_bytes(Fernet(key).encrypt(json.dumps(label).encode()))
        return number, read_files(folder)


def solved(number: int, files: Files) -> tuple[int, bytes]:
    """Return the diagnosis of a log and the plans of all arms that do not know the truth."""
    with scratch_folder() as place:
        write_files(place, files)
        problem, log = load_scene(place / "scene.json"), read_pushlog(place / "log")
        tasks = json.loads(files["tasks.json"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        report = diagnose(log)
    found: dict[str, Any] = {"verdict": str(report.verdict), "effects": report.named, "sentence": report.sentence, "plans": []}
    for start, goal in tasks:
        here = problem.with_changes(start=start, goal=goal)
        plans = {"old": _told(_plan(here), here), "wide": _told(_plan(here, margin_weight=2.0), here)}
        try:
            better = correct(here, report)
            plans["corrected"] = _told(_plan(better), better)
        except InputError as error:
            found["refused"], plans["corrected"] = str(error), plans["old"]
        found["plans"].append(plans)
    return number, json.dumps(found).encode()


def _told(result: PlanResult, problem: PlanningProblem) -> dict[str, Any]:
    """What is kept of a plan."""
    pushes = [[p.start.tolist(), p.twist.tolist(), p.duration] for p in result.pushes]
    return {
        "status": str(result.status), "pushes": pushes, "duration": result.duration,
        "success": result.success_probability, "arrival": result.arrival_probability, "radius": problem.finger_radius,
    }  # fmt: skip


def carried_out(
    number: int, engine: str, seed: int, label: dict[str, Any], answer: dict[str, Any]
) -> tuple[int, list[dict[str, Any]]]:
    """Return a row for each plan of a loop whose label is open: where it ended."""
    world = draw_loop(seed, number)
    problem, rows = believed(world), []
    for (start, goal), plans in zip(world.tasks[LOGGED:], answer["plans"], strict=True):
        here = problem.with_changes(start=start, goal=goal)
        truth = true_problem(world, here)
        known = {**plans, "true": _told(_plan(truth), truth)}
        for arm in ARMS:
            told = known[arm]
            row = {"loop": number, "cause": label["cause"], "arm": arm, "arrived": False, "duration": told["duration"]}
            row |= {"success": told["success"], "arrival": told["arrival"], "verdict": answer["verdict"]}
            row |= {"named": " ".join(answer["effects"]), "status": told["status"], "away": None, "turned": None}
            if told["pushes"]:
                pushes = [(np.array(p), np.array(v), float(d)) for p, v, d in told["pushes"]]
                done, _ = carry_out(world, engine, start, pushes, told["radius"])
                off = tracked(world, done.slider[-1:])[0] - goal
                away, turned = float(np.hypot(off[0], off[1])), abs(math.remainder(float(off[2]), 2 * math.pi))
                row |= {"away": away, "turned": turned, "arrived": away <= NEAR[0] and turned <= NEAR[1]}
            rows.append(row)
    return number, rows


@dataclass
class LoopCheck:
    """A campaign of loops in a folder, which resumes where it stopped.

    ``ledger.jsonl``, ``key``, and in ``loops/NUMBER`` the scene, the log, the sealed label, the answer and what came of it.
    """

    folder: Path
    engine: str
    loops: int
    seed: int
    jobs: int = 1

    def __post_init__(self) -> None:
        from cryptography.fernet import Fernet

        self.folder.mkdir(parents=True, exist_ok=True)
        self.ledger, key = Ledger(self.folder / "ledger.jsonl"), self.folder / "key"
        about = {"engine": self.engine, "loops": self.loops, "seed": self.seed}
        if not self.ledger.entries:
            key.write_bytes(Fernet.generate_key())
            self.ledger.add("begun", -1, key=digest(key.read_bytes()), **about)
        begun = self.ledger.entries[0]
        if "engine" not in begun:
            raise InputError("", "expected an empty folder, or one that holds a campaign of loops", file=self.folder)
        for name, value in about.items():
            if begun.get(name) != value:
                raise InputError("", f"this campaign was begun with {name} {begun.get(name)}, not {value}", file=self.folder)
        self.key = key.read_bytes()

    def of(self, number: int) -> Path:
        return self.folder / "loops" / f"{number:04d}"

    def run(self, progress: Progress) -> list[dict[str, Any]]:
        """Seal all loops, answer them, open the labels, and return the rows of all plans."""
        numbers = range(self.loops)
        for done, (number, files) in enumerate(self._missing("sealed", made, lambda k: (k, self.engine, self.seed, self.key)), 1):
            write_files(self.of(number), files)
            seal = {"label": digest(files["label.sealed"]), "log": digest_of_folder(self.of(number) / "log")}
            self.ledger.add("sealed", number, **seal)
            progress("made", done, self.loops)
        for done, (number, answer) in enumerate(self._missing("diagnosed", solved, lambda k: (k, self._seen(k))), 1):
            (self.of(number) / "answer.json").write_bytes(answer)
            self.ledger.add("diagnosed", number, diagnosis=digest(answer))
            progress("diagnosed and planned again", done, self.loops)
        labels, answers = {}, {}
        for number in numbers:
            sealed, answer = ((self.of(number) / name).read_bytes() for name in ("label.sealed", "answer.json"))
            words = complaint(self.ledger, number, sealed, self.of(number) / "log", answer)
            if words is not None:
                raise InputError("", words, file=self.of(number))
            labels[number], answers[number] = open_label(self.ledger, number, sealed, self.key), json.loads(answer)
        jobs = self._missing("executed", carried_out, lambda k: (k, self.engine, self.seed, labels[k], answers[k]))
        for done, (number, rows) in enumerate(jobs, 1):
            (self.of(number) / "rows.json").write_text(json.dumps(rows), encoding="utf-8")
            self.ledger.add("executed", number, rows=digest((self.of(number) / "rows.json").read_bytes()))
            progress("carried out", done, self.loops)
        return [row for k in numbers for row in json.loads((self.of(k) / "rows.json").read_text(encoding="utf-8"))]

    def _missing(self, event: str, function: Callable[..., Any], job: Callable[[int], tuple[Any, ...]]) -> Iterator[Any]:
        missing = [job(k) for k in range(self.loops) if not self.ledger.find(event, k)]
        return run_parallel(function, missing, self.jobs, in_order=False)

    def _seen(self, number: int) -> Files:
        """What the diagnosis of a loop gets."""
        return {name: data for name, data in read_files(self.of(number)).items() if name != "label.sealed"}


def summary(rows: list[dict[str, Any]]) -> list[tuple[str, str]]:
    """Arrivals by cause and arm, in words."""
    lines = []
    for cause in CAUSES:
        mine = [row for row in rows if row["cause"] == cause]
        if not mine:
            continue
        words = []
        for arm in ARMS:
            of_arm = [row for row in mine if row["arm"] == arm]
            words.append(f"{arm} {sum(row['arrived'] for row in of_arm)} of {len(of_arm)}")
        verdicts = {row["loop"]: (row["verdict"], row["named"]) for row in mine}
        right = sum(named == _ALSO.get(cause, cause) for _, named in verdicts.values())
        ambiguous = sum(verdict == "ambiguous" for verdict, _ in verdicts.values())
        wrong = sum(bool(named) and v == "named" and named != _ALSO.get(cause, cause) for v, named in verdicts.values())
        words.append(f"names: {right} right, {wrong} wrong, {ambiguous} ambiguous of {len(verdicts)}")
        lines.append((cause, "; ".join(words)))
    for arm in ARMS:
        spoiled = [row["arrived"] for row in rows if row["arm"] == arm and row["cause"] in SPOILING]
        lines.append((f"arrived where the cause spoils plans, arm {arm}", share(sum(spoiled), len(spoiled))))
    for arm in ARMS:
        of_arm = [row for row in rows if row["arm"] == arm]
        stated = [row["arrival"] for row in of_arm if row["arrival"] is not None]
        mean = f", stated {np.mean(stated):.3f}" if stated else ""
        lines.append((f"arrived, arm {arm}", share(sum(row["arrived"] for row in of_arm), len(of_arm)) + mean))
    lines.append(("corrected against old and wide", _paired(rows)))
    return lines


def _paired(rows: list[dict[str, Any]]) -> str:
    """Plans to one goal that arrive in one arm only, and how much time the corrected ones take."""
    plans: dict[tuple[int, int], dict[str, dict[str, Any]]] = {}
    for number, row in enumerate(rows):
        plans.setdefault((row["loop"], number // len(ARMS)), {})[row["arm"]] = row
    words = []
    for arm in ("old", "wide"):
        better = sum(p["corrected"]["arrived"] and not p[arm]["arrived"] for p in plans.values())
        worse = sum(p[arm]["arrived"] and not p["corrected"]["arrived"] for p in plans.values())
        both = [p for p in plans.values() if p[arm]["duration"] and p["corrected"]["duration"]]
        time = sum(p["corrected"]["duration"] for p in both) / max(1e-9, sum(p[arm]["duration"] for p in both))
        low, high = binomial_interval(better, max(1, better + worse))
        words.append(
            f"{better} better and {worse} worse than {arm} (share better {low:.2f} to {high:.2f}), time {time:.3f} of it"
        )
    return "; ".join(words)
