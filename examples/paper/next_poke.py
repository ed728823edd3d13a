"""How many pokes does choosing them save?

On simulated rigs, pokes at random places against pokes that promise to tell most, with the slider known and with pokes alone;
then a replay of the real pokes, in which the next one is chosen among those not yet seen by its contact point and the
finger's heading. Mean angle error after each number of pokes, and the pokes that the mean error needs to come down to given
levels, with bootstrap intervals over rigs or replays.

    python examples/paper/next_poke.py DATA -o paper [--rigs 24] [--replays 6] [--jobs 2]
"""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import lab
import numpy as np

import stablepush as sp
from stablepush.geometry.planar import normalize_twist, unit

COUNTS = tuple(range(2, 10))
SHOWN = (2, 3, 4, 5, 7, 9)
#: Levels (deg) of the mean error whose pokes are counted.
LEVELS = (20.0, 16.0, 14.0, 12.0, 10.0, 9.0)
MU, NOISE = 0.8, 0.06


def curve(
    slider: sp.Slider,
    with_slider: bool,
    pool: list[sp.EdgePush],
    loads: np.ndarray,
    twists: np.ndarray,
    chosen: bool,
    rng: np.random.Generator,
    score,
) -> list[float]:
    """Return the score after each number of pokes, taken from the pool one at a time, at random or as they promise most."""
    left = list(rng.permutation(len(pool)))
    seen: list[int] = [left.pop(), left.pop()]
    scores = []
    while True:
        fit = sp.fit_limit_surface(
            loads[seen], twists[seen], slider=sp.Slider(slider.vertices) if with_slider else None, characteristic_length=lab.RHO
        )
        scores.append(score(fit.surface, left))
        if len(seen) == COUNTS[-1]:
            return scores
        if chosen:
            order = {id(pool[i].point): i for i in left}
            best = sp.rank_pokes(fit.surface, [pool[i] for i in left], MU)[0]
            seen.append(order[id(best.point)])
            left.remove(seen[-1])
        else:
            seen.append(left.pop())


def simulated(with_slider: bool, chosen: bool, seed: int) -> list[float]:
    """Poke a triangle on random feet; score: angle error against the true surface, over all loads."""
    rng = np.random.default_rng((seed, 4))
    outline = np.array(((0.0, 0.0), (0.15, 0.0), (0.0, 0.15))) - 0.05
    feet = np.array([[0.01, 0.01], [0.12, 0.01], [0.01, 0.12]]) + rng.uniform(-0.008, 0.025, size=(3, 2)) - 0.05
    shares = np.linalg.solve(np.vstack((np.ones(3), feet.T)), (1.0, 0.0, 0.0))
    truth = sp.IdealLimitSurface(sp.SupportDistribution(feet, shares), 5.0, lab.RHO)
    slider = sp.Slider(outline)
    pool = sp.poke_candidates(slider, places=6, headings=5)
    loads, twists = sp.poke_outcome(truth, [p.point for p in pool], [p.normal for p in pool], [p.heading for p in pool], MU)
    loads = loads + 5 * NOISE * rng.normal(size=loads.shape) * (1, 1, lab.RHO)
    twists = unit(normalize_twist(twists, lab.RHO)) + NOISE * rng.normal(size=twists.shape)
    asked = unit(rng.normal(size=(300, 3))) / (1, 1, lab.RHO)
    answers = truth.wrench(asked)
    return curve(
        slider, with_slider, pool, loads, twists / (1, 1, lab.RHO), chosen, rng, lambda s, _: lab.angle_error(s, answers, asked)
    )


def replayed(data: Path, arrangement: str, with_slider: bool, chosen: bool, turn: int) -> list[float]:
    """Replay real pokes; score: angle error on 15 pokes kept aside."""
    loads, twists, slider, pool = lab.pokes_as_commanded(data, arrangement)
    rng = np.random.default_rng((sum(arrangement.encode()), turn, 5))
    order = rng.permutation(len(pool))
    test, rows = order[:15], order[15:]
    return curve(
        slider,
        with_slider,
        [pool[i] for i in rows],
        loads[rows],
        twists[rows],
        chosen,
        rng,
        lambda s, _: lab.angle_error(s, loads[test], twists[test]),
    )


def needed(curves: np.ndarray, level: float) -> float:
    """Return the pokes after which the mean (k) of curves (m, k) is down to the level for good, between two counts by the
    straight line; NaN if it never is."""
    mean = curves.mean(axis=0)
    above = np.flatnonzero(mean > level)
    if not len(above):
        return float(COUNTS[0])
    last = int(above[-1])
    if last == len(COUNTS) - 1:
        return float("nan")
    return COUNTS[last] + float((mean[last] - level) / (mean[last] - mean[last + 1]))


def needed_interval(curves: np.ndarray, level: float) -> str:
    """Return the pokes needed with their 95 % bootstrap interval; ">" where less than 95 % of the resamples come down to it."""
    rng = np.random.default_rng(0)
    draws = [needed(curves[rng.integers(len(curves), size=len(curves))], level) for _ in range(2000)]
    low, high = np.nanquantile(np.where(np.isnan(draws), np.inf, draws), (0.025, 0.975), method="nearest")
    value = needed(curves, level)
    word = f"> {COUNTS[-1]}" if np.isnan(value) else "<= 2" if value == COUNTS[0] else f"{value:.1f}"
    return word if np.isnan(value) else f"{word} ({low:.1f}-{f'{high:.1f}' if np.isfinite(high) else f'>{COUNTS[-1]}'})"


def main() -> None:
    arguments = lab.parser(__doc__)
    arguments.add_argument("--rigs", type=int, default=24, help="simulated rigs")
    arguments.add_argument("--replays", type=int, default=6, help="replays of each log")
    options = arguments.parse_args()
    logs = lab.pokes(options.data, "wood")
    report: dict[str, list] = {}
    table: list[str] = []
    print("mean angle error (deg) ± 95 %, and the gain of choosing, paired; after pokes")
    print(" " * 34 + "".join(f"{n:>15d}" for n in SHOWN))
    for with_slider in (True, False):
        word = "with the slider" if with_slider else "pokes alone"
        sim, real = {}, {}
        for chosen in (False, True):
            jobs = list(product((with_slider,), (chosen,), range(options.rigs)))
            sim[chosen] = np.array(lab.run_all(simulated, jobs, options))
            jobs = list(product((options.data,), logs, (with_slider,), (chosen,), range(options.replays)))
            real[chosen] = np.array(lab.run_all(replayed, jobs, options))
        for name, both in (("simulated", sim), ("replay", real)):
            for label, values in (("random", both[False]), ("chosen", both[True]), ("gain", both[False] - both[True])):
                row = [lab.interval(column) for column in values.T]
                report[f"{name}, {word}, {label}"] = row
                shown = [row[COUNTS.index(n)] for n in SHOWN]
                print(f"{f'{name}, {word}, {label}':>34s}" + "".join(f"   {m:5.2f} ± {h:4.2f}" for m, h in shown), flush=True)
                if label != "gain":
                    cells = "".join(f"{needed_interval(values, level):>17s}" for level in LEVELS)
                    table.append(f"{f'{name}, {word}, {label}':>34s}{cells}")
    print("pokes until the mean error is down to (deg)")
    print("\n".join((" " * 34 + "".join(f"{level:>17g}" for level in LEVELS), *table)))
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "next_poke.json").write_text(json.dumps(report, indent=1), encoding="utf-8")
    draw(report, options.output / "next_poke.png")
    print(options.output / "next_poke.png")


def draw(report: dict, file: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure((11, 4.5), layout="constrained")
    for axes, name in zip(figure.subplots(1, 2), ("simulated", "replay"), strict=True):
        for word, color in (("with the slider", "#D55E00"), ("pokes alone", "#0072B2")):
            for label, style in (("random", "--"), ("chosen", "-")):
                mean, half = np.array(report[f"{name}, {word}, {label}"]).T
                axes.errorbar(COUNTS, mean, half, color=color, linestyle=style, capsize=2, label=f"{word}, {label}")
        axes.set(title=name, xlabel="pokes", ylabel="mean angle error, deg")
        axes.grid(alpha=0.3)
    figure.axes[0].legend(fontsize=8)
    figure.savefig(file, dpi=120)


if __name__ == "__main__":
    main()
