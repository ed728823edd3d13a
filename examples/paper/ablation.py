"""Which part of the default identification brings how much, on the real pokes.

From the paper's fit to this library's default one step at a time, the older methods that the paper names beside it, all on the
same pokes; then the same with a tenth of the pokes replaced by nonsense.

    python examples/paper/ablation.py DATA -o paper [--surface wood] [--evaluations 4] [--jobs 2]
"""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import lab
import numpy as np

import stablepush as sp
from stablepush.geometry.planar import unit

TOTALS = (5, 10, 20, 40)
TEST = 10


def held_out(loads: np.ndarray, twists: np.ndarray, **options: Any) -> sp.LimitSurface:
    """Fit with a quarter of the pokes held out to choose the weights, as the paper has it."""
    validation_indices = np.arange(max(1, len(loads) // 4))
    return sp.fit_limit_surface(
        loads, twists, characteristic_length=lab.RHO, validation_indices=validation_indices, **options
    ).surface


def fitted(loads: np.ndarray, twists: np.ndarray, **options: Any) -> sp.LimitSurface:
    return sp.fit_limit_surface(loads, twists, characteristic_length=lab.RHO, **options).surface


#: From pokes and slider to a surface, in the order of the steps.
STEPS: dict[str, Callable[[np.ndarray, np.ndarray, sp.Slider], sp.LimitSurface]] = {
    "norm loss, one hold-out": lambda f, v, _: held_out(f, v, loss="norm"),
    "squared loss, one hold-out": lambda f, v, _: held_out(f, v, loss="published"),
    "folds and refit": lambda f, v, _: fitted(f, v, loss="published"),
    "+ ellipsoid, whitened": lambda f, v, _: fitted(f, v, robust=False),
    "+ robust weights": lambda f, v, _: fitted(f, v),
    "+ slider (the default)": lambda f, v, s: fitted(f, v, slider=s),
    "same, COM within 5 mm": lambda f, v, s: fitted(f, v, slider=s, com_tolerance=0.005),
    "same, degree 6": lambda f, v, s: fitted(f, v, slider=s, model="poly6-cvx"),
    "grid, least squares (1991)": lambda f, v, s: sp.fit_pressure_grid(f, v, bare(s), "least-squares").surface,
    "grid, linear program (1993)": lambda f, v, s: sp.fit_pressure_grid(f, v, bare(s)).surface,
    "ellipsoid, true feet (1996)": lambda f, v, s: sp.ellipsoid_from_pressure(s.support, 1.0),
    "ideal surface, true feet": lambda f, v, s: sp.IdealLimitSurface(s.support, 1.0),
}


def bare(slider: sp.Slider) -> sp.Slider:
    """Return the slider without what is known of its feet."""
    return sp.Slider(slider.vertices, slider.mass)


def evaluate(data: Path, surface: str, arrangement: str, spoiled: float, turn: int) -> dict[str, list[float]]:
    """Return the test error (deg) of every step for every number of pokes."""
    loads, twists, slider = lab.pokes(data, surface)[arrangement]
    rng = np.random.default_rng((sum(arrangement.encode()), turn, 1))
    order = rng.permutation(len(loads))
    test, pool = order[:TEST], order[TEST:]
    found: dict[str, list[float]] = {name: [] for name in STEPS}
    for count in TOTALS:
        rows = pool[:count]
        f, v = loads[rows].copy(), twists[rows]
        for i in range(round(spoiled * count)):
            wrong = unit(rng.normal(size=3)) * np.linalg.norm(f[i, :2]) * (1, 1, lab.RHO)
            f[i] = wrong * (1 if wrong @ v[i] > 0 else -1)
        for name, step in STEPS.items():
            # degree 6 takes some ten times as long: only where it could help
            if name == "same, degree 6" and (spoiled or turn > 0):
                found[name].append(np.nan)
            else:
                found[name].append(
                    lab.angle_error(step(f, v, slider if "feet" in name else bare(slider)), loads[test], twists[test])
                )
    return found


def main() -> None:
    arguments = lab.parser(__doc__)
    arguments.add_argument("--surface", choices=("wood", "board"), default="wood")
    arguments.add_argument("--evaluations", type=int, default=4)
    options = arguments.parse_args()
    logs = lab.pokes(options.data, options.surface)
    report: dict[str, Any] = {}
    for spoiled in (0.0, 0.1):
        jobs = list(product((options.data,), (options.surface,), logs, (spoiled,), range(options.evaluations)))
        results = lab.run_all(evaluate, jobs, options)
        title = f"{options.surface}, {len(logs)} arrangements, up to {options.evaluations} splits each" + (
            ", 10 % nonsense" if spoiled else ""
        )
        print(f"\n{title}: mean angle (deg) ± 95 %, against the pokes seen in all")
        print(" " * 28 + "".join(f"{n:>15d}" for n in TOTALS) + "   splits in all")
        for name in STEPS:
            values = np.array([r[name] for r in results])
            values = values[np.isfinite(values).all(axis=1)]
            if not len(values):
                continue
            row = [lab.interval(column) for column in values.T]
            report[f"{title}: {name}"] = row
            print(f"{name:>28s}" + "".join(f"   {m:5.2f} ± {h:4.2f}" for m, h in row) + f"   {len(values)}")
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / f"ablation_{options.surface}.json").write_text(json.dumps(report, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
