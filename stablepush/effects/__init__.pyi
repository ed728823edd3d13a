from .catalogue import (
    CATALOGUE as CATALOGUE,
    FAMILIES as FAMILIES,
    FINGER_FRICTION as FINGER_FRICTION,
    FITTED as FITTED,
    OF_PRESSURE as OF_PRESSURE,
    PRESSURE_SHIFT as PRESSURE_SHIFT,
)
from .effect import Effect as Effect, parse_effect as parse_effect
from .identified import KnownEffect as KnownEffect, effects_from_node as effects_from_node
from .kind import (
    FASTEST as FASTEST,
    PLACE as PLACE,
    REFERENCE_SPEED as REFERENCE_SPEED,
    SLOWEST as SLOWEST,
    EffectKind as EffectKind,
    Family as Family,
    LogRows as LogRows,
    Parameter as Parameter,
    PushSetup as PushSetup,
    RigBounds as RigBounds,
    TouchingRows as TouchingRows,
    in_order as in_order,
)
from .kinds.anisotropy import friction_over_direction as friction_over_direction, principal as principal
from .kinds.contact_friction import friction_change as friction_change
from .kinds.drift import friction_over_log as friction_over_log
from .kinds.spatial_variation import friction_over_place as friction_over_place
from .kinds.speed_dependence import friction_over_speed as friction_over_speed
from .kinds.tilt import slope_over_place as slope_over_place
from .lab import LAB_REMEDY as LAB_REMEDY, LabEffect as LabEffect, applicable as applicable, lab_effects as lab_effects
from .table import CREEP as CREEP, resting_share as resting_share, table_friction as table_friction, with_effects as with_effects
