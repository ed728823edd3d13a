"""What figure 3 leaves open, and how much of the difference to the published numbers it can make.

The paper does not say how facets share the points sampled on them, how weights of legs are drawn, or by which length moments
are scaled; nor is it clear whether noisy loads become unit vectors, as noisy twists do. Each variant changes one of these, or a
number that the paper gives (half of the pairs of legs on facets); methods as published.

    python examples/paper/figure3_variants.py --published published.json [--trials 50]
"""

from __future__ import annotations

from itertools import product

import figure3
import lab
import numpy as np

import stablepush as sp
from stablepush.geometry.planar import normalize_wrench, unit

METHODS = ("poly4-cvx", "quadratic")
VARIANTS = {
    "3pts_noise_free": (
        "as in figure 3",
        "facets by area",
        "weights of a flat Dirichlet",
        "weights all the same",
        "moments over the unit radius",
        "a quarter on facets",
    ),
    "ring_noisy": ("as in figure 3", "loads as unit vectors", "loads of the clean size", "moments over the unit radius"),
}


def pairs(points: int, rng: np.random.Generator, variant: str) -> tuple[np.ndarray, np.ndarray]:
    """As ``figure3.trial_pairs``, with one choice made otherwise."""
    if points == 3:
        angles = rng.uniform(0, 2 * np.pi, 3)
        shares = rng.dirichlet(np.ones(3)) if variant == "weights of a flat Dirichlet" else rng.uniform(size=3)
        shares = np.ones(3) if variant == "weights all the same" else shares
        feet = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
        support = sp.SupportDistribution(feet - shares / shares.sum() @ feet, shares)
    else:
        support = sp.SupportDistribution.ring(1.0, points)
    rho = 1.0 if variant == "moments over the unit radius" else None
    ideal = sp.IdealLimitSurface(support, 1.0, rho)
    rho = ideal.characteristic_length
    on_facets = figure3.PAIRS // (4 if variant == "a quarter on facets" else 2) if points == 3 else 0
    directions = unit(rng.normal(size=(figure3.PAIRS - on_facets, 3)))
    loads = normalize_wrench(ideal.wrench(directions / (1, 1, rho)), rho)
    if on_facets:
        which = np.arange(on_facets) % 3
        if variant == "facets by area":
            which = rng.choice(3, on_facets, p=support.weights**2 / (support.weights**2).sum())
        more_loads, more_directions = figure3.facet_pairs(ideal, which, rng)
        loads, directions = np.concatenate((loads, more_loads)), np.concatenate((directions, more_directions))
    order = rng.permutation(figure3.PAIRS)
    return loads[order], directions[order]


def run_trial(case: str, variant: str, trial: int) -> dict[str, list[float]]:
    """Test errors (deg) by method for every number of training pairs."""
    points, noise = figure3.CASES[case]
    rng = np.random.default_rng((list(figure3.CASES).index(case), trial))
    loads, directions = pairs(points, rng, variant)
    test, rest = slice(0, figure3.TEST), slice(figure3.TEST, None)
    seen_loads = loads[rest] + noise * rng.normal(size=loads[rest].shape)
    if variant == "loads of the clean size":
        seen_loads *= np.linalg.norm(loads[rest], axis=1, keepdims=True) / np.linalg.norm(seen_loads, axis=1, keepdims=True)
    elif variant == "loads as unit vectors":
        seen_loads = unit(seen_loads)
    seen = unit(directions[rest] + noise * rng.normal(size=directions[rest].shape))
    errors: dict[str, list[float]] = {method: [] for method in METHODS}
    for count, method in product(figure3.TRAIN, METHODS):
        rows = np.concatenate((figure3.VALIDATION + np.arange(count), np.arange(figure3.VALIDATION)))
        fit = sp.fit_limit_surface(
            seen_loads[rows],
            seen[rows],
            method,
            characteristic_length=1.0,
            loss="norm",
            validation_indices=np.arange(count, len(rows)),
        )
        errors[method].append(lab.angle_error(fit.surface, loads[test], directions[test], rho=1.0))
    return errors


def main() -> None:
    arguments = lab.parser(__doc__, data=False)
    arguments.add_argument("--trials", type=int, default=50)
    arguments.add_argument("--cases", nargs="+", choices=tuple(VARIANTS), default=list(VARIANTS))
    options = arguments.parse_args()
    theirs = lab.published(options).get("figure_3", {}).get("mean_angle_error_deg", {})
    for case in options.cases:
        variants = VARIANTS[case]
        print(f"\n{case:<32s}" + "".join(f"{n:>15d}" for n in figure3.TRAIN))
        for method in METHODS:
            known = theirs.get(case, {}).get({"quadratic": "quad"}.get(method, method))
            if known:
                print(
                    f"{method + ', published':<32s}"
                    + "".join(f"{m:8.2f} ± {h:4.2f}" for m, h in zip(known["mean"], known["ci95"], strict=True))
                )
        for variant in variants:
            jobs = [(case, variant, trial) for trial in range(options.trials)]
            found = lab.run_all(run_trial, jobs, options)
            for method in METHODS:
                cells = [lab.interval([f[method][k] for f in found]) for k in range(len(figure3.TRAIN))]
                print(f"{method + ', ' + variant:<32s}"[:44] + "".join(f"{m:8.2f} ± {h:4.2f}" for m, h in cells), flush=True)


if __name__ == "__main__":
    main()
