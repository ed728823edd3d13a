"""What the library decides, as JSON: statuses, verdicts, orders and counts, no digits. The same on every processor.

    python tests/outcomes.py

The problems are those in which rounding would decide if anything let it: symmetric sliders, goals straight ahead, obstacles in
the middle, equal contacts, motions at rest, values too small to compute with.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from conftest import make_log, small_scene, triangle

import stablepush as sp
from stablepush.effects import parse_effect

SQUARE = sp.Slider.rectangle(0.1, 0.1, 1.0)
HEXAGON = sp.Slider.regular_polygon(6, 0.06, 1.0)
RING = sp.IdealLimitSurface(sp.SupportDistribution.ring(0.04, 8), 4.0)
#: Angles (rad) by which problems are turned as a whole: what is decided stays, what is computed does not.
TURNS = (0.0, 0.3, 1.0, np.pi / 2, 2.0, -2.5)


def said(run: Callable[[], Any]) -> str:
    """The class and the first words of a refusal, ``"taken"`` if there is none."""
    try:
        run()
    except sp.StablepushError as error:
        return f"{type(error).__name__}: {' '.join(str(error).split()[:6])}"
    return "taken"


def turned(problem: sp.PlanningProblem, angle: float) -> sp.PlanningProblem:
    """The problem, turned about the origin of W."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array(((c, s), (-s, c)))
    start, goal = (np.append(pose[:2] @ turn, pose[2] + angle) for pose in (problem.start, problem.goal))
    walls = [outline @ turn for outline in problem.obstacles]
    return sp.PlanningProblem(
        problem.slider, problem.surface, problem.contacts, start, goal, walls, min_margin=problem.min_margin
    )


def mirrored() -> sp.PlanningProblem:
    """A square pushed straight ahead, an obstacle in the middle of its way: both sides are as long."""
    wall = ((0.35, -0.05), (0.45, -0.05), (0.45, 0.05), (0.35, 0.05))
    contact = sp.PushContact.on_edge(SQUARE, 3, 0.05, 0.05, 0.5)
    return sp.PlanningProblem(SQUARE, RING, [contact], (0.0, 0.0, 0.0), (0.8, 0.0, 0.0), [wall], min_margin=0.02)


def plans() -> dict[str, Any]:
    found: dict[str, Any] = {}
    around = mirrored()
    straight = sp.PlanningProblem(SQUARE, RING, around.contacts, (0.0, 0.0, 0.0), (0.5, 0.0, 0.0), min_margin=0.02)
    several = small_scene(
        slider=SQUARE,
        surface=RING,
        contacts=[sp.PushContact.on_edge(SQUARE, edge, 0.05, 0.05, 0.5) for edge in range(4)],
        goal=(0.5, 0.7, 0.0),
    )
    for name, problem in (("mirrored", around), ("straight", straight)):
        for angle in TURNS:
            result = sp.plan(turned(problem, angle), time_limit=60.0)
            sides = [int(np.sign(round(push.twist[2] * push.duration, 6))) for push in result.pushes]
            found[f"{name}, heading {angle:.2f}"] = (result.status, len(result.pushes), sides, result.message.split(",")[0])
    result = sp.plan(several, time_limit=60.0)
    found["several contacts"] = (result.status, result.switches, [push.contact for push in result.pushes])
    return found


def contacts() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, slider in (("square", SQUARE), ("hexagon", HEXAGON)):
        for measure in ("area", "tightest-turn", "margin"):
            ranked = sp.rank_contacts(slider, RING, 0.5, measure=measure, widths=(0.03, 0.05), places=3)
            found[f"{name}, {measure}"] = [(one.edge, round(one.center, 6), round(one.width, 6)) for one in ranked]
    full = sp.rank_contacts(SQUARE, RING, 0.5, widths=0.1, places=9)
    found["fingers on the ends of an edge"] = [one.edge for one in full]
    return found


def regions() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for edge in range(4):
        contact = sp.PushContact.on_edge(SQUARE, edge, 0.05, 0.05, 0.5)
        twist = np.append(contact.normals[0], 0.0)
        worst = sp.worst_pressure(SQUARE, contact, twist)
        region = sp.stable_region(RING, contact)
        found[f"edge {edge}"] = (len(worst.points), len(region.translation_intervals), [len(region.polygons(s)) for s in (1, -1)])
    held = sp.PushContact([(0.05, 0.0), (-0.05, 0.0)], [(-1.0, 0.0), (1.0, 0.0)], 0.5)
    found["opposed fingers"] = round(float(held.frame[2]), 6)
    return found


def refusals() -> dict[str, str]:
    feet = sp.SupportDistribution([(0.01, 0.02), (-0.03, 0.01), (0.02, -0.03)], [1, 1, 1])
    slider = sp.Slider(SQUARE.vertices, 1.0, feet)
    surface = sp.IdealLimitSurface(feet, 3.0)
    found = {}
    for exponent in (-1, -6, -9, -12, -15, -18, -100, -302):
        spread = [parse_effect(f"pressure-spread:scale=1e{exponent}")]
        found[f"spread 1e{exponent}"] = said(partial(sp.VirtualRig, slider, surface, 0.5, sp.Pusher.finger(0.005), spread))
    for residue in (0.0, 1e-17, -1e-17, 1e-300):
        shapes = {
            "closed outline": lambda r=residue: sp.Slider([*SQUARE.vertices, SQUARE.vertices[0] + r]),
            "flat outline": lambda r=residue: sp.Slider([(-0.1, 0.0), (0.1, 0.0), (0.0, r)]),
            "origin on the outline": lambda r=residue: sp.Slider(np.add(SQUARE.vertices, (0.05 + r, 0.0))),
            "fingers in one place": lambda r=residue: sp.PushContact([(0.0, -0.05), (r, -0.05)], (0.0, 1.0), 0.5),
            "feet in one place": lambda r=residue: sp.IdealLimitSurface(
                sp.SupportDistribution([(0.01, 0), (0.01, r)], [1, 1]), 1.0
            ),
            "a foot without load": lambda r=residue: sp.IdealLimitSurface(
                sp.SupportDistribution([(0.01, 0), (-0.01, 0)], [1, abs(r)]), 1.0
            ),
            "moments without force": lambda r=residue: sp.fit_limit_surface(
                [(r, 0, 1), (0, r, -1), (1, 0, 0), (0, 1, 0), (r, r, 1), (r, 0, 1)],
                [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 1)],
                model="quadratic",
                slider=SQUARE,
            ),
            "straight pokes": lambda r=residue: sp.fit_limit_surface(
                [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0.6, 0.8, 0), (0, 0, 1)],
                [(1, 0, r), (0, 1, -r), (-1, 0, r), (0.6, 0.8, r), (0, 0, 1)],
                model="quadratic",
                slider=SQUARE,
            ),
        }
        for name, shape in shapes.items():
            found[f"{name}, {residue:g}"] = said(shape)
    return found


def pushes() -> dict[str, Any]:
    """How pushes end that no friction holds, and what a log at rest gives."""
    found: dict[str, Any] = {}
    for angle in TURNS:
        c, s = np.cos(angle), np.sin(angle)
        slider = sp.Slider(SQUARE.vertices @ ((c, s), (-s, c)), 1.0)
        contact = sp.PushContact.on_edge(slider, 3, 0.05, 0.05, 0.0)
        table = sp.TableFriction(sp.IdealLimitSurface(sp.SupportDistribution.ring(0.04, 8), 4.0))
        frame = contact.frame
        for name, pusher in (("finger", sp.Pusher.finger(0.0)), ("fingers", sp.Pusher.two_fingers(0.05, 0.0))):
            trace = sp.simulate_push(table, slider, pusher, 0.0, (0.0, 0.0, 0.0), frame, [((0.02, 0.0, 0.0), 1.0)])
            found[f"{name}, heading {angle:.2f}"] = np.unique(trace.modes, axis=0).tolist()
    poses = {
        "trial": list("aabb"),
        "t": [0.0, 1.0] * 2,
        "x": [0.1, 0.1, 0.3, 0.3],
        "y": [0.2, 0.2, 0.1, 0.1],
        "theta": [0.3, 0.3, 0, 0],
    }
    loads = {"fx": [1.0] * 4, "fy": [0.0] * 4, "tau": [0.0] * 4}
    log = sp.PushLog(sp.Rig(SQUARE), {"trial": ["a", "b"], "start_time": [0.0, 5.0]}, poses | loads)
    found["pairs of a log at rest"] = len(log.pairs()[2])
    return found


def fits() -> dict[str, Any]:
    log = make_log(count=20, noise=None)
    loads, twists, _ = log.pairs()
    fit = sp.fit_limit_surface(loads, twists, slider=triangle(), seed=0)
    ranked = sp.rank_pokes(fit.surface, sp.poke_candidates(triangle(), places=2, headings=3), mu=0.2)
    return {
        "status": fit.status,
        "certified": bool(fit.certificate and fit.certificate.sos_convex),
        "first poke": (ranked[0].edge, np.round(ranked[0].point, 6).tolist()),
    }


def diagnoses() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for effect in ("drift:rate=-0.2", "tilt:slope=0.02/0.01", "anisotropy-world:ratio=1.2,direction=0.5"):
        report = sp.diagnose(make_log(effect, count=30))
        found[effect.partition(":")[0]] = (report.verdict, report.named)
    found["nothing"] = sp.diagnose(make_log(count=30)).verdict
    return found


def files() -> dict[str, Any]:
    """Files that one command writes and another reads."""
    with tempfile.TemporaryDirectory() as place:
        from stablepush.planning.problem import save_scene

        scene, plan = Path(place) / "scene.json", Path(place) / "plan.json"
        save_scene(small_scene(), scene)
        problem = sp.load_scene(scene)
        sp.save_plan(sp.plan(problem), plan)
        report = sp.check_plan(problem, sp.load_plan(plan))
    return {"valid": report.valid, "objections": list(report.objections)}


def outcomes() -> dict[str, dict[str, Any]]:
    parts = (refusals, contacts, regions, pushes, plans, fits, diagnoses, files)
    return {part.__name__: part() for part in parts}


if __name__ == "__main__":
    json.dump(outcomes(), sys.stdout, indent=1, default=str)
    print()
