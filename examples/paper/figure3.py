"""Figure 3 of Zhou et al. 2016: test error on simulated supports against the number of training pairs.

Three random support points on the unit circle, and 360 even ones on it; clean and noisy pairs; convex quartic, quartic,
ellipsoid and Gaussian process as published, and this library's default on the same pairs. Noisy twists are made unit vectors
again; the paper's words may mean noisy loads too, but with their size kept more cells agree (``figure3_variants.py``). 50 trials;
no data needed:

    python examples/paper/figure3.py -o paper [--published published.json] [--trials 50] [--jobs 2]
"""

from __future__ import annotations

import json
from itertools import product

import lab
import numpy as np

import stablepush as sp
from stablepush.geometry.planar import normalize_wrench, unit

TRAIN = (7, 15, 22, 45)
METHODS = (*lab.PUBLISHED, "default")
CASES = {"3pts_noisy": (3, 0.1), "3pts_noise_free": (3, 0.0), "ring_noisy": (360, 0.1), "ring_noise_free": (360, 0.0)}
#: Pairs of a trial, and how many of them validate and test.
PAIRS, VALIDATION, TEST = 150, 30, 75
_NAMES = {"poly4-cvx": "poly4-cvx", "poly4": "poly4", "quadratic": "quad", "gp": "gp"}


def trial_pairs(points: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return 150 clean pairs of a random support, normalised by its radius of gyration; half on the facets for three points."""
    if points == 3:
        angles = rng.uniform(0, 2 * np.pi, 3)
        shares = rng.uniform(size=3)
        feet = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
        feet -= shares / shares.sum() @ feet
        support = sp.SupportDistribution(feet, shares)
    else:
        support = sp.SupportDistribution.ring(1.0, points)
    ideal = sp.IdealLimitSurface(support, 1.0)
    rho = ideal.characteristic_length
    on_facets = PAIRS // 2 if points == 3 else 0
    directions = unit(rng.normal(size=(PAIRS - on_facets, 3)))
    loads = normalize_wrench(ideal.wrench(directions / (1, 1, rho)), rho)
    if on_facets:
        more_loads, more_directions = facet_pairs(ideal, np.arange(on_facets) % 3, rng)
        loads, directions = np.concatenate((loads, more_loads)), np.concatenate((directions, more_directions))
    order = rng.permutation(PAIRS)
    return loads[order], directions[order]


def facet_pairs(ideal: sp.IdealLimitSurface, which: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of rotations about support points (n,), whose own friction may be anything within its limit."""
    count, rho, support = len(which), ideal.characteristic_length, ideal.support
    sense, x = rng.choice((-1.0, 1.0), size=count), support.points[which]
    turning = np.stack((sense * x[:, 1], -sense * x[:, 0], sense), axis=-1)
    angle, size = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.uniform(size=count))
    force = (support.weights[which] * size)[:, None] * np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    own = np.concatenate((force, (x[:, :1] * force[:, 1:] - x[:, 1:] * force[:, :1]) / rho), axis=1)
    return normalize_wrench(ideal.wrench(turning), rho) + own, unit(turning * (1, 1, rho))


def run_trial(case: str, trial: int) -> dict[str, list[float]]:
    """Return the test errors (deg) of every method for every number of training pairs."""
    points, noise = CASES[case]
    rng = np.random.default_rng((list(CASES).index(case), trial))
    loads, directions = trial_pairs(points, rng)
    test = slice(0, TEST)
    seen_loads = loads[TEST:] + noise * rng.normal(size=loads[TEST:].shape)
    seen = unit(directions[TEST:] + noise * rng.normal(size=directions[TEST:].shape))
    validation = np.arange(VALIDATION)
    errors: dict[str, list[float]] = {method: [] for method in METHODS}
    for count in TRAIN:
        train = VALIDATION + np.arange(count)
        rows = np.concatenate((train, validation))
        for method in METHODS:
            if method == "default":
                fit = sp.fit_limit_surface(seen_loads[rows], seen[rows], characteristic_length=1.0)
            else:
                validation_indices = np.arange(count, len(rows))
                fit = sp.fit_limit_surface(
                    seen_loads[rows],
                    seen[rows],
                    method,
                    characteristic_length=1.0,
                    loss="norm",
                    validation_indices=validation_indices,
                )
            errors[method].append(lab.angle_error(fit.surface, loads[test], directions[test], rho=1.0))
    return errors


def main() -> None:
    arguments = lab.parser(__doc__, data=False)
    arguments.add_argument("--trials", type=int, default=50)
    arguments.add_argument("--cases", nargs="+", choices=tuple(CASES), help="all if not given")
    options = arguments.parse_args()
    theirs = lab.published(options).get("figure_3", {}).get("mean_angle_error_deg", {})
    cases_run = options.cases or list(CASES)
    jobs = list(product(cases_run, range(options.trials)))
    results = dict(zip(jobs, lab.run_all(run_trial, jobs, options), strict=True))
    found = {
        case: {
            m: [lab.interval([results[case, t][m][k] for t in range(options.trials)]) for k in range(len(TRAIN))] for m in METHODS
        }
        for case in cases_run
    }
    cells = agreeing = 0
    print(f"mean angle (deg) ± 95 % over {options.trials} trials; the published number behind it, * where the two differ")
    for case, methods in found.items():
        print(f"\n{case}" + "".join(f"{n:>26d}" for n in TRAIN))
        for method, row in methods.items():
            line = f"{method:>16s}"
            known = theirs.get(case, {}).get(_NAMES.get(method, ""))
            for k, ours in enumerate(row):
                line += f"   {ours[0]:5.2f} ± {ours[1]:4.2f}"
                if known:
                    other = known["mean"][k], known["ci95"][k]
                    same = lab.agrees(ours, other)
                    cells, agreeing = cells + 1, agreeing + same
                    line += f" ({other[0]:5.2f}){' ' if same else '*'}"
            print(line)
    if cells:
        print(f"\n{agreeing} of {cells} cells agree with the paper within the 95 % interval of the difference")
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "figure3.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    draw(found, theirs, options.output / "figure3.png")
    print(options.output / "figure3.png")


def draw(found: dict, theirs: dict, file) -> None:
    """Bars with intervals, one panel a case; published means as black ticks."""
    from matplotlib.figure import Figure

    colors = dict(zip(METHODS, ("#0072B2", "#E69F00", "#009E73", "#999999", "#D55E00"), strict=True))
    figure = Figure((13, 7), layout="constrained")
    panels = figure.subplots(2, 2).ravel()
    for axes in panels[len(found) :]:
        axes.set_visible(False)
    for axes, (case, methods) in zip(panels, found.items(), strict=False):
        for i, (method, row) in enumerate(methods.items()):
            place = np.arange(len(TRAIN)) + (i - 2) * 0.17
            mean, half = np.array(row).T
            label = "this library's default" if method == "default" else f"{method}, as published"
            axes.bar(place, mean, 0.16, yerr=half, color=colors[method], label=label, error_kw={"elinewidth": 0.8})
            if known := theirs.get(case, {}).get(_NAMES.get(method, "")):
                axes.plot(place, known["mean"], linestyle="none", marker="_", color="black", markersize=11)
        axes.set_xticks(range(len(TRAIN)), [str(n) for n in TRAIN])
        axes.set(title=case.replace("_", " "), xlabel="training pairs (30 more for validation)", ylabel="mean angle, deg")
    figure.axes[0].legend(fontsize=8)
    figure.suptitle("Test error on simulated supports; black marks: the paper")
    figure.savefig(file, dpi=120)


if __name__ == "__main__":
    main()
