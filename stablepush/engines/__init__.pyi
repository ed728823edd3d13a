from .executor import (
    Execution as Execution,
    Executor as Executor,
    Fingers as Fingers,
    SliderOnFeet as SliderOnFeet,
    executor as executor,
)
from .walls import walls as walls
