from .pushing import (
    MotionProfile as MotionProfile,
    PushAnswer as PushAnswer,
    Pusher as Pusher,
    PushTrace as PushTrace,
    TableFriction as TableFriction,
    final_poses as final_poses,
    motion_profile as motion_profile,
    push_twist as push_twist,
    rollout as rollout,
    simulate_push as simulate_push,
)
from .sliding import Slide as Slide, simulate_free_sliding as simulate_free_sliding
from .sliding_directions import (
    EigenDirections as EigenDirections,
    eigen_directions as eigen_directions,
    sliding_basins as sliding_basins,
)
