"""Commands that make and verify plans."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stablepush.cli import clock
from stablepush.cli.common import (
    Output,
    Progress,
    about,
    also_written,
    interruptible,
    note_if_invalid,
    number,
    options_of,
    require_files,
    require_outside,
    require_png,
    told,
    whole_number,
)

if TYPE_CHECKING:
    from stablepush.planning import PlanningProblem, PlanResult

PlannerName = Annotated[
    str,
    typer.Option(
        "--planner",
        metavar="NAME",
        help="cor-lattice; ompl-bitstar, ompl-rrtstar, ompl-informed-rrtstar, ompl-rrtconnect, ompl-rrt, ompl-kpiece to compare "
        "with (one contact); or one that a package registers (an unknown NAME lists all).",
    ),
]
Seed = Annotated[int, typer.Option(parser=whole_number, metavar="INTEGER", help="Seed of planners that draw random numbers.")]
RefinementBudget = Annotated[
    float,
    typer.Option(
        "--refinement-budget",
        "--improve",
        parser=number,
        metavar="STEPS",
        help="Search steps to refine the first plan; inf: until the time limit. --improve is its former name.",
    ),
]


#: Distance (m) of an obstacle below which the remedy is named.
_NEAR = 2e-3
#: Time (s) of each search for a plan without bounds or obstacles: most take a tenth of it.
_RELAXED = 3.0

_OPTIONS = options_of(
    "planner",
    "time_limit",
    "seed",
    "success",
    "require_success",
    "region",
    "margin_weight",
    "max_twist_rate",
    "refinement_budget",
    "clearance",
)


def plan(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="scene/1 file.")],
    output: Output,
    planner: PlannerName = "cor-lattice",
    time_limit: Annotated[
        float, typer.Option(parser=number, metavar="SECONDS", help="Wall time in s, from the start of the program.")
    ] = 30.0,
    seed: Seed = 0,
    success: Annotated[
        float,
        typer.Option(
            parser=number,
            metavar="P",
            help="Wanted probability that the slider sticks to the pusher over the whole path. If no plan reaches it, the most "
            "probable plan found is taken, with a warning. 0: the quickest plan.",
        ),
    ] = 0.98,
    require_success: Annotated[
        float,
        typer.Option(parser=number, metavar="P", help="Reject plans that are less likely to succeed: no-path, exit code 1."),
    ] = 0.0,
    region: Annotated[
        str,
        typer.Option(
            help="Rotation centres to use. model: what the fitted surface allows; all-pressure: what holds for every pressure "
            "under the slider; conservative: the part of that which STABLE finds (Lynch and Mason)."
        ),
    ] = "model",
    margin_weight: Annotated[
        float,
        typer.Option(
            parser=number,
            metavar="W",
            help="Weight W of the margin: a push without margin costs 1 + W times as much as a safe one of the same duration.",
        ),
    ] = 0.0,
    max_twist_rate: Annotated[
        float,
        typer.Option(
            "--max-twist-rate",
            parser=number,
            metavar="RAD/S",
            help="Largest rate at which the unit twist (vx, vy, rho omega) may turn from push to push; inf: no blending.",
        ),
    ] = math.inf,
    refinement_budget: RefinementBudget = 20_000,
    clearance: Annotated[
        float | None,
        typer.Option(
            parser=number,
            metavar="METRES",
            help="Least distance of slider and pusher from obstacles; 0: they may touch. If not given: 0.005, or 0 "
            "where that would take more than 5 % longer.",
        ),
    ] = None,
    view: Annotated[Path | None, typer.Option(help="Animation of the plan as an HTML page.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Picture of the plan as PNG, if one is found.")] = None,
) -> None:
    """Plan a path of stable pushes."""
    from stablepush.core import check_number
    from stablepush.io import write_atomically
    from stablepush.planning import (
        feasible_relaxations,
        load_scene,
        plan as make_plan,
        save_plan,
    )

    check_number(time_limit, "--time-limit", at_least=0.0)
    require_files(output, view, picture, read=(scene,))
    require_png(picture)
    problem = load_scene(scene)

    def left() -> float:
        return max(0.0, time_limit - clock.elapsed())

    relaxed = ""
    with Progress("plan") as step, about(scene, options=_OPTIONS), interruptible() as interrupted:
        make = partial(
            make_plan,
            planner=planner,
            seed=seed,
            success=success,
            require_success=require_success,
            region=region,
            margin_weight=margin_weight,
            max_twist_rate=max_twist_rate,
            clearance=clearance,
            stop=interrupted,
            progress=step.describe,
        )
        result = make(problem, time_limit=left(), refinement_budget=refinement_budget)
        stopped = interrupted()
        if result.status == "timeout":
            relaxed = f"the search may need more than the {time_limit:g} s of --time-limit"
        if result.status == "no-path":
            step.describe("which bounds or obstacles are in the way")
            relaxed = feasible_relaxations(
                problem, lambda other: make(other, time_limit=min(left(), _RELAXED), refinement_budget=0.0)
            )
    if stopped and not result.solved:
        raise KeyboardInterrupt
    save_plan(result, output)
    if view is not None:
        from stablepush.views import plan_html

        write_atomically(view, plan_html(problem, result))
    if picture is not None and result.solved:
        from stablepush.views.plot import plot_plan, save_figure

        save_figure(plot_plan(problem, result), picture)
    _tell_plan(problem, result, output, relaxed, (view, picture if result.solved else None))
    if picture is not None and not result.solved:
        print(f"{picture}: not written, for there is no plan")
    if stopped:
        raise InterruptedError(f"{output} holds the best plan found so far")
    raise typer.Exit(0 if result.solved else 1)


def _tell_plan(
    problem: PlanningProblem, result: PlanResult, output: Path, relaxed: str, written: tuple[Path | None, ...]
) -> None:
    """Print what a plan is, where it ends, and what comes near it."""
    from stablepush.planning import APART, NO_ROOM, clearance_of

    nearest = clearance_of(problem, result) if result.solved else None
    told(
        output=output, status=result.status, message=result.message, pushes=len(result.pushes), duration=result.duration,
        clearance=None if nearest is None else nearest.distance,
        length=result.length, switches=result.switches, min_margin=result.min_margin, lower_bound=result.lower_bound,
        planning_time=result.planning_time, success_probability=result.success_probability,
        success_interval=result.success_interval, arrival_probability=result.arrival_probability,
        arrival_interval=result.arrival_interval, hint=relaxed or None,
    )  # fmt: skip
    print(f"{output}: {_plan_line(result)}")
    also_written(*written)
    if relaxed:
        print(f"hint: {relaxed}")
    if result.solved:
        away, turned = result.from_goal(problem.goal)
        near, square = problem.tolerance
        print(
            f"it ends {1000 * away:.1f} mm and {math.degrees(turned):.1f} deg from the goal (tolerance {1000 * near:.3g} mm, "
            f"{math.degrees(square):.2g} deg); it {result.outlook}"
        )
        if nearest is not None:
            close = f"; {NO_ROOM} (--clearance {APART:g})" if NO_ROOM in result.message else f": try --clearance {APART:g}"
            hint = close if nearest.distance < _NEAR else ""
            print(
                f"closest to an obstacle: {1000 * nearest.distance:.1f} mm, in {nearest.where}; the probabilities do not count "
                f"collisions{hint}"
            )


def check(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="scene/1 file.")],
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN", help="plan/1 file.")],
) -> None:
    """Verify a plan, apart from the planner that made it.

    Exit code 0: valid; 1: not valid, with what is wrong; 2: a file that cannot be read.
    """
    from stablepush.planning import check_plan, load_plan, load_scene

    problem = load_scene(scene)
    result = load_plan(plan_file)
    with about(scene):
        report = check_plan(problem, result)
    told(plan=plan_file, valid=report.valid, objections=list(report.objections))
    alone = ""
    if report.only_margins_differ:
        print("made for another scene: its pushes are stable in this one, too, and only the margins that it states differ")
        alone = ", for its margins alone"
    for objection in report.objections:
        print(objection)
    print(f"{plan_file}: {'valid' if report.valid else 'NOT valid'}{alone}")
    raise typer.Exit(0 if report.valid else 1)


def compare(
    scenes: Annotated[list[Path], typer.Argument(metavar="SCENE", help="scene/1 files.")],
    planner: PlannerName = "cor-lattice",
    time_limit: Annotated[float, typer.Option(parser=number, metavar="SECONDS", help="Wall time in s for each plan.")] = 30.0,
    seed: Seed = 0,
    refinement_budget: RefinementBudget = 20_000,
    table: Annotated[Path | None, typer.Option("--csv", help="Table to write.")] = None,
) -> None:
    """Compare plans by region: model, all-pressure and conservative.

    The conservative region is what STABLE finds (Lynch and Mason). certified: share of the path that holds for every pressure
    under the slider. The exit code is 1 if no plan is found.
    """
    import numpy as np

    from stablepush.core import check_choice, check_number
    from stablepush.io import table_text, write_atomically
    from stablepush.planning import compare_regions, load_scene, planner_names

    check_choice(planner, "--planner", planner_names())
    check_number(time_limit, "--time-limit", at_least=0.0)
    require_files(table, read=scenes)
    problems = [load_scene(scene) for scene in scenes]
    # keys of the table, and what stands over the printed columns
    head = {
        "duration": "duration_s", "length": "length_m", "switches": "switches", "min_margin_deg": "min_margin_deg",
        "certified": "certified", "planning_time": "planning_s",
    }  # fmt: skip
    names = [scene.stem for scene in scenes]
    # scenes of one name are told apart by their paths
    named = [name if names.count(name) == 1 else str(scene) for name, scene in zip(names, scenes, strict=True)]
    rows: list[list[object]] = []
    print(f"{'scene':<24s} {'region':<13s} {'status':<9s}" + "".join(f" {word:>14s}" for word in head.values()))
    with Progress("compare", len(problems)) as step:
        for scene, name, problem in zip(scenes, named, problems, strict=True):
            with about(scene, options=_OPTIONS):
                plans = compare_regions(
                    problem, planner, time_limit, seed, refinement_budget=refinement_budget, progress=step.describe
                )
            for one in plans:
                found = one.result
                numbers: list[float | None] = [None] * 5
                if found.solved:
                    share = None if math.isnan(one.certified) else one.certified
                    numbers = [found.duration, found.length, found.switches, math.degrees(found.min_margin), share]
                numbers.append(found.planning_time)
                rows.append([name, one.region, found.status, *("" if n is None else n for n in numbers)])
                words = "".join(f" {'-' if n is None else f'{n:.4g}':>14s}" for n in numbers)
                step.say(f"{name:<24s} {one.region:<13s} {found.status:<9s}{words}", error=False)
            step()
    told(plans=[dict(zip(("scene", "region", "status", *head), row, strict=True)) for row in rows])
    if table is not None:
        columns = zip(("scene", "region", "status", *head), zip(*rows, strict=True), strict=True)
        write_atomically(table, table_text({name: np.array(values, dtype=object) for name, values in columns}))
    raise typer.Exit(0 if any(row[2] == "solved" for row in rows) else 1)


def trajectory(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="scene/1 file.")],
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN", help="plan/1 file.")],
    output: Annotated[Path | None, typer.Option("-o", "--output", help="CSV file to write; this, --rosbag or both.")] = None,
    rate: Annotated[float, typer.Option(parser=number, metavar="HZ", help="Samples a second.")] = 50.0,
    speed: Annotated[
        float, typer.Option(parser=number, metavar="M/S", help="Speed limit of any point; inf: that of the plan.")
    ] = math.inf,
    acceleration: Annotated[
        float, typer.Option(parser=number, metavar="M/S2", help="Acceleration limit along the path; inf: none.")
    ] = 0.1,
    jerk: Annotated[float, typer.Option(parser=number, metavar="M/S3", help="Jerk limit along the path; inf: none.")] = 1.0,
    standoff: Annotated[
        float,
        typer.Option(
            parser=number, metavar="METRES", help="Distance of approach and retract; shorter where obstacles or bounds limit it."
        ),
    ] = 0.02,
    height: Annotated[
        float | None,
        typer.Option(
            parser=number,
            metavar="METRES",
            help="Height of the pusher over the table: adds poses of a tool, in columns tx, ty, tz, qx, qy, qz, qw.",
        ),
    ] = None,
    tool: Annotated[
        tuple[str, str, str, str, str, str, str] | None,
        typer.Option(metavar="X Y Z QX QY QZ QW", help="Pose of a tool in the pusher's frame: adds its poses, as --height does."),
    ] = None,
    rosbag: Annotated[
        Path | None, typer.Option(help="ROS 2 bag to write, with a MultiDOFJointTrajectory for controllers (extra ros).")
    ] = None,
) -> None:
    """Sample a plan in time, for a robot to follow.

    Poses and velocities of slider and pusher as CSV, from rest to rest, with an approach and a retract.
    """
    from stablepush.cli.common import numbers, require_folder
    from stablepush.core import InputError
    from stablepush.planning import load_plan, load_scene, sample_plan, save_rosbag, save_trajectory

    written = [path for path in (output, rosbag) if path is not None]
    if not written:
        raise InputError("--output", "expected a file to write, or a bag (--rosbag)")
    require_files(output, read=(scene, plan_file))
    if rosbag is not None:
        require_folder(rosbag)
        for path in filter(None, (output, scene, plan_file)):
            require_outside(path, rosbag)
    place = None if tool is None else numbers("--tool", ("X", "Y", "Z", "QX", "QY", "QZ", "QW"), tool)
    problem, result = load_scene(scene), load_plan(plan_file)
    with about(plan_file, options=options_of("rate", "speed", "acceleration", "jerk", "standoff", "height", "tool")):
        samples = sample_plan(problem, result, rate, acceleration, jerk=jerk, speed=speed, standoff=standoff)
        tool_poses = None
        if height is not None or place is not None:
            tool_poses = samples.tool_poses(height or 0.0, (0, 0, 0, 0, 0, 0, 1) if place is None else place)
    # first what can fail for lack of an extra
    if rosbag is not None:
        save_rosbag(samples, rosbag, tool_poses=tool_poses)
    if output is not None:
        save_trajectory(samples, output, tool_poses)
    told(output=written[0], samples=len(samples.t), duration=samples.t[-1], duration_of_plan=result.duration)
    changes = f", and with {problem.switch_cost:g} s for a change of contact" if result.switches else ""
    print(
        f"{written[0]}: {len(samples.t)} samples over {samples.t[-1]:.2f} s; the plan takes {result.duration:.2f} s, "
        f"without approach, retract and limits of acceleration{changes}"
    )
    also_written(*written[1:])
    note_if_invalid(problem, result, plan_file)


def _plan_line(result: PlanResult) -> str:
    if not result.solved:
        return f"{result.status}: {result.message}"
    bound = "" if result.lower_bound is None else f" (no plan takes less than {result.lower_bound:.1f} s)"
    pushes, changes = len(result.pushes), result.switches
    return (
        f"solved in {result.planning_time:.2f} s: {pushes} push{'es' * (pushes != 1)} over {result.length:.3f} m, "
        f"{result.duration:.1f} s{bound}, {changes or 'no'} change{'s' * (changes > 1)} of contact, "
        f"least margin {math.degrees(result.min_margin):.2f} deg"
    )
