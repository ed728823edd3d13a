"""The command that diagnoses the gap between simulation and reality."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stablepush.cli.common import Progress, about, require_files, require_folder, require_outside
from stablepush.core import InputError

if TYPE_CHECKING:
    from stablepush.diagnosis import GapReport


def diagnose(
    log: Annotated[Path, typer.Argument(help="pushlog/1 folder.")],
    answer: Annotated[Path | None, typer.Option("--json", help="diagnosis/1 file to write.")] = None,
    html: Annotated[Path | None, typer.Option(help="Report as one HTML page.")] = None,
    pushes: Annotated[Path | None, typer.Option(help="CSV list of the pushes to try next, as simulate takes it.")] = None,
    mended: Annotated[Path | None, typer.Option(help="Folder for rig.json and model.json of the corrected simulation.")] = None,
) -> None:
    """Find where simulation and reality differ, which effect causes it, and how much a corrected simulation reduces the gap."""
    from stablepush.diagnosis import diagnose as run, percent
    from stablepush.io import read_pushlog, write_atomically, write_json

    require_files(answer, html, pushes)
    if mended is not None:
        require_folder(mended)
        if mended in (answer, html, pushes):
            raise InputError("", "expected different output paths, this one is given twice", file=mended)
    for path in (answer, html, pushes, mended):
        if path is not None:
            require_outside(path, log)
    data = read_pushlog(log)
    with about(log), Progress("diagnose") as step:
        report = run(data, name=str(log), progress=step.describe)
    if answer is not None:
        write_json(answer, report.to_json())
    if html is not None:
        from stablepush.views import gap_html

        write_atomically(html, gap_html(report))
    if pushes is not None:
        _write_pushes(report, pushes)
    if mended is not None:
        _write_corrected(report, mended)
    print(f"{log}: {report.verdict}{': ' + ', '.join(report.named) if report.named else ''}")
    print(report.sentence)
    for entry in report.reductions:
        low, high = entry.ci95
        unit = "" if entry.unit == "1" else f" {entry.unit}"
        sizes = f"{entry.before:.4g}{unit} before, {entry.after:.4g} after, floor {entry.floor:.4g}"
        print(f"{entry.channel}: {sizes}; explained {100 * entry.closed:.0f} % ({percent(low)} to {percent(high)})")


def _write_pushes(report: GapReport, path: Path) -> None:
    from stablepush.rig import write_pushes

    proposed = report.next_experiment.pushes
    if proposed:
        write_pushes(proposed, path)
    else:
        print(f"{path}: not written: {report.next_experiment.why}")


def _write_corrected(report: GapReport, folder: Path) -> None:
    from stablepush.io import model_to_json, rig_to_json, write_json

    if report.surface is None:
        print(f"{folder}: not written: a corrected simulation needs forces in the log, or mass and support friction in rig.json")
        return
    extra = {**(report.rig.extra or {}), "effects": report.effects}
    write_json(folder / "rig.json", rig_to_json(replace(report.rig, extra=extra)))
    write_json(folder / "model.json", {**model_to_json(report.surface), "effects": report.effects})
