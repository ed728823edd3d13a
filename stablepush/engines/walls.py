"""The sides of an outline as thin boxes."""

from __future__ import annotations

import numpy as np


def walls(outline: np.ndarray, thickness: float) -> list[tuple[np.ndarray, float, float]]:
    """Return boxes behind the edges of an outline (n, 2): middle (2,) in m, angle in rad, length in m.

    Of all shapes, contacts of balls with boxes are exact. At a sharp corner a box ends where it would come out of the next edge.
    """
    along = np.roll(outline, -1, axis=0) - outline
    lengths = np.linalg.norm(along, axis=1)
    along /= lengths[:, None]
    # cosine and sine of the angle inside the corner at the start of each edge
    back = -np.roll(along, 1, axis=0)
    cosine, sine = (along * back).sum(axis=1), along[:, 0] * back[:, 1] - along[:, 1] * back[:, 0]
    # where the outline goes in, the box may reach the next edge
    short = np.where(sine > 0, thickness * np.maximum(0.0, cosine) / np.where(sine > 0, sine, 1.0), 0.0)
    found = []
    for k, (start, side) in enumerate(zip(outline, along, strict=True)):
        first, last = short[k], lengths[k] - short[(k + 1) % len(outline)]
        middle = start + (first + last) / 2 * side + thickness / 2 * np.array((-side[1], side[0]))
        found.append((middle, float(np.arctan2(side[1], side[0])), float(last - first)))
    return found
