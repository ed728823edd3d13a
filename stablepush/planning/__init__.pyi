from .alignment import aligns as aligns
from .chance.scenarios import (
    Scenarios as Scenarios,
    alignment_push as alignment_push,
    draw_scenarios as draw_scenarios,
)
from .chance.success import estimate_success as estimate_success
from .check import CheckReport as CheckReport, check_plan as check_plan
from .clearance import Clearance as Clearance, clearance_of as clearance_of
from .collision import SweptBody as SweptBody, body_of as body_of, world_of as world_of
from .comparison import RegionPlan as RegionPlan, certified_share as certified_share, compare_regions as compare_regions
from .correct import correct as correct
from .correction import Correction as Correction, load_corrections as load_corrections, load_diagnosis as load_diagnosis
from .feasibility import infeasibility as infeasibility
from .keep_away import APART as APART, NO_ROOM as NO_ROOM
from .options import REGIONS as REGIONS, PlanOptions as PlanOptions, promised_region as promised_region
from .problem import (
    PlanningProblem as PlanningProblem,
    disc_outlines as disc_outlines,
    load_scene as load_scene,
    save_scene as save_scene,
    scene_to_json as scene_to_json,
)
from .pusher_loads import (
    PushLoads as PushLoads,
    loads_of as loads_of,
    push_margins as push_margins,
    require_loads as require_loads,
)
from .registry import plan as plan, planner_names as planner_names
from .relaxations import feasible_relaxations as feasible_relaxations
from .result import (
    PlanResult as PlanResult,
    PlanStatus as PlanStatus,
    Push as Push,
    Success as Success,
    Transfer as Transfer,
    load_plan as load_plan,
    save_plan as save_plan,
)
from .rosbag import load_rosbag as load_rosbag, save_rosbag as save_rosbag
from .trajectory import (
    PASSES as PASSES,
    PHASES as PHASES,
    Trajectory as Trajectory,
    finger_frame as finger_frame,
    load_trajectory as load_trajectory,
    pusher_in_transfer as pusher_in_transfer,
    sample_plan as sample_plan,
    save_trajectory as save_trajectory,
)
from .uncertainty import Uncertainty as Uncertainty
