"""Is the exact sweep right? Random pushes among random polygons against poses sampled densely along them.

Sliders and obstacles are random outlines, convex or not. A push that the sweep calls free, although a sampled pose overlaps,
is an error; one that it refuses, although all samples are free, must touch between two samples, and is sampled more densely
about the place where it comes nearest.

    python examples/planning/sweeps.py [--pushes 10000] [--samples 10000] [--seed 0]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import shapely
from tqdm import tqdm

import stablepush as sp
from stablepush.geometry.se2 import compose, exp, transform_points
from stablepush.planning.collision import OVERLAP, SweptBody

PUSHES_A_SCENE = 100


def star(rng: np.random.Generator, corners: int, radius: float) -> np.ndarray:
    """A random outline round the origin."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, size=corners))
    return (radius * rng.uniform(0.3, 1, size=corners))[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))


def scene(rng: np.random.Generator) -> sp.PlanningProblem:
    """A random slider among random obstacles."""
    while True:
        try:
            obstacles = [star(rng, int(rng.integers(3, 9)), 0.2) + rng.uniform(-1, 1, 2) for _ in range(rng.integers(1, 15))]
            slider = sp.Slider(star(rng, int(rng.integers(3, 9)), 0.15))
            surface = sp.IdealLimitSurface(sp.SupportDistribution.ring(0.05, 8), 1.0)
            contact = sp.PushContact([(0, 0.01), (0, -0.01)], [1, 0], 0.5)
            return sp.PlanningProblem(slider, surface, [contact], (0, 0, 0), (1, 0, 0), obstacles, (-1.3, -1.3, 1.3, 1.3))
        except sp.InputError:
            continue


def clearance(problem: sp.PlanningProblem, pose: np.ndarray) -> float:
    """Least distance (m) of the slider from obstacles and bounds; negative by how far it is out of bounds."""
    placed = transform_points(pose, problem.slider.vertices)
    blocked = shapely.union_all([shapely.Polygon(o) for o in problem.obstacles])
    assert problem.bounds is not None
    inside = float(min((placed - problem.bounds[:2]).min(), (problem.bounds[2:] - placed).min()))
    return min(float(shapely.distance(shapely.Polygon(placed), blocked)), inside)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pushes", type=int, default=10_000)
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    times = np.linspace(0, 1, options.samples)[:, None]
    asked = free = pose_errors = refused = unexplained = 0
    taken = 0.0
    nearest = []
    with tqdm(total=options.pushes, disable=None, leave=False) as bar:
        while asked < options.pushes:
            problem = scene(rng)
            body = SweptBody(problem)
            poses = np.column_stack((rng.uniform(-1, 1, (4 * PUSHES_A_SCENE, 2)), rng.uniform(-np.pi, np.pi, 4 * PUSHES_A_SCENE)))
            poses = poses[body.free(poses)][:PUSHES_A_SCENE]
            twists = rng.normal(size=(len(poses), 3)) * (0.2, 0.2, 2.0)
            twists[::5, 2] = 0.0
            body.pushes_are_free(poses[:1], twists[:1], 1.0)
            started = time.perf_counter()
            found = body.pushes_are_free(poses, twists, np.ones(len(poses)))
            taken += time.perf_counter() - started
            for pose, twist, good in zip(poses, twists, found, strict=True):
                dense = bool(body.free(compose(pose, exp(twist * times))).all())
                asked, free = asked + 1, free + int(good)
                pose_errors += int(good and not dense)
                if dense and not good:
                    refused += 1
                    path = compose(pose, exp(twist * times[:: options.samples // 1000]))
                    clearances = np.array([clearance(problem, p) for p in path])
                    k = int(np.argmin(clearances))
                    fine = np.linspace(max(0, k - 1), min(len(path) - 1, k + 1), 2001)[:, None] / (len(path) - 1)
                    least = min(clearance(problem, p) for p in compose(pose, exp(twist * fine)))
                    nearest.append(least)
                    # a touch of no more than the overlap that is allowed, and the rounding of the samples
                    unexplained += int(least > 2 * OVERLAP)
                bar.update()
    print(f"{asked} pushes, {free} free: {pose_errors} free by the sweep but not by {options.samples} poses along them")
    print(f"{refused} refused by the sweep but free at all poses: nearest approach {max(nearest, default=0):.1e} m,")
    print(f"{unexplained} of them farther than the overlap that is allowed")
    print(f"time a push: {1e6 * taken / asked:.1f} µs")


if __name__ == "__main__":
    main()
