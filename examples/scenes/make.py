"""Write the scenes of this folder: a triangle on a table, pushed with two fingers, among obstacles of all kinds.

The limit surface is identified from the built-in rig's simulated pokes. Everything is reproducible.

    python examples/scenes/make.py [-o examples/scenes]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import shapely

import stablepush as sp
from stablepush.demo import CONTACT_FRICTION, demo_pokes, demo_slider
from stablepush.geometry.se2 import transform_points
from stablepush.io.json_files import write_json
from stablepush.planning.problem import save_scene

PUSHER = ((-0.03, -0.035), (0.0, -0.035), (0.0, 0.035), (-0.03, 0.035))


def box(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    """Return a rectangle."""
    return np.array(((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


def scenes(surface: sp.LimitSurface) -> dict[str, sp.PlanningProblem]:
    """Return the problems by name."""
    slider = demo_slider()
    front, side, back = (
        sp.PushContact.on_edge(slider, e, c, 0.05, CONTACT_FRICTION) for e, c in ((0, 0.16 / 3), (2, 0.107), (1, 0.113))
    )
    quarter = np.pi / 2

    def problem(start, goal, obstacles, bounds, contacts=(front,), pusher=PUSHER, switch_cost=5.0) -> sp.PlanningProblem:
        return sp.PlanningProblem(
            slider, surface, contacts, start, goal, obstacles, bounds, pusher, (0.01, 0.05), 0.05, switch_cost, 0.03
        )

    return {
        "open": problem((0.2, 0.2, 0.0), (1.2, 0.3, 0.0), (), (0, 0, 1.5, 1)),
        "walls": problem(
            (0.18, 0.2, 0.0), (1.28, 0.3, -quarter), (box(0.48, 0, 0.56, 0.45), box(0.88, 0.55, 0.96, 1)), (0, 0, 1.5, 1)
        ),
        "maze": problem(
            (0.25, 0.25, 0.0),
            (2.7, 0.3, 2 * quarter),
            (
                box(0.55, 0, 0.6, 1.45),
                box(1.15, 0.55, 1.2, 2),
                box(1.75, 0, 1.8, 1.45),
                box(2.35, 0.55, 2.4, 2),
                box(0.6, 0.9, 0.8, 0.95),
                box(2.0, 1.0, 2.35, 1.05),
            ),
            (0, 0, 3, 2),
        ),
        "narrow": problem(
            (0.25, 0.25, quarter), (1.2, 0.75, 0.0), (box(0.7, 0, 0.8, 0.37), box(0.7, 0.6, 0.8, 1)), (0, 0, 1.5, 1)
        ),
        "parking": problem(
            (0.3, 0.75, -quarter), (1.1, 0.2, 2 * quarter), (box(0.8, 0, 0.97, 0.4), box(1.2, 0, 1.4, 0.4)), (0, 0, 1.6, 1.1)
        ),
        "bug-trap": problem(
            (0.75, 0.5, -quarter),
            (1.7, 0.5, -quarter),
            (box(1.1, 0.2, 1.15, 0.8), box(0.55, 0.2, 1.1, 0.25), box(0.55, 0.75, 1.1, 0.8)),
            (0, 0, 2, 1),
        ),
        # a hook that turns tighter than any turn of STABLE
        "tight-turn": problem(
            (0.2, 0.2, 0.0), (0.75, 0.25, 2 * quarter), (box(0.42, 0, 0.47, 0.72), box(0.95, 0, 1.0, 1.1)), (0, 0, 1.0, 1.1)
        ),
        "clutter": problem((0.2, 0.2, 0.0), (2.8, 1.8, 0.0), clutter(slider), (0, 0, 3, 2)),
        # too low to turn in: only another edge leads on
        "two-contacts": problem(
            (0.3, 0.2, 0.0), (1.6, 0.2, 0.0), (box(0, 0.36, 1.9, 0.6),), (0, 0, 1.9, 0.6), (front, side, back)
        ),
        # the centre of mass would pass the gap, the slider does not
        "unsolvable": problem(
            (0.25, 0.25, 0.0), (1.2, 0.5, 0.0), (box(0.7, 0, 0.8, 0.45), box(0.7, 0.55, 0.8, 1)), (0, 0, 1.5, 1)
        ),
    }


def clutter(slider: sp.Slider, count: int = 50) -> list[np.ndarray]:
    """Fifty random polygons, convex or not, that leave the start and the goal free."""
    rng = np.random.default_rng(4)
    keep = [shapely.Polygon(transform_points(pose, slider.vertices)).buffer(0.16) for pose in ((0.2, 0.2, 0.0), (2.8, 1.8, 0.0))]
    polygons: list[np.ndarray] = []
    while len(polygons) < count:
        corners = int(rng.integers(3, 8))
        angles = np.sort(rng.uniform(0, 2 * np.pi, size=corners))
        radii = rng.uniform(0.02, 0.07, size=corners)
        outline = rng.uniform((0, 0), (3, 2)) + radii[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
        shape = shapely.Polygon(outline)
        apart = all(shapely.distance(shape, shapely.Polygon(other)) > 0.15 for other in polygons)
        if shape.is_valid and shape.area > 4e-4 and apart and not any(shapely.intersects(shape, k) for k in keep):
            polygons.append(outline)
    return polygons


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent)
    options = parser.parse_args()
    loads, twists, _ = demo_pokes().pairs()
    surface = sp.fit_limit_surface(loads, twists, slider=demo_slider(), seed=0).surface
    options.output.mkdir(parents=True, exist_ok=True)
    sp.save_model(surface, options.output / "triangle.json")
    for name, problem in scenes(surface).items():
        path = options.output / f"{name}.json"
        save_scene(problem, path)
        document = json.loads(path.read_text(encoding="utf-8"))
        document["model"] = "triangle.json"
        write_json(path, document)


if __name__ == "__main__":
    main()
