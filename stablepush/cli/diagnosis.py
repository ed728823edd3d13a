"""The command that diagnoses the gap between simulation and reality."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stablepush.cli.common import Progress, about, require_files, require_folder, require_outside
from stablepush.errors import InputError

if TYPE_CHECKING:
    from stablepush.diagnosis import GapReport


def diagnose(
    log: Annotated[Path, typer.Argument(help="pushlog/1 folder.")],
    answer: Annotated[Path | None, typer.Option("--json", help="diagnosis/1 file to write.")] = None,
    html: Annotated[Path | None, typer.Option(help="Report as one HTML page.")] = None,
    pushes: Annotated[Path | None, typer.Option(help="CSV list of the pushes to try next, as simulate takes it.")] = None,
    mended: Annotated[Path | None, typer.Option(help="Folder for rig.json and model.json of the mended simulation.")] = None,
) -> None:
    """Tell where simulation and reality differ, which effect causes it, and how far the gap shrinks."""
    from stablepush.diagnosis import diagnose as run
    from stablepush.files import write_atomically, write_json
    from stablepush.logs import read_pushlog

    require_files(answer, html, pushes)
    if mended is not None:
        require_folder(mended)
        if mended in (answer, html, pushes):
            raise InputError(f"{mended}: expected different places to write, it is named twice")
    for path in (answer, html, pushes, mended):
        if path is not None:
            require_outside(path, log)
    data = read_pushlog(log)
    with about(log), Progress("diagnose") as step:
        report = run(data, name=str(log), progress=step.describe)
    if answer is not None:
        write_json(answer, report.to_json())
    if html is not None:
        write_atomically(html, _page(report))
    if pushes is not None:
        _write_pushes(report, pushes)
    if mended is not None:
        _write_mended(report, mended)
    print(f"{log}: {report.verdict}{': ' + ', '.join(report.named) if report.named else ''}")
    print(report.sentence)
    for entry in report.shrink:
        low, high = entry["ci95"]
        unit = "" if entry["unit"] == "1" else f" {entry['unit']}"
        sizes = f"{entry['before']:.4g}{unit} before, {entry['after']:.4g} after, floor {entry['floor']:.4g}"
        print(f"{entry['channel']}: {sizes}; closed {100 * entry['closed']:.0f} % ({_percent(low)} to {_percent(high)})")


def _percent(share: float) -> str:
    """A share in percent; where there is hardly a gap its interval says nothing."""
    return "below -100" if share < -1 else f"{100 * share:.0f}"


def _write_pushes(report: GapReport, path: Path) -> None:
    import numpy as np

    from stablepush.files import write_atomically
    from stablepush.logs.table import table_text

    proposed = report.next_experiment["pushes"]
    if not proposed:
        print(f"{path}: not written: {report.next_experiment['why']}")
        return
    names = [name for name in proposed[0] if not name.startswith("expected")]
    write_atomically(path, table_text({name: np.array([push[name] for push in proposed]) for name in names}))


def _write_mended(report: GapReport, folder: Path) -> None:
    from stablepush.files import write_json
    from stablepush.formats import model_to_json
    from stablepush.logs.pushlog import rig_to_json

    if report.surface is None:
        print(f"{folder}: not written: a mended simulation needs forces, or a rig that says the mass and the support's friction")
        return
    extra = {**(report.rig.extra or {}), "effects": report.effects}
    write_json(folder / "rig.json", rig_to_json(replace(report.rig, extra=extra)))
    write_json(folder / "model.json", {**model_to_json(report.surface), "effects": report.effects})


def _page(report: GapReport) -> str:
    from stablepush.plot import figure_png, plot_effects, plot_ends, plot_residuals, plot_residuals_against
    from stablepush.report import Section, report_html

    def number(value: object) -> str:
        if isinstance(value, list):
            return ", ".join(number(v) for v in value)
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    sections = [
        Section("Verdict", report.sentence, [("verdict", report.verdict), ("effects", ", ".join(report.named) or "none")])
    ]
    shrink = [
        (
            entry["channel"],
            f"{number(entry['before'])} {entry['unit'].removeprefix('1')} before, {number(entry['after'])} after, "
            f"floor {number(entry['floor'])}; "
            f"closed {100 * entry['closed']:.0f} % ({_percent(entry['ci95'][0])} to {_percent(entry['ci95'][1])}), "
            f"{entry['held_out_trials']} held-out trials",
        )
        for entry in report.shrink
    ]
    sections.append(
        Section("How far the gap shrinks", "Root mean squares on trials that the mended simulation was not fitted to.", shrink)
    )
    if report.residuals:
        sections.append(Section.with_picture("Where: over the table", figure_png(plot_residuals(report))))
        text = "Residuals of the nominal simulation and of the mended one."
        sections.append(Section.with_picture("Where: heading and order", figure_png(plot_residuals_against(report)), text))
    if report.where:
        found = [
            (
                f"{f.channel}, {f.component}: {f.covariate}",
                f"{100 * f.share:.0f} % of the variance, p {f.p_value:.4f}",
            )
            for f in report.where[:12]
        ]
        sections.append(Section("Where: what residuals follow", "On held-out trials.", found))
    if report.ends and len(report.places):
        words = "Pushes carried out again in simulation, from where the slider lay and as the pusher went."
        sections.append(Section.with_picture("Where: ends of pushes", figure_png(plot_ends(report)), words))
    rows = []
    for entry in report.ranking:
        parameters = "; ".join(
            f"{name} {number(p['estimate'])} ({number(p['ci95'])}) {p['unit']}" for name, p in entry["parameters"].items()
        )
        said = parameters if entry["identifiable"] else f"This log cannot show it: {entry['reason']}."
        rows.append((entry["effect"], f"{entry['probability']:.2f}. {said}"))
    text = "Probability of each effect of the catalogue given the others that are named, and its parameters with 95 % intervals."
    sections.append(Section.with_picture("Why", figure_png(plot_effects(report)), text, rows))
    after = report.next_experiment
    pushes = [
        (f"push {k + 1}", ", ".join(f"{name} {number(value)}" for name, value in push.items()))
        for k, push in enumerate(after["pushes"])
    ]
    words = f"To separate {' and '.join(after['separates'])}: {after['why']}." if after["separates"] else f"{after['why']}."
    sections.append(Section("What to try next", words, pushes))
    how = (
        "Loads of support points under the outline and the parameters of effects are fitted jointly to the measured "
        "wrenches and to the gaps between fingers and outline, each row weighted by the noise of forces and motion and by "
        "how far off it is. Without forces the ends of pushes are fitted in the place of wrenches, each carried out again "
        "in simulation. An effect is named if no effect would show so clearly by chance more than once in a hundred logs "
        "(signs of the trials' scores drawn at random; without forces a larger gain may do instead), and the log density "
        "grows by enough over its scatter between pushes; the others are judged given it. Pressure is named if it "
        "predicts held-out trials as well as any pressure does, friction of the fingers if forces of those that slip say "
        "so. Which effects act was found on all trials; shares of the gap are those of trials left out of the fit, five "
        "folds, repeats kept together."
    )
    sections.append(Section("How it was computed", how))
    sections.append(Section("Data quality", "", [("note", note) for note in report.notes] or [("note", "nothing to remark")]))
    return report_html("Diagnosis of a push log", f"{report.log}, {report.trials} pushes", sections)
