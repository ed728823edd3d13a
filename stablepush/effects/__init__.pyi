from .catalogue import (
    CATALOGUE as CATALOGUE,
    REFERENCE_SPEED as REFERENCE_SPEED,
    Effect as Effect,
    EffectKind as EffectKind,
    Parameter as Parameter,
    parse_effect as parse_effect,
    principal as principal,
)
from .families import FAMILIES as FAMILIES, FASTEST as FASTEST, PLACE as PLACE, SLOWEST as SLOWEST, Family as Family
from .known import KnownEffect as KnownEffect, effects_from_node as effects_from_node
from .lab import LabEffect as LabEffect, LogRows as LogRows, lab_effects as lab_effects
