"""The command that writes a page to try pushes on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stablepush.cli.common import Output, about, note_if_invalid, require_files, told


def view(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="scene/1 file.")],
    output: Output,
    plan_file: Annotated[Path | None, typer.Argument(metavar="PLAN", help="plan/1 file, drawn as a path.")] = None,
    model: Annotated[Path | None, typer.Argument(metavar="MODEL", help="model/1 file, in place of the scene's.")] = None,
) -> None:
    """Write a page on which pushes can be tried by hand.

    Move rotation centre, start, goal and obstacles; see stability, margin, the load in the cone, and which finger slips first.
    """
    from stablepush.io import load_model, write_atomically
    from stablepush.planning import load_plan, load_scene
    from stablepush.views import scene_html

    require_files(output, read=(scene, plan_file, model))
    problem = load_scene(scene)
    result = None if plan_file is None else load_plan(plan_file)
    surface = None if model is None else load_model(model)
    with about(scene):
        page = scene_html(problem, result, surface, title=f"Try pushes: {scene.stem}")
    write_atomically(output, page)
    told(output=output)
    print(f"{output}: open it in a browser; it needs no network")
    if surface is None:
        note_if_invalid(problem, result, plan_file)
