"""The command that diagnoses the gap between simulation and reality."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stablepush.cli.common import Progress, about, also_written, require_files, require_folder, require_outside, told
from stablepush.core import InputError

if TYPE_CHECKING:
    from stablepush.diagnosis import GapReport

#: Files of a corrected simulation.
_MENDED = ("rig.json", "model.json")
#: What explains a gap where nothing is named, by verdict.
_BY = {"absorbed": " by refitting the surface", "unknown": " by a fit that is not named"}
#: Why plans reckon with less certain fingers than before, by verdict, where their friction was not found.
_WHY_WIDER = {
    "absorbed": ", for fingers may be part of what a refit absorbed",
    "unknown": ", for fingers may be part of the gap that no cause explains",
}


def diagnose(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG", help="pushlog/1 folder; several of one rig together.")],
    simulated: Annotated[
        Path | None,
        typer.Option(
            help="pushlog/1 folder that another simulator wrote for the same commands: it is then the nominal simulation."
        ),
    ] = None,
    answer: Annotated[Path | None, typer.Option("--json", help="diagnosis/1 file to write.")] = None,
    html: Annotated[Path | None, typer.Option(help="Report as one HTML page.")] = None,
    pushes: Annotated[Path | None, typer.Option(help="CSV list of the pushes to try next, as simulate takes it.")] = None,
    mended: Annotated[Path | None, typer.Option(help="Folder for rig.json and model.json of the corrected simulation.")] = None,
) -> None:
    """Find where a log differs from simulation, and why.

    Names the effect that causes the gap, with its size, and how much of the gap a corrected simulation explains. In the summary,
    "before" is the error of the nominal simulation, "after" that of the corrected one, both on pushes that the fit did not see,
    and "floor" the error that noise alone leaves.
    """
    from stablepush.diagnosis import diagnose as run
    from stablepush.io import read_pushlog, write_atomically, write_json

    require_files(answer, html, pushes)
    if mended is not None:
        require_folder(mended)
        if mended in (answer, html, pushes):
            raise InputError("", "expected different output paths, this one is given twice", file=mended)
    for path in (answer, html, pushes, mended):
        for folder in (*logs, *([] if simulated is None else [simulated])):
            if path is not None:
                require_outside(path, folder)
    data = [read_pushlog(log) for log in logs]
    other = None if simulated is None else read_pushlog(simulated)
    about_logs = about(logs[0]) if len(logs) == 1 else nullcontext()
    with about_logs, Progress("diagnose") as step:
        try:
            report = run(data, name=[str(log) for log in logs], simulated=other, progress=step.describe)
        except InputError as error:
            if simulated is None or not error.place.startswith("simulated: "):
                raise
            raise InputError(error.place.removeprefix("simulated: "), error.expected, error.got, file=simulated) from None
    if answer is not None:
        write_json(answer, report.to_json())
    if html is not None:
        from stablepush.views import gap_html

        write_atomically(html, gap_html(report))
    if pushes is not None and not _write_pushes(report, pushes):
        pushes = None
    if mended is not None and not _write_corrected(report, mended):
        mended = None
    also_written(answer, html, pushes, mended)
    _tell_report(report, answer)


def _tell_report(report: GapReport, answer: Path | None) -> None:
    """Print what a diagnosis says."""
    told(
        log=report.log, verdict=report.verdict, effects=report.named, sentence=report.sentence, estimates=report.effects,
        channels=[
            {"channel": e.channel, "unit": e.unit, "before": e.before, "after": e.after, "floor": e.floor,
             "noise_floor": e.noise_floor, "closed": e.closed,
             "ci95": e.ci95}
            for e in report.reductions
        ],
        to_do=report.to_do,
    )  # fmt: skip
    print(f"{report.log}: {report.verdict}{': ' + ', '.join(report.named) if report.named else ''}")
    print(report.sentence)
    for entry in report.reductions:
        by = _BY.get(report.verdict, "") if entry.explained.endswith(")") else ""
        print(f"{entry.channel}: {entry.sizes}; {entry.explained}{by}")
    friction = report.support_friction
    if friction is not None:
        print(f"support friction: {friction:.3g} as refitted, where {report.rig.support_friction:.3g} was assumed")
    for id, needs in report.untested.items():
        print(f"not tested: {id}, which needs {needs}")
    for words in report.to_do:
        print(f"to do: {words}")
    if answer is not None and report.corrected and report.changes_plans:
        print(f"to plan for the rig as it is: stablepush correct SCENE.json {answer} -o SCENE2.json")


def _leave_out(option: str, path: Path, why: str) -> None:
    """Say why a file that was asked for is not written."""
    told(**{f"not_written_{option}": why})
    print(f"{path}: not written: {why}")


def _write_pushes(report: GapReport, path: Path) -> bool:
    """Write the proposed pushes, if there are any."""
    from stablepush.rig import write_pushes

    proposed = report.next_experiment.pushes
    if proposed:
        write_pushes(proposed, path)
    else:
        _leave_out("pushes", path, report.next_experiment.why)
    return bool(proposed)


def _write_corrected(report: GapReport, folder: Path) -> bool:
    """Write rig.json and model.json of the corrected simulation, if there is one."""
    from stablepush.io import model_to_json, rig_to_json, whole_folder, write_json

    if not report.corrected:
        _leave_out("mended", folder, "the log could not be diagnosed, or the differences belong to the other simulator")
        return False
    if report.surface is None:
        _leave_out("mended", folder, "a corrected simulation needs forces in the log, or mass and support friction in rig.json")
        return False
    surface = report.corrected[0].surface or report.surface
    effects = [{"effect": id, "parameters": values, "covariance": None} for id, values in report.effects_beside.items()]
    extra = {**(report.rig.extra or {}), "effects": effects}
    with whole_folder(folder, *_MENDED) as place:
        write_json(place / "rig.json", rig_to_json(replace(report.rig, extra=extra, model=surface)))
        write_json(place / "model.json", {**model_to_json(surface), "effects": effects})
    return True


def correct(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="scene/1 file.")],
    diagnosis: Annotated[Path, typer.Argument(metavar="DIAGNOSIS", help="diagnosis/1 file, as diagnose --json writes it.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="scene/1 file to write.")],
) -> None:
    """Write the scene of the rig as a diagnosis found it.

    Its surface, fingers and effects are the corrected ones, each with its uncertainty.
    """
    from stablepush.effects import CATALOGUE
    from stablepush.planning import correct as corrected, load_diagnosis, load_scene, require_loads, save_scene

    require_files(output, read=(scene, diagnosis))
    problem, saved = load_scene(scene), load_diagnosis(diagnosis)
    with about(scene):
        found = corrected(problem, saved)
    save_scene(found, output)
    before, after = problem.contacts[0].mu, found.contacts[0].mu
    changes = ["limit surface as the diagnosis has it"] if found.surface is not problem.surface else []
    if found.support_friction != problem.support_friction:
        changes += [f"support friction {found.support_friction:.3g}"]
    changes += [f"finger friction {after:.3g} for {before:.3g}"] if after != before else []
    width, own = found.uncertainty.relative_friction, problem.uncertainty.relative_friction
    if width > own:
        why = _WHY_WIDER.get(saved.verdict, "") if after == before else ""
        changes += [f"plans for finger friction of {(1 - width) * after:.2g} to {(1 + width) * after:.2g}{why}"]
    changes += [f"finger radius {1000 * found.finger_radius:.3g} mm"] if found.finger_radius != problem.finger_radius else []
    aside = any((a.points != b.points).any() for a, b in zip(found.contacts, problem.contacts, strict=True))
    changes += ["contacts elsewhere"] if aside else []
    offset = saved.corrected[0].tracker_offset
    if (found.goal != problem.goal).any() and offset is not None:
        by = ", ".join(f"{1000 * value:.3g}" for value in (-offset[0], -offset[1]))
        changes += [f"start and goal are of the centre of mass, at ({by}) mm of the tracked frame"]
    changes += [f"effects {', '.join(entry.effect.id for entry in found.effects)}"] if found.effects else []
    changes += [f"{len(found.alternatives)} alternatives"] if found.alternatives else []
    told(
        output=output, changes=changes, effects=[entry.effect.id for entry in found.effects], alternatives=len(found.alternatives)
    )
    acts = [entry.effect.id for entry in saved.corrected[0].effects if CATALOGUE[entry.effect.id].acts == "support"]
    fitted = found.surface is problem.surface and problem.surface.point_loads is None and problem.surface.force_unit == "N"
    left = [id for id in saved.named if id not in CATALOGUE]
    without = f": {', '.join(left)} is the lab's own, which no scene can hold" if left else ""
    print(f"{output}: {'; '.join(changes) or 'nothing to correct'}{without}")
    if acts and fitted:
        print(
            f"the limit surface stays: if it was fitted to pokes on this table, {', '.join(acts)} is in it, too; model.json of "
            "diagnose --mended is without"
        )
    try:
        found.require_plannable()
        require_loads(found)
    except InputError as error:
        open_still = bool(found.alternatives) and error.place.startswith(("uncertainty.start", "effects", "alternatives"))
        settle = "; make the pushes of the diagnosis' next experiment, which tell the causes apart" if open_still else ""
        print(f"{output}: plan will refuse this scene: {error}{settle}")
