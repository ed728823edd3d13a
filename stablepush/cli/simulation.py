"""Commands that simulate motion."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from stablepush.cli.common import (
    Output,
    Progress,
    about,
    number,
    require_distinct,
    require_file,
    require_folder,
    require_seed,
    whole_number,
)
from stablepush.errors import InputError


def simulate(
    scene: Annotated[Path, typer.Argument(help="scene/1 file.")],
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN", help="plan/1 file, solved.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="pushlog/1 folder to write.")],
    effect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID:PARAM=VALUE,...",
            help="What the rig has besides the nominal simulation; repeatable; vectors as 0.01/0.02.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(parser=whole_number, metavar="INTEGER", help="Seed of noise and scatter.")] = 0,
    rows: Annotated[int, typer.Option(parser=whole_number, metavar="INTEGER", help="Rows of a push.")] = 7,
    finger_radius: Annotated[float, typer.Option(parser=number, metavar="METRES", help="Nominal radius of the fingers.")] = 0.005,
    mu: Annotated[
        float | None,
        typer.Option(parser=number, metavar="MU", help="Friction of the support, for models with forces in units of mu*N."),
    ] = None,
    noise: Annotated[
        tuple[str, str, str], typer.Option(metavar="N M RAD", help="Standard deviations of a row: force, position, angle.")
    ] = ("0", "0", "0"),
    outliers: Annotated[float, typer.Option(parser=number, metavar="SHARE", help="Share of rows ten times as far off.")] = 0.0,
    scatter: Annotated[
        float, typer.Option(parser=number, metavar="SHARE", help="Relative standard deviation of friction from push to push.")
    ] = 0.0,
    replan: Annotated[
        float | None,
        typer.Option(parser=number, metavar="METRES", help="Plan again when the slider is farther off the plan after a push."),
    ] = None,
) -> None:
    """Execute a plan on a simulated rig, with effects that the plan knows nothing of, and log it."""
    import numpy as np

    from stablepush.effects import parse_effect
    from stablepush.execution import execute_closed_loop, execute_plan
    from stablepush.logs import Noise, write_pushlog
    from stablepush.path import load_plan
    from stablepush.problem import load_scene
    from stablepush.pushing import Pusher
    from stablepush.virtual_rig import VirtualRig

    require_seed(seed)
    if not 1 <= rows <= 100_000:
        raise InputError(f"--rows: expected a whole number from 1 to 100000, got {rows}")
    deviations = []
    for name, text in zip(("N", "M", "RAD"), noise, strict=True):
        value = number(text)
        _require(f"--noise: {name}", value, text)
        deviations.append(value)
    for option, given in (
        ("--finger-radius", finger_radius),
        ("--mu", mu),
        ("--outliers", outliers),
        ("--scatter", scatter),
        ("--replan", replan),
    ):
        if given is not None:
            _require(option, given, f"{given:g}")
    effects = [parse_effect(text) for text in effect or []]
    require_folder(output)
    problem, result = load_scene(scene), load_plan(plan_file)
    contact = problem.contacts[0]
    spread = None if not any(deviations) else Noise(*deviations)
    with about(scene):
        rig = VirtualRig(
            problem.slider,
            problem.surface,
            contact.mu,
            Pusher.of_contact(contact, finger_radius) if len(contact.points) <= 2 else Pusher.finger(finger_radius),
            effects,
            spread,
            outliers,
            scatter,
            mu,
        )
    with about(plan_file), Progress("simulate", len(result.pushes)) as step:
        if replan is None:
            execution = execute_plan(rig, problem, result, rows=rows, seed=seed, progress=step.to)
        else:
            execution = execute_closed_loop(rig, problem, result, replan, rows=rows, seed=seed, progress=step.describe)
    write_pushlog(execution.log, output)
    x, y, theta = execution.final_pose
    miss = np.hypot(*(execution.final_pose[:2] - problem.goal[:2]))
    turn = math.degrees(abs(math.remainder(theta - float(problem.goal[2]), 2 * math.pi)))
    stuck = execution.log.trials["stable"]
    jams = sum(bool(trace.jammed.any()) for trace in execution.traces)
    jammed = f"; {jams} pushes jammed" if jams else ""
    missed = f"{1000 * miss:.1f} mm and {turn:.2f} deg from the goal"
    print(
        f"{output}: {len(execution.log)} pushes, {int(np.nansum(stuck))} stuck all the way; the slider ends at "
        f"x {x:.4f} m, y {y:.4f} m, theta {math.degrees(theta):.2f} deg, {missed}{jammed}"
    )


def _require(option: str, value: float, text: str) -> None:
    if not 0 <= value <= 1e6:
        raise InputError(f"{option}: expected a number >= 0, got {text}")


def slide(
    model: Annotated[Path, typer.Argument(help="model/1 file.")],
    slider_file: Annotated[Path, typer.Option("--slider", help="slider/1 file, with a mass.")],
    twist: Annotated[tuple[str, str, str], typer.Option(metavar="VX VY OMEGA", help="First body twist: m/s, m/s, rad/s.")],
    output: Output,
    mu: Annotated[
        float | None,
        typer.Option(parser=number, metavar="MU", help="Friction of the support, for models with forces in units of mu*N."),
    ] = None,
    gravity: Annotated[float, typer.Option(parser=number, metavar="M/S2", help="Gravity.")] = 9.81,
    duration: Annotated[
        float | None, typer.Option(parser=number, metavar="SECONDS", help="Cut the slide after this time.")
    ] = None,
    samples: Annotated[int, typer.Option(parser=whole_number, metavar="INTEGER", help="Rows of the table.")] = 201,
    picture: Annotated[Path | None, typer.Option(help="Picture of the slide as PNG.")] = None,
    view: Annotated[Path | None, typer.Option(help="Animation of the slide as an HTML page.")] = None,
) -> None:
    """Simulate a free slide until the body rests."""
    from stablepush.files import write_atomically
    from stablepush.formats import load_model, load_slider
    from stablepush.logs.table import table_text
    from stablepush.sliding import simulate_free_sliding

    first = []
    for name, text in zip(("VX", "VY", "OMEGA"), twist, strict=True):
        value = number(text)
        if not (math.isfinite(value) and abs(value) <= 1e6):
            raise InputError(f"--twist: {name}: expected a finite number of at most 1e6, got {text!r}")
        first.append(value)
    for option, given, least in (("--mu", mu, 0.0), ("--gravity", gravity, None), ("--duration", duration, None)):
        if given is None:
            continue
        if not math.isfinite(given) or given > 1e6 or (given < 0 if least is not None else given <= 0):
            raise InputError(f"{option}: expected a number {'>= 0' if least is not None else '> 0'}, got {given:g}")
    if not 2 <= samples <= 1_000_000:
        raise InputError(f"--samples: expected a whole number from 2 to 1000000, got {samples}")
    for path in (output, picture, view):
        if path is not None:
            require_file(path)
    require_distinct(output, picture, view)
    surface, slider = load_model(model), load_slider(slider_file)
    if slider.mass is None or slider.mass == 0:
        raise InputError(f"{slider_file}: mass: expected a mass > 0 in kg, got {slider.mass}")
    if mu is None and surface.force_unit == "mu*N":
        raise InputError(f"--mu: expected the friction of the support, since the forces of {model} are in units of mu*N")
    with about(model):
        result = simulate_free_sliding(surface, slider, first, mu=mu, gravity=gravity, duration=duration, samples=samples)
    columns = ("t", "x", "y", "theta", "vx", "vy", "omega")
    rows = (result.t, *result.poses.T, *result.twists.T)
    write_atomically(output, table_text(dict(zip(columns, rows, strict=True))))
    if picture is not None:
        from stablepush.plot import plot_slide, save_figure

        save_figure(plot_slide(slider, result), picture)
    if view is not None:
        from stablepush.report import slide_html

        write_atomically(view, slide_html(slider, result))
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
    return f"last rotation centre ({c[0]:.4g}, {c[1]:.4g}) m in the body"
