"""Pushes by this library and by MuJoCo: final poses of random pushes with one and two fingers, straight and turning.

MuJoCo's slider stands on feet that each slide up and down on their own, so that the pressure is prescribed; friction has
elliptic cones; the fingers are heavy and keep their imposed motion. Needs the extra ``sim``.

    python examples/simulation/against_mujoco.py [--pushes 200] [--step 1e-4] [--jobs 2]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import stablepush as sp
from stablepush.core.parallel import run_parallel
from stablepush.geometry.planar import transport_twist, twist_from_cor
from stablepush.geometry.se2 import inverse, transform_points, wrap_angle

GRAVITY = 9.81


def random_push(seed: int) -> dict:
    """A rectangle on feet, a contact, and a motion of the pusher."""
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.03, 0.08, 2)
    outline = np.array(((-1, -1), (1, -1), (1, 1), (-1, 1))) * half
    feet = rng.uniform(-0.9, 0.9, (int(rng.integers(3, 9)), 2)) * half
    weights = rng.uniform(0.3, 1.0, len(feet))
    feet -= weights @ feet / weights.sum()
    inside = np.abs(feet).max(axis=0) / half
    feet /= max(1.0, float(inside.max()) / 0.95)
    mass, mu, contact_mu = rng.uniform(0.5, 1.5), rng.uniform(0.2, 0.4), rng.uniform(0.2, 0.8)
    two, turning = bool(seed % 2), bool(seed // 2 % 2)
    width = 0.5 * float(half[1]) if two else 0.0
    slider = sp.Slider(outline, mass=mass)
    contact = sp.PushContact.on_edge(slider, 3, float(half[1]) * rng.uniform(0.6, 1.4), width, contact_mu)
    pusher = sp.Pusher.of_contact(contact, 0.005)
    docked = pusher.docked(contact)
    speed = rng.uniform(0.005, 0.02)
    if turning:
        sense = rng.choice((-1.0, 1.0))
        twist = transport_twist(
            twist_from_cor((rng.uniform(-0.05, 0.05), sense * rng.uniform(0.06, 0.3)), sense), inverse(docked)
        )
    else:
        heading = rng.uniform(-0.4, 0.4)
        twist = np.array((np.cos(heading), np.sin(heading), 0.0))
    x, y = pusher.fingers.T
    twist = twist * (speed / float(np.hypot(twist[0] - twist[2] * y, twist[1] + twist[2] * x).max()))
    return {
        "slider": slider, "half": half, "feet": feet, "weights": weights / weights.sum(), "mu": mu, "contact_mu": contact_mu,
        "pusher": pusher, "docked": docked, "twist": twist, "time": 0.04 / speed,
    }  # fmt: skip


def by_mujoco(push: dict, step: float) -> np.ndarray:
    """Final pose of the slider."""
    import mujoco

    mass, (hx, hy) = push["slider"].mass, push["half"]
    px, py, angle = push["docked"]
    # feet touch the table only, fingers the box only
    on_table, on_box = 'contype="1" conaffinity="1"', 'contype="2" conaffinity="2"'
    planar = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
    under, at_finger = f'friction="{push["mu"]}"', f'friction="{push["contact_mu"]}"'
    feet = "".join(
        f'<body pos="{x} {y} 0"><joint type="slide" axis="0 0 1"/>'
        f'<geom type="sphere" size="0.002" pos="0 0 0.002" mass="{w * 0.98 * mass}" {on_table} {under}/></body>'
        for (x, y), w in zip(push["feet"], push["weights"], strict=True)
    )
    radius = push["pusher"].radius
    fingers = "".join(
        f'<geom type="sphere" size="{radius}" pos="{x} {y} 0" mass="500" {on_box} {at_finger}/>'
        for x, y in push["pusher"].fingers
    )
    box = f'<geom type="box" size="{hx} {hy} 0.01" pos="0 0 0.03" mass="{0.02 * mass}" {on_box} {at_finger}/>'
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><option timestep="{step}" cone="elliptic" impratio="10" solver="Newton" tolerance="1e-12" iterations="100"
      noslip_iterations="20" gravity="0 0 -{GRAVITY}"/>
    <default><geom condim="3" solref="{4 * step} 1" solimp="0.99 0.999 0.0001"/></default>
    <worldbody>
      <geom type="plane" size="2 2 0.1" {on_table} {under}/>
      <body>{planar}{box}{feet}</body>
      <body pos="0 0 0.03">{planar}{fingers}</body>
    </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    q, v = model.nq - 3, model.nv - 3
    data.qpos[q:] = px, py, angle
    vx, vy, omega = push["twist"]
    for _ in range(round(push["time"] / step)):
        c, s = np.cos(data.qpos[q + 2]), np.sin(data.qpos[q + 2])
        data.qvel[v:] = c * vx - s * vy, s * vx + c * vy, omega
        mujoco.mj_step(model, data)
    return np.array(data.qpos[:3])


def by_library(push: dict, step: float = 2.5e-4) -> tuple[np.ndarray, np.ndarray]:
    """Final poses of the slider and of the pusher."""
    support = sp.SupportDistribution(push["feet"], push["weights"])
    surface = sp.IdealLimitSurface(support, push["mu"] * push["slider"].mass * GRAVITY)
    motion = [(push["twist"], push["time"])]
    trace = sp.simulate_push(
        surface, push["slider"], push["pusher"], push["contact_mu"], (0, 0, 0), push["docked"], motion, step=step
    )
    return trace.poses[-1], trace.pushers[-1]


def both(seed: int, step: float) -> tuple[np.ndarray, np.ndarray, float, float]:
    push = random_push(seed)
    by_library(push)
    begin = time.perf_counter()
    ours, _ = by_library(push)
    middle = time.perf_counter()
    theirs = by_mujoco(push, step)
    return ours, theirs, middle - begin, time.perf_counter() - middle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pushes", type=int, default=200)
    parser.add_argument("--step", type=float, default=1e-4, help="of MuJoCo, in s")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    found = list(run_parallel(both, [(seed, options.step) for seed in range(options.pushes)], options.jobs))
    ours, theirs = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    route = np.hypot(*theirs[:, :2].T)
    off, turn = np.hypot(*(ours - theirs)[:, :2].T), np.abs(wrap_angle(ours[:, 2] - theirs[:, 2]))
    kinds = np.arange(options.pushes)
    print(f"{options.pushes} pushes of 40 mm at 5 to 20 mm/s, MuJoCo with steps of {options.step:g} s")
    share = 100 * off / np.maximum(route, 1e-3)
    for word, chosen in (
        ("all", kinds >= 0),
        ("one finger, straight", kinds % 4 == 0),
        ("two fingers, straight", kinds % 4 == 1),
        ("one finger, turning", kinds % 4 == 2),
        ("two fingers, turning", kinds % 4 == 3),
    ):
        if chosen.any():
            mm, deg, percent = 1000 * off[chosen], np.degrees(turn[chosen]), share[chosen]
            print(
                f"{word:<22s} median {np.median(mm):.3f} mm, {np.median(deg):.3f} deg, {np.median(percent):.2f} % of the path; "
                f"95 % {np.quantile(mm, 0.95):.3f} mm, {np.quantile(deg, 0.95):.3f} deg, {np.quantile(percent, 0.95):.2f} %"
            )
    library, mujoco = sum(f[2] for f in found), sum(f[3] for f in found)
    ours_ms, theirs_ms = 1000 * library / len(found), 1000 * mujoco / len(found)
    print(f"time for a push: {ours_ms:.2f} ms here, {theirs_ms:.0f} ms in MuJoCo, {mujoco / library:.0f} times")
    worst = np.argsort(-off)[:5]
    print("largest: " + ", ".join(f"push {i}: {1000 * off[i]:.2f} mm{margin(int(i))}" for i in worst))


def margin(seed: int) -> str:
    """How far the first motion of a push by two fingers is from the boundary of the stable set, in words: next to it a little
    decides whether a finger comes loose."""
    push = random_push(seed)
    pusher, docked = push["pusher"], push["docked"]
    if len(pusher.fingers) < 2:
        return ""
    points = transform_points(docked, pusher.fingers) + np.array((pusher.radius, 0.0))
    contact = sp.PushContact(points, ((1.0, 0.0), (1.0, 0.0)), push["contact_mu"])
    support = sp.SupportDistribution(push["feet"], push["weights"])
    oracle = sp.StabilityOracle(sp.IdealLimitSurface(support, 1.0), contact)
    return f" (margin {np.degrees(oracle.margin(transport_twist(push['twist'], docked)[None])[0]):.2f} deg)"


if __name__ == "__main__":
    main()
