"""A push of an edge that is to be made: what experiments propose, rigs execute, and lists of pushes keep."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import FloatArray, InputError, check_array, check_number, read_only
from stablepush.objects.slider import Slider

#: Slack at the ends of an edge, as a share of its length, and of motions at right angles to the normal.
_SLACK = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class EdgePush:
    """A push that one finger, or two on the same edge, are to make; :meth:`on_edge` checks it.

    Attributes
    ----------
    edge : int
        Edge of the slider that is pushed.
    arc_length : float
        Where the middle of the fingers meets it: distance (m) from its first vertex.
    point, normal : array, shape (2,)
        The same place (m) and the unit inward normal there, in B.
    direction : float
        Of the pusher's motion, in rad from ``normal``, counter-clockwise. Without meaning where ``cor`` is given.
    distance, speed : float
        Of the faster finger after it has met the slider, in m and m/s.
    width : float
        Distance (m) between two fingers; 0 for one finger.
    cor : array, shape (2,), or None
        The pusher turns about this point (m, in B before the push) instead of moving straight, ``sense`` 1 counter-clockwise.
    start : array, shape (3,), or None
        Pose in W to which the slider is reset before the push; None leaves it where it lies.
    group : str
        The same for repeats; blank if there are none.
    expected : mapping
        Differences that the push is expected to show, by names that end in a unit.
    """

    edge: int
    arc_length: float
    point: FloatArray
    normal: FloatArray
    direction: float = 0.0
    distance: float = 0.03
    speed: float = 0.02
    width: float = 0.0
    cor: FloatArray | None = None
    sense: float = math.nan
    start: FloatArray | None = None
    group: str = ""
    expected: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def on_edge(  # noqa: PLR0913
        cls,
        slider: Slider,
        edge: int,
        arc_length: float,
        *,
        direction: float = 0.0,
        distance: float = 0.03,
        speed: float = 0.02,
        width: float = 0.0,
        cor: ArrayLike | None = None,
        sense: float = math.nan,
        start: ArrayLike | None = None,
        group: str = "",
    ) -> EdgePush:
        """Return a push of an edge of a slider: parameters as the attributes of the class.

        Raises :class:`stablepush.InputError` for a place that is not on the edge, or a motion that leads away from it.
        """
        if isinstance(edge, bool) or not isinstance(edge, int | np.integer) or not 0 <= edge < len(slider.vertices):
            raise InputError("edge", f"expected one from 0 to {len(slider.vertices) - 1}", repr(edge))
        a, b = slider.edge(edge)
        length = float(np.linalg.norm(b - a))
        if not -_SLACK * length <= check_number(arc_length, "arc_length") <= (1 + _SLACK) * length:
            raise InputError("arc_length", f"expected a place on edge {edge}, from 0 to {length:.6g} m", f"{arc_length:.6g}")
        if math.cos(check_number(direction, "direction")) <= _SLACK:
            raise InputError("direction", "expected one towards the slider, within pi/2 of the normal", f"{direction:.6g} rad")
        if cor is not None and sense not in (-1.0, 1.0):
            raise InputError("sense", "expected 1 or -1 for a push that turns", f"{sense:g}")
        tangent = (b - a) / length
        return cls(
            int(edge),
            float(arc_length),
            read_only(a + arc_length * tangent),
            read_only(np.array((-tangent[1], tangent[0]))),
            float(direction),
            check_number(distance, "distance", positive=True),
            check_number(speed, "speed", positive=True),
            check_number(width, "width", at_least=0.0),
            None if cor is None else read_only(check_array(cor, "cor", (2,))),
            float(sense),
            None if start is None else read_only(check_array(start, "start", (3,))),
            group,
        )

    @property
    def heading(self) -> FloatArray:
        """Unit direction (2,) of the pusher's motion in B."""
        left = np.array((-self.normal[1], self.normal[0]))
        return math.cos(self.direction) * self.normal + math.sin(self.direction) * left

    @property
    def gain(self) -> float:
        """Expected share of the variance of slip directions that the push takes away; see :func:`stablepush.rank_pokes`."""
        return self.expected.get("expected_gain", 0.0)

    def to_json(self) -> dict[str, Any]:
        """Return the entries of a list of pushes, with what each is expected to show."""
        entry: dict[str, Any] = {
            "edge": self.edge,
            "along": self.arc_length,
            "direction": self.direction,
            "way": self.distance,
            "speed": self.speed,
            "width": self.width,
        }
        if self.cor is not None:
            entry |= {"cor_x": float(self.cor[0]), "cor_y": float(self.cor[1]), "sense": self.sense}
        if self.start is not None:
            entry |= dict(zip(("x", "y", "theta"), self.start.tolist(), strict=True))
        if self.group:
            entry["group"] = self.group
        return {**entry, **self.expected}
