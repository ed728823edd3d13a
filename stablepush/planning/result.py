"""Push paths and their file format ``plan/1``."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import (
    LARGEST_MAGNITUDE,
    FloatArray,
    InputError,
    Node,
    Word,
    binomial_interval,
    check_share,
    read_only,
    shown_as,
)
from stablepush.geometry import compose, exp, inverse, wrap_angle
from stablepush.io import read_json, write_json


class PlanStatus(Word):
    """How a search for a plan ended."""

    SOLVED = "solved", "simulate it, then execute it"
    NO_PATH = (
        "no-path",
        "no plan exists, or none that the search resolves: try other contacts, wider gaps or a larger tolerance",
    )
    TIMEOUT = "timeout", "no path was found in time, but one may exist: try a longer time limit or another planner"
    INTERRUPTED = "interrupted", "the search was stopped before it found a path"
    REJECTED = "rejected", "the independent check refused the planner's path, which is a bug in the planner: report it"


@dataclass(frozen=True, slots=True, eq=False)
class Push:
    """One constant body twist (m/s, rad/s) held for ``duration`` (s) at a contact: ``end = start * exp(twist * duration)``."""

    contact: int
    twist: FloatArray
    duration: float
    start: FloatArray
    end: FloatArray
    margin: float

    @classmethod
    def from_start(cls, contact: int, twist: ArrayLike, duration: float, start: ArrayLike, margin: float) -> Push:
        """Return the push from a start pose, its end computed."""
        v, pose = read_only(np.asarray(twist)), read_only(np.asarray(start))
        return cls(contact, v, duration, pose, read_only(compose(pose, exp(v * duration))), margin)

    @property
    def length(self) -> float:
        """Path length (m) of the body origin."""
        return float(np.hypot(self.twist[0], self.twist[1])) * self.duration

    def poses(self, times: ArrayLike) -> FloatArray:
        """Poses (..., 3) of B in W at times (s) after the start of the push."""
        return compose(self.start, exp(self.twist * np.asarray(times)[..., None]))


@dataclass(frozen=True, slots=True, eq=False)
class Transfer:
    """The pusher goes from contact ``source`` to contact ``target`` while the slider rests; poses (n, 3) of its frame in W."""

    source: int
    target: int
    pusher_path: FloatArray
    duration: float


Interval = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Success:
    """Probabilities of a plan, estimated on scenarios.

    Attributes
    ----------
    probability, interval
        That the slider sticks to the pusher throughout, with its 95 % interval (Clopper and Pearson).
    arrival, arrival_interval
        That its final pose is within the tolerance of the goal: a slider that slips may arrive, one that sticks may have started
        aside.
    failures : sequence of (push, share, cause)
        Where it is lost first: number of the push from 0, share of all scenarios, and of what; the most frequent first.
    ends : array, shape (m, 3)
        Final poses in W of the scenarios that lose the slider and were simulated.
    counts : tuple of int
        Scenarios, those that stick, those that stick and arrive, and those that slip, were simulated and arrive.
    """

    probability: float
    interval: Interval
    arrival: float
    arrival_interval: Interval
    failures: tuple[tuple[int, float, str], ...]
    ends: FloatArray
    counts: tuple[int, int, int, int]

    def intervals(self, level: float) -> tuple[Interval, Interval]:
        """Return the intervals of both probabilities at a level.

        Not all slips are simulated: what that leaves open of the arrival adds in quadrature.
        """
        total, stuck, _, rescued = self.counts
        lost, simulated = total - stuck, len(self.ends)
        low, high = binomial_interval(round(self.arrival * total), total, level)
        if lost > simulated:
            share, (least, most) = rescued / simulated, binomial_interval(rescued, simulated, level)
            low = self.arrival - math.hypot(self.arrival - low, lost / total * (share - least))
            high = self.arrival + math.hypot(high - self.arrival, lost / total * (most - share))
        return binomial_interval(stuck, total, level), (max(low, 0.0), min(high, 1.0))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PlanResult:
    """What a planner found.

    ``status``, a :class:`PlanStatus`, equals its word, as ``"solved"``, and has an ``advice``; ``message`` says more. Planners of
    others may have words of their own.
    ``duration`` in s, ``length`` (path of the body origin during pushes) in m, ``min_margin`` in rad;
    ``lower_bound`` (s) is below the duration of every plan that solves the problem, or None; ``planning_time`` in s.
    ``success_probability``: that the slider sticks to the pusher over the whole path, ``arrival_probability``: that its final
    pose is within the tolerance of the goal, over all that the problem says is uncertain, with 95 % intervals; None where
    unknown. ``success`` has more: where the slider is lost first, and of what; None for plans from files.
    """

    _repr_html_ = shown_as("plan")

    status: str
    planner: str
    segments: tuple[Push | Transfer, ...] = ()
    duration: float = 0.0
    length: float = 0.0
    switches: int = 0
    min_margin: float = 0.0
    lower_bound: float | None = None
    planning_time: float = 0.0
    seed: int = 0
    message: str = ""
    success_probability: float | None = None
    success_interval: tuple[float, float] | None = None
    arrival_probability: float | None = None
    arrival_interval: tuple[float, float] | None = None
    success: Success | None = None

    def __post_init__(self) -> None:
        if self.status in set(PlanStatus):
            object.__setattr__(self, "status", PlanStatus(self.status))

    def __repr__(self) -> str:
        count, words = len(self.pushes), [f"{self.status}, {self.planner}"]
        if count:
            words += [f"{count} push{'es' * (count > 1)}", f"{self.switches} change{'s' * (self.switches != 1)} of contact"]
            words += [f"{self.duration:.4g} s", f"{self.length:.4g} m", f"least margin {self.min_margin:.3g} rad"]
        if self.success_probability is not None:
            words.append(f"success {self.success_probability:.3g}")
        words.append(f"planned in {self.planning_time:.3g} s")
        return f"PlanResult({', '.join(words)}{': ' * bool(self.message)}{self.message})"

    @classmethod
    def from_segments(
        cls,
        segments: list[Push | Transfer],
        *,
        planner: str,
        seed: int = 0,
        lower_bound: float | None = None,
        planning_time: float = 0.0,
        message: str = "",
    ) -> PlanResult:
        """Return a solved plan with its sums."""
        pushes = [s for s in segments if isinstance(s, Push)]
        return cls(
            status="solved",
            planner=planner,
            segments=tuple(segments),
            duration=sum(s.duration for s in segments),
            length=sum(p.length for p in pushes),
            switches=len(segments) - len(pushes),
            min_margin=min((p.margin for p in pushes), default=0.0),
            lower_bound=lower_bound,
            planning_time=planning_time,
            seed=seed,
            message=message,
        )

    @property
    def solved(self) -> bool:
        """True if the plan reaches the goal."""
        return self.status == "solved"

    @property
    def outlook(self) -> str:
        """How likely the plan is to succeed, in words."""
        if self.success_probability is None or self.success_interval is None or self.arrival_probability is None:
            return "of unknown probability of success"
        low, high = self.success_interval
        words = (
            f"sticks throughout with probability {self.success_probability:.3f} (95 %: {low:.3f} to {high:.3f}), "
            f"arrives with {self.arrival_probability:.3f}"
        )
        if self.success is not None and self.success.failures:
            number, share, cause = self.success.failures[0]
            words += f"; most likely to slip: push {number + 1} (in {100 * share:.2g} % of scenarios), {cause}"
        return words

    def from_goal(self, goal: ArrayLike) -> tuple[float, float]:
        """Return how far (m) the last pose is from a goal (3,), and how much it is turned (rad).

        Raises :class:`InputError` for a plan without pushes.
        """
        if not self.pushes:
            raise InputError("result", "expected a plan with pushes", str(self.status))
        offset = compose(inverse(self.pushes[-1].end), np.asarray(goal))
        return float(np.hypot(offset[0], offset[1])), abs(float(wrap_angle(offset[2])))

    @property
    def pushes(self) -> list[Push]:
        """The pushes in order."""
        return [s for s in self.segments if isinstance(s, Push)]


def plan_to_json(result: PlanResult) -> dict[str, Any]:
    """Return the ``plan/1`` of a result."""
    return {
        "format": "plan/1",
        "status": result.status,
        "planner": result.planner,
        "seed": result.seed,
        "duration": result.duration,
        "length": result.length,
        "switches": result.switches,
        "min_margin": result.min_margin,
        "lower_bound": result.lower_bound,
        "planning_time": result.planning_time,
        "message": result.message,
        "success_probability": result.success_probability,
        "success_interval": None if result.success_interval is None else list(result.success_interval),
        "arrival_probability": result.arrival_probability,
        "arrival_interval": None if result.arrival_interval is None else list(result.arrival_interval),
        "segments": [_segment_to_json(s) for s in result.segments],
    }


def _segment_to_json(segment: Push | Transfer) -> dict[str, Any]:
    if isinstance(segment, Transfer):
        return {
            "kind": "transfer",
            "from": segment.source,
            "to": segment.target,
            "pusher_path": segment.pusher_path.tolist(),
            "duration": segment.duration,
        }
    return {
        "kind": "push",
        "contact": segment.contact,
        "twist": segment.twist.tolist(),
        "duration": segment.duration,
        "start": segment.start.tolist(),
        "end": segment.end.tolist(),
        "margin": segment.margin,
    }


def save_plan(result: PlanResult, path: str | Path) -> None:
    """Write a ``plan/1`` file."""
    write_json(path, plan_to_json(result))


def load_plan(path: str | Path) -> PlanResult:
    """Read a ``plan/1`` file. Whether the plan is right is for :func:`stablepush.check_plan` to say."""
    root = read_json(path, "plan/1")
    root.expect_keys("format", *(f.name for f in fields(PlanResult)))
    bound = root["lower_bound"]
    return PlanResult(
        status=root["status"].text(),
        planner=root["planner"].text(),
        seed=_any_integer(root["seed"], 2**63),
        duration=root["duration"].number(),
        length=root["length"].number(),
        switches=_any_integer(root["switches"]),
        min_margin=root["min_margin"].number(),
        lower_bound=None if bound.value is None else bound.number(),
        planning_time=root["planning_time"].number(),
        message="" if root.get("message") is None else root["message"].text(),
        segments=tuple(_segment_from_node(node) for node in root["segments"].items()),
        success_probability=_share(root.get("success_probability")),
        success_interval=_interval(root.get("success_interval")),
        arrival_probability=_share(root.get("arrival_probability")),
        arrival_interval=_interval(root.get("arrival_interval")),
    )


def _share(node: Node | None) -> float | None:
    return None if node is None else node.checked(lambda: check_share(node.number(), ""))


def _interval(node: Node | None) -> tuple[float, float] | None:
    if node is None:
        return None
    low, high = node.array(2).tolist()
    if not 0 <= low <= high <= 1:
        node.fail("expected two numbers from 0 to 1, the smaller first", f"{low:g}, {high:g}")
    return low, high


def _any_integer(node: Node, largest: float = LARGEST_MAGNITUDE) -> int:
    if isinstance(node.value, bool) or not isinstance(node.value, int) or abs(node.value) > largest:
        node.fail(f"expected a whole number of at most {largest:g}")
    return int(node.value)


def _segment_from_node(node: Node) -> Push | Transfer:
    if node["kind"].text(("push", "transfer")) == "transfer":
        node.expect_keys("kind", "from", "to", "pusher_path", "duration")
        return Transfer(
            _any_integer(node["from"]),
            _any_integer(node["to"]),
            read_only(node["pusher_path"].array(None, 3)),
            node["duration"].number(),
        )
    node.expect_keys("kind", *(f.name for f in fields(Push)))
    return Push(
        _any_integer(node["contact"]),
        read_only(node["twist"].array(3)),
        node["duration"].number(),
        read_only(node["start"].array(3)),
        read_only(node["end"].array(3)),
        node["margin"].number(),
    )
