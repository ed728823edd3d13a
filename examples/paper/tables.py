"""Tables I and II of Zhou et al. 2016: which two-finger rotations are stable, predicted from pokes on another surface.

Accuracy and recall of the stable class over the hand-labelled rotations of every arrangement that is there, with the authors'
splits: seed 1 once an arrangement, 25 evaluations for each of 10, 20, 30 training pokes in that order, 10 more for
validation, and their characteristic length, 50 mm (``near_ties.py`` tells how much of a cell hangs on nearly equal weights).
Then this library's default, which knows the outline and the centre of mass: on the same pokes, and from 0 to 10 in all.

    python examples/paper/tables.py DATA -o paper [--jobs 2]
"""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import lab
import numpy as np
import scipy.optimize

import stablepush as sp
from stablepush.geometry.planar import angle_between, normalize_twist, unit
from stablepush.stability.oracle import BOUNDARY_SLACK

TRAIN, EVALUATIONS = (10, 20, 30), 25
FEW = (0, 1, 2, 3, 5, 10)
METHODS = (*lab.PUBLISHED, "default")


def splits() -> dict[int, list[tuple[np.ndarray, np.ndarray]]]:
    """Return the authors' training and validation rows, for each number of training pokes."""
    state = np.random.RandomState(1)
    found: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for count in TRAIN:
        found[count] = []
        for _ in range(EVALUATIONS):
            rows = lab.matlab_permutation(state, 50)
            first, validation = rows[:40], rows[40:]
            found[count].append((first[lab.matlab_permutation(state, 40)][:count], validation))
    return found


def judge(surface: sp.LimitSurface, contacts: list[sp.PushContact], twists: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return for every rotation whether the surface calls it stable, and with what probability."""
    stable, probability = np.zeros(len(twists), dtype=bool), np.zeros(len(twists))
    for i, (contact, twist) in enumerate(zip(contacts, twists, strict=True)):
        oracle = sp.StabilityOracle(surface, contact)
        try:
            stable[i] = bool(oracle.is_stable(twist))
        except sp.ConvergenceError:
            load = stationary_load(surface, twist)
            stable[i] = load is not None and bool(oracle.cone.margin(load) >= -BOUNDARY_SLACK)
        share = oracle.probability(twist)
        probability[i] = stable[i] if share is None else float(share)
    return stable, probability


def stationary_load(surface: sp.LimitSurface, twist: np.ndarray) -> np.ndarray | None:
    """Return a normalised load whose slip is ``twist``, where a quartic that is not convex has no largest ``V·F`` on ``H = 1``.

    The paper's inverse: ``|∇H(F) - V|²`` is minimised from ``F = V`` on; None where that leaves more than 1 deg.
    """
    if not isinstance(surface, sp.PolynomialLimitSurface):
        return None
    direction = unit(normalize_twist(twist, surface.characteristic_length))
    physical = np.array((1.0, 1.0, surface.characteristic_length))
    size = np.linalg.norm(surface.gradient(direction * physical)) ** (-1 / (surface.degree - 1))
    found = scipy.optimize.least_squares(lambda f: surface.gradient(f * size * physical) - direction, direction)
    load = found.x * size
    slip = surface.gradient(load * physical)
    return load if surface.value(load * physical) > 0 and np.degrees(angle_between(slip, direction)) < 1 else None


def score(surface: sp.LimitSurface, contacts: list[sp.PushContact], twists: np.ndarray, labels: np.ndarray) -> list[float]:
    """Return accuracy and recall (%), the Brier score of the probability and that of the plain yes or no."""
    stable, probability = judge(surface, contacts, twists)
    return [
        100 * float((stable == labels).mean()),
        100 * float(stable[labels].mean()),
        float(((probability - labels) ** 2).mean()),
        float((stable != labels).mean()),
    ]


def evaluate(data: Path, arrangement: str, kind: str, method: str, count: int, turn: int) -> list[float]:
    """Return the scores of one evaluation, and the angle error (deg) on the wood pokes not seen."""
    loads, twists, slider = lab.patch_pokes(data) if arrangement == "patch" else lab.pokes(data, "wood")[arrangement]
    contacts, rotations, labels = lab.labelled_rotations(data)[arrangement]
    if kind == "split":
        train, validation = splits()[count][turn]
        seen = np.concatenate((train, validation))
    else:
        seen = np.random.default_rng((count, turn)).permutation(len(loads))[:count]
    if method == "default":
        fit = sp.fit_limit_surface(loads[seen], twists[seen], slider=slider, characteristic_length=lab.RHO)
    else:
        fit = lab.fit_as_published(loads, twists, train, validation, method)
    other = np.setdiff1d(np.arange(len(loads)), seen)
    return [*score(fit.surface, contacts, rotations, labels), lab.angle_error(fit.surface, loads[other], twists[other])]


def main() -> None:
    options = lab.parser(__doc__).parse_args()
    theirs = lab.published(options).get("tables_1_2", {}).get("per_arrangement", {})
    names = {"30_90_30_30_30_90": "30_90_30", "10_130_10_10_10_130": "10_130_10", "patch": "patch"}
    arrangements = sorted(lab.labelled_rotations(options.data))
    jobs = [
        (options.data, *job)
        for job in (
            *product(arrangements, ("split",), METHODS, TRAIN, range(EVALUATIONS)),
            *product(arrangements, ("few",), ("default",), FEW, range(EVALUATIONS)),
        )
    ]
    results = np.array(lab.run_all(evaluate, jobs, options))
    keys = [job[1:5] for job in jobs]

    def select(arrangement: str, kind: str, method: str, count: int) -> np.ndarray:
        return results[[k == (arrangement, kind, method, count) for k in keys]]

    summary: dict[str, dict] = {}
    for arrangement in arrangements:
        known = theirs.get(names.get(arrangement, arrangement), {})
        print(f"\n{arrangement}: accuracy / recall (%) ± 95 % over {EVALUATIONS} splits; the published number behind it")
        print(" " * 11 + "".join(f"{f'{n} pokes + 10':>44s}" for n in TRAIN))
        for method in METHODS:
            line = f"{method:>11s}"
            for k, count in enumerate(TRAIN):
                row = select(arrangement, "split", method, count)
                summary.setdefault(arrangement, {})[f"{method} {count}+10"] = [lab.interval(column) for column in row.T]
                for column, quantity in ((0, "accuracy"), (1, "recall")):
                    mean, half = lab.interval(row[:, column])
                    other = known.get(method if method != "default" else "poly4-cvx", {}).get(quantity)
                    line += f"  {mean:5.1f} ± {half:3.1f}" + (f" ({other[k]:5.1f})" if other else "")
            print(line + ("   (published: poly4-cvx)" if method == "default" and known else ""))
        print("default, pokes seen in all: accuracy, recall (%), Brier score of probability and of yes or no, angle error (deg)")
        for count in FEW:
            row = select(arrangement, "few", "default", count)
            summary[arrangement][f"default {count}"] = [lab.interval(column) for column in row.T]
            print(f"{count:11d}" + "".join(f"   {m:7.3f} ± {h:5.3f}" for m, h in map(lab.interval, row.T)))
    print(f"\nall {len(arrangements)} arrangements")
    for kind, counts in (("split", TRAIN), ("few", FEW)):
        for count in counts:
            row = np.mean([select(a, kind, "default", count) for a in arrangements], axis=0)
            print(
                f"default {count:3d}{' + 10' if kind == 'split' else '':5s}"
                + "".join(f"   {m:7.3f} ± {h:5.3f}" for m, h in map(lab.interval, row.T))
            )
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "tables.json").write_text(json.dumps(summary, indent=1), encoding="utf-8")
    draw(summary, theirs, names, options.output / "tables.png")
    print(options.output / "tables.png")


def draw(summary: dict, theirs: dict, names: dict, file: Path) -> None:
    """Accuracy and recall against the pokes seen in all, one row an arrangement."""
    from matplotlib.figure import Figure

    figure = Figure((11, 3.6 * len(summary)), layout="constrained")
    panels = figure.subplots(len(summary), 2, squeeze=False)
    for row, (arrangement, scores) in zip(panels, summary.items(), strict=True):
        for column, (axes, quantity) in enumerate(zip(row, ("accuracy", "recall"), strict=True)):
            seen = sorted({*FEW, *(n + 10 for n in TRAIN)})
            points = [scores.get(f"default {n}") or scores[f"default {n - 10}+10"] for n in seen]
            mean, half = np.array([p[column] for p in points]).T
            axes.errorbar(seen, mean, half, color="#D55E00", marker="o", label="this library's default, with the slider")
            mean, half = np.array([scores[f"poly4-cvx {n}+10"][column] for n in TRAIN]).T
            axes.errorbar(np.array(TRAIN) + 10, mean, half, color="#0072B2", marker="s", label="poly4-cvx as published, ours")
            if known := theirs.get(names.get(arrangement, arrangement), {}).get("poly4-cvx"):
                axes.plot(np.array(TRAIN) + 10, known[quantity], "k_", markersize=14, label="poly4-cvx, the paper")
            axes.set(title=f"{arrangement}: {quantity}", xlabel="pokes seen in all", ylabel="%", ylim=(60, 102))
            axes.grid(alpha=0.3)
    panels[0, 0].legend(fontsize=8, loc="lower right")
    figure.savefig(file, dpi=120)


if __name__ == "__main__":
    main()
