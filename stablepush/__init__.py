"""Plan stable pushes of flat objects: limit surfaces from a few pokes, stable rotation centres, push paths."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stablepush.all_pressure import WorstPressure, all_pressure_region, worst_pressure
    from stablepush.check import CheckReport, check_plan
    from stablepush.commands import Command, contact_push, poke, random_pushes, read_commands
    from stablepush.comparison import RegionPlan, certified_share, compare_regions
    from stablepush.conservative import lynch_mason_region
    from stablepush.contact import PushContact, WrenchCone
    from stablepush.contact_choice import RankedContact, rank_contacts
    from stablepush.diagnosis import GapReport, diagnose
    from stablepush.effects import CATALOGUE, Effect, EffectKind, parse_effect
    from stablepush.errors import (
        ConvergenceError,
        InputError,
        PlanWarning,
        PlausibilityWarning,
        SolverError,
        StablepushError,
        StablepushWarning,
        UnsupportedContactError,
    )
    from stablepush.execution import execute_closed_loop, execute_plan, plan_commands
    from stablepush.formats import load_contact, load_model, load_slider, save_model
    from stablepush.identify import (
        Certificate,
        CrossValidation,
        Fit,
        GridPressure,
        OnlineEstimate,
        OnlineIdentifier,
        Poke,
        certify,
        cross_validate,
        ellipsoid_from_pressure,
        fit_limit_surface,
        fit_pressure_grid,
        poke_candidates,
        poke_outcome,
        rank_pokes,
    )
    from stablepush.logs import Noise, PushLog, Rig, read_pushlog, write_pushlog
    from stablepush.models import (
        GaussianProcessSurface,
        IdealLimitSurface,
        LimitSurface,
        PolynomialLimitSurface,
        monomial_exponents,
    )
    from stablepush.movingai import load_movingai_map
    from stablepush.options import PlanOptions
    from stablepush.oracle import StabilityOracle
    from stablepush.parallel import run_parallel
    from stablepush.path import PlanResult, Push, Transfer, load_plan, save_plan
    from stablepush.planning import least_probability, plan, planner_names
    from stablepush.probability import ProbabilityMap, chance_region, probability_map
    from stablepush.problem import PlanningProblem, load_scene, save_scene
    from stablepush.pushing import PushAnswer, Pusher, PushTrace, TableFriction, push_twist, simulate_push
    from stablepush.region import StableRegion, stable_region
    from stablepush.rosbag import load_rosbag, save_rosbag
    from stablepush.slider import Slider
    from stablepush.sliding import Slide, simulate_free_sliding
    from stablepush.sliding_directions import EigenDirections, eigen_directions, sliding_basins
    from stablepush.support import SupportDistribution
    from stablepush.trajectory import Trajectory, load_trajectory, sample_plan, save_trajectory
    from stablepush.virtual_rig import Execution, VirtualRig, execute_batch

__version__ = "0.1.0"

#: Where each public name lives. Names are loaded on first use: the program answers --help before numpy is imported.
_HOMES = {
    "all_pressure": ("WorstPressure", "all_pressure_region", "worst_pressure"),
    "check": ("CheckReport", "check_plan"),
    "commands": ("Command", "contact_push", "poke", "random_pushes", "read_commands"),
    "comparison": ("RegionPlan", "certified_share", "compare_regions"),
    "conservative": ("lynch_mason_region",),
    "contact": ("PushContact", "WrenchCone"),
    "contact_choice": ("RankedContact", "rank_contacts"),
    "diagnosis": ("GapReport", "diagnose"),
    "effects": ("CATALOGUE", "Effect", "EffectKind", "parse_effect"),
    "errors": (
        *("ConvergenceError", "InputError", "PlanWarning", "PlausibilityWarning", "SolverError", "StablepushError"),
        *("StablepushWarning", "UnavailableError", "UnsupportedContactError"),
    ),
    "execution": ("execute_closed_loop", "execute_plan", "plan_commands"),
    "formats": ("load_contact", "load_model", "load_slider", "save_model"),
    "identify": (
        "Certificate",
        "CrossValidation",
        "Fit",
        "GridPressure",
        "OnlineEstimate",
        "OnlineIdentifier",
        "Poke",
        "certify",
        "cross_validate",
        "ellipsoid_from_pressure",
        "fit_limit_surface",
        "fit_pressure_grid",
        "poke_candidates",
        "poke_outcome",
        "rank_pokes",
    ),
    "logs": ("Noise", "PushLog", "Rig", "read_pushlog", "write_pushlog"),
    "models": ("GaussianProcessSurface", "IdealLimitSurface", "LimitSurface", "PolynomialLimitSurface", "monomial_exponents"),
    "movingai": ("load_movingai_map",),
    "oracle": ("StabilityOracle",),
    "path": ("PlanResult", "Push", "Transfer", "load_plan", "save_plan"),
    "options": ("PlanOptions",),
    "planning": ("least_probability", "plan", "planner_names"),
    "problem": ("PlanningProblem", "load_scene", "save_scene"),
    "probability": ("ProbabilityMap", "chance_region", "probability_map"),
    "pushing": ("PushAnswer", "PushTrace", "Pusher", "TableFriction", "push_twist", "simulate_push"),
    "region": ("StableRegion", "stable_region"),
    "parallel": ("run_parallel",),
    "rosbag": ("load_rosbag", "save_rosbag"),
    "slider": ("Slider",),
    "sliding_directions": ("EigenDirections", "eigen_directions", "sliding_basins"),
    "sliding": ("Slide", "simulate_free_sliding"),
    "support": ("SupportDistribution",),
    "virtual_rig": ("Execution", "VirtualRig", "execute_batch"),
    "trajectory": ("Trajectory", "load_trajectory", "sample_plan", "save_trajectory"),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "CATALOGUE",
    "Certificate",
    "CheckReport",
    "Command",
    "ConvergenceError",
    "CrossValidation",
    "Effect",
    "EffectKind",
    "EigenDirections",
    "Execution",
    "Fit",
    "GapReport",
    "GaussianProcessSurface",
    "GridPressure",
    "IdealLimitSurface",
    "InputError",
    "LimitSurface",
    "Noise",
    "OnlineEstimate",
    "OnlineIdentifier",
    "PlanOptions",
    "PlanResult",
    "PlanWarning",
    "PlanningProblem",
    "PlausibilityWarning",
    "Poke",
    "PolynomialLimitSurface",
    "ProbabilityMap",
    "Push",
    "PushAnswer",
    "PushContact",
    "PushLog",
    "PushTrace",
    "Pusher",
    "RankedContact",
    "RegionPlan",
    "Rig",
    "Slide",
    "Slider",
    "SolverError",
    "StabilityOracle",
    "StableRegion",
    "StablepushError",
    "StablepushWarning",
    "SupportDistribution",
    "TableFriction",
    "Trajectory",
    "Transfer",
    "UnavailableError",
    "UnsupportedContactError",
    "VirtualRig",
    "WorstPressure",
    "WrenchCone",
    "all_pressure_region",
    "certified_share",
    "certify",
    "chance_region",
    "check_plan",
    "compare_regions",
    "contact_push",
    "cross_validate",
    "diagnose",
    "eigen_directions",
    "ellipsoid_from_pressure",
    "execute_batch",
    "execute_closed_loop",
    "execute_plan",
    "fit_limit_surface",
    "fit_pressure_grid",
    "least_probability",
    "load_contact",
    "load_model",
    "load_movingai_map",
    "load_plan",
    "load_rosbag",
    "load_scene",
    "load_slider",
    "load_trajectory",
    "lynch_mason_region",
    "monomial_exponents",
    "parse_effect",
    "plan",
    "plan_commands",
    "planner_names",
    "poke",
    "poke_candidates",
    "poke_outcome",
    "probability_map",
    "push_twist",
    "random_pushes",
    "rank_contacts",
    "rank_pokes",
    "read_commands",
    "read_pushlog",
    "run_parallel",
    "sample_plan",
    "save_model",
    "save_plan",
    "save_rosbag",
    "save_scene",
    "save_trajectory",
    "simulate_free_sliding",
    "simulate_push",
    "sliding_basins",
    "stable_region",
    "worst_pressure",
    "write_pushlog",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'stablepush' has no attribute {name!r}")
    value = getattr(import_module(f"stablepush.{_HOME_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*globals(), *_HOME_OF]
