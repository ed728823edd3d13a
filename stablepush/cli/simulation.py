"""Commands that simulate motion."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from stablepush.cli.common import Output, about, number, require_distinct, require_file, whole_number
from stablepush.errors import InputError


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
    for path in (output, picture):
        if path is not None:
            require_file(path)
    require_distinct(output, picture)
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
