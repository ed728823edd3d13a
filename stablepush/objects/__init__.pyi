from .contact import PushContact as PushContact
from .edge_push import EdgePush as EdgePush
from .slider import Slider as Slider, check_simple_polygon as check_simple_polygon
from .support import SupportDistribution as SupportDistribution
from .wrench_cone import WrenchCone as WrenchCone
