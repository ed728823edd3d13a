"""The stable-region figure of Zhou et al. 2016, and how regions do on the hand-labelled rotations.

Full patch contact, two fingers 50 mm apart in the middle of a leg of the triangle, mu 1, CORs in a square of 400 mm about the
push point: the region of the quartic identified from the patch's pokes, the region of even pressure, what holds for every
pressure, and Lynch and Mason's STABLE. Then accuracy and recall of the stable class on the labelled rotations (mu 0.95):
STABLE and all-pressure over the outline and over the hull of the nominal support, the default model from 30 pokes, and what
it calls stable with probability 0.9 (25 random draws of pokes).

    python examples/paper/stable_regions.py DATA -o paper [--draws 25] [--jobs 2]
"""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import lab
import numpy as np

import stablepush as sp
from stablepush.views.plot.canvas import save_figure
from stablepush.views.plot.regions import plot_margins, plot_regions, plot_twist_sphere

#: Sides (m) of the squares within which areas are compared; the paper samples CORs in the first.
SQUARES, POKES, PROBABILITY = (0.4, 0.8, 2.0), 30, 0.9


def predict(data: Path, arrangement: str, draw: int) -> dict[str, list[float]]:
    """Return accuracy and recall (%) of what depends on the pokes drawn."""
    loads, twists, slider = lab.patch_pokes(data) if arrangement == "patch" else lab.pokes(data, "wood")[arrangement]
    contacts, rotations, labels = lab.labelled_rotations(data)[arrangement]
    rows = np.random.default_rng((draw, 12)).permutation(len(loads))[:POKES]
    surface = sp.fit_limit_surface(loads[rows], twists[rows], slider=slider, characteristic_length=lab.RHO).surface
    oracles = [sp.StabilityOracle(surface, contact) for contact in contacts]
    stable = np.array([bool(o.is_stable(twist)) for o, twist in zip(oracles, rotations, strict=True)])
    shares = np.array([float(o.probability(twist)) for o, twist in zip(oracles, rotations, strict=True)])
    return {
        f"default, {POKES} pokes": score(stable, labels),
        f"probability {PROBABILITY:g}, {POKES} pokes": score(shares >= PROBABILITY - 1e-9, labels),
    }


def score(stable: np.ndarray, labels: np.ndarray) -> list[float]:
    """Return accuracy, recall and precision of the stable class (%); precision is NaN where nothing is called stable."""
    called = labels[stable]
    return [
        100 * float((stable == labels).mean()),
        100 * float(stable[labels].mean()),
        100 * float(called.mean()) if len(called) else float("nan"),
    ]


def main() -> None:
    arguments = lab.parser(__doc__)
    arguments.add_argument("--draws", type=int, default=25, help="random draws of pokes for the models")
    options = arguments.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    loads, twists, slider = lab.patch_pokes(options.data)
    contact = sp.PushContact.on_edge(slider, edge=0, center=0.05, width=0.05, mu=1.0)
    fit = sp.fit_limit_surface(loads, twists, slider=slider, characteristic_length=lab.RHO)
    even = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.003), 1.0, lab.RHO)
    outline = sp.Slider(slider.vertices)
    regions = {
        f"quartic from {len(loads)} pokes": sp.stable_region(fit.surface, contact),
        "even pressure": sp.stable_region(even, contact),
        f"probability {PROBABILITY:g}": sp.chance_region(fit.surface, contact, PROBABILITY),
        "all-pressure": sp.all_pressure_region(outline, contact, characteristic_length=lab.RHO),
        "STABLE": sp.lynch_mason_region(outline, contact, characteristic_length=lab.RHO),
    }
    areas = {
        name: {side: [region.area(sense, side / 2) for sense in (1, -1)] for side in SQUARES} for name, region in regions.items()
    }
    print("CORs in squares about the centre of mass: area (cm²) counter-clockwise, clockwise (ratio of the sum to STABLE's)")
    print(" " * 24 + "".join(f"{f'{1e3 * side:.0f} mm':>30s}" for side in SQUARES) + f"{'tightest turns (mm)':>22s}")
    for name, by_side in areas.items():
        cells = []
        for side, both in by_side.items():
            base = sum(areas["STABLE"][side])
            ratio = f"({sum(both) / base:.1f})" if base > 0 else "(STABLE has none)"
            cells.append(f"{' '.join(f'{1e4 * a:.1f}' for a in both)} {ratio}")
        turns = " ".join(f"{region_turn(regions[name], sense):.0f}" for sense in (1, -1))
        print(f"{name:>24s}" + "".join(f"{cell:>30s}" for cell in cells) + f"{turns:>22s}")
    shown = [regions[name] for name in (f"quartic from {len(loads)} pokes", "all-pressure", "STABLE")]
    shading = sp.probability_map(fit.surface, contact, SQUARES[0] / 2)
    title = "Full patch contact, fingers 50 mm apart, mu 1"
    save_figure(plot_regions(shown, contact, slider, 0.25, title, shading), options.output / "stable_regions.png")
    save_figure(plot_twist_sphere(shown, title), options.output / "stable_regions_sphere.png")
    save_figure(plot_margins(fit.surface, contact, shown), options.output / "stable_regions_margins.png")

    labelled = lab.labelled_rotations(options.data)
    found: dict[str, dict[str, list]] = {}
    for arrangement, (contacts, rotations, labels) in labelled.items():
        slider = lab.patch_pokes(options.data)[2] if arrangement == "patch" else lab.pokes(options.data, "wood")[arrangement][2]
        rows: dict[str, list] = {}
        for word, body in (("outline", sp.Slider(slider.vertices)), ("support", slider)):
            for name, build in (("STABLE", sp.lynch_mason_region), ("all-pressure", sp.all_pressure_region)):
                held = [bool(build(body, c).contains_twists(twist)) for c, twist in zip(contacts, rotations, strict=True)]
                rows[f"{name}, {word}"] = [score(np.array(held), labels)]
        for result in lab.run_all(predict, list(product((options.data,), (arrangement,), range(options.draws))), options):
            for name, values in result.items():
                rows.setdefault(name, []).append(values)
        found[arrangement] = rows
    print("labelled rotations: accuracy, recall, precision of the stable class (%)")
    for arrangement, rows in found.items():
        print(f"{arrangement}, {int(labelled[arrangement][2].sum())} of {len(labelled[arrangement][2])} stable")
        for name, values in rows.items():
            v = np.array(values, dtype=float)
            if len(v) == 1:
                cells = "".join(f"{x:>16.1f}" if np.isfinite(x) else f"{'-':>16s}" for x in v[0])
            else:
                cells = "".join(
                    f"{f'{m:.1f} ± {h:.1f}':>16s}" for m, h in (lab.interval(column[np.isfinite(column)]) for column in v.T)
                )
            print(f"{name:>28s}{cells}")
    report = {"areas_m2": {name: {str(k): v for k, v in by_side.items()} for name, by_side in areas.items()}, "labelled": found}
    (options.output / "stable_regions.json").write_text(json.dumps(report, indent=1), encoding="utf-8")
    print(options.output / "stable_regions.png")


def region_turn(region: sp.StableRegion, sense: int) -> float:
    """Return the distance (mm) of the nearest stable COR."""
    cor = region.tightest_turn(sense)
    return float("nan") if cor is None else 1e3 * float(np.linalg.norm(cor))


if __name__ == "__main__":
    main()
