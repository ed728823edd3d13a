from .arcs import arcs_hold as arcs_hold
from .friction import share_at_place as share_at_place, share_at_speed as share_at_speed
