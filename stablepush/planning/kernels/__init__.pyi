from .sweep import (
    Body as Body,
    World as World,
    clearance_at as clearance_at,
    edges_near as edges_near,
    line_is_free as line_is_free,
    pose_is_free as pose_is_free,
    push_is_free as push_is_free,
)
