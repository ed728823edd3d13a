"""The paper's three free slides: a triangle on three feet whose surface is a quartic fitted to few noisy pokes.

Prints final pose, rotation centre and direction for the quartic and for the feet themselves, with the paper's variant of the
equation beside it; all eigen-directions; convergence of the end with the tolerance of the integration. Leaves the paper's figure.

    python examples/simulation/free_slides.py [-o slides] [--seed 0]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import stablepush as sp
import stablepush.mechanics.sliding
from stablepush.geometry.planar import cor_from_twist
from stablepush.views.pages import slide_html
from stablepush.views.plot.canvas import save_figure
from stablepush.views.plot.motions import plot_slide, plot_wrench_paths

#: First twists of the paper's figure, in m/s and rad/s.
CASES = ((0.15, -0.15, 2 * np.pi), (0.25, -0.1, 3 * np.pi), (0.5, 0.1, np.pi))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("slides"))
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(options.seed)
    # the rig of the paper's logs: legs of 150 mm, feet 10 mm from the corners, about the centre of mass
    outline = np.array(((0.0, 0.0), (0.15, 0.0), (0.0, 0.15))) - 0.05
    feet = sp.SupportDistribution(np.array(((0.01, 0.01), (0.13, 0.01), (0.01, 0.13))) - 0.05, (1, 1, 1))
    slider = sp.Slider(outline, mass=1.508)
    ideal = sp.IdealLimitSurface(feet, 4.2)
    twists = rng.normal(size=(20, 3)) / (1, 1, 0.05)
    loads = ideal.wrench(twists)
    noisy = loads * (1 + 0.1 * rng.normal(size=loads.shape))
    quartic = sp.fit_limit_surface(noisy, twists, validation_indices=np.arange(10)).surface
    slides = {}
    for name, surface in (("quartic", quartic), ("feet", ideal)):
        print(f"{name}:")
        for k, twist in enumerate(CASES):
            slide = sp.simulate_free_sliding(surface, slider, twist)
            paper = sp.simulate_free_sliding(surface, slider, twist, variant="paper")
            slides[name, k] = slide
            x, y, theta = slide.poses[-1]
            d, (px, py, ptheta) = slide.direction, paper.poses[-1]
            print(
                f"  V(0) = ({1000 * twist[0]:.0f}, {1000 * twist[1]:.0f}) mm/s, {twist[2] / np.pi:.0f} pi rad/s: rests after "
                f"{slide.t[-1]:.4f} s at {1000 * x:.2f} mm, {1000 * y:.2f} mm, {np.degrees(theta):.2f} deg"
            )
            c = slide.cor
            centre = f"({1000 * c[0]:.1f}, {1000 * c[1]:.1f}) mm" if np.isfinite(c).all() else "none (it translates)"
            print(f"    last centre {centre}, direction ({d[0]:.3f}, {d[1]:.3f}, {0.05 * d[2]:.3f}) of (vx, vy, 0.05 m omega)")
            place = f"{1000 * px:.2f} mm, {1000 * py:.2f} mm, {np.degrees(ptheta):.2f} deg"
            print(f"    without the turning of the frame, as the paper writes it: {place}")
        found = sp.eigen_directions(surface, slider)
        print(f"  eigen-directions ({'all' if found.complete else 'not all'} of them, by their count):")
        for v, kind in zip(found.twists, found.kinds, strict=True):
            centre, _ = cor_from_twist(v)
            print(f"    {kind:<9s} centre ({1000 * centre[0]:9.1f}, {1000 * centre[1]:9.1f}) mm, {'ccw' if v[2] > 0 else 'cw'}")
        if len(found.translations):
            spans = ", ".join(f"{np.degrees(a):.0f} to {np.degrees(b):.0f} deg" for a, b in found.translations)
            print(f"    every translation is kept; those at {spans} attract")
        start = rng.normal(size=(400, 3)) / (1, 1, 0.05)
        _, ends = sp.sliding_basins(surface, slider, start)
        shares = [f"{kind} {i}: {100 * np.mean(ends == i):.0f} %" for i, kind in enumerate(found.kinds) if kind == "stable"]
        print(f"    slow slides from random directions end in {', '.join(shares)}, elsewhere {100 * np.mean(ends < 0):.0f} %")
    print("end of the first slide of the feet against a tolerance of 1e-12:")
    keep = stablepush.mechanics.sliding._RELATIVE
    stablepush.mechanics.sliding._RELATIVE = 1e-12
    best = sp.simulate_free_sliding(ideal, slider, CASES[0])
    for tolerance in (1e-5, 1e-7, 1e-9):
        stablepush.mechanics.sliding._RELATIVE = tolerance
        slide = sp.simulate_free_sliding(ideal, slider, CASES[0])
        off = slide.poses[-1] - best.poses[-1]
        print(f"  {tolerance:g}: {np.hypot(*off[:2]):.1e} m, {abs(off[2]):.1e} rad, {abs(slide.t[-1] - best.t[-1]):.1e} s")
    stablepush.mechanics.sliding._RELATIVE = keep
    for k in range(len(CASES)):
        save_figure(plot_slide(slider, slides["quartic", k]), options.output / f"slide_{k + 1}.png")
    paths = {f"slide {k + 1}": slides["quartic", k].wrenches for k in range(len(CASES))}
    save_figure(plot_wrench_paths(quartic, paths), options.output / "loads.png")
    (options.output / "slide_2.html").write_text(slide_html(slider, slides["quartic", 1]), encoding="utf-8")
    print(f"pictures and an animation in {options.output}")


if __name__ == "__main__":
    main()
