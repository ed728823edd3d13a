"""Commands that simulate motion."""

from __future__ import annotations

import math
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stablepush.cli.common import (
    Output,
    Progress,
    about,
    also_written,
    is_quiet,
    note_if_invalid,
    number,
    numbers,
    options_of,
    require_files,
    require_folder,
    require_outside,
    require_png,
    told,
    whole_number,
)
from stablepush.core import InputError, counted

#: How deep (m) a slider is in an obstacle that it does not only touch.
_ROUNDING = 1e-6

if TYPE_CHECKING:
    from stablepush.effects import Effect
    from stablepush.planning import PlanningProblem, PlanResult
    from stablepush.rig import Execution


def simulate(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="scene/1 file.")],
    plan_file: Annotated[
        Path,
        typer.Argument(
            metavar="PLAN",
            help="plan/1 file, solved; or a CSV list: pushes of edges (edge, along) or rotations (cor_x, cor_y, sense, angle).",
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="pushlog/1 folder to write.")],
    effect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID:PARAM=VALUE,...",
            help="Effect on the rig that the plan does not know, in place of the scene's; repeatable; vectors as 0.01/0.02.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(parser=whole_number, metavar="INTEGER", help="Seed of noise and scatter.")] = 0,
    rows: Annotated[int, typer.Option(parser=whole_number, metavar="INTEGER", help="Rows logged for each push.")] = 7,
    finger_radius: Annotated[
        float | None,
        typer.Option(parser=number, metavar="METRES", help="Nominal radius of the fingers; the scene's if not given."),
    ] = None,
    mu: Annotated[
        float | None,
        typer.Option(
            "--support-mu",
            "--mu",
            parser=number,
            metavar="MU",
            help="Friction of the support, for models with forces in units of mu*N. --mu: its former name.",
        ),
    ] = None,
    noise: Annotated[
        tuple[str, str, str],
        typer.Option(metavar="N M RAD", help="Noise of a row, standard deviations of force (N), position (m) and angle (rad)."),
    ] = ("0", "0", "0"),
    outliers: Annotated[
        float, typer.Option(parser=number, metavar="SHARE", help="Share of rows with ten times the noise.")
    ] = 0.0,
    scatter: Annotated[
        float, typer.Option(parser=number, metavar="SHARE", help="Relative standard deviation of friction from push to push.")
    ] = 0.0,
    replan: Annotated[
        float | None,
        typer.Option(
            parser=number, metavar="METRES", help="Replan when the slider is farther than this from the plan after a push."
        ),
    ] = None,
    engine: Annotated[
        str | None,
        typer.Option(help="mujoco or drake: the pushes happen there; in the quasi-static simulation of stablepush if not given."),
    ] = None,
    view: Annotated[Path | None, typer.Option(help="Animation of what happened as an HTML page.")] = None,
) -> None:
    """Execute a plan or a list of pushes on a simulated rig.

    The rig may have effects that the plan does not know. The result is a log (pushlog/1), as a laboratory records it. Columns of
    a list: edge (from 0), along (m, from its first vertex), direction (rad, off the inward normal), way (m), and others that
    docs/simulation.md names. Obstacles are not simulated.
    """
    from stablepush.core import check_number, note_finger, note_friction, note_noise
    from stablepush.io import Noise, write_pushlog
    from stablepush.mechanics import Pusher
    from stablepush.planning import load_plan, load_scene
    from stablepush.rig import VirtualRig, execute_closed_loop, execute_plan, read_commands, require_contacts

    deviations = numbers("--noise", ("N", "M", "RAD"), noise)
    if min(deviations) < 0:
        raise InputError("--noise", "expected numbers >= 0", f"{' '.join(noise)}")
    if finger_radius is not None:
        note_finger(check_number(finger_radius, "--finger-radius", at_least=0.0), "--finger-radius")
    note_friction(mu or 0.0, "--support-mu")
    note_noise(deviations[1], deviations[2], "--noise")
    effects = _effects_of(effect or [])
    require_folder(output)
    require_files(view, read=(scene, plan_file))
    for path in (view, scene, plan_file):
        if path is not None:
            require_outside(path, output)
    listed = plan_file.suffix.lower() == ".csv"
    if listed and replan is not None:
        raise InputError("--replan", "expected a plan to follow, not a list of pushes")
    problem = load_scene(scene)
    # an effect that is asked for takes the place of the scene's
    asked = {entry.id for entry in effects}
    effects = [*(entry.effect for entry in problem.effects if entry.effect.id not in asked), *effects]
    contact, radius = problem.contacts[0], problem.finger_radius if finger_radius is None else finger_radius
    spread = Noise(*deviations) if any(deviations) else None
    names = ("outliers", "scatter", "rows", "seed", "engine", *(["finger_radius"] if finger_radius is not None else []))
    given = options_of(*names, support_friction="support-mu", tolerance="replan")
    with about(scene, options=given):
        require_contacts(problem)
        pusher = Pusher.of_contact(contact, radius)
        support = problem.support_friction if mu is None else mu
        rig = VirtualRig(
            problem.slider, problem.surface, contact.mu, pusher, effects, spread, outliers, scatter, support, engine=engine
        )
    if listed:
        commands = read_commands(plan_file, problem, radius)
        with about(plan_file, options=given), Progress("simulate") as step:
            execution = rig.execute(commands, rows=rows, seed=seed, progress=step.to)
        result = None
    else:
        result = load_plan(plan_file)
        with about(plan_file, options=given), Progress("simulate") as step:
            if replan is None:
                execution = execute_plan(rig, problem, result, rows=rows, seed=seed, progress=step.to)
            else:
                execution = execute_closed_loop(rig, problem, result, replan, rows=rows, seed=seed, progress=step.describe)
    if view is not None:
        from stablepush.io import write_atomically
        from stablepush.views import execution_html

        write_atomically(view, execution_html(problem, execution.pushers, execution.traces, result))
    write_pushlog(execution.log, output)
    _tell_execution(execution, problem, result, output, view)
    # effects other than the plan was made with may be what a simulation is about
    if result is not None and not (asked and problem.acting_effects):
        note_if_invalid(problem, result, plan_file)


def _tell_execution(
    execution: Execution, problem: PlanningProblem, result: PlanResult | None, output: Path, view: Path | None
) -> None:
    """Print what happened."""
    stayed = execution.log.trials["stable"]
    told(
        output=output, pushes=len(execution.log), stable=[None if v != v else bool(v) for v in stayed.tolist()],  # noqa: PLR0124
        final_pose=execution.final_pose, goal=None if result is None else problem.goal, plans=execution.plans,
        stop_reason=execution.stop_reason,
    )  # fmt: skip
    print(f"{output}: {_outcome(execution, None if result is None else problem)}")
    also_written(view)
    met = _first_in_an_obstacle(execution, problem)
    if met is not None and not is_quiet():
        words = f"the slider goes into an obstacle in push {met}: a simulated run has none, and slides on as if it were not there"
        print(f"{output}: note: {words}", file=sys.stderr)


def _effects_of(texts: list[str]) -> list[Effect]:
    """Effects of a command line; a warning tells values that no rig was found with."""
    from stablepush.core import PlausibilityWarning
    from stablepush.effects import CATALOGUE, lab_effects, parse_effect

    unknown = [text for text in texts if text.partition(":")[0] not in CATALOGUE]
    of_lab = [text for text in unknown if text.partition(":")[0] in lab_effects()]
    if of_lab:
        raise InputError(
            "--effect", "expected an effect of the catalogue: those of a lab are diagnosed, not simulated", of_lab[0]
        )
    try:
        effects = [parse_effect(text) for text in texts]
    except InputError as error:
        place = error.place.removeprefix("effect").strip()
        raise InputError(f"--effect{f': {place}' if place else ''}", error.expected, error.got) from None
    for entry in effects:
        for parameter in CATALOGUE[entry.id].parameters:
            if any(not parameter.low <= value <= parameter.high for value in entry.values.get(parameter.name, ())):
                found = f"rigs are found with {parameter.low:g} to {parameter.high:g} {parameter.unit}"
                place = f"--effect: {entry.id}: {parameter.name}"
                warnings.warn(PlausibilityWarning(place, f"{found}: it is simulated all the same"), stacklevel=2)
    return effects


def _outcome(execution: Execution, problem: PlanningProblem | None) -> str:
    """What happened in a line; ``problem``: whose goal the slider was to reach."""
    import numpy as np

    log = execution.log
    words = [counted(len(log), "push")]
    stable = np.asarray(log.trials["stable"])
    if np.isfinite(stable).any():
        words[0] += f", {int(np.nansum(stable))} of {int(np.isfinite(stable).sum())} sticking throughout"
    x, y, theta = execution.final_pose
    if problem is not None:
        error = float(np.hypot(*(execution.final_pose[:2] - problem.goal[:2])))
        turn = math.degrees(abs(math.remainder(float(theta) - float(problem.goal[2]), 2 * math.pi)))
        words.append(
            f"the slider ends at x {x:.4f} m, y {y:.4f} m, theta {math.remainder(math.degrees(theta), 360):.2f} deg, "
            f"{1000 * error:.1f} mm and {turn:.2f} deg from the goal"
        )
    if execution.plans > 1:
        words.append(f"replanned {execution.plans - 1} times")
    if execution.stop_reason:
        words.append(execution.stop_reason)
    untouched = sum(not (trace.modes > 0).any() for trace in execution.traces)
    jams = sum(bool(trace.jammed.any()) for trace in execution.traces)
    for count, what in ((untouched, "never touched the slider"), (jams, "jammed")):
        if count:
            words.append(f"{count} {what}")
    return "; ".join(words)


def _first_in_an_obstacle(execution: Execution, problem: PlanningProblem) -> str | None:
    """Name of the first push in which the slider overlaps an obstacle, if any."""
    import shapely

    from stablepush.geometry import transform_points

    obstacles = [shapely.Polygon(outline) for outline in problem.obstacles]
    for name, trace in zip(execution.log.trials["trial"], execution.traces, strict=True):
        sliders = shapely.polygons([transform_points(pose, problem.slider.vertices) for pose in trace.poses])
        # paths may touch obstacles: rounding is no overlap
        inner = shapely.buffer(sliders, -_ROUNDING)
        if any(shapely.intersects(inner, obstacle).any() for obstacle in obstacles):
            return str(name)
    return None


def slide(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="model/1 file.")],
    slider_file: Annotated[Path, typer.Option("--slider", help="slider/1 file, with a mass.")],
    twist: Annotated[tuple[str, str, str], typer.Option(metavar="VX VY OMEGA", help="Initial body twist: m/s, m/s, rad/s.")],
    output: Output,
    mu: Annotated[
        float | None,
        typer.Option(
            "--support-mu",
            "--mu",
            parser=number,
            metavar="MU",
            help="Friction of the support, for models with forces in units of mu*N. --mu: its former name.",
        ),
    ] = None,
    gravity: Annotated[float, typer.Option(parser=number, metavar="M/S2", help="Acceleration of gravity, in m/s2.")] = 9.81,
    duration: Annotated[
        float | None, typer.Option(parser=number, metavar="SECONDS", help="Stop the simulation after this time, in s.")
    ] = None,
    samples: Annotated[int, typer.Option(parser=whole_number, metavar="INTEGER", help="Rows of the table.")] = 201,
    picture: Annotated[Path | None, typer.Option(help="Picture of the slide as PNG.")] = None,
    view: Annotated[Path | None, typer.Option(help="Animation of the slide as an HTML page.")] = None,
) -> None:
    """Simulate a free slide until the body rests."""
    from stablepush.core import note_friction, note_gravity, note_slide
    from stablepush.io import load_model, load_slider, table_text, write_atomically
    from stablepush.mechanics import simulate_free_sliding

    first = numbers("--twist", ("VX", "VY", "OMEGA"), twist)
    note_slide(first, "--twist")
    note_gravity(gravity, "--gravity")
    note_friction(mu or 0.0, "--support-mu")
    require_files(output, picture, view, read=(model, slider_file))
    require_png(picture)
    surface, slider = load_model(model), load_slider(slider_file)
    given = options_of("gravity", "duration", "samples", mu="support-mu") | {"slider.mass": f"{slider_file}: mass"}
    with about(model, options=given):
        result = simulate_free_sliding(surface, slider, first, mu=mu, gravity=gravity, duration=duration, samples=samples)
    columns = ("t", "x", "y", "theta", "vx", "vy", "omega")
    rows = (result.t, *result.poses.T, *result.twists.T)
    if picture is not None:
        from stablepush.views.plot import plot_slide, save_figure

        save_figure(plot_slide(slider, result), picture)
    if view is not None:
        from stablepush.views import slide_html

        write_atomically(view, slide_html(slider, result))
    write_atomically(output, table_text(dict(zip(columns, rows, strict=True))))
    told(output=output, at_rest=result.at_rest, duration=result.t[-1], final_pose=result.poses[-1], rotation_centre=result.cor)
    also_written(picture, view)
    x, y, theta = result.poses[-1]
    end = "at rest" if result.at_rest else "cut"
    print(
        f"{output}: {end} after {result.t[-1]:.4f} s at x {x:.4f} m, y {y:.4f} m, theta {math.degrees(theta):.2f} deg; "
        f"{_last_motion(result.cor)}"
    )


def _last_motion(cor: object) -> str:
    import numpy as np

    c = np.asarray(cor)
    if not np.isfinite(c).all():
        return "no turning at the end"
    return f"last rotation centre ({c[0]:.4g}, {c[1]:.4g}) m in the body frame"
