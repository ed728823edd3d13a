"""Friction of the feet, foot by foot: what a world's effects make of it. Only numpy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stablepush.blind.worlds import CHANGING_FORMS, GRAVITY, REFERENCE_SPEED, Applied, World, share_in_log

#: How much faster than it wears out friction goes on falling: exponents of the form "wear".
_WEAR = 4.0
#: Speed (m/s) over which Stribeck friction falls, and at which directions count.
_STRIBECK, _STILL = 0.008, 1e-4
#: Share by which a sagging table's slope changes, per m; how far (m) a domed one goes until it is as steep again; width (m)
#: of the step in a slope.
_SAG, _DOME, _STEP = 6.0, 0.25, 0.02
#: Steepness of a threshold of speed, per e-fold; curvature of friction over the logarithm of speed; edge (m) of a stain, and
#: where (m) a bowl is at its size.
_THRESHOLD, _VALLEY, _EDGE, _BOWL = 6.0, 1.2, 0.005, 0.15
#: Effects whose numbers change over the log as a whole: their laws know nothing of the order.
_OF_NUMBERS = {"contact-friction": "change", "contact-geometry": "change"}


#: Effects that change friction, slope or load of the feet as the slider goes on.
CHANGING = frozenset((
    "anisotropy-world", "anisotropy-object", "speed-dependence", "spatial-variation", "tilt", "checkerboard", "threefold",
    "load-transfer",
))  # fmt: skip


def turned(angle: np.ndarray | float) -> np.ndarray:
    """Rotation matrices (..., 2, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.moveaxis(np.array(((c, -s), (s, c))), (0, 1), (-2, -1))


def at(world: World, order: float) -> World:
    """The world as it is in a push: numbers of contacts whose form changes over the log are those of then."""
    applied = [
        replace(a, numbers=a.numbers | {_OF_NUMBERS[a.effect]: share_in_log(a.form, order) * a.numbers[_OF_NUMBERS[a.effect]]})
        if a.effect in _OF_NUMBERS and a.form in CHANGING_FORMS
        else a
        for a in world.applied
    ]
    return replace(world, applied=applied)


def feet_of(world: World) -> tuple[np.ndarray, np.ndarray]:
    """Places (k, 2) in B and shares (k,) of the weight, as they really are."""
    feet, weights = world.feet.copy(), world.weights.copy()
    shift, spread = world.of("pressure-shift"), world.of("pressure-spread")
    if shift is not None:
        offset = np.array(shift.numbers["offset"])
        if shift.form == "shift":
            feet = feet + offset
        elif shift.form == "weights":
            weights = _reweighed(feet, weights, offset)
        elif shift.form == "foot":
            # the foot that lies most that way takes load from all others
            toward = feet @ offset / np.linalg.norm(offset)
            taken = min(0.5, float(np.linalg.norm(offset)) / float(toward.max()))
            weights = (1 - taken) * weights
            weights[int(toward.argmax())] += taken
        else:
            # the foot that carries most stands elsewhere
            most = int(weights.argmax())
            feet[most] = feet[most] + offset / weights[most]
    if spread is not None:
        change = spread.numbers["change"]
        if spread.form == "scale":
            feet = feet * (1 + change)
        elif spread.form == "axis":
            feet = feet * (1 + change * np.array((1.6, 0.4)))
        elif spread.form == "outer":
            away = np.linalg.norm(feet, axis=1, keepdims=True)
            feet = feet * (1 + change * np.where(away > np.median(away), 1.4, 0.6))
            feet = feet - weights @ feet
        else:
            # a foot at the centre takes some of the load, or gives it back
            far = (weights * (feet**2).sum(axis=1)) / (weights @ (feet**2).sum(axis=1))
            weights = weights + change * (far - 1 / len(weights))
            weights = np.maximum(weights, 0.02) / np.maximum(weights, 0.02).sum()
            weights = _reweighed(feet, weights, -(weights @ feet))
    return feet, weights


def _reweighed(feet: np.ndarray, weights: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Weights (k,) nearest to the given ones whose centre moves by an offset; none is negative."""
    rows = np.concatenate((feet.T, np.ones((1, len(feet)))))
    moved = weights + np.linalg.pinv(rows) @ np.array((*offset, 0.0))
    moved = np.maximum(moved, 0.01)
    return moved / moved.sum()


def slope_at(world: World, place: np.ndarray) -> np.ndarray:
    """Lateral gravity (2,) over g at a place (2,) of the table."""
    tilt = world.of("tilt")
    if tilt is None:
        return np.zeros(2)
    slope = np.array(tilt.numbers["slope"])
    if tilt.form == "plane":
        return slope
    if tilt.form == "dome":
        return slope + float(np.linalg.norm(slope)) / _DOME * place
    if tilt.form == "step":
        return slope * (1 + 0.6 * float(np.tanh(place @ slope / float(np.linalg.norm(slope)) / _STEP)))
    # the slope is what it says in the middle, and less on one side than on the other
    return slope * (1 + _SAG * float(place @ slope) / float(np.linalg.norm(slope)))


def friction(world: World, place: np.ndarray, velocity: np.ndarray, theta: float, order: float) -> np.ndarray:
    """Friction coefficients (k,) of feet at places (k, 2) of the table with velocities (k, 2) in W.

    Along the motion, and to the left of it, which friction that depends on the direction has as well: (2, k). ``theta``: heading
    of the slider; ``order``: of the push in the log, 0 to 1.
    """
    mu = np.full(len(place), world.mu)
    speed = np.linalg.norm(velocity, axis=1)
    for a in world.applied:
        mu = mu * _factor(a, place, speed, order)
    mu = np.maximum(mu, 0.01)
    along, left = np.ones(len(place)), np.zeros(len(place))
    for a in world.applied:
        if a.form in ("lobes", "directions", "grains", "ridges"):
            angle = np.arctan2(velocity[:, 1], velocity[:, 0]) - a.numbers["direction"]
            angle = angle - (theta if a.effect.endswith("object") else 0.0)
            more, slope = _more(a, angle)
            moves = speed > _STILL
            along, left = along + np.where(moves, more, 0.0), left + np.where(moves, slope, 0.0)
    return np.stack((mu * along, mu * left))


def _more(a: Applied, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What friction at an angle from the direction of an effect has more than one, and how that changes with the angle.

    The greatest power over a convex set of forces: one plus this is its support function.
    """
    if a.form == "ridges":
        # one set of ridges: a line is added to the circle of forces
        size = (a.numbers["ratio"] - 1) / (a.numbers["ratio"] + 1) * np.pi / 2
        mean = 1 + size * 2 / np.pi
        return (1 + size * np.abs(np.cos(angle))) / mean - 1, -size * np.sign(np.cos(angle)) * np.sin(angle) / mean
    if a.form == "grains":
        # two grains of a weave: the mean of two ellipses
        ratio, more, slope = a.numbers["ratio"], np.zeros(angle.shape), np.zeros(angle.shape)
        minor = np.sqrt(2 / (1 + ratio**2))
        for turn in (-0.5, 0.5):
            phi = angle - turn * a.numbers["between"]
            power = minor * np.sqrt((ratio * np.cos(phi)) ** 2 + np.sin(phi) ** 2)
            more = more + 0.5 * power
            slope = slope + 0.5 * minor**2 * (1 - ratio**2) * np.cos(phi) * np.sin(phi) / power
        return more - 1, slope
    waves = _waves(a)
    return sum(s * np.cos(k * angle) for k, s in waves), sum(-k * s * np.sin(k * angle) for k, s in waves)  # type: ignore[return-value]


def _waves(a: Applied) -> tuple[tuple[int, float], ...]:
    """Numbers of lobes and their sizes."""
    if a.form == "directions":
        return ((3, a.numbers["size"]),)
    size = (a.numbers["ratio"] - 1) / (a.numbers["ratio"] + 1)
    return (2, size), (4, 0.15 * size)


def _factor(a: Applied, place: np.ndarray, speed: np.ndarray, order: float) -> np.ndarray | float:
    n = a.numbers
    if a.effect == "speed-dependence":
        relative = np.log(np.maximum(speed, 1e-3) / REFERENCE_SPEED)
        if a.form == "logarithm":
            return np.maximum(0.2, 1 + n["slope"] * relative)
        if a.form == "threshold":
            # as much from slow to fast, all at one speed
            return np.maximum(0.2, 1 + n["slope"] * np.tanh(_THRESHOLD * relative / 2))
        if a.form == "valley":
            # least, or most, at a speed in between
            return np.maximum(0.2, 1 + _VALLEY * n["slope"] * relative * (relative + 0.5))
        # as much from slow to fast, but falling off by an exponential
        return 1 - 2.0 * n["slope"] * (np.exp(-speed / _STRIBECK) - np.exp(-REFERENCE_SPEED / _STRIBECK))
    if a.effect == "spatial-variation":
        if a.form == "gradient":
            return np.maximum(0.2, 1 + place @ np.array(n["gradient"]))
        if a.form in ("stain", "bowl"):
            away = np.linalg.norm(place - np.array(n["center"]), axis=1)
            shape = 0.5 - 0.5 * np.tanh((away - n["radius"]) / _EDGE) if a.form == "stain" else (away / _BOWL) ** 2
            return np.maximum(0.2, 1 + n["size"] * shape)
        away = ((place[:, None] - np.array(n["centers"])) ** 2).sum(axis=2)
        return np.maximum(0.2, 1 + n["size"] * (np.exp(-away / (2 * n["wide"] ** 2)) * (1, -1, 1)).sum(axis=1))
    if a.effect == "drift":
        if a.form == "linear":
            return 1 + n["rate"] * order
        if a.form == "jump":
            return 1 + n["rate"] * (order > 0.5)
        if a.form == "hump":
            return 1 + n["rate"] * 4 * order * (1 - order)
        return 1 + n["rate"] * (1 - np.exp(-_WEAR * order)) / (1 - np.exp(-_WEAR))
    if a.effect == "checkerboard":
        cell = np.floor((place + np.array(n["phase"])) / n["side"]).sum(axis=1)
        return 1 + n["size"] * np.where(cell % 2 == 0, 1.0, -1.0)
    return 1.0


def ellipse(world: World, theta: float) -> tuple[float, float, float] | None:
    """Factors of friction along and across a direction (rad in W), of anisotropy in the form of an ellipse."""
    for effect in ("anisotropy-world", "anisotropy-object"):
        a = world.of(effect)
        if a is not None and a.form == "ellipse":
            ratio = a.numbers["ratio"]
            # the mean of the squares stays
            minor = float(np.sqrt(2 / (1 + ratio**2)))
            return ratio * minor, minor, a.numbers["direction"] + (theta if effect.endswith("object") else 0.0)
    return None


def friction_at(world: World, place: np.ndarray, velocity: np.ndarray, theta: float, order: float) -> np.ndarray:
    """Force (k, 2) in W that feet of unit load at places (k, 2), with velocities (k, 2) in W, take to be moved; 0 at rest."""
    e = velocity / np.maximum(np.linalg.norm(velocity, axis=1, keepdims=True), 1e-12)
    along, left = friction(world, place, velocity, theta, order)
    shape = ellipse(world, theta)
    if shape is None:
        return np.asarray(along[:, None] * e + left[:, None] * np.stack((-e[:, 1], e[:, 0]), axis=-1))
    # greatest power over the ellipse of forces
    axes = turned(shape[2])
    stretched = e @ (axes @ np.diag((shape[0] ** 2, shape[1] ** 2)) @ axes.T)
    return np.asarray(along[:, None] * stretched / (np.sqrt((stretched * e).sum(axis=1, keepdims=True)) + 1e-12))


def loads(world: World, poses: np.ndarray, twists: np.ndarray, orders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Friction loads (n, 3) in B of poses (n, 3) and body twists (n, 3) by the formula, with all effects of the table; and what
    each foot of the world as it is believed adds for a unit load, (n, 3, k)."""
    found, each = [], []
    for pose, twist, order in zip(poses, twists, orders, strict=True):
        feet, weights = feet_of(world)
        found.append(_load(world, feet, weights, pose, twist, order))
        each.append(_units(world.feet, twist))
    return np.array(found), np.array(each)


def _units(feet: np.ndarray, twist: np.ndarray) -> np.ndarray:
    velocity = twist[:2] + twist[2] * np.stack((-feet[:, 1], feet[:, 0]), axis=-1)
    e = velocity / (np.linalg.norm(velocity, axis=1, keepdims=True) + 1e-9)
    return np.stack((e[:, 0], e[:, 1], feet[:, 0] * e[:, 1] - feet[:, 1] * e[:, 0]))


def _load(world: World, feet: np.ndarray, weights: np.ndarray, pose: np.ndarray, twist: np.ndarray, order: float) -> np.ndarray:
    rotation = turned(pose[2])
    velocity = (twist[:2] + twist[2] * np.stack((-feet[:, 1], feet[:, 0]), axis=-1)) @ rotation.T
    place = pose[:2] + feet @ rotation.T
    normal = weights * world.mass * GRAVITY
    force = normal[:, None] * friction_at(world, place, velocity, float(pose[2]), order)
    lateral = world.mass * GRAVITY * slope_at(world, pose[:2])
    f = (force - weights[:, None] * lateral) @ rotation
    return np.array((*f.sum(axis=0), float((feet[:, 0] * f[:, 1] - feet[:, 1] * f[:, 0]).sum())))
