"""The demonstration: pokes, a plan, a run that loses the object, its diagnosis, and a corrected plan that arrives; as a page."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stablepush.cli.common import told
from stablepush.demo import SLIPPERY, demo_log, demo_pokes, demo_scene, demo_slider
from stablepush.diagnosis import diagnose
from stablepush.geometry import wrap_angle
from stablepush.identify import Fit, fit_limit_surface
from stablepush.io import (
    LOG_FILES,
    load_model,
    read_pushlog,
    save_model,
    whole_folder,
    write_atomically,
    write_json,
    write_pushlog,
)
from stablepush.planning import (
    CheckReport,
    PlanningProblem,
    PlanResult,
    check_plan,
    correct,
    load_corrections,
    load_plan,
    load_scene,
    plan,
    save_plan,
    save_scene,
)
from stablepush.rig import Execution
from stablepush.stability import StableRegion, all_pressure_region, lynch_mason_region, probability_map, stable_region
from stablepush.views import Section, execution_html, gap_html, plan_html, report_html
from stablepush.views.plot import figure_png, plot_plan, plot_regions

#: What the page proposes.
_NEXT = (
    ("a limit surface from a log of pokes; SCENE.json refers to it", "stablepush fit POKES -o model.json"),
    ("a path of stable pushes", "stablepush plan SCENE.json -o plan.json --view plan.html"),
    (
        "from the log of the executed plan: why it went another way",
        "stablepush diagnose LOG --html diagnosis.html --json diagnosis.json",
    ),
    ("the scene with what was found", "stablepush correct SCENE.json diagnosis.json -o corrected.json"),
    ("a plan that reckons with it", "stablepush plan corrected.json -o corrected-plan.json"),
)


#: Files that a demo leaves.
DEMO_FILES = (
    *("model.json", "scene.json", "plan.json", "diagnosis.json", "corrected.json", "corrected-plan.json", "map.png", "plan.png"),
    *("plan.html", "run.html", "second-run.html", "diagnosis.html", "report.html"),
    *(f"{log}/{file}" for log in ("pokes", "run", "second-run") for file in LOG_FILES),
)


def run_demo(output: Path, seed: int) -> int:
    """Run the chain and leave its files in ``output``, all at the end; every step reads what the one before it wrote."""
    with whole_folder(output, *DEMO_FILES) as folder:
        return _run(folder, output, seed)


def _run(folder: Path, output: Path, seed: int) -> int:
    """``folder``: where files are until the end; ``output``: where they are then."""
    started = time.perf_counter()
    write_pushlog(demo_pokes(seed=seed), folder / "pokes")
    pokes = read_pushlog(folder / "pokes")
    loads, twists, _ = pokes.pairs()
    print(f"{output / 'pokes'}: {len(pokes)} simulated pokes")

    fit = fit_limit_surface(loads, twists, slider=pokes.rig.slider, seed=seed)
    save_model(fit.surface, folder / "model.json")
    surface = load_model(folder / "model.json")
    held_out = math.degrees(fit.validation_error or 0.0)
    print(f"{output / 'model.json'}: poly4-cvx, {held_out:.1f} deg on held-out pokes, {fit.total_time:.1f} s")

    save_scene(demo_scene(surface), folder / "scene.json")
    scene = load_scene(folder / "scene.json")
    contact = scene.contacts[0]
    model_region = stable_region(surface, contact)
    rho = surface.characteristic_length
    promised = [build(demo_slider(), contact, characteristic_length=rho) for build in (all_pressure_region, lynch_mason_region)]
    regions = [model_region, *promised]
    shading = probability_map(surface, contact, 5 * demo_slider().radius)
    map_png = figure_png(plot_regions(regions, contact, scene.slider, probability=shading))
    write_atomically(folder / "map.png", map_png)
    print(f"{output / 'map.png'}: stable rotation centres")

    # the first plan of an install builds compiled code: what is reported is how long planning takes after that
    plan(scene, time_limit=60.0, seed=seed, refinement_budget=0)
    result = plan(scene, time_limit=60.0, seed=seed)
    save_plan(result, folder / "plan.json")
    report = check_plan(scene, load_plan(folder / "plan.json"))
    if result.solved:
        verdict = "check: valid" if report.valid else f"check: {report.objections[0]}"
        print(f"{output / 'plan.json'}: {len(result.pushes)} pushes, {result.duration:.1f} s, {result.outlook}; {verdict}")
    else:
        print(f"{output / 'plan.json'}: {result.status}: {result.message}")
    plan_png = figure_png(plot_plan(scene, result))
    write_atomically(folder / "plan.png", plan_png)
    write_atomically(folder / "plan.html", plan_html(scene, result))

    story, after = _loop(folder, output, scene, result, seed) if result.solved else ("", [])

    sections = [
        *after[:1],
        _identified(fit),
        _stable(regions, map_png),
        _planned(result, report, plan_png),
        Section("The first plan as it should move", link="plan.html", link_text="Animation of the plan"),
        *after[1:],
        Section("What to do next", "The same with files of your own:", [(command, what) for what, command in _NEXT]),
    ]
    lead = (
        f"{story} stablepush finds how a flat object slides, plans pushes during which it sticks to the fingers, and tells why "
        "a robot deviates from a plan. All of this page was computed when the demo ran, on a simulated rig: a triangle on three "
        "feet, poked by one finger and pushed by two. The identification does not know where the feet are."
    )
    write_atomically(folder / "report.html", report_html("stablepush demo", lead, sections))
    told(output=output, report=output / "report.html")
    print(f"{output / 'report.html'}: open it in a browser ({time.perf_counter() - started:.1f} s in all)")
    return 0 if result.solved and report.valid else 1


def _identified(fit: Fit) -> Section:
    certificate, held_out = fit.certificate, math.degrees(fit.validation_error or 0.0)
    return Section(
        "From pokes to a limit surface",
        "A finger pokes the triangle at random places. Each poke gives a load and a slip twist. A semidefinite program finds "
        "the convex quartic that fits them and agrees with likely pressures under the outline. Its proof of convexity is "
        "checked apart from the solver.",
        [
            ("pokes", str(len(fit.wrenches))),
            ("angle between predicted and measured slip, pokes left out", f"{held_out:.1f}°"),
            (
                "smallest eigenvalue of the certificate (above 0 proves convexity)",
                f"{certificate.min_eigenvalue:.3g}" if certificate else "none",
            ),
            ("prior", "likely pressures under the outline" if fit.prior_weight else "none: the pokes contradict it"),
            (
                "time",
                f"{fit.total_time:.2f} s: likely pressures first, the final solve {1e3 * fit.solve_time:.1f} ms",
            ),
        ],
    )


def _stable(regions: Sequence[StableRegion], map_png: bytes) -> Section:
    return Section.with_picture(
        "Which rotation centres are stable",
        map_png,
        "Coloured: stable by the identified surface, the darker the likelier. Dotted: stable whatever the pressure under the "
        "outline is, exactly. Hatched: the part of that which Lynch and Mason's test finds.",
        [
            (
                f"{r.name}: motions, directions of translation",
                f"{r.solid_angle():.3f} of 12.57 sr, {_degrees(r.translation_intervals)}",
            )
            for r in regions
        ],
    )


def _planned(result: PlanResult, report: CheckReport, plan_png: bytes) -> Section:
    return Section.with_picture(
        "The first plan: a path of stable pushes",
        plan_png,
        rows=[
            ("status", result.status),
            ("pushes", str(len(result.pushes))),
            ("duration", f"{result.duration:.1f} s; no plan can take less than {result.lower_bound or 0:.1f} s"),
            ("length", f"{result.length:.2f} m"),
            ("least angle between the load and the friction cone's facets", f"{np.degrees(result.min_margin):.2f}°"),
            ("predicted", result.outlook),
            ("planning time", f"{result.planning_time:.2f} s"),
            ("independent check", "valid" if report.valid else "; ".join(report.objections)),
        ],
    )


def _loop(folder: Path, output: Path, scene: PlanningProblem, result: PlanResult, seed: int) -> tuple[str, list[Section]]:
    """Carry out the plan, diagnose the log, correct the scene, plan again, carry that out; what happened, and sections on it."""
    first = demo_log(scene, result, seed)
    write_pushlog(first.log, folder / "run")
    away = _from_goal(scene, first)
    print(f"{output / 'run'}: the plan carried out on the rig: the object ends {away[0]:.1f} mm from the goal{_turned(away)}")

    found = diagnose(read_pushlog(folder / "run"), name="run")
    write_json(folder / "diagnosis.json", found.to_json())
    write_atomically(folder / "diagnosis.html", gap_html(found))
    print(f"{output / 'diagnosis.json'}: {found.verdict}{': ' + ', '.join(found.named) if found.named else ''}")

    save_scene(correct(scene, load_corrections(folder / "diagnosis.json")), folder / "corrected.json")
    corrected = load_scene(folder / "corrected.json")
    again = plan(corrected, time_limit=60.0, seed=seed)
    save_plan(again, folder / "corrected-plan.json")
    headings = [f"Before: {away[0]:.0f} mm from the goal"]
    _show_run(folder / "run.html", scene, result, first, "The first plan on the rig")
    said = f"The object ended {away[0]:.0f} mm from the goal{_turned(away)}"
    if not again.solved:
        print(f"{output / 'corrected-plan.json'}: {again.status}: {again.message}")
        diagnosed = Section("What the log of the run says", found.sentence, (), "", "diagnosis.html", "The diagnosis, in full")
        before = Section("The first run", pages=[(headings[0], "run.html")])
        return f"{said}, and the corrected scene has no plan: {again.message}.", [before, diagnosed]
    second = demo_log(corrected, again, seed + 1)
    write_pushlog(second.log, folder / "second-run")
    arrived = _from_goal(corrected, second)
    print(f"{output / 'corrected-plan.json'}: carried out, the object ends {arrived[0]:.1f} mm from the goal{_turned(arrived)}")
    _show_run(folder / "second-run.html", corrected, again, second, "The second plan on the rig")
    headings.append(f"After: {arrived[0]:.1f} mm from the goal")

    mu = [problem.contacts[0].mu for problem in (scene, corrected)]
    cause = f"named the cause ({', '.join(found.named)})" if found.named else f"named no cause ({found.verdict})"
    near, turn = 1000 * scene.tolerance[0], math.degrees(scene.tolerance[1])
    there = "within" if arrived[0] <= near and arrived[1] <= turn else "outside"
    story = (
        f"A plan made from 40 pokes was carried out on a rig whose fingers have a friction of {SLIPPERY:.2f} where the plan "
        f"assumes {mu[0]:.2f}. {said}. The diagnosis of the run's log {cause}. A second plan, with the corrected scene, ended "
        f"{arrived[0]:.1f} mm from the goal{_turned(arrived)}, {there} the tolerance of {near:.0f} mm and {turn:.1f}°."
    )
    rows = [
        ("friction of the fingers, as assumed", f"{mu[0]:.2f}"),
        ("as the diagnosis found it", f"{mu[1]:.3f}"),
        ("of the simulated rig", f"{SLIPPERY:.2f}"),
        ("the first plan", _outcome(result, away)),
        ("the second plan", _outcome(again, arrived)),
    ]
    share = 100 * scene.uncertainty.relative_friction
    lost = (
        f"The first plan allows for {share:.0f} % of the friction to either side; the truth is outside of that, and neither the "
        "plan nor the diagnosis is told."
    )
    pages = list(zip(headings, ("run.html", "second-run.html"), strict=True))
    told = [
        Section(
            "Before and after",
            "The pictures show how it ended, Play shows the run. Obstacles are not simulated: nothing stops an object there.",
            pages=pages,
        ),
        Section("What the log of the run says", f"{lost} {found.sentence}", rows, "", "diagnosis.html", "The diagnosis, in full"),
    ]
    return story, told


def _outcome(result: PlanResult, away: tuple[float, float]) -> str:
    success = result.success_probability or 0.0
    return f"{result.duration:.1f} s, predicted success {success:.2f}, ended {away[0]:.1f} mm and {away[1]:.1f}° off"


def _turned(away: tuple[float, float]) -> str:
    return f" and turned {away[1]:.1f}° away from it"


def _from_goal(problem: PlanningProblem, done: Execution) -> tuple[float, float]:
    """Distance (mm) and angle (deg) of the object from the goal after a run."""
    off = done.final_pose - problem.goal
    return 1000 * math.hypot(*off[:2]), abs(math.degrees(wrap_angle(off[2])))


def _show_run(path: Path, problem: PlanningProblem, result: PlanResult, done: Execution, title: str) -> None:
    write_atomically(path, execution_html(problem, done.pushers, done.traces, result, title))


def _degrees(intervals: tuple[tuple[float, float], ...]) -> str:
    return " and ".join(f"{np.degrees(low):.1f}° to {np.degrees(high):.1f}° in B" for low, high in intervals) or "none"
