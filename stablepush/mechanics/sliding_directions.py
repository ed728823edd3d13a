"""Directions of motion that free sliding keeps, and which of them attract.

In the coordinates of :mod:`.sliding` slow slides drift along ``du/ds = -(G - (G·u) u)``: down the slope of the power
``h(u) = G·u`` on the sphere of directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import BoolArray, FloatArray, check_array, order_with_ties
from stablepush.geometry import unit
from stablepush.mechanics.kernels.inertia import Body
from stablepush.objects import Slider
from stablepush.surfaces import LimitSurface

#: Points of the sphere between which eigen-directions are sought, and how often they are made four times as many.
_GRID, _REFINEMENTS = 1500, 3
#: Directions so near (rad) to the translations are taken for them, where all translations are kept.
_BELT = 0.01
#: Directions that differ by less (rad) are one.
_SAME = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class EigenDirections:
    """Directions of motion that sliding keeps: the load, over inertia, points against the motion.

    They are the critical points of the power ``h(u) = F·V`` on the unit sphere of ``U``, down which directions drift.

    Attributes
    ----------
    twists : array, shape (n, 3)
        Of unit length in ``(vx, vy, rho*omega)``.
    kinds : list of {"stable", "saddle", "unstable"}
        Minima of the power attract; nothing ends in the others.
    decelerations : array, shape (n,)
        ``h(u)`` in √(kg) m/s²: slides end sooner along larger ones.
    translations : array, shape (m, 2)
        If the centre of pressure lies under the centre of mass, friction does not turn a body that translates: every translation
        is kept. Those in these intervals of angles (rad in B, the second up to a turn after the first) attract, the others
        start to turn. Empty if translations are not kept, or none attracts.
    complete : bool
        Whether minima - saddles + maxima is what the topology of the sphere asks for: else some are missing, or there is
        a continuum of them, as for a body of revolution.
    """

    twists: FloatArray
    kinds: list[str]
    decelerations: FloatArray
    translations: FloatArray
    complete: bool


def eigen_directions(surface: LimitSurface, slider: Slider, *, mu: float | None = None, gravity: float = 9.81) -> EigenDirections:
    """Return all directions of motion that free sliding keeps, and which of them attract.

    Parameters are those of :func:`simulate_free_sliding`. The sphere of directions is searched for critical points of the power,
    from the local minima of its slope on a grid, until their count is what topology asks for (Poincaré and Hopf). Turns about a
    support point attract if the rest of the friction pulls it less than it can hold.
    """
    from scipy.spatial import cKDTree

    body = Body(surface, slider, 1.0 if mu is None and surface.force_unit == "mu*N" else mu, gravity)
    pivots = _pivots(body)
    kept, translations = _translations(body)
    wanted = _index(body, 1.0) + _index(body, -1.0) if kept else 2
    found: list[tuple[FloatArray, str]] = []
    complete = False
    count = _GRID
    for _ in range(_REFINEMENTS):
        grid = _sphere(count)
        slope = np.linalg.norm(_drift(body, grid), axis=1)
        neighbours = cKDTree(grid).query(grid, k=9)[1]
        starts = grid[slope <= slope[neighbours].min(axis=1)]
        found = [(u, "stable") for u in pivots]
        for begin in starts:
            u = _critical(body, begin)
            if u is None or (kept and abs(u[2]) < _BELT):
                continue
            if all(np.linalg.norm(u - other) > _SAME for other, _ in found):
                found.append((u, _kind(body, u)))
        kinds = [kind for _, kind in found]
        complete = kinds.count("stable") - kinds.count("saddle") + kinds.count("unstable") == wanted
        if complete:
            break
        count *= 4
    # mirrored directions have the same power: the stable first, then by their angle
    found.sort(key=lambda one: (one[1], *np.round(np.arctan2(one[0][[1, 2]], one[0][[0, 0]]), 6)))
    directions = np.array([u for u, _ in found]).reshape(-1, 3)
    power = (body.friction(directions) * directions).sum(axis=1) if len(directions) else np.zeros(0)
    order = order_with_ties(power, 1e-9 * float(np.abs(power).max(initial=0.0)))
    rho = surface.characteristic_length
    twists = unit(directions / body.roots * (1, 1, rho)) / (1, 1, rho)
    return EigenDirections(twists[order], [found[i][1] for i in order], power[order], translations, complete)


def sliding_basins(
    surface: LimitSurface, slider: Slider, twists: ArrayLike, *, mu: float | None = None, gravity: float = 9.81
) -> tuple[EigenDirections, np.ndarray]:
    """Return the eigen-directions and, for slow slides that begin along ``twists`` (n, 3), the number of the one they end in.

    Slow: the turning of the frame, which grows with the square of the speed, is left out. -1 where a direction has not
    settled near any of them.
    """
    v = check_array(twists, "twists", (None, 3))
    found = eigen_directions(surface, slider, mu=mu, gravity=gravity)
    body = Body(surface, slider, 1.0 if mu is None and surface.force_unit == "mu*N" else mu, gravity)
    targets = unit(found.twists * body.roots)
    u = unit(v * body.roots)
    step = 0.05 / max(float(np.linalg.norm(_drift(body, u), axis=1).max()), 1e-300)
    result = np.full(len(u), -1)
    for _ in range(20_000):
        move = _drift(body, u)
        middle = unit(u + step / 2 * move)
        u = unit(u + step * _drift(body, middle))
        near = np.linalg.norm(u[:, None] - targets[None], axis=2)
        result = np.where(near.min(axis=1) < 0.02, near.argmin(axis=1), -1) if len(targets) else result
        if (result >= 0).all() and np.isin(result, [i for i, k in enumerate(found.kinds) if k == "stable"]).all():
            break
    return found, result


def _sphere(count: int) -> FloatArray:
    """Points (count, 3) spread evenly over the unit sphere (a spiral by the golden angle)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (3 - np.sqrt(5)) * k
    return np.stack((np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z), axis=-1)


def _drift(body: Body, directions: FloatArray) -> FloatArray:
    """Rates (n, 3) at which directions change: down the slope of the power on the sphere."""
    friction = body.friction(directions)
    return (friction * directions).sum(axis=1, keepdims=True) * directions - friction


def _tangents(u: FloatArray) -> FloatArray:
    """Two unit vectors (2, 3) across a unit vector."""
    first = unit(np.cross(u, np.eye(3)[np.argmin(np.abs(u))]))
    return np.stack((first, np.cross(u, first)))


def _slopes(body: Body, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slope (2,) of the power on the sphere, in the tangents of ``u``, and second derivatives (2, 2) by differences."""
    basis = _tangents(u)
    width = 1e-5
    moved = unit(np.concatenate((u[None], u + width * basis, u - width * basis)))
    drift = -_drift(body, moved)
    # slopes at the neighbours in the basis at u: the part along u of a tangent vector is of second order
    return basis @ drift[0], (drift[1:3] - drift[3:5]) @ basis.T / (2 * width)


def _critical(body: Body, start: FloatArray) -> FloatArray | None:
    """Newton from a direction to a critical point of the power nearby, or None."""
    u = start
    scale = float(np.linalg.norm(body.friction(u[None])))
    for _ in range(50):
        slope, bend = _slopes(body, u)
        if np.linalg.norm(slope) < 1e-10 * scale:
            return u if np.linalg.norm(u - start) < 1.0 else None
        try:
            step = -np.linalg.solve(bend, slope)
        except np.linalg.LinAlgError:
            return None
        size = float(np.linalg.norm(step))
        u = unit(u + min(1.0, 0.2 / max(size, 1e-300)) * step @ _tangents(u))
    return None


def _kind(body: Body, u: FloatArray) -> str:
    bend = _slopes(body, u)[1]
    low, high = np.linalg.eigvalsh((bend + bend.T) / 2)
    return "stable" if low > 0 else "unstable" if high < 0 else "saddle"


def _belt(height: float) -> FloatArray:
    """Unit vectors U (n, 3) all round the axis of pure turning, at a height: translations at zero."""
    angles = np.linspace(-np.pi, np.pi, 2000, endpoint=False)
    width = np.sqrt(1 - height**2)
    return np.stack((width * np.cos(angles), width * np.sin(angles), np.full(2000, height)), axis=-1)


def _translations(body: Body) -> tuple[bool, FloatArray]:
    """Whether friction keeps all translations, and the intervals of angles (n, 2) of those that attract."""
    if np.abs(_drift(body, _belt(0.0))).max() > 1e-9 * np.abs(body.friction(_belt(0.0))).max():
        return False, np.zeros((0, 2))
    height = _BELT / 2
    # they attract where both neighbours drift back
    back = (_drift(body, _belt(height))[:, 2] < 0) & (_drift(body, _belt(-height))[:, 2] > 0)
    if back.all():
        return True, np.array(((-np.pi, np.pi),))
    step = 2 * np.pi / len(back)
    begins = np.flatnonzero(back & ~np.roll(back, 1))
    lengths = [int(np.argmin(np.roll(back, -b))) for b in begins]
    return True, np.array(
        [(-np.pi + b * step, -np.pi + (b + n - 1) * step) for b, n in zip(begins, lengths, strict=True)]
    ).reshape(-1, 2)


def _index(body: Body, side: float) -> int:
    """Minima - saddles + maxima on one side of the translations: how often the drift turns along the edge of that cap."""
    edge = _belt(side * _BELT)
    drift = _drift(body, edge)
    # stereographic projection of the cap to a disc
    low = 1 + side * edge[:, 2:]
    flat = (drift[:, :2] * low - edge[:, :2] * side * drift[:, 2:]) / low**2
    angles = np.unwrap(np.arctan2(flat[:, 1], flat[:, 0]), discont=np.pi)
    closing = (angles[0] - angles[-1] + np.pi) % (2 * np.pi) - np.pi
    return round(float(angles[-1] + closing - angles[0]) / (2 * np.pi))


def _pivots(body: Body) -> list[FloatArray]:
    """Turns about support points that attract: the others pull the point along with less than its friction can hold."""
    result: list[FloatArray] = []
    points, loads = body.points, body.loads
    for k in range(len(points)):
        if loads[k] <= 0:
            continue
        for sense in (1.0, -1.0):
            u = unit(np.array((points[k, 1], -points[k, 0], 1.0)) * sense * body.roots)
            # friction f at the point adds (f, x × f), which has to cancel the drift
            others: BoolArray = np.linalg.norm(points - points[k], axis=1) > 1e-12
            held = float(loads[~others].sum())
            metric = np.array(((1.0, 0.0, -points[k, 1]), (0.0, 1.0, points[k, 0]))) / body.roots
            drift = _drift(body, u[None])[0]
            force, *_ = np.linalg.lstsq(_tangents(u) @ metric.T, _tangents(u) @ drift, rcond=None)
            if np.linalg.norm(force) < held:
                result.append(u)
    return result
