"""Compiled: whether pushes are stable at every heading that they pass."""

from __future__ import annotations

import math

import numpy as np

from stablepush.core import compiled
from stablepush.mechanics.kernels.friction import load_held


@compiled
def arcs_are_stable(table, twists, headings, places, extra, facets, least, step, bend, rho, result):  # type: ignore[no-untyped-def]
    """Fill ``result`` (n,): whether the load of each body twist stays within all cones while its heading goes from
    ``headings[i, 0]`` by ``headings[i, 1]`` (rad).

    The load of cone ``k`` is that of ``table`` plus ``extra`` (n, k, 3); ``facets`` (k, f, 3) are unit normals for ``(fx, fy,
    tau/rho)``, ``least`` (k,) the sines of the margins that are asked. Loads are looked at between parts of at most ``step``. A
    cone of margins is convex, and over a part ``d`` a load is off the straight line between its ends by at most ``bend d²/8``,
    with ``bend`` (N/rad²) its greatest second derivative: what holds by so much at both ends holds between. So it is with
    ``places`` (q, 2) in W: loads are affine in the place.
    """
    load = np.empty(3)
    for i in range(twists.shape[0]):
        turn = headings[i, 1]
        parts = max(1, math.ceil(abs(turn) / step - 1e-9))
        slack = bend * (turn / parts) ** 2 / 8
        good = True
        for p in range(parts + 1):
            # the last first: what fails, mostly fails at an end
            theta = headings[i, 0] + turn * ((p + parts) % (parts + 1)) / parts
            for q in range(places.shape[0]):
                load_held(table, places[q, 0], places[q, 1], theta, twists[i, 0], twists[i, 1], twists[i, 2], load)
                for k in range(facets.shape[0]):
                    fx, fy, fz = load[0] + extra[i, k, 0], load[1] + extra[i, k, 1], (load[2] + extra[i, k, 2]) / rho
                    size = math.sqrt(fx * fx + fy * fy + fz * fz)
                    needed = least[k] * size + slack * (1.0 + abs(least[k]))
                    for f in range(facets.shape[1]):
                        if facets[k, f, 0] * fx + facets[k, f, 1] * fy + facets[k, f, 2] * fz < needed:
                            good = False
                            break
                    if not good:
                        break
                if not good:
                    break
            if not good:
                break
        result[i] = good
