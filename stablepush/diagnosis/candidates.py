"""Pushes that a lab could make next, and which of them separate two causes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from stablepush._arrays import FloatArray
from stablepush.diagnosis.equations import Values
from stablepush.diagnosis.forward import PARAMETERS, ForwardModel
from stablepush.diagnosis.observations import Observations
from stablepush.diagnosis.system import System
from stablepush.se2 import compose

#: Headings of the slider, speeds (m/s) and places (m from the origin of W) that are looked at, and pushes that are proposed.
_HEADINGS, _SPEEDS, _PLACES, _PROPOSED = 12, (0.005, 0.02, 0.06), (-0.1, 0.1), 8
#: Way of a push, in m.
_WAY = 0.04


def separating_pushes(system: System, loads: FloatArray, values: Values) -> list[dict[str, Any]]:
    """Return pushes whose predicted loads differ most between two effects, each at its estimated size.

    Pushes of an edge at its middle, in the terms of a list that ``simulate`` takes: ``edge``, ``along`` (m), ``direction`` (rad),
    ``way`` (m), ``speed`` (m/s), and where the slider is put, ``x, y, theta`` in W; with the difference in N that is expected.
    """
    vertices = system.rig.slider.vertices
    entries, twists, poses, places = [], [], [], []
    for face in range(len(vertices)):
        a, b = system.rig.slider.edge(face)
        along = (b - a) / np.linalg.norm(b - a)
        normal = np.array((-along[1], along[0]))
        middle, along_edge = (a + b) / 2, float(np.linalg.norm(b - a)) / 2
        for heading in 2 * np.pi * np.arange(_HEADINGS) / _HEADINGS:
            for speed in _SPEEDS:
                for x in _PLACES:
                    put = {"x": x, "y": x, "theta": float(heading)}
                    entries.append({"edge": face, "along": along_edge, "direction": 0.0, "way": _WAY, "speed": speed, **put})
                    # a push off the centre turns the slider about as much as its lever says
                    turn = float(middle[0] * normal[1] - middle[1] * normal[0]) / system.rho**2
                    twists.append(speed * np.array((*normal, turn)) / np.hypot(1.0, turn * system.rho))
                    poses.append((x, x, heading))
                    places.append(middle)
    pose, twist, place = np.array(poses), np.array(twists), np.array(places)
    n = len(entries)
    o: Observations = replace(
        system.observations,
        trial=np.arange(n),
        order=np.tile((0.0, 1.0), n)[:n],
        time=np.zeros(n),
        pose=pose,
        twist=twist,
        acceleration=np.zeros((n, 3)),
        wrench=np.zeros((n, 3)),
        pusher=compose(pose, np.column_stack((place, np.zeros(n)))),
        normal=np.full((n, 2, 2), np.nan),
        place=np.full((n, 2, 2), np.nan),
        gap=np.full((n, 2), np.nan),
        slip=np.full(n, np.nan),
        span=np.ones(n),
    )
    model = ForwardModel(o, system.points, system.weight, system.rig.slider.radius_of_gyration**2, system.center)
    scale = np.array((1, 1, system.rho))
    first, second = (model.predict(loads, {id: v} if id in PARAMETERS else {}) / scale for id, v in values.items())
    gain = np.linalg.norm(first - second, axis=1)
    order = np.argsort(-gain)
    chosen: list[int] = []
    for i in order:
        # not the same face and speed over and over
        if (
            sum(entries[i]["edge"] == entries[j]["edge"] and abs(entries[i]["theta"] - entries[j]["theta"]) < 0.6 for j in chosen)
            < 1
        ):
            chosen.append(int(i))
        if len(chosen) == _PROPOSED:
            break
    return [{**entries[i], "expected_difference_N": float(gain[i])} for i in chosen]
