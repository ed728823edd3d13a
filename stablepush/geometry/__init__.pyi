from .outlines import contacts_on_outline as contacts_on_outline, nearest_on_outline as nearest_on_outline
from .planar import (
    angle_between as angle_between,
    cor_from_twist as cor_from_twist,
    normalize_twist as normalize_twist,
    normalize_wrench as normalize_wrench,
    point_velocity as point_velocity,
    transport_twist as transport_twist,
    twist_from_cor as twist_from_cor,
    unit as unit,
    wrench_from_force as wrench_from_force,
)
from .se2 import (
    compose as compose,
    exp as exp,
    inverse as inverse,
    log as log,
    rotate_vectors as rotate_vectors,
    transform_points as transform_points,
    wrap_angle as wrap_angle,
)
