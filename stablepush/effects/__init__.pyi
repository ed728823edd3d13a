from .catalogue import (
    CATALOGUE as CATALOGUE,
    REFERENCE_SPEED as REFERENCE_SPEED,
    Effect as Effect,
    EffectKind as EffectKind,
    Parameter as Parameter,
    parse_effect as parse_effect,
    principal as principal,
)
from .families import (
    FAMILIES as FAMILIES,
    FASTEST as FASTEST,
    PLACE as PLACE,
    SLOWEST as SLOWEST,
    Family as Family,
    friction_over_direction as friction_over_direction,
    friction_over_log as friction_over_log,
    friction_over_place as friction_over_place,
    friction_over_speed as friction_over_speed,
    slope_over_place as slope_over_place,
)
from .known import KnownEffect as KnownEffect, effects_from_node as effects_from_node
from .lab import (
    LAB_REMEDY as LAB_REMEDY,
    LabEffect as LabEffect,
    LogRows as LogRows,
    applicable as applicable,
    lab_effects as lab_effects,
)
from .table import CREEP as CREEP, resting_share as resting_share, table_friction as table_friction
