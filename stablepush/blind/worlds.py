"""Random worlds: a slider on feet, a pusher, a campaign of pushes, instruments, and what is wrong with them.

Nothing here comes from the rest of the library: only numpy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

#: Kinds of sets, of as many in an order of the seed: half are clean.
TURNS = ("clean",) * 8 + ("effect",) * 5 + ("pair", "trap", "outside")
#: Forms of each effect: the first is the catalogue's, the others are not.
FORMS: dict[str, tuple[str, ...]] = {
    "anisotropy-world": ("ellipse", "lobes", "grains", "ridges"), "anisotropy-object": ("ellipse", "lobes", "grains", "ridges"),
    "speed-dependence": ("logarithm", "stribeck", "threshold", "valley"),
    "spatial-variation": ("gradient", "patches", "stain", "bowl"), "drift": ("linear", "wear", "jump", "hump"),
    "pressure-shift": ("shift", "weights", "foot", "nudge"), "pressure-spread": ("scale", "weights", "axis", "outer"),
    "tilt": ("plane", "sagging", "dome", "step"), "inertia": ("mass", "smooth", "late", "early"),
    "contact-friction": ("constant", "load", "wear", "fade"), "contact-geometry": ("radius", "one-finger", "wear", "swapped"),
    "force-bias": ("constant", "warming", "jump", "tool"), "force-rotation": ("angle", "crosstalk", "warming", "shear"),
    "frame-offset": ("constant", "jump", "warming", "reseated"), "latency": ("delay", "filter", "warming", "jitter"),
}  # fmt: skip
#: Forms whose numbers change over the log, by :func:`share_in_log`.
CHANGING_FORMS = frozenset(("wear", "fade", "jump", "warming", "swapped", "reseated", "jitter"))
#: Largest amplitudes, in the unit of the effect, and shares of them that sets have.
LARGEST = {
    "anisotropy-world": 0.32, "anisotropy-object": 0.32, "speed-dependence": 0.12, "spatial-variation": 1.2, "drift": 0.3,
    "pressure-shift": 0.008, "pressure-spread": 0.25, "tilt": 0.03, "inertia": 1.0, "contact-friction": 0.3,
    "contact-geometry": 0.003, "force-bias": 0.3, "force-rotation": 0.12, "frame-offset": 0.004, "latency": 0.12,
}  # fmt: skip
SHARES = (0.25, 0.5, 1.0)
OUTSIDE = ("checkerboard", "threefold", "load-transfer")
#: Logs without an effect that may mislead: noise with heavy tails, friction that scatters from push to push, and a rig that
#: believes in even pressure over the outline.
TRAPS = ("outliers", "scatter", "patch")
#: Effects that pairs are made of.
PAIRED = (
    "anisotropy-world", "speed-dependence", "spatial-variation", "drift", "tilt", "contact-geometry", "force-bias", "latency",
)  # fmt: skip
GRAVITY = 9.81
#: Speed (m/s) at which friction that depends on it is nominal.
REFERENCE_SPEED = 0.02
#: Accelerations of the pusher (m/s²) where inertia is to show; elsewhere it is at its speed before it touches.
ROUGH = (0.5, 2.0)


@dataclass(frozen=True)
class Applied:
    """An effect that acts: its id in the catalogue (or a word for what is in no catalogue), form and numbers."""

    effect: str
    form: str
    numbers: dict[str, Any]

    @property
    def matches(self) -> bool:
        return self.effect in FORMS and self.form == FORMS[self.effect][0]


@dataclass(frozen=True)
class Push:
    """A push: start pose of the slider, first pose of the pusher's centre in B (heading: where it pushes), its twist in its own
    frame, duration (s) and acceleration (m/s², 0: from the first at its speed); ``group`` is blank if it is made once; ``cor``:
    the commanded rotation centre in B and its sense, of two fingers that turn."""

    start: np.ndarray
    place: np.ndarray
    twist: np.ndarray
    duration: float
    acceleration: float
    group: str
    speed: float
    cor: tuple[float, float, float] | None


@dataclass(frozen=True)
class World:
    """Everything that a set is made of; lengths in m, masses in kg.

    ``believed_mu``: friction of the table as the operator has it; ``half``: half the distance of two fingers, 0 of one.
    """

    outline: np.ndarray
    feet: np.ndarray
    weights: np.ndarray
    mass: float
    mu: float
    contact_mu: float
    radius: float
    half: float
    force_noise: float
    position_noise: float
    angle_noise: float
    tracker: bool
    rows: int
    believed_mu: float
    pushes: list[Push]
    applied: list[Applied]
    kind: str
    seed: int
    trap: str = ""

    @property
    def two(self) -> bool:
        return self.half > 0

    def of(self, effect: str) -> Applied | None:
        return next((a for a in self.applied if a.effect == effect), None)


def share_in_log(form: str, order: float) -> float:
    """Share of an effect's size that acts in a push, of forms that change over the log; ``order``: its place in the log, 0 to 1.

    The mean over a log is about 1.
    """
    if form in ("wear", "warming"):
        return 0.4 + 1.2 * order
    if form == "fade":
        return 1.9 * float(np.exp(-1.3 * order)) - 0.07
    if form == "jump":
        return 0.5 if order < 0.5 else 1.5
    if form == "swapped":
        # three tools take turns
        return (0.6, 1.4, 1.0)[min(2, int(3 * order))]
    # another one in every push
    wave = float(np.sin(1e4 * order + 1.0) * 43758.5453)
    return 1.0 + 0.4 * (2 * (wave - np.floor(wave)) - 1)


def draw(seed: int, number: int, pushes: int = 60) -> World:
    """The world of a set: the same for the same numbers; the number alone reveals nothing."""
    rng = np.random.default_rng([seed, number])
    block, place = divmod(number, len(TURNS))
    turns = [TURNS[i] for i in np.random.default_rng([seed, block, 1]).permutation(len(TURNS))]
    kind = turns[place]
    applied: list[Applied] = []
    trap = ""
    if kind == "effect":
        # every effect in turn, so that scores by effect have about as many sets
        turn = block * TURNS.count("effect") + turns[:place].count("effect")
        around, which = divmod(turn, len(FORMS))
        effect = list(FORMS)[np.random.default_rng([seed, around, 2]).permutation(len(FORMS))[which]]
        forms = FORMS[effect]
        # an effect has its forms in turn, another one first for each seed
        applied = [_effect(effect, forms[(around + seed) % len(forms)], rng)]
    elif kind == "pair":
        applied = [
            _effect(str(e), FORMS[str(e)][int(rng.integers(len(FORMS[str(e)])))], rng, 0.5)
            for e in rng.choice(PAIRED, 2, replace=False)
        ]
    elif kind == "outside":
        word = OUTSIDE[(block + seed) % len(OUTSIDE)]
        applied = [_outside(word, rng)]
    elif kind == "trap":
        trap = TRAPS[(block + seed) % len(TRAPS)]
    outline, feet, weights = slider_on_feet(rng)
    mass, mu, contact_mu = float(rng.uniform(0.6, 1.4)), float(rng.uniform(0.2, 0.45)), float(rng.uniform(0.3, 0.7))
    radius = float(rng.uniform(0.004, 0.007))
    lengths = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
    half = 0.012 if rng.random() < 0.5 and np.sort(lengths)[-3] > 0.05 else 0.0
    if any(a.form == "one-finger" for a in applied) and np.sort(lengths)[-2] > 0.05:
        half = 0.012
    if not half:
        # of one finger there is no other
        applied = [Applied(a.effect, "radius", a.numbers) if a.form == "one-finger" else a for a in applied]
    rough = any(a.effect == "inertia" for a in applied)
    off = 0.03 * float(rng.normal()) if rng.random() < 0.5 else 0.0
    return World(
        outline, feet, weights, mass, mu, contact_mu, radius, half, float(rng.uniform(0.03, 0.05)),
        float(rng.uniform(1e-4, 2e-4)), float(rng.uniform(0.0018, 0.0035)), bool(rng.random() < 0.5), int(rng.integers(6, 9)),
        mu * (1 + off),
        _campaign(outline, radius, half, pushes, rough, rng), applied, kind, seed, trap,
    )  # fmt: skip


def slider_on_feet(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outline (counter-clockwise) about the centre of mass, feet and their shares of the weight."""
    word = rng.choice(("rectangle", "triangle", "hexagon", "free"))
    size = rng.uniform(0.04, 0.065)
    if word == "rectangle":
        half = size * np.array((1.0, rng.uniform(0.5, 1.0)))
        outline = np.array(((-1, -1), (1, -1), (1, 1), (-1, 1))) * half
    elif word == "triangle":
        outline = 1.6 * size * np.array(((0.0, 0.0), (1.0, 0.0), (rng.uniform(0.0, 0.4), rng.uniform(0.7, 1.0))))
    elif word == "hexagon":
        angles = np.arange(6) * np.pi / 3 + 0.1
        outline = size * np.stack((rng.uniform(1.0, 1.3) * np.cos(angles), np.sin(angles)), axis=-1)
    else:
        angles = 2 * np.pi * (np.arange(5) + rng.uniform(-0.15, 0.15, 5)) / 5
        outline = size * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    middle = outline.mean(axis=0)
    # feet under corners, or under these and the middles of edges
    around = np.concatenate((outline, (outline + np.roll(outline, -1, axis=0)) / 2))
    count = int(rng.integers(3, 6))
    corners = around[np.sort(rng.choice(len(outline) if count <= len(outline) else len(around), count, replace=False))]
    feet = middle + (corners - middle) * rng.uniform(0.55, 0.92, (count, 1))
    weights = rng.uniform(0.5, 1.5, count)
    weights /= weights.sum()
    center = weights @ feet
    return outline - center, feet - center, weights


def _campaign(outline: np.ndarray, radius: float, half: float, count: int, rough: bool, rng: np.random.Generator) -> list[Push]:
    """Pushes in random order; of many, four are made four times."""
    again = 4 if count >= 24 else 0
    single = [_push(outline, radius, half, rough, rng, "") for _ in range(count - 4 * again)]
    repeated = [_push(outline, radius, half, rough, rng, f"r{k + 1}") for k in range(again)]
    pushes = single + [push for push in repeated for _ in range(4)]
    return [pushes[i] for i in rng.permutation(len(pushes))]


def _push(outline: np.ndarray, radius: float, half: float, rough: bool, rng: np.random.Generator, group: str) -> Push:
    lengths = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
    needed = 2 * half + 2 * radius + 0.006
    edge = int(rng.choice(np.flatnonzero(lengths > needed)))
    a, b = outline[edge], outline[(edge + 1) % len(outline)]
    along = (b - a) / lengths[edge]
    normal = np.array((-along[1], along[0]))
    free = lengths[edge] - needed
    middle = a + along * (needed / 2 + free * rng.uniform(0.1, 0.9))
    start = np.array((*rng.uniform(-0.15, 0.15, 2), rng.uniform(-np.pi, np.pi)))
    place = middle - (radius + 3e-4) * normal
    heading = float(np.arctan2(normal[1], normal[0]))
    speed = float(np.exp(rng.uniform(np.log(0.006), np.log(0.03)))) if not rough else float(rng.uniform(0.06, 0.15))
    cor = None
    if rng.random() < 0.5:
        away = rng.uniform(-0.35, 0.35)
        twist = np.array((np.cos(away), np.sin(away), 0.0))
    else:
        # about a centre beside the pusher, at the same speed
        reach = float(rng.choice((-1.0, 1.0)) * rng.uniform(0.05, 0.3))
        back = rng.uniform(-0.02, 0.02)
        omega = 1 / reach
        twist = np.array((1.0, -back * omega, omega)) / np.hypot(1.0, back * omega)
        center = place + back * normal - reach * along
        cor = (float(center[0]), float(center[1]), float(np.sign(reach)))
    distance = rng.uniform(0.02, 0.03)
    acceleration = float(rng.uniform(*ROUGH)) if rough else 0.0
    spent = 0.5 * speed / acceleration if rough else 0.0
    return Push(
        start, np.array((*place, heading)), speed * twist, distance / speed + spent, acceleration, group, speed,
        cor if half else None,
    )  # fmt: skip


def _effect(effect: str, form: str, rng: np.random.Generator, least: float = 0.0) -> Applied:
    share = float(rng.choice([s for s in SHARES if s >= least]))
    size, angle, sign = share * LARGEST[effect], float(rng.uniform(-np.pi, np.pi)), float(rng.choice((-1.0, 1.0)))
    vector = [size * np.cos(angle), size * np.sin(angle)]
    numbers: dict[str, Any] = {"share": share}
    if effect == "inertia":
        # all of the mass counts: nothing to choose
        numbers = {}
    if effect.startswith("anisotropy"):
        numbers |= {"ratio": 1 + size, "direction": angle / 2}
    elif effect in ("tilt", "spatial-variation", "pressure-shift", "force-bias", "frame-offset"):
        word = {"tilt": "slope", "spatial-variation": "gradient", "force-bias": "force"}.get(effect, "offset")
        numbers |= {word: vector}
    elif effect != "inertia":
        word = {
            "speed-dependence": "slope", "drift": "rate", "pressure-spread": "change", "contact-friction": "change",
            "contact-geometry": "change", "force-rotation": "angle", "latency": "delay",
        }[effect]  # fmt: skip
        numbers |= {word: size if effect == "latency" else sign * size}
    if form == "bowl":
        numbers |= {"center": rng.uniform(-0.08, 0.08, 2).tolist(), "size": sign * 0.25 * share}
    if form == "stain":
        numbers |= {
            "center": rng.uniform(-0.08, 0.08, 2).tolist(),
            "radius": float(rng.uniform(0.06, 0.1)),
            "size": sign * 0.25 * share,
        }
    if form == "grains":
        numbers |= {"between": float(rng.uniform(0.5, 1.0))}
    if form == "patches":
        numbers |= {"centers": rng.uniform(-0.15, 0.15, (3, 2)).tolist(), "wide": 0.07, "size": sign * 0.25 * share}
    return Applied(effect, form, numbers)


def _outside(word: str, rng: np.random.Generator) -> Applied:
    if word == "checkerboard":
        return Applied(word, "squares", {"side": 0.05, "size": 0.2, "phase": rng.uniform(0, 0.05, 2).tolist()})
    if word == "threefold":
        return Applied(word, "directions", {"size": 0.1, "direction": float(rng.uniform(-np.pi, np.pi))})
    return Applied(word, "height", {"height": 0.025})
