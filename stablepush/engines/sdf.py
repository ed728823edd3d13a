"""A slider on feet, fingers and obstacles as an SDFormat world for Drake."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stablepush.engines.executor import FOOT, HALF, HEIGHT, IN_FEET, Fingers, SliderOnFeet
from stablepush.engines.walls import walls

#: Stiffness (N/m) and relaxation time (s) of contacts, thickness (m) of walls.
STIFF, RELAXATION, WALL = 2e5, 2e-3, 1e-3
#: How far the table reaches beyond everything on it, and its thickness (m).
_BEYOND, _THICK = 1000.0, 1.0
#: Mass (kg) of a finger that is driven and of what carries its joints, natural frequency (rad/s) of its critically damped servo.
_DRIVEN, _CARRIER, _SERVO = 5.0, 0.01, 300.0


def sdf(slider: SliderOnFeet, fingers: Fingers, obstacles: Sequence[np.ndarray], start: np.ndarray, pusher: np.ndarray) -> str:
    """Return a world with the models ``table``, ``slider``, ``pusher`` and ``obstacles``.

    ``start``, ``pusher`` (3,): poses in W of slider and pusher where they begin; the joints are zero there. ``slider`` hangs on a
    planar joint. ``pusher`` is driven along ``pusher_x, pusher_y, pusher_theta``, which have gains of position servos.
    """
    if slider.grain[0] != 1.0 or np.any(slider.slope):
        raise ValueError("slider: expected a level table with one coefficient of friction")
    table, skin = _material(slider.friction), _material(fingers.friction)
    # no plane: Drake keeps a static model's shapes with the moving ones, where a half-space, which has no bounds, crashes it
    there = np.concatenate((start[None, :2], pusher[None, :2], *obstacles))
    width = 2 * (float(np.abs(there).max()) + _BEYOND)
    floor = _collision("floor", f"0 0 {-_THICK / 2} 0 0 0", f"<box><size>{width} {width} {_THICK}</size></box>", table)
    sides = "".join(
        _collision(f"side{k}", f"{x} {y} 0 0 0 {angle}", f"<box><size>{length} {WALL} {2 * HALF}</size></box>", skin)
        for k, ((x, y), angle, length) in enumerate(walls(slider.outline, WALL))
    )
    feet = "".join(
        f'<link name="foot{k}"><pose relative_to="slider">{x} {y} {FOOT - HEIGHT} 0 0 0</pose>'
        f"{_inertia(share * IN_FEET * slider.mass, 1e-9)}"
        f"{_collision(f'ball{k}', '0 0 0 0 0 0', f'<sphere><radius>{FOOT}</radius></sphere>', table)}</link>"
        f"{_joint(f'slide{k}', 'prismatic', 'slider', f'foot{k}', '0 0 1', effort=0.0)}"
        for k, ((x, y), share) in enumerate(zip(slider.feet, slider.shares, strict=True))
    )
    mass = _DRIVEN * len(fingers.centers)
    spread = float(_DRIVEN * (0.4 * fingers.radius**2 + (fingers.centers**2).sum(axis=1)).sum())
    tips = "".join(
        _collision(f"finger{k}", f"{x} {y} 0 0 0 0", f"<sphere><radius>{fingers.radius}</radius></sphere>", skin)
        for k, (x, y) in enumerate(fingers.centers)
    )
    stops = "".join(
        _collision(
            f"stop{number}_{k}", f"{x} {y} {HEIGHT} 0 0 {angle}", f"<box><size>{length} {WALL} {2 * HALF}</size></box>", skin
        )
        for number, outline in enumerate(obstacles)
        for k, ((x, y), angle, length) in enumerate(walls(outline, WALL))
    )
    standing = "" if not stops else f'<model name="obstacles"><static>true</static><link name="stops">{stops}</link></model>'
    return f"""<sdf version="1.9" xmlns:drake="drake.mit.edu">
<world name="stablepush">
<model name="table"><static>true</static><link name="table">{floor}</link></model>
<model name="slider">
<link name="slider"><pose>{_pose(start)}</pose>{_inertia((1 - IN_FEET) * slider.mass, 1e-5)}{sides}</link>
{feet}
<link name="start"><pose>{_pose(start)}</pose>{_inertia(_CARRIER, 1e-5)}</link>
<joint name="start_fixed" type="fixed"><parent>world</parent><child>start</child></joint>
<drake:joint name="slider_planar" type="planar"><drake:parent>start</drake:parent><drake:child>slider</drake:child>
<drake:damping>0 0 0</drake:damping></drake:joint>
</model>
<model name="pusher">
<link name="carrier_x"><pose>{_pose(pusher)}</pose>{_inertia(_CARRIER, 1e-5)}</link>
<link name="carrier_y"><pose>{_pose(pusher)}</pose>{_inertia(_CARRIER, 1e-5)}</link>
<link name="tool"><pose>{_pose(pusher)}</pose>{_inertia(mass, spread)}{tips}</link>
{_joint("pusher_x", "prismatic", "world", "carrier_x", "1 0 0", mass)}
{_joint("pusher_y", "prismatic", "carrier_x", "carrier_y", "0 1 0", mass)}
{_joint("pusher_theta", "revolute", "carrier_y", "tool", "0 0 1", spread)}
</model>
{standing}
</world>
</sdf>
"""


def _pose(pose: np.ndarray) -> str:
    return f"{pose[0]:.12g} {pose[1]:.12g} {HEIGHT} 0 0 {pose[2]:.12g}"


def _material(mu: float) -> str:
    return (
        f"<drake:proximity_properties><drake:mu_dynamic>{mu}</drake:mu_dynamic><drake:mu_static>{mu}</drake:mu_static>"
        f"<drake:point_contact_stiffness>{STIFF}</drake:point_contact_stiffness>"
        f"<drake:relaxation_time>{RELAXATION}</drake:relaxation_time></drake:proximity_properties>"
    )


def _collision(name: str, pose: str, shape: str, material: str) -> str:
    return f'<collision name="{name}"><pose>{pose}</pose><geometry>{shape}</geometry>{material}</collision>\n'


def _inertia(mass: float, turning: float) -> str:
    moments = f"<ixx>{turning}</ixx><iyy>{turning}</iyy><izz>{turning}</izz>"
    return f"<inertial><mass>{mass}</mass><inertia>{moments}</inertia></inertial>"


def _joint(name: str, kind: str, parent: str, child: str, axis: str, inertia: float = 0.0, effort: float | None = None) -> str:
    """A joint along an axis of W; driven by a servo for ``inertia``, unless its ``effort`` is zero."""
    limit = "" if effort is None else f"<limit><effort>{effort}</effort></limit>"
    gains = f'<drake:controller_gains p="{inertia * _SERVO**2}" d="{2 * inertia * _SERVO}"/>' if effort is None else ""
    turned = f'<xyz expressed_in="__model__">{axis}</xyz>' if effort is None else f"<xyz>{axis}</xyz>"
    return (
        f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>'
        f"<axis>{turned}{limit}</axis>{gains}</joint>"
    )
