from .arcs import arcs_are_stable as arcs_are_stable
from .friction import friction_at as friction_at, joint_anisotropy as joint_anisotropy
