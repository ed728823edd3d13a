"""The command that checks the diagnosis on logs whose cause is sealed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stablepush.cli.common import Progress, about, options_of, require_folder, told, whole_number
from stablepush.core import InputError

if TYPE_CHECKING:
    from stablepush.blind import Score


#: Modules that generators need.
_NEEDS = {
    "mujoco": ("mujoco", "cryptography"), "drake": ("pydrake", "cryptography"), "both": ("mujoco", "pydrake", "cryptography"),
    "lab": ("cryptography",),
}  # fmt: skip


def blind(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the check; an interrupted check in it resumes.")],
    sets: Annotated[
        int | None,
        typer.Option(parser=whole_number, metavar="INTEGER", help="Number of logs; 12, or all those of the lab, if not given."),
    ] = None,
    generator: Annotated[
        str | None,
        typer.Option(
            help="Source of the logs: mujoco (default), drake, both (one set in ten from Drake), or lab, the Manipulation Lab's "
            "pokes with other supports."
        ),
    ] = None,
    data: Annotated[Path | None, typer.Option(help="Clone of the lab's logs, for the generator lab.")] = None,
    seed: Annotated[
        int | None, typer.Option(parser=whole_number, metavar="INTEGER", help="Seed of the logs; a random one if not given.")
    ] = None,
    pushes: Annotated[
        int | None, typer.Option(parser=whole_number, metavar="INTEGER", help="Pushes of each log; 60 if not given.")
    ] = None,
    jobs: Annotated[int, typer.Option(parser=whole_number, metavar="INTEGER", help="Number of parallel processes.")] = 1,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask cluster that does the work.")] = None,
    expect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HASH",
            help="A hash of the ledger that you noted earlier: the check is refused if the ledger lacks it; repeatable.",
        ),
    ] = None,
    loop: Annotated[
        bool,
        typer.Option(
            "--loop",
            help="Whole loops: plans carried out with something wrong, diagnosis of their log, correction, new plans; how many "
            "arrive is counted.",
        ),
    ] = False,
    earlier: Annotated[
        int | None,
        typer.Option(
            parser=whole_number,
            metavar="INTEGER",
            help="Number of earlier checks whose results were used to improve the diagnosis.",
        ),
    ] = None,
) -> None:
    """Score the diagnosis on logs whose cause is sealed.

    Logs are made, their causes encrypted, the logs diagnosed, and then the causes decrypted. With --loop whole loops are
    counted, in four arms: plans with the surface of the pokes (old), the same with wide margins (wide), with the corrected
    scene (corrected), and with the true one (true).

    Exits with 1 if the seal of any set is broken.
    """
    if generator is not None and generator not in _NEEDS:
        raise InputError("--generator", f"expected {', '.join(list(_NEEDS)[:-1])} or lab", repr(generator))
    if (generator == "lab") != (data is not None):
        raise InputError("--data", "the generator lab needs the folder of the lab's logs, others take none")
    for word, value, least, most in (("sets", sets, 1, 100_000), ("pushes", pushes, 4, 10_000), ("jobs", jobs, 1, 1024)):
        if value is not None and not least <= value <= most:
            raise InputError(f"--{word}", f"expected a whole number from {least} to {most}", value)
    if earlier is not None and earlier < 0:
        raise InputError("--earlier", "expected a whole number from 0", earlier)
    if seed is not None:
        from stablepush.core import check_seed

        with about(output, options=options_of("seed")):
            check_seed(seed)
    require_folder(output)
    if loop:
        _loop(output, generator or "mujoco", sets or 10, seed, jobs)
        return
    # one that was begun has its generator
    _require(generator or ("lab" if (output / "ledger.jsonl").is_file() else "mujoco"))
    from stablepush.blind import BlindCheck, alone
    from stablepush.io import write_atomically

    with alone(output), Progress("blind") as progress:
        check = BlindCheck(output, generator, sets, seed, pushes, jobs, scheduler, data, expect or ())
        _require(check.generator)

        def on_progress(what: str, done: int, total: int) -> None:
            progress.describe(f"{what} {done} of {total}")

        progress.say(f"ledger when all was sealed: {check.seal(on_progress)}", error=False)
        progress.say(f"ledger when all was diagnosed: {check.diagnose(on_progress)}", error=False)
        score = check.score(on_progress)
    write_atomically(output / "score.csv", _csv(score.rows, ["set"]))
    write_atomically(output / "score.html", _page(score, earlier, check.generator) if data is None else _lab_page(score))
    told(output=output, score=dict(score.lines))
    for name, words in score.lines:
        print(f"{name}: {words}")
    print(output / "score.html")
    if score.refused:
        raise typer.Exit(1)


def _loop(output: Path, generator: str, loops: int, seed: int | None, jobs: int) -> None:
    """A campaign of loops: its rows as ``rows.json`` of each, a summary, and ``score.csv``."""
    if generator not in ("mujoco", "drake"):
        raise InputError("--generator", "expected mujoco or drake for loops", repr(generator))
    _require(generator)
    import secrets

    from stablepush.blind import LoopCheck, alone, summary
    from stablepush.io import write_atomically

    with alone(output), Progress("blind") as progress:
        check = LoopCheck(output, generator, loops, secrets.randbelow(2**31) if seed is None else seed, jobs)
        rows = check.run(lambda what, done, total: progress.describe(f"{what} {done} of {total}"))
    write_atomically(output / "score.csv", _csv(rows, ["loop"]))
    lines = [("loops", f"{loops}, seed {check.seed}"), *summary(rows), ("last entry of the ledger", check.ledger.head)]
    told(output=output, score=dict(lines))
    for name, words in lines:
        print(f"{name}: {words}")


_ENGINES = {"mujoco": "MuJoCo", "drake": "Drake", "both": "MuJoCo, one in ten from Drake"}


def _require(generator: str) -> None:
    from importlib.util import find_spec

    missing = [module for module in _NEEDS[generator] if find_spec(module) is None]
    if missing:
        extras = ",".join(dict.fromkeys("drake" if module == "pydrake" else "sim" for module in missing))
        raise InputError(f"the blind check needs {' and '.join(missing)}", f'pip install "stablepush[{extras}]"')


def _csv(rows: list[dict[str, Any]], otherwise: list[str]) -> str:
    import csv
    import io

    out = io.StringIO()
    writer = csv.DictWriter(out, list(rows[0]) if rows else otherwise, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def _lab_page(score: Score) -> str:
    from stablepush.views import Section, report_html

    how = (
        "Real pokes of a triangle on three feet. The rig that was diagnosed had the feet of any arrangement; which one the "
        "slider stood on was sealed. A wrong support counts as found if an effect of the pressure, or of the slider's own "
        "friction, is named, or the gap is explained by recalibration."
    )
    sections = [Section("Score", how, score.lines), Section("By log", "", score.by_effect)]
    return report_html("Blind check of the diagnosis on real pokes", f"{len(score.rows)} cases", sections)


def _page(score: Score, earlier: int | None, generator: str) -> str:
    from stablepush.views import Section, report_html
    from stablepush.views.plot import figure_png, plot_calibration

    before = (
        "Whether the diagnosis was improved on earlier checks was not stated."
        if earlier is None
        else "The diagnosis was not changed on what an earlier check showed."
        if earlier == 0
        else f"The diagnosis was improved on {earlier} earlier {'check' if earlier == 1 else 'checks'}, of other seeds."
    )
    how = (
        f"Logs come from {_ENGINES[generator]}, in a process of their own that shares no code with the diagnosis; many of the "
        "effects have another form than in the catalogue. Labels are encrypted before any log is diagnosed, and opened when all "
        "are; a ledger of hashes shows the order. An effect counts as detectable if it stands out by ten times the noise of all "
        "rows together, after a free pressure has taken what it can; that is part of the sealed label. " + before
    )
    sections = [
        Section("Score", how, score.lines),
        Section.with_picture(
            "Probabilities", figure_png(plot_calibration(score.calibration, score.coverage)),
            "Left: how often an effect acts, by its reported probability. Right: how often the most probable effect acts, "
            "among the share of sets that the diagnosis is most certain of.",
        ),
        Section("By effect", "Answers to sets with one effect; faint ones are not detectable.", score.by_effect),
        Section("By form and engine", "", score.by_form),
    ]  # fmt: skip
    return report_html("Blind check of the diagnosis", f"{len(score.rows)} sets", sections)
