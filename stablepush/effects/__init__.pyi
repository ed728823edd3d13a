from .catalogue import (
    CATALOGUE as CATALOGUE,
    REFERENCE_SPEED as REFERENCE_SPEED,
    Effect as Effect,
    EffectKind as EffectKind,
    parse_effect as parse_effect,
    principal as principal,
)
from .known import KnownEffect as KnownEffect, effects_from_node as effects_from_node
