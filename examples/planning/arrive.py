"""Do plans arrive? Random tasks, planned on a surface fitted to eight noisy pokes, executed without feedback in MuJoCo or Drake.

Outlines, feet, pressures, friction at the fingers, their places and the centre of mass are random, within what the problem says
is uncertain, and hidden from the planner. A plan arrives if the slider ends within 10 mm and 3 degrees of where the plan ends. It
sticks if the slider never moves by 1 mm or more against the fingers. Needs the extra ``sim`` or ``drake``; the engines share
nothing with planning, stability or simulation of the library. Tasks are those that ``success=0`` solves.

    python examples/planning/arrive.py modes     [--tasks 500] [--engine mujoco] [-o rows.json]
    python examples/planning/arrive.py guarantees [--tasks 300]
    python examples/planning/arrive.py levels    [--tasks 300] [--only quickest] [--between 0.4 0.8]    stated against measured
    python examples/planning/arrive.py beyond    [--tasks 200]      friction 20 % off, fingers 4 mm off, start 5 mm and 5 deg off
    python examples/planning/arrive.py effects   [--tasks 60]       a table that slopes or is grained, known and not known
    python examples/planning/arrive.py --show rows.json [more.json]
"""

from __future__ import annotations

import argparse
import json
import math
import warnings
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

import stablepush as sp
from stablepush.engines import Execution, Fingers, SliderOnFeet, executor

QUICKEST = {"success": 0.0}
#: Planning modes by study and name. A level of success is one of the whole path.
MODES: dict[str, dict[str, dict[str, Any]]] = {
    "modes": {
        "quickest": QUICKEST,
        "default": {},
        "all-pressure": {"success": 0.0, "region": "all-pressure"},
        "STABLE": {"success": 0.0, "region": "conservative"},
    },
    "guarantees": {
        "all-pressure": {"success": 0.0, "region": "all-pressure"},
        "STABLE": {"success": 0.0, "region": "conservative"},
    },
    "levels": {"quickest": QUICKEST} | {f"success={level}": {"success": level} for level in (0.5, 0.7, 0.9, 0.98)},
    "beyond": {"default": {}},
}
#: Effects of the table of the study ``effects``: slope (rad), or friction along the grain over that across it; their directions
#: are random.
EFFECTS: dict[str, tuple[float, float]] = {
    "tilt of 2 deg": (math.radians(2.0), 1.0),
    "tilt of 4 deg": (math.radians(4.0), 1.0),
    "anisotropy of 1.3": (0.0, 1.3),
    "anisotropy of 1.5": (0.0, 1.5),
}
#: What differs from the problem by more than it says: a factor of the friction at the fingers, m along the edge, and how much of
#: :data:`_START` the slider is displaced.
BEYOND: dict[str, dict[str, float]] = {
    "as it says": {},
    "friction 20 % less": {"friction": 0.8},
    "friction 20 % more": {"friction": 1.2},
    "fingers 4 mm aside": {"aside": 0.004},
    "fingers 4 mm aside, other side": {"aside": -0.004},
    "start 5 mm and 5 deg off": {"start": 1.0},
}
#: What guarantees take for granted besides: the centre of mass is where the problem has it.
EXACT = {"exact": 1.0}
#: Displacement (m, m, rad) of the slider where the start is off, and how far (m) back the fingers begin then.
_START, _BACK = np.array((0.0035, 0.0035, math.radians(5.0))), 0.02
#: Arrived: within so many m and rad. Sticking: moved against the fingers by less than so many m.
NEAR, STUCK = (0.01, math.radians(3.0)), 1e-3
#: Resampled tasks behind an interval.
_RESAMPLES = 4000
#: Radius (m) of the fingers, rate (Hz) at which a plan is sampled.
FINGER, RATE = 0.004, 100.0
UNCERTAINTY = sp.Uncertainty()


@dataclass(frozen=True)
class Task:
    """What the planner sees, and what is true.

    Feet (k, 2) in B, their shares of the load, the centre of mass (2,) in B, friction of table and fingers, how far (m) the
    fingers are aside, how much of :data:`_START` the slider is displaced, slope and grain of the table.
    """

    problem: sp.PlanningProblem
    feet: np.ndarray
    shares: np.ndarray
    center: np.ndarray
    table_mu: float
    contact_mu: float
    aside: float
    displaced: float = 0.0
    slope: tuple[float, float] = (0.0, 0.0)
    grain: tuple[float, float] = (1.0, 0.0)


def random_task(seed: int) -> Task:
    """A convex outline, three to eight feet under it, a surface from eight pokes with 3 % noise, and a goal."""
    rng = np.random.default_rng(seed)
    corners = int(rng.integers(3, 7))
    angles = 2 * np.pi * (np.arange(corners) + rng.uniform(-0.25, 0.25, corners)) / corners + rng.uniform(0, 2 * np.pi)
    outline = rng.uniform(0.05, 0.09) * np.stack((np.cos(angles), rng.uniform(0.6, 1.0) * np.sin(angles)), axis=-1)
    slider = sp.Slider.centered(outline, float(rng.uniform(0.5, 1.5)))
    feet, shares = random_feet(slider, rng)
    center = UNCERTAINTY.center_of_mass * rng.normal(size=2)
    feet = feet + center
    mu = float(rng.uniform(0.2, 0.4))
    truth = sp.IdealLimitSurface(sp.SupportDistribution(feet, shares), mu * slider.mass * 9.81)
    twists = rng.normal(size=(8, 3)) / (1, 1, slider.radius_of_gyration)
    loads = truth.wrench(twists)
    loads = loads * (1 + 0.03 * rng.normal(size=loads.shape))
    surface = sp.fit_limit_surface(loads, twists, slider=slider, seed=0).surface
    lengths = [float(np.linalg.norm(np.subtract(*slider.edge(k)))) for k in range(len(slider.vertices))]
    edge = int(np.argmax(lengths))
    start, end = slider.edge(edge)
    # before the centre of mass, as far as the edge allows
    foot = float(-start @ (end - start)) / lengths[edge]
    width = min(0.05, 0.5 * lengths[edge])
    middle = float(np.clip(foot, width / 2 + 0.006, lengths[edge] - width / 2 - 0.006))
    nominal = float(rng.uniform(0.4, 0.8))
    contact = sp.PushContact.on_edge(slider, edge, middle, width, nominal)
    heading = float(contact.frame[2])
    ahead, aside = rng.uniform(0.25, 0.5), rng.uniform(-0.2, 0.2)
    c, s = math.cos(heading), math.sin(heading)
    goal = (c * ahead - s * aside, s * ahead + c * aside, float(rng.uniform(-0.8, 0.8)))
    problem = sp.PlanningProblem(
        slider, surface, [contact], (0, 0, 0), goal, tolerance=(0.005, 0.02), speed=0.03, uncertainty=UNCERTAINTY
    )
    low, high = UNCERTAINTY.friction_range(nominal)
    contact_mu, aside = float(rng.uniform(low, high)), float(rng.uniform(-1, 1) * UNCERTAINTY.contact_place)
    return Task(problem, feet, shares, center, mu, contact_mu, aside)


def random_feet(slider: sp.Slider, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Feet (k, 2) under the outline and shares of the load whose mean is the origin."""
    while True:
        count = int(rng.integers(3, 9))
        corners = slider.vertices[rng.integers(len(slider.vertices), size=(count, 2))]
        feet = 0.9 * (corners * rng.dirichlet((1.0, 1.0), size=count)[:, :, None]).sum(axis=1)
        shares = rng.dirichlet(np.ones(count))
        # move the mean to the origin by an exponential tilt
        tilt = np.zeros(2)
        for _ in range(50):
            q = shares * np.exp(feet @ tilt)
            q /= q.sum()
            mean = q @ feet
            spread = (feet * q[:, None]).T @ feet - np.outer(mean, mean)
            if np.linalg.cond(spread) > 1e6:
                break
            step = np.linalg.solve(spread, mean)
            tilt -= step * min(1.0, 2.0 / max(1e-9, float(np.abs(feet @ step).max())))
        if np.abs(mean).max() < 1e-9 and q.min() > 1e-3:
            return feet, q


def carried_out(task: Task, pushes: Sequence[sp.Push], engine: str) -> Execution:
    """The fingers go where the plan has them, wherever the slider is."""
    problem = task.problem
    contact = problem.contacts[0]
    x, y, theta = contact.frame
    across = np.array((-math.sin(theta), math.cos(theta)))
    # the frame of the fingers' centres, behind the contact points; the fingers are aside on it
    docked = np.array((x - FINGER * math.cos(theta), y - FINGER * math.sin(theta), theta))
    centers = np.array([(0.0, float((p - (x, y)) @ across) + task.aside) for p in contact.points])
    body = SliderOnFeet(problem.slider.vertices, float(problem.slider.mass or 1.0), task.feet, task.shares, task.table_mu)
    body = replace(body, slope=np.array(task.slope), grain=task.grain)
    times, poses, now = [np.zeros(1)], [placed(np.array(problem.start)[None], docked)], 0.0
    for push in pushes:
        t = np.linspace(0.0, push.duration, 1 + math.ceil(push.duration * RATE))[1:]
        times.append(now + t)
        poses.append(placed(push.poses(t), docked))
        now += push.duration
    run = executor(engine, body, Fingers(centers, FINGER, task.contact_mu))
    t, path, start = np.concatenate(times), np.concatenate(poses), np.array(problem.start)
    if task.displaced:
        start = placed(start[None], task.displaced * _START)[0]
        back = path[0] - _BACK * np.array((math.cos(path[0, 2]), math.sin(path[0, 2]), 0.0))
        t, path = np.append(0.0, t + _BACK / problem.speed), np.concatenate((back[None], path))
    return run.follow(start, t, path)


def placed(poses: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Poses (n, 3) in W of a frame (3,) in B."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return poses + np.stack((c * frame[0] - s * frame[1], s * frame[0] + c * frame[1], np.full(len(poses), frame[2])), axis=-1)


def slipped(task: Task, done: Execution) -> float:
    """Largest distance (m) that the slider slips against the fingers at the two contact points, after the first moment."""
    c, s = np.cos(done.pusher[:, 2]), np.sin(done.pusher[:, 2])
    points = [placed(done.slider, np.array((*p, 0.0)))[:, :2] - done.pusher[:, :2] for p in task.problem.contacts[0].points]
    paths = [np.stack((c * p[:, 0] + s * p[:, 1], c * p[:, 1] - s * p[:, 0]), axis=-1) for p in points]
    return max(float(np.linalg.norm(path - path[min(50, len(path) - 1)], axis=1).max()) for path in paths)


Between = tuple[float, float]


def rows_of(job: tuple[str, str, int, float, list[str] | None, Between, Between, int]) -> list[dict[str, Any]]:
    """Plans of a task in all modes, executed; none if it has no quickest plan."""
    study, engine, seed, budget, only, sticking, arriving, repeats = job
    task = random_task(seed)
    rows: list[dict[str, Any]] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        quickest = sp.plan(task.problem, time_limit=30, refinement_budget=budget, **QUICKEST)
        if not quickest.solved:
            return []
        if study == "effects":
            return [row | {"seed": seed} for row in rows_under_effects(task, quickest, engine, budget)]
        for name, asked in MODES[study].items():
            if only and name not in only:
                continue
            result = sp.plan(task.problem, time_limit=30, refinement_budget=budget, **asked) if asked != QUICKEST else quickest
            stated = about_end(task, result) if result.solved else None
            if stated and not (sticking[0] <= stated.probability <= sticking[1] and arriving[0] <= stated.arrival <= arriving[1]):
                continue
            truths = {"beyond": BEYOND, "guarantees": {name: {}, f"{name}, exact centre": EXACT}}.get(study, {name: {}})
            for words, off in truths.items():
                row = {"seed": seed, "name": words, "solved": result.solved, "quickest": quickest.duration}
                if stated is None:
                    rows.append(row)
                    continue
                row |= {"sticking_stated": stated.probability, "arrival_stated": stated.arrival}
                for again in range(repeats):
                    rows.append(row | judged(retried(task, again), result, engine, off))
    return rows


def rows_under_effects(task: Task, quickest: sp.PlanResult, engine: str, budget: float) -> list[dict[str, Any]]:
    """Default plans that know an effect of the table, and those that do not, executed on that table."""
    rows = []
    blind = sp.plan(task.problem, time_limit=30, refinement_budget=budget)
    for name, (tilt, ratio) in EFFECTS.items():
        direction = float(np.random.default_rng([7, round(1e9 * task.contact_mu)]).uniform(-math.pi, math.pi))
        slope = (tilt * math.cos(direction), tilt * math.sin(direction))
        effect = sp.parse_effect(
            f"tilt:slope={slope[0]}/{slope[1]}" if tilt else f"anisotropy-world:ratio={ratio},direction={direction / 2}"
        )
        true = replace(task, slope=slope, grain=(ratio, direction / 2))
        knowing = task.problem.with_changes(effects=[effect])
        for words, problem, result in (
            (f"{name}, not known", task.problem, blind),
            (f"{name}, known", knowing, sp.plan(knowing, time_limit=30, refinement_budget=budget)),
        ):
            row = {"seed": 0, "name": words, "solved": result.solved, "quickest": quickest.duration}
            if result.solved:
                stated = about_end(replace(task, problem=problem), result)
                row |= {"sticking_stated": stated.probability, "arrival_stated": stated.arrival}
                row |= judged(true, result, engine, {})
            rows.append(row)
    return rows


def retried(task: Task, again: int) -> Task:
    """The same task on the same feet with other friction and places of the fingers; itself the first time."""
    if not again:
        return task
    rng = np.random.default_rng([again, round(1e9 * task.contact_mu)])
    low, high = UNCERTAINTY.friction_range(task.problem.contacts[0].mu)
    aside = float(rng.uniform(-1, 1) * UNCERTAINTY.contact_place)
    return replace(task, contact_mu=float(rng.uniform(low, high)), aside=aside)


def about_end(task: Task, result: sp.PlanResult) -> sp.Success:
    """The probabilities that a plan states, of arriving at its own end, against which arrival is judged."""
    return sp.estimate_success(task.problem.with_changes(goal=result.pushes[-1].end, tolerance=NEAR), result, seed=1)


def judged(task: Task, result: sp.PlanResult, engine: str, off: dict[str, float]) -> dict[str, Any]:
    """The outcome of an execution."""
    end = result.pushes[-1].end
    true = replace(task, contact_mu=task.contact_mu * off.get("friction", 1.0), aside=off.get("aside", task.aside))
    true = replace(true, displaced=off.get("start", 0.0), feet=task.feet - off.get("exact", 0.0) * task.center)
    done = carried_out(true, result.pushes, engine)
    away = done.slider[-1] - end
    distance, turn, slip = math.hypot(away[0], away[1]), abs(math.remainder(away[2], 2 * math.pi)), slipped(true, done)
    return {
        "duration": result.duration,
        "planning_time": result.planning_time,
        "stuck": slip < STUCK,
        "arrived": distance <= NEAR[0] and turn <= NEAR[1],
        "distance": distance,
        "turn": turn,
        "slip": slip,
    }


def show(rows: list[dict[str, Any]]) -> None:
    """Shares with 95 % intervals (Clopper and Pearson), by name."""
    names = list(dict.fromkeys(row["name"] for row in rows))
    solvers = [{row["seed"] for row in rows if row["name"] == name and row["solved"]} for name in names]
    everywhere = set.intersection(*filter(None, solvers)) if any(solvers) else set()
    for name in names:
        own = [row for row in rows if row["name"] == name]
        solved = [row for row in own if row["solved"]]
        if not solved:
            print(f"{name:>30s}: no plan for {len(own)} tasks")
            continue
        # a default without a plan has not arrived; a guarantee that is not given is none
        tried = solved if name.startswith(("all-pressure", "STABLE")) else own
        arrived, stuck = (sum(row[key] for row in solved) for key in ("arrived", "stuck"))
        ratios = [row["duration"] / row["quickest"] for row in solved]
        common = [row for row in solved if row["seed"] in everywhere]
        longer = sum(row["duration"] for row in common) / sum(row["quickest"] for row in common) if common else math.nan
        mean = {key: float(np.mean([row[key] for row in solved])) for key in ("sticking_stated", "arrival_stated")}
        print(
            f"{name:>30s}: arrived {share(arrived, len(tried))}, stated {mean['arrival_stated']:.3f}; "
            f"sticking {share(stuck, len(solved))}, stated {mean['sticking_stated']:.3f}; {len(own) - len(solved)} without plan; "
            f"time {np.median(ratios):.3f} of the quickest (median), {longer:.3f} in total on {len(common)} common tasks"
        )
    for row in rows:
        if row["solved"] and row["name"].startswith(("default", "all-pressure", "STABLE")) and not row["arrived"]:
            print(
                f"  lost: {row['seed']} {row['name']}: {1000 * row['distance']:.1f} mm, {math.degrees(row['turn']):.1f} deg, "
                f"slip {1000 * row['slip']:.1f} mm, stated {row['sticking_stated']:.3f}, {row['arrival_stated']:.3f}"
            )


#: Bounds of the stated probabilities whose executions are counted together.
BINS = (0.0, 0.4, 0.6, 0.8, 0.94, 0.99, 1.0 + 1e-9)


def show_calibration(rows: list[dict[str, Any]]) -> None:
    """Stated against measured, of sticking and of arrival. Executions of a task share what is true: see the interval of tasks."""
    for name in ("all", *dict.fromkeys(row["name"] for row in rows)):
        for stated, measured in (("sticking_stated", "stuck"), ("arrival_stated", "arrived")):
            solved = [row for row in rows if row["solved"] and name in ("all", row["name"])]
            for low, high in pairwise(BINS):
                chosen = [row for row in solved if low <= row[stated] < high]
                if len(chosen) >= 20:
                    mean, count = float(np.mean([row[stated] for row in chosen])), sum(row[measured] for row in chosen)
                    print(
                        f"{name:>30s}: {measured:>7s} {mean:.3f} stated, {share(count, len(chosen))}{by_task(chosen, measured)}"
                    )


def by_task(rows: list[dict[str, Any]], measured: str) -> str:
    """The 95 % interval of a share if tasks are drawn again, not rows: executions of one task have its surface in common."""
    tasks: dict[int, list[bool]] = {}
    for row in rows:
        tasks.setdefault(row["seed"], []).append(bool(row[measured]))
    if len(tasks) == len(rows):
        return ""
    counts = np.array([(sum(found), len(found)) for found in tasks.values()])
    drawn = counts[np.random.default_rng(0).integers(len(counts), size=(_RESAMPLES, len(counts)))].sum(axis=1)
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], (0.025, 0.975))
    return f"; of {len(tasks)} tasks {100 * low:.1f} to {100 * high:.1f}"


def share(count: int, total: int) -> str:
    low, high = binomtest(count, total).proportion_ci(0.95)
    return f"{count} of {total}, {100 * count / total:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", nargs="?", choices=[*MODES, "effects"], default="modes")
    parser.add_argument("--tasks", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--engine", choices=("mujoco", "drake"), default="mujoco")
    parser.add_argument("--budget", type=float, default=2000, help="refinement budget")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--only", nargs="*", help="planning modes, if not all of the study")
    parser.add_argument("--between", type=float, nargs=2, default=(0.0, 1.0), help="execute plans that state such a success only")
    parser.add_argument("--arriving", type=float, nargs=2, default=(0.0, 1.0), help="and such an arrival")
    parser.add_argument("--repeats", type=int, default=1, help="executions of a plan, each with other fingers")
    parser.add_argument("--show", type=Path, nargs="*", help="rows of earlier runs, to print again")
    options = parser.parse_args()
    if options.show:
        known = [row for file in options.show for row in json.loads(file.read_text())]
        show(known)
        show_calibration(known)
        return
    chosen = options.only or options.repeats > 1 or (*options.between, *options.arriving) != (0, 1, 0, 1)
    if options.study == "effects" and chosen:
        parser.error("effects takes none of --only, --between, --arriving, --repeats")
    rows: list[dict[str, Any]] = []
    seed, solved = options.first_seed, 0
    with ProcessPoolExecutor(options.jobs) as pool:
        while solved < options.tasks:
            seeds = range(seed, seed + min(2 * options.jobs, options.tasks - solved))
            between = (tuple(options.between), tuple(options.arriving))
            asked = [(options.study, options.engine, k, options.budget, options.only, *between, options.repeats) for k in seeds]
            for found in pool.map(rows_of, asked):
                rows += found
                solved += bool(found)
            seed = seeds.stop
            print(f"{solved} of {options.tasks}, seeds up to {seed - 1}", flush=True)
            if options.output:
                options.output.write_text(json.dumps(rows))
    show(rows)
    show_calibration(rows)


if __name__ == "__main__":
    main()
