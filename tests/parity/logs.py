"""Fixed logs, each made by a recipe and seeds alone: diagnoses of them show what a change of the code changes.

No log is stored. Recipes of :func:`recipes` are called in processes of their own.
"""

from __future__ import annotations

import functools
import itertools
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from conftest import edited, make_log, make_rig, small_scene, three_feet, triangle

import stablepush as sp
from stablepush.blind.generator import generate
from stablepush.blind.instruments import write

Recipe = Callable[[], list[sp.PushLog]]

STRANGERS = Path(__file__).resolve().parents[3] / "shared" / "data" / "strangers" / "sets"
#: One of each effect, as `stablepush simulate --effect` takes them, that stands out of the noise of :data:`conftest.QUIET`.
EFFECTS = (
    "anisotropy-world:ratio=1.2,direction=0.5", "anisotropy-object:ratio=1.2,direction=0.5", "speed-dependence:slope=0.07",
    "spatial-variation:gradient=0.8/-0.5", "drift:rate=-0.2", "pressure-shift:offset=0.005/0.002", "pressure-spread:scale=0.8",
    "tilt:slope=0.02/-0.01", "force-bias:force=0.2/-0.1", "force-rotation:angle=0.1", "frame-offset:offset=0.003/-0.002",
    "latency:delay=0.05", "contact-friction:mu=0.3", "contact-geometry:radius=0.006",
)  # fmt: skip
#: Effects of which logs have two.
PAIRED = ("anisotropy-world:ratio=1.2,direction=0.5", "tilt:slope=0.02/-0.01", "latency:delay=0.05", "drift:rate=-0.2")
#: Effects of executed plans, which show in where the slider ends.
EXECUTED = ("contact-friction:mu=0.25", "tilt:slope=0.05/0.02", "frame-offset:offset=0.004/-0.003", "latency:delay=0.08")
#: Seed of worlds of the engines, that no check of the library was made with.
WORLDS = 6301
FORCES = ("fx", "fy", "tau")


def recipes() -> dict[str, Recipe]:
    """Three hundred logs by name, or the 225 of them that need no other folder."""
    own: dict[str, Recipe] = {}
    for seed in range(4):
        own[f"rig/none-{seed}"] = functools.partial(_own, (), seed, two=bool(seed % 2))
    for effect, two in itertools.product(EFFECTS, (False, True)):
        own[f"rig/{effect}{'-two' if two else ''}"] = functools.partial(_own, (effect,), 1, two=two)
    for pair in itertools.combinations(PAIRED, 2):
        own[f"rig/{'+'.join(pair)}"] = functools.partial(_own, pair, 2, two=False)
    for effect in EFFECTS:
        own[f"no forces/{effect}"] = functools.partial(_without_forces, functools.partial(_own, (effect,), 3, two=True))
    for number in range(88):
        own[f"mujoco/{number}"] = functools.partial(_world, "mujoco", number)
    for number in range(12):
        own[f"drake/{number}"] = functools.partial(_world, "drake", number)
    for number in range(28):
        own[f"no forces/mujoco-{number}"] = functools.partial(_without_forces, functools.partial(_world, "mujoco", number))
    for effect, seed in itertools.product(("", *EXECUTED), range(3)):
        own[f"executed/{effect or 'none'}-{seed}"] = functools.partial(_executed, effect, seed)
    for effect, seed in itertools.product(("", "tilt:slope=0.05/0.02", "latency:delay=0.08"), range(4)):
        own[f"alike/{effect or 'none'}-{seed}"] = functools.partial(_alike, effect, seed)
    for effect in ("", *EFFECTS):
        own[f"several/{effect or 'none'}"] = functools.partial(_several, effect)
    for effect in EFFECTS[:3]:
        own[f"several/{effect}-no forces"] = functools.partial(_without_forces, functools.partial(_several, effect))
    folders = sorted(STRANGERS.iterdir()) if STRANGERS.is_dir() else []
    return own | {f"strangers/{folder.name}": functools.partial(_read, folder) for folder in folders}


def _own(effects: tuple[str, ...], seed: int, two: bool) -> list[sp.PushLog]:
    return [make_log(*effects, seed=seed, two=two)]


def _without_forces(recipe: Recipe) -> list[sp.PushLog]:
    return [edited(log, drop=FORCES) for log in recipe()]


def _world(engine: str, number: int) -> list[sp.PushLog]:
    """A set of the blind check's generator, of 24 pushes."""
    _, log = generate(engine, WORLDS, number, 24)
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / "log", *log)
        return _read(Path(folder) / "log")


def _executed(effect: str, seed: int) -> list[sp.PushLog]:
    """A plan made for a known surface, carried out under an effect that nobody stated."""
    scene = small_scene(pusher=None)
    slider = triangle()
    contact = sp.PushContact.on_edge(slider, 0, 0.05, 0.05, 0.9)
    surface = sp.IdealLimitSurface(three_feet(), 3.5)
    problem = sp.PlanningProblem(slider, surface, [contact], scene.start, (1.0, 0.45, 0.9))
    result = sp.plan(problem, refinement_budget=500)
    pusher, noise = sp.Pusher.of_contact(contact, 0.005), sp.Noise(0.02, 1e-4, 1e-3)

    def carried_out(acting: list[sp.Effect]) -> sp.PushLog:
        return sp.execute_plan(sp.VirtualRig(slider, surface, 0.9, pusher, acting, noise), problem, result, seed=seed).log

    # what the operator states is the rig without the effect
    log = carried_out([sp.parse_effect(effect)] if effect else [])
    return [sp.PushLog(carried_out([]).rig, log.trials, log.samples)]


def _alike(effect: str, seed: int) -> list[sp.PushLog]:
    """Twelve pushes of two fingers at the same place of an edge, straight ahead, in any heading."""
    rng = np.random.default_rng(seed)
    pushes = [
        sp.EdgePush.on_edge(
            triangle(), 0, 0.05, width=0.05, distance=0.08, speed=float(rng.uniform(0.01, 0.06)),
            start=(*rng.uniform(-0.2, 0.2, 2), rng.uniform(-np.pi, np.pi)),
        )
        for _ in range(12)
    ]  # fmt: skip
    return [make_rig(*([effect] if effect else []), two=True).execute(pushes, rows=12, seed=seed).log]


def _several(effect: str) -> list[sp.PushLog]:
    effects = (effect,) if effect else ()
    return [make_log(*effects, count=20, seed=seed, two=False) for seed in (4, 5)]


def _read(folder: Path) -> list[sp.PushLog]:
    return [sp.read_pushlog(folder)]
