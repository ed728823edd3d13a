"""The command that writes a scene and a plan as a model of another simulator."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from stablepush.cli.common import about, note_if_invalid, number, options_of, require_files, told
from stablepush.core import EffectError, InputError


def export(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="scene/1 file.")],
    plan_file: Annotated[
        Path | None,
        typer.Argument(metavar="PLAN", help="plan/1 file, solved: the motion of the fingers, and where they begin."),
    ] = None,
    mjcf: Annotated[Path | None, typer.Option(help="MuJoCo model to write (XML); its keyframes are the plan.")] = None,
    sdf: Annotated[Path | None, typer.Option(help="SDFormat world for Drake to write.")] = None,
    finger_radius: Annotated[
        float | None, typer.Option(parser=number, metavar="METRES", help="Radius of the fingers; the scene's if not given.")
    ] = None,
) -> None:
    """Write a scene and a plan for MuJoCo or Drake.

    The model has the slider on feet, driven fingers, and obstacles. Fingers need a radius: that of the scene, or --finger-radius.
    """
    from stablepush.io import write_atomically
    from stablepush.planning import load_plan, load_scene
    from stablepush.rig import export_mjcf, export_sdf

    if mjcf is None and sdf is None:
        raise InputError("--mjcf, --sdf", "expected at least one file to write", "none")
    require_files(mjcf, sdf, read=(scene, plan_file))
    problem = load_scene(scene)
    result = None if plan_file is None else load_plan(plan_file)
    with about(scene, options=options_of("finger_radius")):
        if finger_radius is not None:
            problem = problem.with_changes(finger_radius=finger_radius)
    writers = [(path, write) for path, write in ((mjcf, export_mjcf), (sdf, export_sdf)) if path is not None]
    models = []
    for path, write in writers:
        try:
            models.append((path, write(problem, result)))
        except EffectError as error:
            # the effects are the scene's
            raise error.within(file=scene) from None
        except InputError as error:
            # of the plan, or of the scene
            of_plan = plan_file is not None and error.place.startswith(("segments", "plan"))
            named = options_of("finger_radius") if finger_radius is not None else {}
            with about(plan_file if of_plan and plan_file is not None else scene, options=named):
                raise error from None
    for path, text in models:
        write_atomically(path, text)
    if problem.pusher is not None:
        print("note: the outline of the pusher is not in the model, which has its fingers alone", file=sys.stderr)
    note_if_invalid(problem, result, plan_file)
    keyframes = models[0][1].count("<key ")
    told(mjcf=mjcf, sdf=sdf, keyframes=keyframes if mjcf is not None else None)
    if mjcf is not None:
        words = "the start" if result is None else f"{keyframes} keyframes of the plan"
        print(f"{mjcf}: MuJoCo model with {words}")
    if sdf is not None:
        motion = "" if plan_file is None else f"; its motion: stablepush trajectory {scene} {plan_file} -o trajectory.csv"
        print(f"{sdf}: SDFormat world{motion}")
