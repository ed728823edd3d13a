from .h_inv import load_on_surface as load_on_surface
from .support_points import (
    AT_REST as AT_REST,
    load_of_points as load_of_points,
    loads_side_by_side as loads_side_by_side,
    sum_loads as sum_loads,
    sum_loads_of_many as sum_loads_of_many,
)
