"""What Zhou et al. 2016 only state: a patch is like a ring, and the characteristic length hardly matters.

Section IV-A: results for 400 even points in a unit square are similar to those for the ring. Section II: radius of gyration,
mean edge and enclosing circle as rho perform alike. 15 trials each, convex quartic as published, and this library's default;
no data needed:

    python examples/paper/remarks.py -o paper
"""

from __future__ import annotations

import json

import lab
import numpy as np

import stablepush as sp
from stablepush.geometry.planar import normalize_wrench, unit

TRIALS, TRAIN, VALIDATION, TEST = 15, (7, 15, 22, 45), 30, 75
SUPPORTS = {
    "ring of 360": sp.SupportDistribution.ring(1.0, 360),
    "square of 400": sp.SupportDistribution.from_polygon(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)), 0.05),
}


def errors(support: sp.SupportDistribution, noise: float, rho: float, seed: int) -> tuple[list[float], list[float]]:
    """Return test errors (deg, at the radius of gyration) of the published fit and of the default, made with another rho."""
    ideal = sp.IdealLimitSurface(support, 1.0)
    own = ideal.characteristic_length
    rng = np.random.default_rng(seed)
    directions = unit(rng.normal(size=(TEST + VALIDATION + max(TRAIN), 3)))
    loads = normalize_wrench(ideal.wrench(directions / (1, 1, own)), own)
    test = loads[:TEST] * (1, 1, own), directions[:TEST] / (1, 1, own)
    loads = (loads + noise * rng.normal(size=loads.shape))[TEST:] * (1, 1, own)
    twists = unit(directions + noise * rng.normal(size=directions.shape))[TEST:] / (1, 1, own)
    found: tuple[list[float], list[float]] = ([], [])
    for count in TRAIN:
        rows = slice(0, VALIDATION + count)
        validation_indices = np.arange(VALIDATION)
        published = sp.fit_limit_surface(
            loads[rows], twists[rows], characteristic_length=rho, loss="norm", validation_indices=validation_indices
        )
        default = sp.fit_limit_surface(loads[rows], twists[rows], characteristic_length=rho)
        for kept, fit in zip(found, (published, default), strict=True):
            kept.append(lab.angle_error(fit.surface, *test, rho=own))
    return found


def main() -> None:
    arguments = lab.parser(__doc__, data=False)
    arguments.add_argument("--trials", type=int, default=TRIALS)
    options = arguments.parse_args()
    report = {}

    def tell(label: str, support: sp.SupportDistribution, noise: float, rho: float) -> None:
        results = np.array(lab.run_all(errors, [(support, noise, rho, seed) for seed in range(options.trials)], options))
        for k, method in enumerate(("as published", "default")):
            report[f"{label}, {method}"] = row = [lab.interval(column) for column in results[:, k].T]
            print(f"{f'{label}, {method}':>52s}" + "".join(f"   {m:5.2f} ± {h:4.2f}" for m, h in row), flush=True)

    print(f"mean angle (deg) ± 95 % over {options.trials} trials, by number of training pairs (30 more for validation)")
    print(" " * 52 + "".join(f"{n:>15d}" for n in TRAIN))
    for name, support in SUPPORTS.items():
        for noise in (0.0, 0.1):
            tell(f"{name}, noise {noise}", support, noise, support.characteristic_length)
    square = SUPPORTS["square of 400"]
    lengths = {"radius of gyration": square.characteristic_length, "mean edge": 1.0, "enclosing circle": np.sqrt(0.5)}
    for name, rho in lengths.items():
        tell(f"square, noise 0.1, rho = {name} ({rho:.2f})", square, 0.1, float(rho))
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "remarks.json").write_text(json.dumps(report, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
