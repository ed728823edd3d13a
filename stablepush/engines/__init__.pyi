from .executor import (
    GRAVITY as GRAVITY,
    Execution as Execution,
    Executor as Executor,
    Fingers as Fingers,
    SliderOnFeet as SliderOnFeet,
    executor as executor,
)
from .mjcf import Motion as Motion, mjcf as mjcf
from .sdf import sdf as sdf
from .walls import walls as walls
