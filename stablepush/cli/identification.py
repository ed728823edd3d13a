"""Commands that read logs and fit limit surfaces."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stablepush.cli.common import (
    Output,
    Progress,
    about,
    also_written,
    number,
    options_of,
    require_files,
    require_folder,
    require_outside,
    told,
    whole_number,
)
from stablepush.core import InputError, counted, real_path, some_of

if TYPE_CHECKING:
    from stablepush.identify import Fit

#: Angle error (deg) of left-out pokes beyond which the data is doubted: rough wood has 12.
_LARGE = 18.0
#: Acceleration of gravity (m/s²).
_GRAVITY = 9.81


def import_logs(
    source: Annotated[
        Path, typer.Argument(metavar="SOURCE", help="Raw log, a folder of them, or a clone of the lab's repository.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write; several logs give one folder each.")],
    kind: Annotated[
        str | None,
        typer.Option(help="mlab-poke, mlab-stable, mit-push, rosbag or csv; if not given, the first three are tried."),
    ] = None,
    slider: Annotated[
        Path | None, typer.Option(help="slider/1 file: the outline about the centre of mass; replaces the lab's triangle.")
    ] = None,
    mapping: Annotated[
        Path | None, typer.Option(help="YAML file that says which topic or column is what; for the kinds rosbag and csv.")
    ] = None,
) -> None:
    """Convert raw logs into pushlog/1 folders.

    Logs of the Manipulation Lab and of the MIT push data set, ROS bags, and CSV tables.
    """
    from stablepush.io import load_slider, write_pushlog
    from stablepush.io.importers import find_sources, import_source

    require_folder(output)
    for path in (source, slider, mapping):
        if path is not None and path.exists():
            require_outside(path, output)
    replacement = None if slider is None else load_slider(slider)
    with about(source, options=options_of("kind", "mapping")):
        sources = find_sources(source, kind, mapping)
    several = len(sources) > 1
    imported, made = 0, []
    with Progress("import", len(sources)) as step:
        for item in sources:
            try:
                log, notes = import_source(item, replacement)
            except InputError as error:
                # what is about the mapping, or the slider that it names, is about all logs
                of_log = mapping is None or real_path(error.file).is_relative_to(real_path(item.file))
                if not several or not error.file or not of_log:
                    raise
                # a clone holds files of other experiments: one that is no log of ours must not keep the others out
                step.say(f"note: skipped: {error}")
                continue
            target = output / item.name if several else output
            write_pushlog(log, target)
            imported += 1
            pairs = log.pairs()
            forward = int(((pairs.wrenches * pairs.twists).sum(axis=1) > 0).sum())
            for note in notes:
                step.say(f"note: {note}")
            against = len(pairs.trials) - forward
            summary = f", {counted(len(pairs.trials), 'pair')} of load and twist" if pairs.trials else ""
            summary += f", in {against} of which the force opposes the motion" if against else ""
            made.append({"output": target, "kind": item.kind, "pushes": len(log), "pairs": len(pairs.trials), "notes": notes})
            told(logs=made)
            step.say(f"{target}: {item.kind}, {counted(len(log), 'push')}{summary}", error=False)
            step()
    if not imported:
        raise InputError("", f"expected at least one whole log, none of {len(sources)} could be read", file=source)


def _write_support(slider: Path, mu: float, output: Path, view: Path | None) -> None:
    """Write the surface of a slider whose support points are known."""
    from stablepush.core import check_number, note_friction
    from stablepush.io import load_slider, save_model, write_atomically
    from stablepush.surfaces import IdealLimitSurface

    note_friction(check_number(mu, "--support-mu", positive=True), "--support-mu")
    body = load_slider(slider)
    if body.support is None or body.mass is None:
        words = (
            "expected both to be stated: --support-mu is for the surface of known support points. For the mean surface leave it "
            'out, and give the scene its "support_friction"'
        )
        raise InputError("support, mass", words, file=slider)
    surface = IdealLimitSurface(body.support, mu * body.mass * _GRAVITY)
    if view is not None:
        from stablepush.views import surface_html

        write_atomically(view, surface_html(surface, title="Surface of known support points"))
    save_model(surface, output)
    told(output=output, model="support", points=len(body.support.points), friction_load=surface.friction_load)
    print(f"{output}: {counted(len(body.support.points), 'support point')}, friction load {surface.friction_load:.4g} N")
    also_written(view)


def fit(
    output: Output,
    log: Annotated[Path | None, typer.Argument(metavar="LOG", help="pushlog/1 folder.")] = None,
    slider: Annotated[
        Path | None, typer.Option(help="slider/1 file or scene, instead of a log: a surface from no poke at all.")
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            help="poly4-cvx (the default), poly4, poly6-cvx, quadratic or gp. support: the exact surface of the support points "
            "in the slider's file, with --slider, --support-mu and a mass."
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(parser=whole_number, metavar="INTEGER", help="Seed of the folds, the pressures and the ensemble.")
    ] = 0,
    no_slider: Annotated[bool, typer.Option("--no-slider", help="Do not use the log's slider as prior knowledge.")] = False,
    loss: Annotated[
        str,
        typer.Option(
            help="squared, published (the equation of Zhou et al. 2016) or norm (their code); the last two ignore the slider."
        ),
    ] = "squared",
    com_tolerance: Annotated[
        float, typer.Option(parser=number, metavar="METRES", help="Half width of the box in which the centre of mass may lie.")
    ] = 0.0,
    support_mu: Annotated[
        float | None,
        typer.Option(parser=number, metavar="MU", help="Friction of the table, for --model support: loads are then in N."),
    ] = None,
    view: Annotated[Path | None, typer.Option(help="The surface with the pokes on it, as an HTML page.")] = None,
) -> None:
    """Identify a limit surface from a log of pokes. With --slider and no log: the mean surface of likely pressures."""
    import numpy as np

    from stablepush.identify import fit_limit_surface
    from stablepush.io import load_slider, read_pushlog

    source = slider if log is None else log
    if source is None or None not in (log, slider):
        words = "expected a log of pokes, whose rig.json has the slider, or --slider without a log"
        raise InputError("LOG", words, "neither" if source is None else "both")
    if model == "support" or support_mu is not None:
        others = {"--loss": loss != "squared", "--com-tolerance": com_tolerance != 0, "--no-slider": no_slider}
        _require_support_alone(log, model, support_mu, others)
    require_files(output, view, read=(slider,))
    if support_mu is not None:
        _write_support(source, support_mu, output, view)
        return
    model = model or "poly4-cvx"
    loads, twists = np.empty((0, 3)), np.empty((0, 3))
    names: list[str] = []
    if log is None:
        if no_slider:
            raise InputError("--no-slider", "expected a log with it")
        body = load_slider(source)
    else:
        for path in (output, view):
            if path is not None:
                require_outside(path, log)
        pokes = read_pushlog(log)
        loads, twists, names = pokes.pairs()
        body = pokes.rig.slider
        if not names:
            raise InputError("", "expected push rows with forces and motion, found none", file=log)
    given = options_of("model", "loss", "com_tolerance", "seed") | ({"wrenches, twists": "--slider"} if log is None else {})
    with Progress("fit") as step, about(source, options=given):
        result = fit_limit_surface(
            loads,
            twists,
            model,
            slider=None if no_slider else body,
            seed=seed,
            loss=loss,
            com_tolerance=com_tolerance,
            progress=step.to,
        )
    from stablepush.io import save_model

    if view is not None:
        from stablepush.io import write_atomically
        from stablepush.views import surface_html

        page = surface_html(result.surface, loads, twists, names, title=f"{model} from {len(names)} pokes")
        write_atomically(view, page)
    save_model(result.surface, output)
    _tell_fit(result, model, names, output, view)


def _require_support_alone(log: Path | None, model: str | None, support_mu: float | None, others: dict[str, bool]) -> None:
    """Refuse options that known support points leave without meaning."""
    if support_mu is None or log is not None or model not in ("support", None):
        raise InputError("--model, --support-mu", "expected --model support, --support-mu and --slider together, without a log")
    if any(others.values()):
        given = ", ".join(name for name, is_given in others.items() if is_given)
        raise InputError(given, "expected none with known support points")


def _tell_fit(result: Fit, model: str, names: list[str], output: Path, view: Path | None) -> None:
    """Print what was identified, how well it fits, and what is to be said of it."""
    import numpy as np

    told(
        output=output, model=model, pokes=len(names), status=result.status, total_time=result.total_time,
        validation_error=result.validation_error, angle_error=float(np.mean(result.angle_errors)) if names else None,
        sos_convex=None if result.certificate is None else result.certificate.sos_convex, notes=list(result.warnings),
    )  # fmt: skip
    print(f"{output}: {model} from {counted(len(names), 'poke')}, {result.status}, {result.total_time:.2f} s")
    also_written(view)
    for warning in result.warnings:
        print(f"note: {warning}")
    left_out = [name for name, weight in zip(names, result.pair_weights, strict=True) if not weight]
    if left_out:
        print(f"note: left out: {counted(len(left_out), 'push')} ({some_of(left_out)})")
    if result.prior_weight:
        told_of_loads = ", weighed by the pokes" if names else "; loads are in units of mu*N"
        print(f"prior: pressures under the slider's outline{told_of_loads}")
    if result.validation_error is not None:
        error = math.degrees(result.validation_error)
        much = " (large: are units, axes and signs of poses and forces right?)" if error > _LARGE else ""
        print(f"angle error on pokes left out: {error:.2f} deg{much}")
    if names:
        print(f"angle error on the pokes used:  {math.degrees(float(np.mean(result.angle_errors))):.2f} deg")
    if result.certificate is not None:
        word = "proven convex" if result.certificate.sos_convex else "NOT proven convex"
        print(
            f"the surface is {word} (sum of squares: smallest eigenvalue {result.certificate.min_eigenvalue:.3g}, "
            f"residual {result.certificate.residual:.1g})"
        )
