from .arcs import arcs_are_stable as arcs_are_stable
from .friction import (
    joint_anisotropy as joint_anisotropy,
    share_at_place as share_at_place,
    share_at_speed as share_at_speed,
)
