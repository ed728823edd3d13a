"""Compiled: the contacts at an instant, the motion that solves the contact law, and workspace for candidate modes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stablepush.core import FloatArray

#: Modes of a contact: open, sticking, the slider slipping to the left or right of the inward normal.
OPEN, STICKING, LEFT, RIGHT = 0, 1, 2, 3
#: Most contacts at once.
MOST_CONTACTS = 8


class Touch(NamedTuple):
    """Contacts of an instant, the first ``number[0]`` rows: points and inward normals in B, gaps (m), the pusher's velocity there
    in B, and which finger or end it is."""

    number: np.ndarray
    point: FloatArray
    normal: FloatArray
    gap: FloatArray
    velocity: FloatArray
    finger: np.ndarray


class Solution(NamedTuple):
    """Twist (3,) in B, load (3,), forces (k, 2) and modes (k,) of the contacts; ``found`` (1,): how many combinations of modes
    are consistent: one is the rule, none is a jam."""

    twist: FloatArray
    load: FloatArray
    force: FloatArray
    mode: np.ndarray
    found: np.ndarray


class Work(NamedTuple):
    """Workspace for candidate modes: twist (3,), load (3,), forces (k, 2) and modes (k,), a line of twists (2, 3), edges of cones
    (2 k, 3), shares (3,)."""

    twist: FloatArray
    load: FloatArray
    force: FloatArray
    mode: np.ndarray
    line: FloatArray
    rays: FloatArray
    shares: FloatArray


def new_touch() -> Touch:
    """Return empty arrays for contacts."""
    k = MOST_CONTACTS
    return Touch(np.zeros(1, np.int64), np.zeros((k, 2)), np.zeros((k, 2)), np.zeros(k), np.zeros((k, 2)), np.zeros(k, np.int64))


def new_solution() -> Solution:
    """Return empty arrays for a solution."""
    k = MOST_CONTACTS
    return Solution(np.zeros(3), np.zeros(3), np.zeros((k, 2)), np.zeros(k, np.int64), np.zeros(1, np.int64))


def new_work() -> Work:
    """Return the workspace."""
    k = MOST_CONTACTS
    modes = np.zeros(k, np.int64)
    return Work(np.zeros(3), np.zeros(3), np.zeros((k, 2)), modes, np.zeros((2, 3)), np.zeros((2 * k, 3)), np.zeros(3))
