"""Commands: thin shells around the library. Heavy modules are imported inside, so that ``--help`` is quick."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stablepush import __version__
from stablepush.cli import blind, building, common, diagnosis, effects, export, identification, plans, regions, simulation, view
from stablepush.cli.common import require_folder, whole_number

app = typer.Typer(
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    help="Plan stable pushes of flat objects: from pokes to a limit surface, stable rotation centres and push paths.\n\n"
    "demo shows the whole chain. With files of your own: fit a surface to pokes, map its stable region, plan a scene, check the "
    "plan, make a trajectory of it for the robot, diagnose the log of what happened, correct the scene, and plan again.",
    epilog="Exit codes: 0 success, 1 a negative answer (no path, not valid), 2 bad input, 130 Ctrl-C. Options of this program "
    "come before the command: stablepush --quiet plan ... The files and all words are explained in docs/formats.md and "
    "docs/glossary.md.",
)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
    quiet: Annotated[
        bool, typer.Option("-q", "--quiet", help="Say nothing but errors: no summary, no progress, no notes.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary of the command as one JSON object.")] = False,
) -> None:
    speaks = version or context.invoked_subcommand is None
    if as_json and not speaks:
        common.answer_in_json()
    if quiet and not speaks:
        common.be_quiet()
    if version:
        print(f"stablepush {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit


@app.command()
def demo(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder to write.")] = Path("stablepush-demo"),
    seed: Annotated[int, typer.Option(parser=whole_number, metavar="INTEGER", help="Seed of the simulated pokes.")] = 0,
) -> None:
    """Run the whole chain on a built-in rig.

    Pokes, fit, map, plan, an execution that fails, its diagnosis, the corrected plan, and a report of all of it.
    """
    from stablepush.cli.demo import run_demo
    from stablepush.core import check_seed

    check_seed(seed, "--seed")
    require_folder(output)
    raise typer.Exit(run_demo(output, seed))


app.command("import")(identification.import_logs)
app.command()(identification.fit)
app.command()(regions.classify)
app.command("map")(regions.draw_map)
app.command()(regions.contacts)
app.command()(plans.plan)
app.command()(plans.check)
app.command()(plans.compare)
app.command()(plans.trajectory)
app.command()(simulation.simulate)
app.command()(simulation.slide)
app.command()(export.export)
app.command()(view.view)
app.command()(diagnosis.diagnose)
app.command()(diagnosis.correct)
app.command()(effects.effects)
app.command()(blind.blind)
app.command("compile")(building.build_all)
