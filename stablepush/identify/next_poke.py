"""The most informative next poke, given the posterior of the surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray, InputError, check_array, check_number, order_with_ties
from stablepush.geometry import normalize_twist, normalize_wrench, point_velocity, unit, wrench_from_force
from stablepush.objects import EdgePush, Slider
from stablepush.surfaces import LimitSurface, PolynomialLimitSurface

#: Directions of force across the friction cone that are asked for their motion.
_CONE_STEPS = 33
#: Loads over the whole sphere at which the surfaces' disagreement is to shrink.
_TARGETS = 200
#: Scatter (rad) of a measured load's and twist's direction, if not given: 9 % on the published pokes.
DEFAULT_SCATTER = 0.1
#: Gains that differ by no more are alike.
_ALIKE = 1e-9


def poke_candidates(
    slider: Slider, edges: Sequence[int] | None = None, places: int = 6, headings: int = 5, widest: float = np.radians(60)
) -> list[EdgePush]:
    """Return pushes by one finger, spread over the given edges (all if None): ``places`` on each, directions up to ``widest``
    (rad) off the normal.

    Their ``gain`` is zero: :func:`rank_pokes` finds it.
    """
    # a heading along the edge would be into it or away from it by rounding
    widest = min(check_number(widest, "widest", at_least=0.0, largest=np.pi / 2), np.pi / 2 - 1e-6)
    for name, count in (("places", places), ("headings", headings)):
        if not isinstance(count, (int, np.integer)) or count < 1:
            raise InputError(name, "expected a whole number >= 1", repr(count))
    if edges is not None and not all(
        isinstance(edge, (int, np.integer)) for edge in np.atleast_1d(np.asarray(edges, dtype=object))
    ):
        raise InputError("edges", "expected numbers of edges", repr(edges))
    angles = np.linspace(-widest, widest, headings) if headings > 1 else (0.0,)
    found = []
    for edge in range(len(slider.vertices)) if edges is None else np.atleast_1d(edges).tolist():
        start, end = slider.edge(edge)
        length = float(np.linalg.norm(end - start))
        for share in (np.arange(places) + 0.5) / places:
            found += [EdgePush.on_edge(slider, edge, share * length, direction=-angle) for angle in angles]
    return found


def poke_outcome(
    surface: LimitSurface, points: ArrayLike, normals: ArrayLike, headings: ArrayLike, mu: float
) -> tuple[FloatArray, FloatArray]:
    """Predict the loads (n, 3), in the surface's unit of force, and slip twists (n, 3) of pokes with a point finger,
    quasi-static.

    The force at the contact lies in the friction cone and the slider moves as the surface says. If a force in the cone moves the
    contact point along the finger's heading, the contact sticks; else it slides, and the force is on the edge of the cone that
    comes nearest: turning the force turns the contact's velocity the same way, as the surface is convex.

    Parameters
    ----------
    points, normals, headings : array-like, shape (n, 2)
        Contact points (m), unit inward normals and unit directions of the finger's motion, in B.
    mu : float
        Coefficient of friction between finger and slider.
    """
    p = check_array(points, "points", (None, 2))
    n, u = unit(check_array(normals, "normals", (None, 2))), unit(check_array(headings, "headings", (None, 2)))
    if not len(p) == len(n) == len(u) or not len(p):
        raise InputError("points, normals, headings", "expected as many of each", f"{len(p)}, {len(n)}, {len(u)}")
    if not n.any(axis=1).all() or not ((n * u).sum(axis=1) > 0).all():
        raise InputError("headings", "expected fingers that move into the slider")
    half = np.arctan(check_number(mu, "mu", at_least=0.0))
    angles = np.linspace(-half, half, _CONE_STEPS)
    tangents = np.stack((-n[:, 1], n[:, 0]), axis=-1)
    forces = np.cos(angles)[:, None, None] * n + np.sin(angles)[:, None, None] * tangents
    twists = surface.twist(wrench_from_force(p, forces))
    velocity = np.stack([point_velocity(twists[:, i], p[i : i + 1])[:, 0] for i in range(len(p))], axis=1)
    turned = np.arctan2((velocity * tangents).sum(axis=-1), (velocity * n).sum(axis=-1))
    wanted = np.arctan2((u * tangents).sum(axis=-1), (u * n).sum(axis=-1))
    chosen = np.array([np.interp(wanted[i], np.maximum.accumulate(turned[:, i]), angles) for i in range(len(p))])
    force = np.cos(chosen)[:, None] * n + np.sin(chosen)[:, None] * tangents
    loads = wrench_from_force(p, force)
    motion = surface.twist(loads)
    # a load on the surface does the work of H_inv of its motion, which on a facet is another load
    work = (surface.wrench(motion) * motion).sum(axis=1) / (loads * motion).sum(axis=1)
    return loads * work[:, None], motion


def rank_pokes(
    surface: PolynomialLimitSurface, candidates: Sequence[EdgePush], mu: float, scatter: float = DEFAULT_SCATTER
) -> list[EdgePush]:
    """Return candidates with their gain, the most telling first.

    With the surfaces of the ensemble as draws of a joint normal distribution, a poke with outcome ``y`` (directions of load and
    twist, with an error of ``scatter``) leaves the slip directions ``t`` at loads all over the sphere with less variance by
    ``tr C_ty (C_yy + s² I)⁻¹ C_yt`` (active learning after Cohn, 1996). Counted on the same 50 surfaces that set the
    regression, gains flatter a little; their order is what they are for.

    Parameters
    ----------
    surface : PolynomialLimitSurface
        With an ensemble, as :func:`stablepush.fit_limit_surface` returns it.
    candidates : sequence of EdgePush
        As from :func:`poke_candidates`.
    mu : float
        Coefficient of friction between finger and slider.
    scatter : float
        Standard deviation (rad) of a measured direction.
    """
    if not candidates:
        raise InputError("candidates", "expected at least one poke")
    members = surface.members()
    if len(members) < 2:
        raise InputError("surface", "expected one with an ensemble, as a convex fit gives it")
    noise = check_number(scatter, "scatter", positive=True)
    rho = surface.characteristic_length
    points, normals, headings = (np.array([getattr(c, name) for c in candidates]) for name in ("point", "normal", "heading"))
    outcomes = []
    for member in members:
        loads, twists = poke_outcome(member, points, normals, headings, mu)
        outcomes.append(np.concatenate((unit(normalize_wrench(loads, rho)), unit(normalize_twist(twists, rho))), axis=1))
    asked = unit(np.random.default_rng(0).normal(size=(_TARGETS, 3))) * (1.0, 1.0, rho)
    targets = np.array([normalize_twist(m.twist(asked), rho).ravel() for m in members])
    targets = targets - targets.mean(axis=0)
    seen = np.array(outcomes)
    seen = seen - seen.mean(axis=0)
    whole = float((targets**2).sum())
    ranked = []
    for c, candidate in enumerate(candidates):
        y = seen[:, c]
        shared = y.T @ targets / len(members)
        own = y.T @ y / len(members) + noise**2 * np.eye(y.shape[1])
        taken = float((shared * np.linalg.solve(own, shared)).sum()) * len(members)
        gain = taken / whole if whole > 0 else 0.0
        ranked.append(replace(candidate, expected={"expected_gain": gain}))
    # pokes whose forces end on the same edge of the friction cone are equally informative, and stay in the order given
    return [ranked[k] for k in order_with_ties([-poke.gain for poke in ranked], _ALIKE)]
