"""Commands: thin shells around the library. Heavy modules are imported inside, so that ``--help`` is quick."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stablepush import __version__
from stablepush.errors import InputError, StablepushError, UnsupportedContactError

if TYPE_CHECKING:
    from stablepush.path import PlanResult
    from stablepush.problem import PlanningProblem

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Plan stable pushes of flat objects: from pokes to a limit surface, stable rotation centres and push paths.",
)


def _number(text: str | float) -> float:
    """Parse a number; the message quotes what was given, in every version of the argument parser."""
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"expected a number, got {text!r}") from None


def _whole_number(text: str | int) -> int:
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"expected a whole number, got {text!r}") from None


Output = Annotated[Path, typer.Option("-o", "--output", help="File to write.")]
Contact = Annotated[Path, typer.Option("--contact", help="Contact of the pusher (JSON).")]


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    if version:
        print(f"stablepush {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit


@app.command()
def demo(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write.")] = Path("stablepush-demo"),
    seed: Annotated[int, typer.Option(parser=_whole_number, metavar="INTEGER", help="Seed of the simulated pokes.")] = 0,
) -> None:
    """Run the whole chain on a small built-in rig: pokes, fit, map, plan, check, report."""
    from stablepush.cli.demo import run_demo

    _require_seed(seed)
    _require_folder(output)
    raise typer.Exit(run_demo(output, seed))


@app.command("import")
def import_logs(
    source: Annotated[Path, typer.Argument(help="Raw log, a folder of them, or a clone of the lab's repository.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write; several logs give one folder each.")],
    kind: Annotated[str | None, typer.Option(help="mlab-poke or mlab-stable; both if not given.")] = None,
    slider: Annotated[Path | None, typer.Option(help="slider/1 file that replaces the lab's triangle.")] = None,
) -> None:
    """Read a lab's raw logs into pushlog/1 folders."""
    from stablepush.formats import load_slider
    from stablepush.logs import write_pushlog
    from stablepush.logs.mlab import find_sources, import_source

    _require_folder(output)
    replacement = None if slider is None else load_slider(slider)
    sources = find_sources(source, kind)
    several = len(sources) > 1
    imported = 0
    with _progress("import", len(sources)) as step:
        for item in sources:
            try:
                log, notes = import_source(item, replacement)
            except InputError as error:
                if not several:
                    raise
                # a clone holds files of other experiments: one that is no log of ours must not keep the others out
                step.say(f"note: skipped: {error}")
                continue
            target = output / item.name if several else output
            write_pushlog(log, target)
            imported += 1
            for note in notes:
                step.say(f"note: {note}")
            pairs = log.pairs()
            forward = int(((pairs[0] * pairs[1]).sum(axis=1) > 0).sum())
            summary = f", {len(pairs[0])} pairs, {forward} with F·V > 0" if len(pairs[0]) else ""
            step.say(f"{target}: {item.kind}, {len(log)} pushes{summary}", error=False)
            step()
    if not imported:
        raise InputError(f"{source}: expected at least one whole log, none of {len(sources)} could be read")


@app.command()
def fit(
    log: Annotated[Path, typer.Argument(help="pushlog/1 folder.")],
    output: Output,
    model: Annotated[str, typer.Option(help="poly4-cvx, poly4, poly6-cvx, quadratic or gp.")] = "poly4-cvx",
    seed: Annotated[
        int, typer.Option(parser=_whole_number, metavar="INTEGER", help="Seed of the folds, the pressures and the ensemble.")
    ] = 0,
    no_slider: Annotated[bool, typer.Option("--no-slider", help="Do not use what the log says of the slider.")] = False,
    loss: Annotated[
        str,
        typer.Option(
            help="squared, published (the paper's equation) or norm (its authors' code); the latter without the slider."
        ),
    ] = "squared",
    com_tolerance: Annotated[
        float, typer.Option(parser=_number, metavar="METRES", help="How far off the centre of mass may be, each way.")
    ] = 0.0,
) -> None:
    """Identify a limit surface from a log of pokes."""
    import numpy as np

    from stablepush.identify import LOSSES, MODELS, WITH_PRIOR, fit_limit_surface
    from stablepush.logs import read_pushlog

    if model not in MODELS:
        raise InputError(f"--model: expected one of {', '.join(MODELS)}, got {model!r}")
    if loss not in LOSSES:
        raise InputError(f"--loss: expected one of {', '.join(LOSSES)}, got {loss!r}")
    if not (math.isfinite(com_tolerance) and 0 <= com_tolerance <= 1e6):
        raise InputError(f"--com-tolerance: expected a length in m >= 0, got {com_tolerance:g}")
    if com_tolerance and (no_slider or loss != "squared" or model not in WITH_PRIOR):
        raise InputError(
            f"--com-tolerance: {com_tolerance:g} is of use only where the slider is: {' or '.join(WITH_PRIOR)}, squared loss"
        )
    _require_seed(seed)
    _require_file(output)
    pokes = read_pushlog(log)
    loads, twists, names = pokes.pairs()
    if not names:
        raise InputError(f"{log}: expected push rows with forces and motion, found none")
    with _progress("fit") as step, _about(log):
        result = fit_limit_surface(
            loads,
            twists,
            model,
            slider=None if no_slider else pokes.rig.slider,
            seed=seed,
            loss=loss,
            com_tolerance=com_tolerance,
            progress=step.to,
        )
    from stablepush.formats import save_model

    save_model(result.surface, output)
    print(f"{output}: {model} from {len(names)} pokes, {result.status}, {result.total_time:.2f} s")
    for remark in result.remarks:
        print(f"note: {remark}")
    if result.prior_weight:
        print("prior: pressures under the slider's outline, weighed by the pokes")
    if result.validation_error is not None:
        print(f"angle error on held-out folds: {math.degrees(result.validation_error):.2f} deg")
    print(f"angle error on the pokes used:  {math.degrees(float(np.mean(result.angle_errors))):.2f} deg")
    if result.certificate is not None:
        word = "SOS-convex" if result.certificate.sos_convex else "NOT certified convex"
        print(
            f"certificate: {word}, smallest eigenvalue {result.certificate.min_eigenvalue:.3g}, "
            f"residual {result.certificate.residual:.1g}"
        )


@app.command()
def classify(
    model: Annotated[Path, typer.Argument(help="model/1 file.")],
    contact: Contact,
    cors: Annotated[Path, typer.Option("--cors", help="CSV with columns cor_x, cor_y, sense.")],
    output: Output,
) -> None:
    """Tell which rotation centres are stable, and by what margin."""
    import numpy as np

    from stablepush.files import write_atomically
    from stablepush.formats import load_contact, load_model
    from stablepush.logs.table import IS_SENSE, read_table, table_text
    from stablepush.oracle import BOUNDARY_SLACK, StabilityOracle
    from stablepush.planar import twist_from_cor

    _require_file(output)
    columns = ("cor_x", "cor_y", "sense")
    oracle = StabilityOracle(load_model(model), load_contact(contact))
    table, _ = read_table(cors, required=columns, numbers=columns, filled=columns, rules={"sense": IS_SENSE})
    centers = np.stack((table["cor_x"], table["cor_y"]), axis=-1).reshape(-1, 2)
    twists = twist_from_cor(centers, table["sense"])
    with _about(model):
        margins, shares = oracle.margin(twists), oracle.probability(twists)
    stable = (margins >= -BOUNDARY_SLACK).astype(float)
    probability = np.full(len(centers), "", dtype=object) if shares is None else shares
    write_atomically(output, table_text({**table, "stable": stable, "margin": margins, "probability": probability}))
    print(f"{output}: {int(stable.sum())} of {len(stable)} rotation centres stable")


@app.command("map")
def draw_map(
    model: Annotated[Path, typer.Argument(help="model/1 file.")],
    contact: Contact,
    output: Output,
    slider: Annotated[
        Path | None, typer.Option(help="slider/1 file; needed for the all-pressure and the conservative region.")
    ] = None,
    regions_file: Annotated[Path | None, typer.Option("--json", help="Regions as JSON.")] = None,
    extent: Annotated[float | None, typer.Option(parser=_number, metavar="METRES", help="Half side of the map in m.")] = None,
    probability: Annotated[
        float | None,
        typer.Option(parser=_number, metavar="P", help="Also the region that is stable with this probability, by the ensemble."),
    ] = None,
    com_tolerance: Annotated[
        float, typer.Option(parser=_number, metavar="METRES", help="How far off the centre of mass may be, for all-pressure.")
    ] = 0.0,
    least_mu: Annotated[
        float | None, typer.Option(parser=_number, metavar="MU", help="Least friction at the contact, for all-pressure.")
    ] = None,
    margins: Annotated[Path | None, typer.Option(help="Chart of margins over turns each way, as PNG.")] = None,
    sphere: Annotated[Path | None, typer.Option(help="Regions on the sphere of unit twists, as PNG.")] = None,
) -> None:
    """Draw the stable regions: of the model, all-pressure and conservative."""
    from stablepush.all_pressure import all_pressure_region
    from stablepush.conservative import lynch_mason_region
    from stablepush.files import write_atomically, write_json
    from stablepush.formats import load_contact, load_model, load_slider
    from stablepush.models import PolynomialLimitSurface
    from stablepush.plot import figure_png, plot_margins, plot_regions, plot_twist_sphere
    from stablepush.probability import chance_region, probability_map
    from stablepush.region import regions_to_json, stable_region

    if extent is not None and not (math.isfinite(extent) and 0 < extent <= 1e6):
        raise InputError(f"--extent: expected a number > 0, got {extent}")
    if probability is not None and not 0 < probability <= 1:
        raise InputError(f"--probability: expected a number above 0 and up to 1, got {probability:g}")
    for name, value in (("--com-tolerance", com_tolerance), ("--least-mu", least_mu)):
        if value is not None and not (math.isfinite(value) and 0 <= value <= 1e6):
            raise InputError(f"{name}: expected a number >= 0, got {value:g}")
    if slider is None and (com_tolerance > 0 or least_mu is not None):
        raise InputError("--com-tolerance, --least-mu: expected --slider with them, as they are for the all-pressure region")
    for path in (output, regions_file, margins, sphere):
        if path is not None:
            _require_file(path)
    _require_distinct(output, regions_file, margins, sphere)
    surface, fingers = load_model(model), load_contact(contact)
    body = None if slider is None else load_slider(slider)
    if least_mu is not None and least_mu > fingers.mu:
        raise InputError(f"--least-mu: expected at most the mu of {contact}, {fingers.mu:g}, got {least_mu:g}")
    shading, rho = None, surface.characteristic_length
    try:
        with _about(model):
            regions = [stable_region(surface, fingers)]
            if probability is not None:
                if not (isinstance(surface, PolynomialLimitSurface) and surface.members()):
                    raise InputError("--probability: expected a model with an ensemble, as fit leaves it")
                regions.append(chance_region(surface, fingers, probability))
            if isinstance(surface, PolynomialLimitSurface) and surface.members() and regions[0].curve is None:
                size = 5 * max(fingers.radius, 0.0 if body is None else body.radius) if extent is None else extent
                shading = probability_map(surface, fingers, size)
    except UnsupportedContactError as error:
        raise InputError(f"{contact}: {error}") from None
    if body is not None and slider is not None:
        with _about(slider):
            limits = None if least_mu is None else (least_mu, fingers.mu)
            if len(body.support_vertices) < 3:
                print("no all-pressure region: the slider's support points lie on a line")
            else:
                regions.append(
                    all_pressure_region(body, fingers, mu=limits, com_tolerance=com_tolerance, characteristic_length=rho)
                )
        try:
            regions.append(lynch_mason_region(body, fingers, characteristic_length=rho))
        except UnsupportedContactError as error:
            print(f"no conservative region: {error}")
    # all is made before any of it is written
    pictures = [(output, figure_png(plot_regions(regions, fingers, body, extent, probability=shading)))]
    if margins is not None:
        pictures.append((margins, figure_png(plot_margins(surface, fingers, regions))))
    if sphere is not None:
        pictures.append((sphere, figure_png(plot_twist_sphere(regions))))
    if regions_file is not None:
        write_json(regions_file, regions_to_json(regions, extent))
    for path, picture in pictures:
        write_atomically(path, picture)
    for region in regions:
        spans = " and ".join(f"{math.degrees(low):.1f} to {math.degrees(high):.1f}" for low, high in region.translation_intervals)
        turns = [region.tightest_turn(sense) for sense in (1, -1)]
        words = [
            f"{math.hypot(*cor):.3g} m {word}" for cor, word in zip(turns, ("left", "right"), strict=True) if cor is not None
        ]
        print(
            f"{region.name}: {region.solid_angle():.3f} sr, "
            + (f"translations from {spans} deg" if spans else "no stable translation")
            + (f", tightest turns {', '.join(words)}" if words else ", no stable turn")
        )
    print(f"{output}: written")


@app.command()
def contacts(
    model: Annotated[Path, typer.Argument(help="model/1 file.")],
    slider: Annotated[Path, typer.Option(help="slider/1 file.")],
    mu: Annotated[float, typer.Option(parser=_number, metavar="MU", help="Friction between finger and slider.")],
    output: Output,
    measure: Annotated[str, typer.Option(help="Rank by area, tightest-turn or margin.")] = "area",
    width: Annotated[
        list[float] | None, typer.Option(parser=_number, metavar="METRES", help="Distance of the fingers; repeatable.")
    ] = None,
    edge: Annotated[
        list[int] | None, typer.Option(parser=_whole_number, metavar="INTEGER", help="Edge that can be reached; repeatable.")
    ] = None,
    places: Annotated[int, typer.Option(parser=_whole_number, metavar="INTEGER", help="Places along each edge.")] = 9,
    picture: Annotated[Path | None, typer.Option(help="Picture of the contacts as PNG.")] = None,
) -> None:
    """Rank two-finger contacts along the edges of a slider, as a table (CSV), the best first."""
    import numpy as np

    from stablepush.contact_choice import MEASURES, rank_contacts
    from stablepush.files import write_atomically
    from stablepush.formats import load_model, load_slider
    from stablepush.logs.table import table_text
    from stablepush.models import GaussianProcessSurface
    from stablepush.plot import figure_png, plot_contacts

    if measure not in MEASURES:
        raise InputError(f"--measure: expected one of {', '.join(MEASURES)}, got {measure!r}")
    if not (math.isfinite(mu) and 0 < mu <= 1e6):
        raise InputError(f"--mu: expected a number > 0, got {mu:g}")
    for value in width or ():
        if not (math.isfinite(value) and 0 < value <= 1e6):
            raise InputError(f"--width: expected a distance > 0 in m, got {value:g}")
    if not 1 <= places <= 1000:
        raise InputError(f"--places: expected a whole number from 1 to 1000, got {places}")
    for path in (output, picture):
        if path is not None:
            _require_file(path)
    _require_distinct(output, picture)
    surface, body = load_model(model), load_slider(slider)
    if isinstance(surface, GaussianProcessSurface):
        raise InputError(f"{model}: expected a limit surface; a Gaussian process has no stable region")
    for index in edge or ():
        if not 0 <= index < len(body.vertices):
            raise InputError(f"--edge: expected 0 to {len(body.vertices) - 1}, got {index}")
    longest = max(float(np.linalg.norm(np.subtract(*body.edge(i)))) for i in edge or range(len(body.vertices)))
    if width and min(width) > longest:
        raise InputError(f"--width: expected fingers that fit on an edge, up to {longest:.6g} m, got {min(width):g}")
    with _progress("contacts") as step, _about(model):
        ranked = rank_contacts(
            body, surface, mu, measure=measure, widths=width or None, places=places, edges=edge or None, progress=step.to
        )
    columns = {
        name: np.array([getattr(one, name) for one in ranked])
        for name in ("edge", "center", "width", "area", "tightest_left", "tightest_right", "margin")
    }
    # a turn that no COR allows is a blank
    for name in ("tightest_left", "tightest_right"):
        columns[name] = np.where(np.isfinite(columns[name]), columns[name], np.nan)
    drawn = figure_png(plot_contacts(body, ranked, measure)) if picture is not None else b""
    write_atomically(output, table_text(columns))
    if picture is not None:
        write_atomically(picture, drawn)
    best = ranked[0]
    print(
        f"{output}: {len(ranked)} contacts; best by {measure}: edge {best.edge}, middle {best.center:.4g} m along it, "
        f"fingers {best.width:.4g} m apart"
    )


@app.command()
def plan(
    scene: Annotated[Path, typer.Argument(help="scene/1 file.")],
    output: Output,
    planner: Annotated[str, typer.Option(help="Name of the planner.")] = "cor-lattice",
    time_limit: Annotated[
        float, typer.Option(parser=_number, metavar="SECONDS", help="Wall time in s, from the start of the program.")
    ] = 30.0,
    seed: Annotated[
        int, typer.Option(parser=_whole_number, metavar="INTEGER", help="Seed of planners that draw random numbers.")
    ] = 0,
    region: Annotated[str, typer.Option(help="Rotation centres to use: model, all-pressure or conservative.")] = "model",
    view: Annotated[Path | None, typer.Option(help="Animation of the plan as an HTML page.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Picture of the plan as PNG, if one is found.")] = None,
) -> None:
    """Plan a path of stable pushes."""
    from stablepush.cli import STARTED
    from stablepush.files import write_atomically
    from stablepush.path import save_plan
    from stablepush.planning import REGIONS, planner_names
    from stablepush.planning import plan as make_plan
    from stablepush.problem import load_scene

    if not (math.isfinite(time_limit) and 0 <= time_limit <= 1e6):
        raise InputError(f"--time-limit: expected a time in s from 0 to 1e6, got {time_limit:g}")
    if planner not in planner_names():
        raise InputError(f"--planner: expected one of {', '.join(planner_names())}, got {planner!r}")
    if region not in REGIONS:
        raise InputError(f"--region: expected {' or '.join(REGIONS)}, got {region!r}")
    _require_seed(seed)
    for path in (output, view, picture):
        if path is not None:
            _require_file(path)
    _require_distinct(output, view, picture)
    problem = load_scene(scene)
    left = max(0.0, time_limit - (time.perf_counter() - STARTED))
    with _progress("plan") as step, _about(scene):
        result = make_plan(problem, planner, left, seed, region=region, progress=step.describe)
    save_plan(result, output)
    if view is not None:
        from stablepush.report import plan_html

        write_atomically(view, plan_html(problem, result))
    if picture is not None and result.solved:
        from stablepush.plot import plot_plan, save_figure

        save_figure(plot_plan(problem, result), picture)
    print(f"{output}: {_plan_line(result)}")
    raise typer.Exit(0 if result.solved else 1)


@app.command()
def check(
    scene: Annotated[Path, typer.Argument(help="scene/1 file.")],
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN", help="plan/1 file.")],
) -> None:
    """Verify a plan independently of the planner that made it."""
    from stablepush.check import check_plan
    from stablepush.path import load_plan
    from stablepush.problem import load_scene

    problem: PlanningProblem = load_scene(scene)
    result = load_plan(plan_file)
    with _about(scene):
        report = check_plan(problem, result)
    for objection in report.objections:
        print(objection)
    print(f"{plan_file}: {'valid' if report.valid else 'NOT valid'}")
    raise typer.Exit(0 if report.valid else 1)


def _plan_line(result: PlanResult) -> str:
    if not result.solved:
        return f"{result.status}: {result.message}"
    bound = "" if result.lower_bound is None else f" (at least {result.lower_bound:.1f} s)"
    return (
        f"solved in {result.planning_time:.2f} s: {len(result.pushes)} pushes, {result.length:.3f} m, "
        f"{result.duration:.1f} s{bound}, {result.switches} changes of contact, "
        f"least margin {math.degrees(result.min_margin):.2f} deg"
    )


@contextmanager
def _about(path: Path) -> Iterator[None]:
    """Put the file that a complaint of the library is about before it."""
    try:
        yield
    except UnsupportedContactError:
        raise
    except StablepushError as error:
        if str(error).startswith(str(path)):
            raise
        raise InputError(f"{path}: {error}") from None


def _require_distinct(*paths: Path | None) -> None:
    given = [path for path in paths if path is not None]
    for i, path in enumerate(given):
        if path in given[:i]:
            raise InputError(f"{path}: expected different files to write, it is named twice")


def _require_seed(seed: int) -> None:
    if not 0 <= seed < 2**32:
        raise InputError(f"--seed: expected a whole number from 0 to 4294967295, got {seed}")


def _require_file(path: Path) -> None:
    """Refuse an output that cannot be written before any work is done."""
    if path.is_dir():
        raise InputError(f"{path}: cannot write: is a directory")
    _require_parent(path)


def _require_folder(path: Path) -> None:
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: cannot write: exists and is not a folder")
    _require_parent(path)


def _require_parent(path: Path) -> None:
    import os

    parent = path.parent
    while not parent.exists() and parent != parent.parent:
        parent = parent.parent
    if not parent.is_dir():
        raise InputError(f"{path}: cannot write: {parent} is not a folder")
    if not os.access(parent, os.W_OK):
        raise InputError(f"{path}: cannot write: no permission in {parent}")


class _progress:
    """A line on standard error while something runs, only where a person can see it."""

    def __init__(self, name: str, total: int | None = None) -> None:
        self._name, self._total, self._done, self._shown = name, total, 0, 0.0
        self._live = sys.stderr.isatty()

    def __enter__(self) -> _progress:
        return self

    def __exit__(self, *_: object) -> None:
        self._clear()

    def __call__(self) -> None:
        self._done += 1
        self.to(self._done, self._total or self._done)

    def to(self, done: int, total: int) -> None:
        self.describe(f"{done} of {total}")

    def describe(self, text: str) -> None:
        now = time.perf_counter()
        if self._live and now - self._shown > 0.1:
            self._shown = now
            print(f"\r\x1b[K{self._name}: {text}", end="", file=sys.stderr, flush=True)

    def say(self, line: str, error: bool = True) -> None:
        self._clear()
        print(line, file=sys.stderr if error else sys.stdout)

    def _clear(self) -> None:
        if self._live and self._shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
