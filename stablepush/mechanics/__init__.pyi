from .pushing import (
    Course as Course,
    PushAnswer as PushAnswer,
    Pusher as Pusher,
    PushTrace as PushTrace,
    TableFriction as TableFriction,
    course_of as course_of,
    follow as follow,
    push_twist as push_twist,
    simulate_push as simulate_push,
)
from .sliding import Slide as Slide, simulate_free_sliding as simulate_free_sliding
from .sliding_directions import (
    EigenDirections as EigenDirections,
    eigen_directions as eigen_directions,
    sliding_basins as sliding_basins,
)
