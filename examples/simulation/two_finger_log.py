"""A real log of two-finger rotations replayed: final poses as predicted and as measured, stable and unstable actions apart.

The fingers go where they were told, from where they docked; friction is that of the nominal feet, or of a surface fitted to
pokes.

    stablepush import DATA --kind mlab-stable -o logs
    python examples/simulation/two_finger_log.py logs/poster_30_90_30_30_30_90_stable [--model model.json]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import stablepush as sp
from stablepush.geometry.planar import transport_twist, twist_from_cor
from stablepush.geometry.se2 import compose, inverse, wrap_angle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path)
    parser.add_argument("--model", type=Path, help="model/1 file instead of the nominal feet")
    parser.add_argument("--mu", type=float, default=0.95)
    parser.add_argument("--radius", type=float, default=0.005, help="of the fingers, in m")
    options = parser.parse_args()
    log = sp.read_pushlog(options.log)
    slider = log.rig.slider
    assert slider.support is not None
    surface = sp.load_model(options.model) if options.model else sp.IdealLimitSurface(slider.support, 4.2)
    s, rows = log.samples, []
    for k, name in enumerate(log.trials["trial"]):
        these = log.rows(name)
        seen = these[np.isfinite(s["x"][these]) & np.isfinite(s["theta"][these])]
        points = np.array([[s[c][i] for c in ("c1x", "c1y", "c2x", "c2y")] for i in these])
        touching = points[np.isfinite(points).all(axis=1)]
        if len(seen) < 2 or not len(touching):
            continue
        start, end = (np.array([s[c][i] for c in ("x", "y", "theta")]) for i in (seen[0], seen[-1]))
        a, b = touching[0].reshape(2, 2)
        normal = np.array((a[1] - b[1], b[0] - a[0]))
        normal *= np.sign(-(a + b) @ normal) / np.linalg.norm(normal)
        contact = sp.PushContact([a, b], [normal, normal], options.mu)
        pusher = sp.Pusher.of_contact(contact, options.radius)
        docked = pusher.docked(contact)
        twist = twist_from_cor((log.trials["cor_x"][k], log.trials["cor_y"][k]), log.trials["sense"][k])
        motion = [(transport_twist(twist, inverse(docked)), abs(float(log.trials["angle"][k])))]
        trace = sp.simulate_push(surface, slider, pusher, options.mu, start, compose(start, docked), motion, step=2e-4)
        error, route = trace.poses[-1] - end, end - start
        rows.append(
            (
                float(log.trials["stable"][k]) if "stable" in log.trials else np.nan,
                1000 * float(np.hypot(*error[:2])),
                float(np.degrees(abs(wrap_angle(error[2])))),
                1000 * float(np.hypot(*route[:2])),
                float(np.degrees(abs(wrap_angle(route[2])))),
                float((trace.modes == 1).all(axis=1).mean()),
            )
        )
        print(
            f"action {name:>3s}: {'stable' if rows[-1][0] == 1 else 'unstable' if rows[-1][0] == 0 else 'unknown':<9s} moved "
            f"{rows[-1][3]:6.1f} mm {rows[-1][4]:5.1f} deg, predicted {rows[-1][1]:6.1f} mm {rows[-1][2]:5.1f} deg away; "
            f"sticking for {100 * rows[-1][5]:.0f} % of the path"
        )
    table = np.array(rows)
    for value, word in ((1.0, "stable"), (0.0, "unstable")):
        part = table[table[:, 0] == value]
        if len(part):
            print(
                f"{word}: {len(part)} actions, median difference of final poses {np.median(part[:, 1]):.1f} mm and "
                f"{np.median(part[:, 2]):.1f} deg of {np.median(part[:, 3]):.0f} mm and {np.median(part[:, 4]):.0f} deg; "
                f"90 % below {np.quantile(part[:, 1], 0.9):.1f} mm and {np.quantile(part[:, 2], 0.9):.1f} deg"
            )


if __name__ == "__main__":
    main()
