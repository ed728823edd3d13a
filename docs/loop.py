"""Draw ``loop.gif``, the picture of the README: pokes, map, plan, an execution that fails, diagnosis, corrected plan.

Run: python docs/loop.py [-o docs/loop.gif]
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import numpy as np
from matplotlib import animation, pyplot as plt
from matplotlib.patches import Polygon

import stablepush as sp
from stablepush.demo import CONTACT_FRICTION, demo_log, demo_pokes, demo_scene, demo_slider
from stablepush.geometry import transform_points

#: Pictures in a second, and of the parts that move.
RATE, MOVING = 8, 22
OBJECT, PUSHER, WALL, GOOD, BAD = "#0072B2", "#D55E00", "#4D4D4D", "#009E73", "#CC3311"


def track(done: sp.Execution) -> tuple[np.ndarray, np.ndarray]:
    """Poses (n, 3) of slider and pusher, evenly spread over the pushes."""
    slider, pusher = (np.concatenate([getattr(trace, name) for trace in done.traces]) for name in ("poses", "pushers"))
    chosen = np.linspace(0, len(slider) - 1, MOVING).round().astype(int)
    return slider[chosen], pusher[chosen]


class Film:
    """Scenes, each of which draws one picture after the other."""

    def __init__(self) -> None:
        warnings.simplefilter("ignore")
        self.pokes = demo_pokes()
        fit = sp.fit_limit_surface(self.pokes.pairs(), slider=demo_slider())
        self.problem = demo_scene(fit.surface)
        self.plan = sp.plan(self.problem)
        self.first = demo_log(self.problem, self.plan)
        self.report = sp.diagnose(self.first.log)
        self.corrected = sp.correct(self.problem, self.report)
        self.again = sp.plan(self.corrected)
        self.second = demo_log(self.corrected, self.again, seed=1)
        self.region = sp.stable_region(fit.surface, self.problem.contacts[0])

    def scenes(self, axes: Any) -> Iterator[None]:
        yield from self.poked(axes)
        yield from self.mapped(axes)
        stated = f"success {self.plan.success_probability:.2f}"
        yield from self.moved(axes, self.plan, f"2  Plan: a path of stable pushes, {stated}", None)
        # from the goal, as the report of the demo has it
        off = 1000 * np.linalg.norm((self.first.final_pose - self.problem.goal)[:2])
        yield from self.moved(axes, self.plan, f"3  Execute with slippery fingers: {off:.0f} mm off", self.first, BAD)
        yield from self.told(axes)
        off = 1000 * np.linalg.norm((self.second.final_pose - self.problem.goal)[:2])
        yield from self.moved(axes, self.again, f"5  Plan again on what was found: {off:.1f} mm off", self.second, GOOD)

    def poked(self, axes: Any) -> Iterator[None]:
        pairs, points = self.pokes.pairs(), self.pokes.columns("c1x", "c1y")
        points = points[np.isfinite(points).all(axis=1)][::5]
        for k in range(4, len(pairs.wrenches) + 1, 4):
            self.clear(axes, "1  Poke: how does it slide?", (-0.2, 0.2), (-0.13, 0.17))
            axes.add_patch(Polygon(self.problem.slider.vertices, facecolor=OBJECT, alpha=0.35))
            force = pairs.wrenches[:k, :2] / np.linalg.norm(pairs.wrenches[:k, :2], axis=1, keepdims=True)
            axes.quiver(*(points[:k] - 0.035 * force).T, *force.T, color=PUSHER, scale=12, width=0.004)
            yield None

    def mapped(self, axes: Any) -> Iterator[None]:
        for _ in range(7):
            self.clear(axes, "1  Which rotation centres keep it stuck to two fingers?", (-0.55, 0.55), (-0.36, 0.47))
            axes.add_patch(Polygon(self.problem.slider.vertices, facecolor=OBJECT, alpha=0.35))
            for sense, color in ((1, OBJECT), (-1, "#E69F00")):
                for part in self.region.polygons(sense, 0.6):
                    axes.add_patch(Polygon(np.array(part.exterior.coords), facecolor=color, alpha=0.55))
            axes.plot(*self.problem.contacts[0].points.T, "o", color=PUSHER, markersize=5)
            yield None

    def moved(
        self, axes: Any, result: sp.PlanResult, words: str, done: sp.Execution | None, color: str = OBJECT
    ) -> Iterator[None]:
        if done is None:
            samples = sp.sample_plan(self.problem, result, rate=20)
            keep = np.linspace(0, len(samples.slider) - 1, MOVING).round().astype(int)
            bodies, pushers = samples.slider[keep], samples.pusher[keep]
        else:
            bodies, pushers = track(done)
        ends = [np.array(push.end) for push in result.pushes]
        for k in range(MOVING + 6):
            self.clear(axes, words, (0.0, 1.5), (0.0, 1.0))
            for wall in self.problem.obstacles:
                axes.add_patch(Polygon(wall, facecolor=WALL))
            axes.plot(*np.array([self.problem.start[:2], *(end[:2] for end in ends)]).T, color="0.75", linewidth=1.5)
            for pose, style in ((self.problem.goal, ":"), (self.problem.start, "--")):
                outline = transform_points(pose, self.problem.slider.vertices)
                axes.add_patch(Polygon(outline, fill=False, linestyle=style, edgecolor="0.4"))
            at = min(k, MOVING - 1)
            axes.add_patch(Polygon(transform_points(bodies[at], self.problem.slider.vertices), facecolor=color, alpha=0.7))
            for outline in self.problem.pusher_outlines(self.problem.contacts[0]):
                axes.add_patch(Polygon(transform_points(pushers[at], outline), facecolor=PUSHER))
            yield None

    def told(self, axes: Any) -> Iterator[None]:
        entry = self.report.ranking[0]
        found = entry.parameters["mu"]
        low, high = found.ci95
        lines = (
            f"named: {', '.join(self.report.named)}",
            f"{found.estimate:.2f} ({low:.2f} to {high:.2f}) where the scene has {CONTACT_FRICTION}",
            f"probability {entry.probability:.2f}",
        )
        for _ in range(14):
            self.clear(axes, "4  Diagnose: what is different on the robot?", (0.0, 1.5), (0.0, 1.0))
            for row, line in enumerate(lines):
                axes.text(0.12, 0.62 - 0.14 * row, line, fontsize=13, color=WALL)
            yield None

    def clear(self, axes: Any, words: str, x: tuple[float, float], y: tuple[float, float]) -> None:
        axes.clear()
        axes.set_aspect("equal")
        axes.set_xlim(*x)
        axes.set_ylim(*y)
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title(words, loc="left", fontsize=12)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).with_name("loop.gif"))
    options = parser.parse_args()
    film = Film()
    figure, axes = plt.subplots(figsize=(6.0, 4.4), layout="constrained")
    writer = animation.PillowWriter(fps=RATE)
    with writer.saving(figure, str(options.output), dpi=90):
        for _ in film.scenes(axes):
            writer.grab_frame()


if __name__ == "__main__":
    main()
