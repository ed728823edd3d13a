"""A slider on feet, fingers and obstacles as an MJCF model, with a motion of the fingers as keyframes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from stablepush.engines.executor import FOOT, GRAVITY, HALF, HEIGHT, IN_FEET, Fingers, SliderOnFeet

#: Step (s) of the simulation.
STEP = 5e-4
#: What the contacts of feet, of fingers and of the table are, so that forces are those of Coulomb's law.
OPTION = f'timestep="{STEP}" cone="elliptic" impratio="1000" solver="Newton" tolerance="1e-12" iterations="50"'
#: Contacts of feet: with a time constant of 1 ms instead of 10 the forces of the fingers chatter, and the slider creeps along
#: them by half a millimetre a second.
FEET = 'solref="0.01 1" solimp="0.99 0.999 0.0001"'
#: Contacts of fingers: they give a little, or they would bounce.
FINGERS = 'solref="0.003 1" solimp="0.3 0.3 0.001"'
#: Feet meet the table, not each other; fingers meet slider and obstacles.
GROUND, TABLE, BOX = 'contype="1" conaffinity="0"', 'contype="0" conaffinity="1"', 'contype="2" conaffinity="2"'
#: Mass (kg) of a finger that is driven, natural frequency (rad/s) of its servo, which is critically damped.
_DRIVEN, _SERVO = 5.0, 300.0
_JOINTS = ("x", "y", "theta")


@dataclass(frozen=True, eq=False)
class Motion:
    """Times ``t`` (n,) in s, poses in W of ``slider`` and ``pusher`` (n, 3), ``velocity`` (n, 3) of the pusher in W."""

    t: np.ndarray
    slider: np.ndarray
    pusher: np.ndarray
    velocity: np.ndarray


def mjcf(slider: SliderOnFeet, fingers: Fingers, obstacles: Sequence[np.ndarray], motion: Motion) -> str:
    """Return a model that needs nothing else.

    Joints ``slider_x, slider_y, slider_theta, pusher_x, …`` hold the poses in W (m, rad). The pusher is driven by six actuators,
    ``pusher_x, …`` (position servos) and ``pusher_vx, …`` (velocity servos). Each row of the motion is a keyframe with its time,
    the poses as planned, and the controls; the first is the start.
    """
    if slider.grain[0] != 1.0:
        raise ValueError("slider.grain: a model in world axes has one coefficient of friction")
    mass = _DRIVEN * len(fingers.centers)
    spread = float(_DRIVEN * (0.4 * fingers.radius**2 + (fingers.centers**2).sum(axis=1)).sum())
    drives = ""
    for joint, inertia in zip(_JOINTS, (mass, mass, spread), strict=True):
        drives += f'<position name="pusher_{joint}" joint="pusher_{joint}" kp="{inertia * _SERVO**2}"/>'
    for joint, inertia in zip(_JOINTS, (mass, mass, spread), strict=True):
        drives += f'<velocity name="pusher_v{joint}" joint="pusher_{joint}" kv="{2 * inertia * _SERVO}"/>'
    tips = "".join(
        f'<geom name="finger{k}" type="sphere" size="{fingers.radius}" pos="{x} {y} 0" mass="{_DRIVEN}" '
        f'friction="{fingers.friction}" priority="1" {BOX} {FINGERS}/>'
        for k, (x, y) in enumerate(fingers.centers)
    )
    pieces = [part for obstacle in obstacles for part in convex_parts(obstacle)]
    meshes = "".join(f'<mesh name="obstacle{k}" vertex="{corners(part)}"/>' for k, part in enumerate(pieces))
    walls = "".join(f'<geom type="mesh" mesh="obstacle{k}" pos="0 0 {HEIGHT}" {BOX}/>' for k in range(len(pieces)))
    turned = (np.unwrap(motion.slider[:, 2]), np.unwrap(motion.pusher[:, 2]))
    keys = []
    for k, t in enumerate(motion.t):
        body, tool = (*motion.slider[k, :2], turned[0][k]), (*motion.pusher[k, :2], turned[1][k])
        places = _numbers((*body, *[0.0] * len(slider.feet), *tool))
        keys.append(f'<key time="{t:.9g}" qpos="{places}" ctrl="{_numbers((*tool, *motion.velocity[k]))}"/>')
    sx, sy = GRAVITY * np.asarray(slider.slope)
    parts = convex_parts(slider.outline)
    return f"""<mujoco model="stablepush">
<option {OPTION} integrator="implicitfast" gravity="{sx} {sy} -{GRAVITY}"/>
<asset>{solid_meshes(parts)}{meshes}</asset>
<default><geom condim="3"/></default>
<worldbody>
<geom name="table" type="plane" size="3 3 0.1" {GROUND}/>
{walls}
<body name="slider">{_planar("slider")}
{slider_parts(slider, parts)}</body>
<body name="pusher" pos="0 0 {HEIGHT}" gravcomp="1">{_planar("pusher")}{tips}</body>
</worldbody>
<actuator>{drives}</actuator>
<keyframe>
{chr(10).join(keys)}
</keyframe>
</mujoco>
"""


def slider_parts(slider: SliderOnFeet, parts: Sequence[np.ndarray]) -> str:
    """Return what is in the body of a slider besides its joints: mass, solids and feet.

    What is not in the feet sits at the origin of B, not at the middle of the mesh, and does not press on them.
    """
    feet = "".join(
        f'<body pos="{x} {y} 0"><joint type="slide" axis="0 0 1"/><geom name="foot{k}" type="sphere" size="{FOOT}" '
        f'pos="0 0 {FOOT}" mass="{share * IN_FEET * slider.mass}" friction="{slider.friction}" priority="1" {TABLE} {FEET}/>'
        "</body>"
        for k, ((x, y), share) in enumerate(zip(slider.feet, slider.shares, strict=True))
    )
    solids = "".join(f'<geom type="mesh" mesh="part{k}" pos="0 0 {HEIGHT}" {BOX} {FINGERS}/>' for k in range(len(parts)))
    inertia = f'<inertial pos="0 0 {HEIGHT}" mass="{(1 - IN_FEET) * slider.mass}" diaginertia="1e-5 1e-5 1e-5"/>'
    return f"{inertia}\n{solids}{feet}"


def solid_meshes(parts: Sequence[np.ndarray]) -> str:
    """Return the meshes that :func:`slider_parts` refers to."""
    return "".join(f'<mesh name="part{k}" vertex="{corners(part)}"/>' for k, part in enumerate(parts))


def corners(outline: np.ndarray) -> str:
    """Return the vertices of a prism over an outline (n, 2)."""
    return " ".join(f"{x} {y} {z}" for z in (-HALF, HALF) for x, y in outline)


def convex_parts(outline: np.ndarray) -> list[np.ndarray]:
    """Return convex parts of an outline (n, 2), for MuJoCo takes a mesh for its hull: triangles, if it is not convex itself."""
    whole = shapely.Polygon(outline)
    if whole.convex_hull.area - whole.area < 1e-9 * whole.area:
        return [np.asarray(outline)]
    return [
        shapely.get_coordinates(triangle.exterior)[:-1]
        for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(whole))
    ]


def _planar(name: str) -> str:
    axes = (("slide", "1 0 0"), ("slide", "0 1 0"), ("hinge", "0 0 1"))
    return "".join(
        f'<joint name="{name}_{joint}" type="{kind}" axis="{axis}"/>' for joint, (kind, axis) in zip(_JOINTS, axes, strict=True)
    )


def _numbers(values: Sequence[float]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
