"""The paper's future work: following a limit surface that changes, poke by poke.

A simulated slider is poked 120 times; after 60 its pressure changes to other feet. Angle error against the true surface after
every poke, with and without forgetting, and for the projected gradient; time for an update. Mean over 20 streams; no data needed:

    python examples/paper/online.py -o paper
"""

from __future__ import annotations

import json
import time

import lab
import numpy as np
from tqdm import tqdm

import stablepush as sp
from stablepush.geometry.planar import unit

POKES, CHANGE, STREAMS, NOISE = 120, 60, 20, 0.05
METHODS = {
    "forgetting 0.9": {"forgetting_factor": 0.9},
    "forgetting 0.95": {"forgetting_factor": 0.95},
    "no forgetting": {"forgetting_factor": 1.0},
    "projected gradient": {"method": "projected-gradient"},
}


def random_rig(rng: np.random.Generator) -> sp.IdealLimitSurface:
    """Return three to five feet about their centre of pressure, about 50 mm out, with a friction load of 4 to 6 N."""
    feet = 0.05 * rng.normal(size=(rng.integers(3, 6), 2))
    shares = rng.uniform(0.3, 1.0, size=len(feet))
    feet -= shares / shares.sum() @ feet
    return sp.IdealLimitSurface(sp.SupportDistribution(feet, shares), float(rng.uniform(4, 6)), lab.RHO)


def stream(seed: int) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """Return error (deg) after every poke and time (ms) of every update, for each method."""
    rng = np.random.default_rng(seed)
    rigs = random_rig(rng), random_rig(rng)
    directions = unit(rng.normal(size=(POKES, 3))) / (1, 1, lab.RHO)
    asked = unit(rng.normal(size=(200, 3))) / (1, 1, lab.RHO)
    answers = [rig.wrench(asked) for rig in rigs]
    followers = {name: sp.OnlineIdentifier(lab.RHO, **options) for name, options in METHODS.items()}
    errors: dict[str, list[float]] = {name: [] for name in METHODS}
    times: dict[str, list[float]] = {name: [] for name in METHODS}
    for i, twist in enumerate(directions):
        rig = rigs[i >= CHANGE]
        load = rig.wrench(twist) + NOISE * rig.friction_load * rng.normal(size=3) * (1, 1, lab.RHO)
        seen = twist + NOISE * rng.normal(size=3) / (1, 1, lab.RHO)
        for name, follower in followers.items():
            started = time.perf_counter()
            estimate = follower.update(load, seen)
            times[name].append(1e3 * (time.perf_counter() - started))
            assert estimate.certificate.sos_convex
            errors[name].append(lab.angle_error(estimate.surface, answers[i >= CHANGE], asked))
    return errors, times


def main() -> None:
    arguments = lab.parser(__doc__, data=False)
    arguments.add_argument("--streams", type=int, default=STREAMS)
    options = arguments.parse_args()
    results = [stream(seed) for seed in tqdm(range(options.streams), disable=None, leave=False)]
    curves = {name: np.array([r[0][name] for r in results]) for name in METHODS}
    print("mean angle error (deg) ± 95 % over the streams, after pokes; the pressure changes after poke", CHANGE)
    moments = (10, 30, 60, 65, 75, 90, 120)
    print(" " * 19 + "".join(f"{m:>15d}" for m in moments) + "   ms an update")
    for name, curve in curves.items():
        row = [lab.interval(curve[:, m - 1]) for m in moments]
        spent = np.median([t for r in results for t in r[1][name]])
        print(f"{name:>19s}" + "".join(f"   {m:5.2f} ± {h:4.2f}" for m, h in row) + f"   {spent:6.1f}")
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "online.json").write_text(
        json.dumps({n: c.mean(axis=0).tolist() for n, c in curves.items()}), encoding="utf-8"
    )

    from matplotlib.figure import Figure

    figure = Figure((8, 4.5), layout="constrained")
    axes = figure.subplots()
    for (name, curve), color in zip(curves.items(), ("#D55E00", "#E69F00", "#0072B2", "#999999"), strict=True):
        axes.plot(np.arange(1, POKES + 1), curve.mean(axis=0), color=color, label=name)
    axes.axvline(CHANGE, color="black", linestyle=":", label="the pressure changes")
    axes.set(xlabel="pokes", ylabel="mean angle error, deg", ylim=(0, 40), title="Following a surface that changes")
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(options.output / "online.png", dpi=120)
    print(options.output / "online.png")


if __name__ == "__main__":
    main()
