"""Does the ensemble that comes with a fit spread as far as the fit errs?

Share of held-out slip directions within the central 50, 80 and 95 % of what the ensemble predicts: on the real pokes (with
their own scatter added, as estimated from the pokes fitted), and on simulated rigs against their true surface.

    python examples/paper/calibration.py DATA -o paper [--evaluations 8] [--jobs 2]
"""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import lab
import numpy as np

import stablepush as sp
from stablepush.geometry.planar import normalize_twist, normalize_wrench, unit

COVERAGES = (0.5, 0.8, 0.95)
TOTALS = (5, 10, 20, 40)
RIGS = 30
NOISE = 0.08


def predicted_shares(fit: sp.Fit, loads: np.ndarray, twists: np.ndarray, scatter: float, rng: np.random.Generator) -> np.ndarray:
    """Return for both tangent components of every twist the share of the ensemble's predictions below it."""
    rho = fit.surface.characteristic_length
    truth = unit(normalize_twist(twists, rho))
    drawn = np.array([unit(normalize_twist(m.twist(loads), rho)) for m in fit.surface.members()])
    center = unit(drawn.mean(axis=0))
    first = unit(np.cross(center, rng.normal(size=center.shape)))
    axes = np.stack((first, np.cross(center, first)), axis=1)
    spread = np.einsum("nai,mni->mna", axes, drawn)
    # each draw stands for many measurements: their scatter is added ten times over
    spread = np.concatenate([spread + scatter * rng.normal(size=spread.shape) for _ in range(10)])
    at = np.einsum("nai,ni->na", axes, truth)
    return (spread < at).mean(axis=0).ravel()


def scatter_of(fit: sp.Fit) -> float:
    """Return the scatter (rad) of one tangent component of the pokes fitted, from the median of their angles."""
    return float(np.median(fit.angle_errors)) / 1.177


def on_pokes(data: Path, arrangement: str, with_slider: bool, count: int, turn: int) -> np.ndarray:
    loads, twists, slider = lab.pokes(data, "wood")[arrangement]
    rng = np.random.default_rng((sum(arrangement.encode()), turn, 2))
    order = rng.permutation(len(loads))
    test, rows = order[:10], order[10 : 10 + count]
    fit = sp.fit_limit_surface(loads[rows], twists[rows], slider=slider if with_slider else None, characteristic_length=lab.RHO)
    return predicted_shares(fit, loads[test], twists[test], scatter_of(fit), rng)


def on_rig(with_slider: bool, count: int, seed: int) -> np.ndarray:
    """Simulate a rig that the prior was not made from: a random rectangle on four or five feet of uniform shares."""
    rng = np.random.default_rng((seed, 3))
    half = rng.uniform(0.03, 0.08, size=2)
    feet = rng.uniform(-half, half, size=(rng.integers(4, 6), 2))
    shares = rng.uniform(0.2, 1.0, size=len(feet))
    center = shares / shares.sum() @ feet
    corners = np.array(((-1, -1), (1, -1), (1, 1), (-1, 1))) * half - center
    truth = sp.IdealLimitSurface(sp.SupportDistribution(feet - center, shares), 4.0)
    slider = sp.Slider(corners)
    rho = slider.characteristic_length
    clean = unit(rng.normal(size=(count, 3)))
    loads = normalize_wrench(truth.wrench(clean / (1, 1, rho)), rho)
    loads = (loads + 4.0 * NOISE * rng.normal(size=loads.shape)) * (1, 1, rho)
    twists = unit(clean + 0.5 * NOISE * rng.normal(size=clean.shape)) / (1, 1, rho)
    fit = sp.fit_limit_surface(loads, twists, slider=slider if with_slider else None, characteristic_length=rho)
    other = unit(rng.normal(size=(40, 3))) / (1, 1, rho)
    return predicted_shares(fit, truth.wrench(other), other, 0.0, rng)


def main() -> None:
    arguments = lab.parser(__doc__)
    arguments.add_argument("--evaluations", type=int, default=8)
    options = arguments.parse_args()
    logs = lab.pokes(options.data, "wood")
    report: dict[str, list[tuple[float, float]]] = {}
    for with_slider, count in product((True, False), TOTALS):
        jobs = list(product((options.data,), logs, (with_slider,), (count,), range(options.evaluations)))
        real = lab.run_all(on_pokes, jobs, options)
        simulated = lab.run_all(on_rig, list(product((with_slider,), (count,), range(RIGS))), options)
        for name, shares in (("pokes", real), ("simulated", simulated)):
            line = f"{name:>9s}, {'with the slider' if with_slider else 'pokes alone':>15s}, {count:2d} pokes:"
            inside = np.array([[(np.abs(s - 0.5) < level / 2).mean() for level in COVERAGES] for s in shares])
            row = [lab.interval(100 * column) for column in inside.T]
            report[line] = row
            print(
                line + "".join(f"   {100 * c:.0f} %: {m:4.1f} ± {h:3.1f}" for c, (m, h) in zip(COVERAGES, row, strict=True)),
                flush=True,
            )
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "calibration.json").write_text(json.dumps(report, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
