"""The generator's process: makes one log, seals its label, and is gone.

    python -m stablepush.blind.generator ENGINE SEED NUMBER PUSHES FOLDER    (the key of the seal comes on standard input)

Writes ``FOLDER/log`` (``pushlog/1``) and ``FOLDER/label.sealed``.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from cryptography.fernet import Fernet

from stablepush.blind.engine import Engine, Truth, contact_mu_under
from stablepush.blind.instruments import SCATTER, Row, record, write
from stablepush.blind.laws import at, feet_of, loads, turned
from stablepush.blind.worlds import Applied, World, draw

#: An effect that stands out by this many times the noise of all rows together, after a free pressure has taken what it can,
#: should be found.
DETECTABLE = 10.0
#: A finger slips where its force is so near to the edge of its cone.
_AT_LIMIT = 0.98
#: Share of the sets that Drake makes where both engines do.
_DRAKE = 0.1
#: Effects that show in the clearance of the fingers, that only reshape the surface, and draws of the noise of motion.
_IN_CLEARANCES, _OF_BODY, _DRAWS = ("contact-geometry", "frame-offset", "latency"), ("pressure-shift", "pressure-spread"), 6


def engine_of(generator: str, seed: int, number: int) -> type[Engine]:
    """Return the engine of a set: of ``"both"``, about one in ten has Drake."""
    drawn = "drake" if np.random.default_rng([seed, number, 3]).random() < _DRAKE else "mujoco"
    if (drawn if generator == "both" else generator) == "drake":
        from stablepush.blind.drake_engine import DrakeEngine

        return DrakeEngine
    from stablepush.blind.mujoco_engine import MujocoEngine

    return MujocoEngine


def generate(generator: str, seed: int, number: int, pushes: int) -> tuple[dict[str, Any], tuple[Row, list[Row], list[Row]]]:
    """Return the label of a set and its log."""
    world, engine = draw(seed, number, pushes), engine_of(generator, seed, number)
    rng = np.random.default_rng([seed, number, 1])
    truths: list[Truth] = []
    for k, push in enumerate(world.pushes):
        # the same push comes out differently, as friction scatters
        scattered = replace(world, mu=world.mu * (1 + (SCATTER if world.trap == "scatter" else 0.005) * float(rng.normal())))
        order = k / max(1, len(world.pushes) - 1)
        truths.append(engine(at(scattered, order)).push(push, order))
    label: dict[str, Any] = {
        "kind": world.kind, "trap": world.trap, "contacts": "two" if world.two else "one",
        "engine": engine.name, "friction_off": world.believed_mu / world.mu - 1,
        "applied": [
            {
                "effect": a.effect, "form": a.form, "matches": a.matches, "numbers": a.numbers,
                "parameters": parameters(world, a), "nominal": nominal(world, a), "size": size(world, a, truths),
            }
            for a in world.applied
        ],
    }  # fmt: skip
    for a in label["applied"]:
        a["detectable"] = a["size"] >= DETECTABLE
    return label, record(world, truths, rng)


def parameters(world: World, a: Applied) -> dict[str, Any]:
    """Parameters of the catalogue, where the form is its own."""
    n = a.numbers
    if not a.matches:
        return {}
    if a.effect.startswith("anisotropy"):
        return {"ratio": n["ratio"], "direction": n["direction"]}
    if a.effect == "inertia":
        return {"mass": world.mass}
    if a.effect == "pressure-spread":
        return {"scale": 1 + n["change"]}
    if a.effect == "contact-friction":
        return {"mu": world.contact_mu + n["change"]}
    if a.effect == "contact-geometry":
        return {"radius": world.radius + n["change"]}
    return {k: v for k, v in n.items() if k != "share"}


def nominal(world: World, a: Applied) -> float:
    """What each parameter of an effect would be without it."""
    if a.effect in ("contact-friction", "contact-geometry"):
        return world.contact_mu if a.effect == "contact-friction" else world.radius
    return 1.0 if a.effect == "pressure-spread" or a.effect.startswith("anisotropy") else 0.0


def size(world: World, a: Applied, truths: list[Truth]) -> float:
    """How far an effect stands out of the noise, all rows together."""
    rows = [truth.pose[:, 0] for truth in truths]
    orders = np.repeat(np.linspace(0, 1, len(truths)), [len(r) for r in rows])
    pose, pusher, force, twist, gained = (
        np.concatenate([getattr(t, name) for t in truths]) for name in ("pose", "pusher", "force", "twist", "acceleration")
    )
    n = len(pose)
    if a.effect in _IN_CLEARANCES:
        numbers = a.numbers
        clearance = {
            "contact-geometry": abs(numbers.get("change", 0.0)),
            "frame-offset": float(np.hypot(*numbers.get("offset", (0, 0)))) / 2,
            "latency": numbers.get("delay", 0.0) * float(np.median(np.hypot(twist[:, 0], twist[:, 1]))),
        }[a.effect]  # fmt: skip
        return float(clearance / (1.5 * world.position_noise) * np.sqrt(n / 2))
    if a.effect == "contact-friction":
        return _size_of_slip(world, pusher, force)
    plain = replace(world, applied=[other for other in world.applied if other is not a])
    truly, units = loads(world, pose, twist, orders)
    without, _ = loads(plain, pose, twist, orders)
    changed = truly - without
    back = turned(-pose[:, 2])
    # the moment follows from where the pusher is
    arm = np.einsum("nij,nj->ni", back, pusher[:, :2] - pose[:, :2])
    read = None
    if a.effect == "inertia":
        there = np.einsum("nij,nj->ni", back, world.mass * gained[:, :2])
        turning = world.mass * float(world.weights @ (world.feet**2).sum(axis=1)) * gained[:, 2]
        changed = np.column_stack((there, turning))
    if a.effect == "force-bias":
        read = np.einsum("nij,j->ni", back, np.array(a.numbers["force"]))
    if a.effect == "force-rotation":
        read = a.numbers["angle"] * np.stack((-truly[:, 1], truly[:, 0]), axis=-1)
    if read is not None:
        changed = np.column_stack((read, arm[:, 0] * read[:, 1] - arm[:, 1] * read[:, 0]))
    if a.effect == "load-transfer":
        changed = 0.1 * truly * np.array((1.0, 1.0, -1.0))
    rng = np.random.default_rng(0)
    rho = float(np.sqrt(world.weights @ (world.feet**2).sum(axis=1)))
    span = float(np.median(np.concatenate([np.diff(t.time) for t in truths])))
    spread = np.array((world.position_noise, world.position_noise, world.angle_noise)) / span
    moved = [loads(plain, pose, twist + spread * rng.normal(size=twist.shape), orders)[0] - without for _ in range(_DRAWS)]
    scale = (1.0, 1.0, rho)
    variance = (np.array(moved) / scale).var(axis=0).mean(axis=1) + world.force_noise**2
    white = 1 / np.sqrt(variance)[:, None]
    target = (changed / scale * white).ravel()
    base = (units / np.array(scale)[:, None] * white[:, :, None]).reshape(3 * n, -1)
    if a.effect in _OF_BODY or a.effect == "anisotropy-object":
        # these are detected against the nominal surface, scaled
        _, weights = feet_of(plain)
        base = base @ weights[:, None]
    left = target - base @ np.linalg.lstsq(base, target, rcond=None)[0]
    at_rest = 2 * len(truths) * np.hypot(*a.numbers["force"]) ** 2 / world.force_noise**2 if a.effect == "force-bias" else 0.0
    return float(np.sqrt(left @ left + at_rest))


def _size_of_slip(world: World, pusher: np.ndarray, force: np.ndarray) -> float:
    """How far another friction of the fingers stands out: rows in which a finger slips along the face say by how much."""
    inward = np.stack((np.cos(pusher[:, 2]), np.sin(pusher[:, 2])), axis=-1)
    along = np.abs(force[:, 1] * inward[:, 0] - force[:, 0] * inward[:, 1])
    normal = (force[:, :2] * inward).sum(axis=1)
    contact_mu = contact_mu_under(world, force[:, :2])
    slips = along > _AT_LIMIT * contact_mu * np.maximum(normal, 1e-9)
    off = np.median(np.abs(contact_mu - world.contact_mu))
    return float(off * np.median(normal) / world.force_noise * np.sqrt(slips.sum() / 4))


def _end_with_parent() -> str:
    """Return the line that the parent wrote first; from now on this process ends when the parent does."""
    first = sys.stdin.readline().strip()

    def wait() -> None:
        sys.stdin.read()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
    return first


def main() -> None:
    generator, folder = sys.argv[1], Path(sys.argv[5])
    seed, number, pushes = (int(word) for word in sys.argv[2:5])
    key = _end_with_parent()
    label, log = generate(generator, seed, number, pushes)
    folder.mkdir(parents=True, exist_ok=True)
    sealed = Fernet(key.encode()).encrypt(json.dumps(label).encode())
    (folder / "label.sealed").write_bytes(sealed)
    write(folder / "log", *log)


if __name__ == "__main__":
    main()
