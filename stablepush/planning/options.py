"""What is asked of a plan beyond its problem."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

from stablepush.core import BoolArray, FloatArray, InputError, check_number, did_you_mean
from stablepush.planning.problem import PlanningProblem
from stablepush.stability import StableRegion, all_pressure_region, lynch_mason_region

#: Regions that hold for every pressure.
_PROMISED = {"all-pressure": all_pressure_region, "conservative": lynch_mason_region}
#: Sets of rotation centres that a plan may draw on.
REGIONS = ("model", *_PROMISED)


class PushSet(Protocol):
    """Pushes of a contact that depend on the heading."""

    def contains_pushes(self, twists: FloatArray, headings: FloatArray) -> BoolArray:
        """Return whether body twists (n, 3) in m/s and rad/s, from ``headings[:, 0]`` by ``headings[:, 1]`` (rad), are in it."""


def promised_region(problem: PlanningProblem, number: int, region: str) -> StableRegion | None:
    """Return the motions that a region guarantees at a contact; None for ``"model"``.

    They hold for every pressure and for every friction and place of the fingers that the problem's ``uncertainty`` allows
    (:meth:`Uncertainty.worst_contact`). The centre of mass is taken as exact.
    """
    if region not in _PROMISED:
        return None
    return _PROMISED[region](problem.slider, problem.uncertainty.worst_contact(problem.contacts[number]))


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """How certain and how good a plan is to be.

    Parameters
    ----------
    region : {"model", "all-pressure", "conservative"}
        CORs that a plan may use. ``"model"``: those that the limit surface calls stable. ``"all-pressure"``: of these, the ones
        that are stable for every pressure distribution. ``"conservative"``: of these, the ones that Lynch and Mason's STABLE
        finds. The last two hold for every contact friction and finger position that the problem's ``uncertainty`` allows and
        take the centre of mass as exact (:func:`promised_region`).
    margin_weight : float
        A push costs its duration times ``1 + margin_weight (1 - margin/m)``, with ``m`` the largest margin of a straight push:
        with 1, one on the boundary of the stable set costs twice as much as the safest. 0 minimises the duration.
    max_twist_rate : float
        Largest rate (rad/s) at which the unit twist ``(vx, vy, rho omega)`` turns from one push to the next at the same contact:
        corners are blended by short pushes between the two. Infinite: no blending. A corner stays, and the slider stops there,
        if its pushes are too short or the blend would be unstable or in collision.
    refinement_budget : float
        Search steps (poses expanded, motions tested) that anytime planners spend on refining the first plan, for each contact,
        and for each of a few smaller tolerances of the goal if its tolerance is wide. It is a count, not a time, so that plans
        are reproducible. Infinite: until the time limit.
    regions : tuple of StableRegion, PushSet or None
        Further regions, one for each contact, in which all pushes must lie; None for a contact that is not used; empty: no
        further condition. :func:`stablepush.plan` sets the common stable regions of the scenarios that it has chosen; under
        effects they depend on the heading.
    search_budget : float
        Search steps after which a planner gives up without a plan. Planners that do not count steps stop at the deadline.
    """

    region: str = "model"
    margin_weight: float = 0.0
    max_twist_rate: float = math.inf
    refinement_budget: float = 20_000
    regions: tuple[StableRegion | PushSet | None, ...] = field(default=(), repr=False)
    search_budget: float = math.inf

    def __post_init__(self) -> None:
        if self.region not in REGIONS:
            raise InputError("region", f"expected {' or '.join(REGIONS)}", f"{self.region!r}{did_you_mean(self.region, REGIONS)}")
        check_number(self.margin_weight, "margin_weight", at_least=0.0)
        if self.max_twist_rate != math.inf:
            check_number(self.max_twist_rate, "max_twist_rate", positive=True)
        for name in ("refinement_budget", "search_budget"):
            if getattr(self, name) != math.inf:
                check_number(getattr(self, name), name, at_least=0.0)
