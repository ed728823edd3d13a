"""All benchmarks in one run: each task beside what one would otherwise use, as it grows, with the memory that it takes.

    python benchmarks/table.py [-o docs/benchmarks] [--only fit region ...] [--before OLD_CHECKOUT]

One thread, compiled code warmed up first. Writes ``table.md`` and ``growth.svg`` into the folder, and prints the table. Times are
medians (single runs of what takes longer than two seconds); memory is the peak of what Python and numpy allocate in a second run,
without what solvers and compiled code take for themselves. ``--before``: a clone of an older version, in which the same tasks
run in turn with this one's, section by section; ``before.md`` has both times and their ratio.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OMP_NUM_THREADS", "1")

import fit as fit_benchmark
import h_inv
import numpy as np
import planning_growth
import region as region_benchmark
import shapely
from scipy.optimize import least_squares

import stablepush as sp
from stablepush.demo import demo_pokes
from stablepush.geometry.planar import twist_from_cor, unit
from stablepush.stability.probability import probability_map

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "simulation"))

EXTENT = 0.4
SCENES = Path(__file__).parents[1] / "examples" / "scenes"
Task = Callable[[], object]
#: The label of a planner that found no path within its time limit.
NO_PATH = " (no path found)"
#: Whether only this package is timed, and not what one would otherwise use.
ALONE = "--alone" in sys.argv


@dataclass(frozen=True)
class Row:
    """A task at a size: seconds and bytes of ours and of the other."""

    task: str
    size: str
    count: float
    ours: float
    memory: int
    other: str
    theirs: float
    other_memory: int


def seconds(task: Task) -> float:
    """The median wall time; of one run if that takes long."""
    times: list[float] = []
    while len(times) < 5 and sum(times) < 2.0:
        began = time.perf_counter()
        task()
        times.append(time.perf_counter() - began)
    return float(np.median(times))


def peak(task: Task) -> int:
    tracemalloc.start()
    task()
    found = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return found


def beside(task: str, size: str, count: float, ours: Task, other: str, theirs: Task, share: float = 1.0) -> Row:
    """Time a task and the other, of which only a ``share`` is done."""
    ours()
    if ALONE:
        return Row(task, size, count, seconds(ours), 0, other, 0.0, 0)
    answer = theirs()
    if isinstance(answer, sp.PlanResult) and not answer.solved:
        other += NO_PATH
    # memory of a part says nothing of the whole
    held = peak(theirs) if share == 1.0 else 0
    return Row(task, size, count, seconds(ours), peak(ours), other, seconds(theirs) / share, held)


def rig() -> tuple[sp.Slider, sp.PushContact, sp.PolynomialLimitSurface]:
    log = demo_pokes()
    surface = sp.fit_limit_surface(*log.pairs()[:2], slider=log.rig.slider).surface
    assert isinstance(surface, sp.PolynomialLimitSurface)
    return log.rig.slider, sp.PushContact.on_edge(log.rig.slider, 0, 0.16 / 3, 0.05, 0.9), surface


def inversion() -> Iterator[Row]:
    _, _, surface = rig()
    for count in (1000, 30_000, 1_000_000):
        directions = unit(np.random.default_rng(0).normal(size=(count, 3)))
        part = directions[:30_000]
        twists = directions / (1, 1, surface.characteristic_length)
        yield beside(
            "wrench of a motion (H_inv)", f"{count} motions", count, lambda t=twists: surface.wrench(t),
            "Newton on numpy batches", lambda p=part: h_inv.numpy_newton(surface, p), len(part) / count,
        )  # fmt: skip


def fitting() -> Iterator[Row]:
    for count in (10, 40, 160, 640):
        pairs = fit_benchmark.pairs_of(count)
        estimator = fit_benchmark.SquaredLoss(4, True, None, False, "zero")

        def ours(pairs: object = pairs, estimator: object = estimator) -> None:
            reduced = estimator.prepare(pairs)  # type: ignore[attr-defined]
            for weights in fit_benchmark.SETTINGS:
                estimator.solve(reduced, weights)  # type: ignore[attr-defined]

        few = fit_benchmark.SETTINGS[::6]
        yield beside(
            "fit, 24 settings of the weights", f"{count} pairs", count, ours,
            "cvxpy afresh", lambda p=pairs, w=few: [fit_benchmark.afresh(p, weights) for weights in w],
            len(few) / len(fit_benchmark.SETTINGS),
        )  # fmt: skip


def fitting_with_slider() -> Iterator[Row]:
    log = demo_pokes()
    pairs = log.pairs()
    for count in (10, 40):
        few = fit_benchmark.Pairs.from_data(pairs[0][:count], pairs[1][:count], log.rig.slider, None)
        yield beside(
            "fit with a slider", f"{count} pokes", count,
            lambda n=count: sp.fit_limit_surface(pairs[0][:n], pairs[1][:n], slider=log.rig.slider),
            "cvxpy afresh, its 219 problems", lambda p=few: [fit_benchmark.afresh(p, w) for w in fit_benchmark.SETTINGS[::6]],
            4 / 219,
        )  # fmt: skip


def on_a_grid(surface: sp.PolynomialLimitSurface, contact: sp.PushContact, cells: int) -> np.ndarray:
    """Whether each COR of a grid is stable, by loads of numpy's Newton and the cone's facets."""
    line = EXTENT * ((2 * np.arange(cells) + 1) / cells - 1)
    cors = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    rho = surface.characteristic_length
    normals = contact.cone(rho).normals
    found = []
    for sense in (1, -1):
        directions = unit(twist_from_cor(cors, sense) * (1, 1, rho))
        found.append((h_inv.numpy_newton(surface, directions) @ normals.T >= 0).all(axis=1))
    return np.array(found)


def regions() -> Iterator[Row]:
    _, contact, surface = rig()
    for cells in (50, 100, 200):
        yield beside(
            "stable region on a grid, both senses", f"{cells} x {cells} CORs", cells**2,
            lambda n=cells: [sp.stable_region(surface, contact).raster(s, EXTENT, n) for s in (1, -1)],
            "H_inv on the grid, numpy", lambda n=cells: on_a_grid(surface, contact, n),
        )  # fmt: skip


def boundaries() -> Iterator[Row]:
    """Boundaries of regions, both senses, beside a grid of CORs, which leaves them open by the size of a cell."""
    slider, contact, surface = rig()

    def discs(region: sp.StableRegion) -> object:
        return region.disc(1), region.disc(-1)

    def grid() -> object:
        return on_a_grid(surface, contact, 200)

    other = "H_inv on a grid of 4 mm, numpy"
    yield beside("boundary of a region", "exact", 1, lambda: sp.stable_region(surface, contact), other, grid)
    yield beside(
        "boundary of a region", "probability 0.9", 1, lambda: discs(sp.chance_region(surface, contact, 0.9)), other, grid,
        1 / len(surface.members()),
    )  # fmt: skip
    yield beside(
        "boundary of a region", "every pressure", 1, lambda: discs(sp.all_pressure_region(slider, contact)),
        "linear programs on such a grid", lambda: every_pressure(slider, contact, 10), 10 / (2 * 200**2),
    )  # fmt: skip


def maps() -> Iterator[Row]:
    _, contact, surface = rig()
    members = surface.members()
    for cells in (50, 100, 200):
        yield beside(
            f"probability map of {len(members)} surfaces", f"{cells} x {cells} CORs", cells**2,
            lambda n=cells: probability_map(surface, contact, EXTENT, n),
            "H_inv on the grid, numpy", lambda n=cells: [on_a_grid(m, contact, n) for m in members[:2]], 2 / len(members),
        )  # fmt: skip


def motions_of(slider: sp.Slider, count: int) -> np.ndarray:
    return unit(np.random.default_rng(0).normal(size=(count, 3))) / (1, 1, slider.radius)


def every_pressure(slider: sp.Slider, contact: sp.PushContact, count: int) -> list[bool]:
    """Whether motions are stable for every pressure on points 5 mm apart, by linear programs."""
    low, high = slider.vertices.min(axis=0), slider.vertices.max(axis=0)
    grid = np.stack(np.meshgrid(*(np.arange(a, b + 1e-9, 0.005) for a, b in zip(low, high, strict=True))), axis=-1)
    points = grid.reshape(-1, 2)
    points = points[shapely.covers(slider.polygon, shapely.points(points))]
    normals = contact.cone(slider.radius).normals
    return [region_benchmark.linear_program(points, normals, slider.radius, twist) for twist in motions_of(slider, count)]


def worst_pressures() -> Iterator[Row]:
    slider, contact, _ = rig()
    region = sp.all_pressure_region(slider, contact)
    for count in (10, 100, 1000):
        yield beside(
            "stable for every pressure", f"{count} motions", count,
            lambda n=count: region.contains_twists(motions_of(slider, n)),
            "linear programs, pressure points 5 mm apart", lambda: every_pressure(slider, contact, 10), 10 / count,
        )  # fmt: skip


def first_plan(problem: sp.PlanningProblem, planner: str = "cor-lattice") -> sp.PlanResult:
    """The quickest plan that is found first: what planners compete for."""
    return sp.plan(problem, planner, time_limit=60, seed=0, refinement_budget=0, success=0)


def planners() -> Iterator[Row]:
    for count in (10, 100, 1000):
        problem = planning_growth.scene(count, 6.0, 0)
        yield beside(
            "first plan, 6 m wide", f"{count} obstacles", count, lambda p=problem: first_plan(p),
            "OMPL's RRT-Connect", lambda p=problem: first_plan(p, "ompl-rrtconnect"),
        )  # fmt: skip


def example_plans() -> Iterator[Row]:
    """The first plan with the default success, the quickest of what is tried, and the whole default plan."""
    scenes = {path.stem: path for path in sorted(SCENES.glob("*.json")) if path.stem not in ("triangle", "unsolvable")}
    problems = {name: sp.load_scene(path) for name, path in scenes.items()}

    def first(problem: sp.PlanningProblem) -> sp.PlanResult:
        return sp.plan(problem, time_limit=60, seed=0, refinement_budget=0)

    for name, problem in problems.items():
        yield beside(
            "first plan, success 0.98", name, 1, lambda p=problem: first(p),
            "OMPL's RRT-Connect, any success", lambda p=problem: first_plan(p, "ompl-rrtconnect"),
        )  # fmt: skip
    for name, problem in problems.items():
        yield beside(
            "plan, refined as by default", name, 1, lambda p=problem: sp.plan(p, time_limit=60, seed=0),
            "its first plan", lambda p=problem: first(p),
        )  # fmt: skip


def pushes() -> Iterator[Row]:
    try:
        import against_mujoco
        import mujoco  # noqa: F401
    except ImportError:
        print("MuJoCo is not installed (extra sim): pushes are left out", file=sys.stderr)
        return
    for count in (2, 8, 32):
        made = [against_mujoco.random_push(seed) for seed in range(count)]
        few = made[:2]
        yield beside(
            "pushes of 40 mm", f"{count} pushes", count, lambda m=made: [against_mujoco.by_library(push) for push in m],
            "MuJoCo", lambda m=few: [against_mujoco.by_mujoco(push, 1e-4) for push in m], len(few) / count,
        )  # fmt: skip


def diagnoses() -> Iterator[Row]:
    from stablepush.diagnosis.likelihood.building import log_model
    from stablepush.diagnosis.likelihood.likelihood import Likelihood
    from stablepush.diagnosis.rows.observations import observe
    from stablepush.effects import CATALOGUE

    slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)], 1.2)
    support = sp.SupportDistribution.from_polygon(0.9 * slider.vertices, 0.03)
    slider = sp.Slider(slider.vertices, 1.2, support)
    effect = sp.parse_effect("tilt:slope=0.02/0.01")
    pusher = sp.Pusher.finger(0.005)
    real = sp.VirtualRig(slider, sp.IdealLimitSurface(support, 3.5), 0.5, pusher, [effect], sp.Noise(0.03, 1e-4, 2e-3))
    for count in (20, 60, 180):
        log = real.execute(sp.random_pushes(slider, pusher, count, seed=1), seed=1).log
        likelihood = log_model(observe(log), log.rig, []).likelihood

        def one_by_one(likelihood: Likelihood = likelihood) -> None:
            """Every effect fitted with the loads of the points by scipy, by differences: no folds, no p-values, no pairs."""
            nominal = likelihood.prior.nominal
            n = len(nominal)
            for id, kind in CATALOGUE.items():
                if kind.in_loads:

                    def left(x: np.ndarray, id: str = id) -> np.ndarray:
                        return likelihood.residual(x[:n], {id: x[n:]})

                    start = np.concatenate((nominal, np.zeros(kind.size)))
                    scale = np.concatenate((np.full(n, 0.1), np.full(kind.size, 0.01)))
                    least_squares(left, start, x_scale=scale, max_nfev=20)

        yield beside(
            "diagnosis, all of it", f"{count} pushes", count, lambda log=log: sp.diagnose(log),
            "a scipy fit of each effect", one_by_one,
        )  # fmt: skip


def starts() -> Iterator[Row]:
    """From the shell, in processes of their own; the second run of each, when compiled code is on disk."""
    with TemporaryDirectory() as place:
        folder = Path(place)
        _, contact, surface = rig()
        from stablepush.io.formats import contact_to_json
        from stablepush.io.json_files import write_json

        sp.save_model(surface, folder / "model.json")
        write_json(folder / "contact.json", contact_to_json(contact))
        rows = "".join(f"{x:.3f},0.1,{s}\n" for x in np.linspace(-1, 1, 10) for s in (1, -1))
        (folder / "cors.csv").write_text("cor_x,cor_y,sense\n" + rows, encoding="utf-8")

        def shell(*arguments: str) -> Task:
            return lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True, cwd=folder)

        program = ("-m", "stablepush")
        scene = (SCENES / "open.json").resolve()
        load_ompl = "import shapely; from ompl import base, geometric"
        classify = (*program, "classify", "model.json", "--contact", "contact.json", "--cors", "cors.csv", "-o", "out.csv")
        for name, ours, other, theirs in (
            ("stablepush --help", shell(*program, "--help"), "python -c pass", shell("-c", "pass")),
            ("classify, 20 CORs", shell(*classify), "python -c 'import scipy.optimize'", shell("-c", "import scipy.optimize")),
            (
                "plan, open.json",
                shell(*program, "plan", str(scene), "-o", "p.json"),
                f"python -c '{load_ompl}'",
                shell("-c", load_ompl),
            ),
            ("import stablepush", shell("-c", "import stablepush"), "python -c 'import numpy'", shell("-c", "import numpy")),
        ):
            ours()
            yield Row(name, "", 1, seconds(ours), 0, other, seconds(theirs), 0)


SECTIONS = {
    "H_inv": inversion, "fit": fitting, "slider": fitting_with_slider, "region": regions, "boundary": boundaries, "map": maps,
    "all-pressure": worst_pressures, "planner": planners, "scenes": example_plans, "pushing": pushes, "diagnosis": diagnoses,
    "start-up": starts,
}  # fmt: skip


def earlier(section: str, clone: Path) -> list[Row]:
    """The rows of a section, timed in a process with the package of an older clone."""
    paths = os.pathsep.join(str(clone.resolve() / part) for part in (".", "planners"))
    command = [sys.executable, __file__, "--only", section, "--alone"]
    ran = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": paths}, check=False)
    if ran.returncode:
        print(f"{section}: the older version cannot do this: {ran.stderr.strip()[-200:]}", file=sys.stderr)
        return []
    return [Row(*values) for values in json.loads(ran.stdout.splitlines()[-1])]


def amount(value: float) -> str:
    for size, unit_name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if value >= size or unit_name == "µs":
            return f"{value / size:.3g}\N{NO-BREAK SPACE}{unit_name}"
    raise AssertionError


def times(row: Row) -> str:
    ratio = row.theirs / row.ours
    return f"{ratio:.0f}" if ratio >= 100 else f"{ratio:.3g}"


def memory(row: Row) -> str:
    """Peaks of ours and of the other (MB), blank if they are not known."""
    ours, theirs = (f"{m / 2**20:.2g}" if m < 100 * 2**20 else f"{m / 2**20:.0f}" for m in (row.memory, row.other_memory))
    return f"{ours} / {theirs}" if row.memory and row.other_memory else ours if row.memory else ""


def markdown(rows: list[Row]) -> str:
    lines = ["| task | time | instead | times as fast | peak memory, MB |", "|---|---|---|---|---|"]
    for r in rows:
        task = ", ".join(filter(None, (r.task, r.size)))
        lines.append(f"| {task} | {amount(r.ours)} | {r.other}: {amount(r.theirs)} | {times(r)} | {memory(r)} |")
    return "\n".join(lines) + "\n"


def draw(rows: list[Row], path: Path) -> None:
    """Times against sizes, ours solid, the others dashed."""
    from matplotlib import rcParams
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    rcParams["svg.hashsalt"] = "stablepush"
    tasks = [t for t in dict.fromkeys(r.task for r in rows) if len({r.count for r in rows if r.task == t}) > 1]
    figure = Figure(figsize=(11, 3.3 * ((len(tasks) + 2) // 3)), layout="constrained")
    FigureCanvasSVG(figure)
    for k, task in enumerate(tasks):
        axes = figure.add_subplot((len(tasks) + 2) // 3, 3, k + 1)
        mine = [r for r in rows if r.task == task]
        axes.loglog([r.count for r in mine], [r.ours for r in mine], "o-", color="#0072B2", label="stablepush")
        axes.loglog(
            [r.count for r in mine], [r.theirs for r in mine], "s--", color="#D55E00", label=mine[0].other.removesuffix(NO_PATH)
        )
        axes.set_title(task, fontsize=10)
        axes.set_xlabel(f"number of {mine[0].size.split(maxsplit=1)[1].split('x')[-1].strip(' 0123456789')}", fontsize=9)
        axes.set_ylabel("time (s)", fontsize=9)
        axes.set_xticks([r.count for r in mine], [f"{r.count:,.0f}" for r in mine])
        # whole decades, and room for the legend above the curves
        times = [t for r in mine for t in (r.ours, r.theirs)]
        low, high = math.floor(math.log10(min(times))), math.ceil(math.log10(max(times)))
        axes.set_ylim(10.0**low, 10.0 ** (high + 0.35 * (high - low)))
        axes.tick_params(labelsize=8)
        axes.minorticks_off()
        axes.grid(visible=True, color="0.9", linewidth=0.5)
        axes.legend(fontsize=8, frameon=False, loc="upper left")
    figure.savefig(path, metadata={"Date": None})


def compared(rows: list[Row], before: list[Row]) -> str:
    """Rows of both versions as a table."""
    was = {(r.task, r.size): r.ours for r in before}
    lines = ["| task | before | now | times as fast |", "|---|---|---|---|"]
    for r in rows:
        old = was.get((r.task, r.size))
        if old is not None:
            task = ", ".join(filter(None, (r.task, r.size)))
            lines.append(f"| {task} | {amount(old)} | {amount(r.ours)} | {old / r.ours:.3g} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("-o", "--output", type=Path, help="folder for table.md and growth.svg")
    parser.add_argument("--only", nargs="*", choices=list(SECTIONS), help="sections")
    parser.add_argument("--before", type=Path, metavar="OLD_CHECKOUT", help="an older version to time beside: writes before.md")
    parser.add_argument("--alone", action="store_true", help="print the times of this package only, as JSON")
    options = parser.parse_args()
    rows: list[Row] = []
    before: list[Row] = []
    for name in options.only or SECTIONS:
        if options.before:
            before += earlier(name, options.before)
        for row in SECTIONS[name]():
            rows.append(row)
            if not ALONE:
                print(
                    f"{row.task:<40s}{row.size:>18s}{amount(row.ours):>12s}   {row.other:<34s}{amount(row.theirs):>12s}"
                    f"{times(row):>10s} times",
                    flush=True,
                )
    if ALONE:
        print(json.dumps([(r.task, r.size, r.count, r.ours, 0, r.other, 0.0, 0) for r in rows]))
    if options.before:
        print(compared(rows, before), end="")
    if options.output:
        options.output.mkdir(parents=True, exist_ok=True)
        (options.output / "table.md").write_text(markdown(rows), encoding="utf-8")
        draw(rows, options.output / "growth.svg")
        if options.before:
            (options.output / "before.md").write_text(compared(rows, before), encoding="utf-8")


if __name__ == "__main__":
    main()
