from .sweep import (
    Body as Body,
    World as World,
    edges_near as edges_near,
    line_is_free as line_is_free,
    pose_is_free as pose_is_free,
    push_is_free as push_is_free,
    room_at as room_at,
)
