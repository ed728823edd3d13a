"""Pushes that a lab could make next, and which of them separate two causes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from stablepush._arrays import FloatArray
from stablepush.diagnosis.equations import SIZES, Fitted
from stablepush.diagnosis.forward import PARAMETERS, SMALL, ForwardModel
from stablepush.diagnosis.observations import Observations
from stablepush.diagnosis.system import System
from stablepush.se2 import compose

#: Headings of the slider, speeds (m/s) and places (m from the origin of W, both ways) that are looked at; pushes proposed.
_HEADINGS, _SPEEDS, _PLACES, _PROPOSED = 12, (0.005, 0.02, 0.06), (-0.1, 0.1), 8
#: How often each is made, and what the sum of squares must differ by, between the causes, for pushes to be worth while.
_TIMES, _TOLD = 2, 10.0
#: Way of a push, in m.
_WAY = 0.04


def separating_pushes(system: System, causes: Mapping[str, Fitted]) -> list[dict[str, Any]]:
    """Return pushes that tell two effects apart, each as it was fitted, the most telling first, each twice: the diagnosis
    believes no single push. None if not even all of them would.

    Chosen one by one so that what is left of the difference of the two predictions, over the noise, is largest when either effect
    takes what values suit it better, as far as the log lets it (the T-criterion of Atkinson and Fedorov 1975, linearised).

    Pushes of an edge at its middle, in the terms of a list that ``simulate`` takes: ``edge``, ``along`` (m), ``direction`` (rad),
    ``way`` (m), ``speed`` (m/s), and where the slider is put, ``x, y, theta`` in W; with the differences in N, and in m between
    finger and outline, that are expected.
    """
    entries, inward, o = _possible(system)
    if not entries:
        return []
    model = ForwardModel(o, system.points, system.weight, system.rig.slider.radius_of_gyration**2, system.center)
    noise = system.noise.force * np.array((1.0, 1.0, system.moment_noise))

    def readings(id: str, fitted: Fitted, step: FloatArray) -> FloatArray:
        """Loads and gap (n, 4) of all pushes over their noise, with an effect a step away from where it was fitted."""
        value = fitted.values[id] + step
        effects = {**fitted.values, id: value}
        load = model.predict(fitted.loads, {k: v for k, v in effects.items() if k in PARAMETERS})
        return np.column_stack((load / noise, _gap_change(id, value, inward, o.twist) / system.gap_noise))

    predicted, slopes, known = [], [], []
    for id, fitted in causes.items():
        size = SIZES[id]
        small = SMALL.get(id, 1e-4) * np.eye(size)
        predicted.append(readings(id, fitted, np.zeros(size)))
        slopes.append(np.stack([(readings(id, fitted, s) - predicted[-1]) / s.max() for s in small], axis=-1))
        at = sum(SIZES[k] for k in list(fitted.values)[: list(fitted.values).index(id)])
        spread = fitted.covariance[at : at + size, at : at + size]
        known.append(np.linalg.pinv(spread, hermitian=True))
    difference = predicted[0] - predicted[1]
    squares = (difference**2).sum(axis=1)
    pulls = [np.einsum("nrd,nr->nd", slope, difference) for slope in slopes]
    grams = [np.einsum("nrd,nre->nde", slope, slope) for slope in slopes]
    chosen: list[int] = []
    total, told, pulled, informed = 0.0, 0.0, [np.zeros(len(k)) for k in known], list(known)
    while len(chosen) < min(_PROPOSED // _TIMES, len(entries)):
        left = np.full(len(entries), np.inf)
        for pull, gram, b, a in zip(pulls, grams, pulled, informed, strict=True):
            slope, information = b + _TIMES * pull, a + _TIMES * gram
            taken = np.einsum("nd,nde,ne->n", slope, np.linalg.pinv(information, hermitian=True), slope)
            left = np.minimum(left, total + _TIMES * squares - taken)
        left[chosen] = -np.inf
        best = int(left.argmax())
        told = float(left[best])
        chosen.append(best)
        total += _TIMES * float(squares[best])
        pulled = [b + _TIMES * pull[best] for b, pull in zip(pulled, pulls, strict=True)]
        informed = [a + _TIMES * gram[best] for a, gram in zip(informed, grams, strict=True)]
    if told < _TOLD:
        return []
    force = np.linalg.norm(difference[:, :3] * noise / (1, 1, system.rho), axis=1)
    away = np.abs(difference[:, 3]) * system.gap_noise
    return [
        {**entries[i], "expected_difference_N": float(force[i]), "expected_difference_m": float(away[i])}
        for i in chosen
        for _ in range(_TIMES)
    ]


def _possible(system: System) -> tuple[list[dict[str, Any]], FloatArray, Observations]:
    """Pushes, normals (n, 2) of the edges that they push, and rows as a log of them would have."""
    two = system.rig.contact_kind == "two-point"
    room = _room(system) if two else 0.0
    entries, twists, poses, places, normals = [], [], [], [], []
    for face in range(len(system.rig.slider.vertices)):
        a, b = system.rig.slider.edge(face)
        length = float(np.linalg.norm(b - a))
        if length <= room:
            continue
        along = (b - a) / length
        normal, middle = np.array((-along[1], along[0])), (a + b) / 2
        # a finger off the centre turns the slider about as much as its lever says, two fingers do not
        turn = 0.0 if two else float(middle[0] * normal[1] - middle[1] * normal[0]) / system.rho**2
        headings = 2 * np.pi * np.arange(_HEADINGS) / _HEADINGS
        for heading, speed, x, y in product(headings, _SPEEDS, _PLACES, _PLACES):
            put = {"x": x, "y": y, "theta": float(heading)}
            entries.append({"edge": face, "along": length / 2, "direction": 0.0, "way": _WAY, "speed": speed, **put})
            twists.append(speed * np.array((*normal, turn)) / np.hypot(1.0, turn * system.rho))
            poses.append((x, y, heading))
            places.append(middle)
            normals.append(normal)
    pose, twist, place = (np.reshape(part, (len(entries), -1)) for part in (poses, twists, places))
    n = len(entries)
    rows = replace(
        system.observations,
        trial=np.arange(n),
        # they come after the log
        order=np.ones(n),
        time=np.zeros(n),
        pose=pose,
        twist=twist,
        acceleration=np.zeros((n, 3)),
        unsteady=np.zeros((n, 3)),
        wrench=np.zeros((n, 3)),
        pusher=compose(pose, np.column_stack((place, np.zeros(n)))) if n else np.zeros((0, 3)),
        normal=np.full((n, 2, 2), np.nan),
        place=np.full((n, 2, 2), np.nan),
        gap=np.full((n, 2), np.nan),
        slip=np.full(n, np.nan),
        span=np.ones(n),
    )
    return entries, np.reshape(normals, (n, 2)), rows


def _room(system: System) -> float:
    """Length (m) of an edge on which two fingers fit."""
    o = system.observations
    apart = np.linalg.norm(o.place[:, 0] - o.place[:, 1], axis=1)
    known = np.isfinite(apart)
    return (float(np.median(apart[known])) if known.any() else 0.0) + 2 * (o.finger_radius or 0.0)


def _gap_change(id: str, value: FloatArray, normals: FloatArray, twists: FloatArray) -> FloatArray:
    """What an effect does to the gaps (n,) between finger and outline, in m, of straight pushes along normals (n, 2)."""
    if id == "contact-geometry":
        return np.full(len(normals), float(value[0]))
    if id == "frame-offset":
        return np.asarray(normals @ value)
    if id == "latency":
        return np.asarray(-float(value[0]) * (normals * twists[:, :2]).sum(axis=1))
    return np.zeros(len(normals))
