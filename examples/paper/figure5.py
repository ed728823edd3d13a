"""Figure 5 of Zhou et al. 2016: test error on real pokes against the number of training pokes.

Every poking log with three support points that is there, on wood and on board; 15 random splits a log into 30 training pokes,
10 for validation and 10 for testing. As published: 5 to 30 training pokes and the 10 for validation. This library's default knows
the outline and the centre of mass; it sees the same pokes, and its error is also drawn against the number of pokes seen in all.

    python examples/paper/figure5.py DATA -o paper [--surface wood] [--jobs 2]
"""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import lab
import numpy as np

import stablepush as sp
from stablepush.geometry.planar import unit

TRAIN, VALIDATION, EVALUATIONS = (5, 10, 20, 30), 10, 15
#: Pokes seen in all by the default: what the training pokes and the validation pokes come to, and fewer.
TOTALS = (3, 5, 10, 15, 20, 30, 40)
_NAMES = {"poly4-cvx": "poly4-cvx", "poly4": "poly4", "quadratic": "quad", "gp": "gp"}


def ideal_pairs(slider: sp.Slider, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return 100 pairs of the ideal surface of the support points; the tables of the paper call it idealLS."""
    assert slider.support is not None
    directions = unit(rng.normal(size=(100, 3))) / (1, 1, lab.RHO)
    return sp.IdealLimitSurface(slider.support, 1.0).wrench(directions), directions


def evaluate(data: Path, surface: str, arrangement: str, turn: int) -> dict[str, list[float]]:
    """Return test errors (deg) on sensor data and on the ideal surface, for every method and number of pokes."""
    loads, twists, slider = lab.pokes(data, surface)[arrangement]
    rng = np.random.default_rng((sum(arrangement.encode()), turn))
    order = rng.permutation(len(loads))
    test, validation, pool = order[:10], order[10 : 10 + VALIDATION], order[10 + VALIDATION :]
    ideal = ideal_pairs(slider, rng)
    found = {}

    def record(name: str, fit: sp.Fit) -> None:
        found[name] = [lab.angle_error(fit.surface, loads[test], twists[test]), lab.angle_error(fit.surface, *ideal)]

    for count in TRAIN:
        for method in lab.PUBLISHED:
            record(f"{method} {count}", lab.fit_as_published(loads, twists, pool[:count], validation, method))
    together = np.concatenate((validation, pool))
    for count in TOTALS:
        rows = together[:count]
        record(f"default {count}", sp.fit_limit_surface(loads[rows], twists[rows], slider=slider, characteristic_length=lab.RHO))
        record(f"alone {count}", sp.fit_limit_surface(loads[rows], twists[rows], characteristic_length=lab.RHO))
    return found


def main() -> None:
    arguments = lab.parser(__doc__)
    arguments.add_argument("--surface", choices=("wood", "board"), default="wood")
    options = arguments.parse_args()
    theirs = lab.published(options).get("figure_5", {}).get("mean_angle_error_deg", {})
    logs = lab.pokes(options.data, options.surface)
    jobs = list(product((options.data,), (options.surface,), logs, range(EVALUATIONS)))
    results = lab.run_all(evaluate, jobs, options)
    found = {name: [lab.interval([r[name][k] for r in results]) for k in (0, 1)] for name in results[0]}
    print(f"{options.surface}: {len(logs)} arrangements ({', '.join(logs)}), {EVALUATIONS} splits each")
    for k, test in enumerate(("sensor", "idealLS")):
        known = theirs.get(f"{options.surface}_{test}", {})
        print(f"\ntest on {test}: mean angle (deg) ± 95 %; the published number behind it, * where the two differ")
        print(" " * 26 + "".join(f"{f'{n} pokes + 10':>26s}" for n in TRAIN))
        for method in lab.PUBLISHED:
            line = f"{method + ', as published':>26s}"
            row = known.get(_NAMES[method])
            for i, count in enumerate(TRAIN):
                mean, half = found[f"{method} {count}"][k]
                line += f"   {mean:5.2f} ± {half:4.2f}"
                if row:
                    same = lab.agrees((mean, half), (row["mean"][i], row["ci95"][i]))
                    line += f" ({row['mean'][i]:5.2f}){' ' if same else '*'}"
            print(line)
        print("pokes seen in all         " + "".join(f"{n:>16d}" for n in TOTALS))
        for name, label in (("default", "with the slider"), ("alone", "pokes alone")):
            print(f"{label:>26s}" + "".join("   {:5.2f} ± {:4.2f} ".format(*found[f"{name} {n}"][k]) for n in TOTALS))
    options.output.mkdir(parents=True, exist_ok=True)
    name = f"figure5_{options.surface}"
    (options.output / f"{name}.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    draw(found, theirs, options.surface, options.output / f"{name}.png")
    print(options.output / f"{name}.png")


def draw(found: dict, theirs: dict, surface: str, file: Path) -> None:
    """Test error against the pokes seen in all, training and validation together."""
    from matplotlib.figure import Figure

    styles = {"poly4-cvx": ("#0072B2", "s"), "poly4": ("#E69F00", "^"), "quadratic": ("#009E73", "v"), "gp": ("#999999", "x")}
    figure = Figure((12, 4.8), layout="constrained")
    for k, (axes, test) in enumerate(zip(figure.subplots(1, 2), ("sensor", "idealLS"), strict=True)):
        seen = np.array(TRAIN) + VALIDATION
        for method, (color, marker) in styles.items():
            mean, half = np.array([found[f"{method} {n}"][k] for n in TRAIN]).T
            axes.errorbar(seen, mean, half, color=color, marker=marker, label=f"{method}, as published", linewidth=1)
        if known := theirs.get(f"{surface}_{test}", {}).get("poly4-cvx"):
            axes.plot(seen, known["mean"], "k_", markersize=14, label="poly4-cvx, the paper")
        for name, color, label in (("default", "#D55E00", "with the slider"), ("alone", "#CC79A7", "pokes alone")):
            mean, half = np.array([found[f"{name} {n}"][k] for n in TOTALS]).T
            axes.errorbar(TOTALS, mean, half, color=color, marker="o", label=f"this library's default, {label}")
        axes.set(title=f"{surface}, test on {test}", xlabel="pokes seen in all", ylabel="mean angle, deg", ylim=(5, 30))
        axes.grid(alpha=0.3)
    figure.axes[0].legend(fontsize=8)
    figure.savefig(file, dpi=120)


if __name__ == "__main__":
    main()
