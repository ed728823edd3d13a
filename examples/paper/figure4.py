"""Figure 4 of Zhou et al. 2016: limit surfaces of the triangle on three feet, in 3-D.

The ideal surface with its facets; quartic without and with convexity from 5 training and 5 validation pokes; ellipsoid and
convex quartic from 10 and 10; this library's default from 10 pokes with the outline known. Dots: measured loads; arrows: slip
twists.

    python examples/paper/figure4.py DATA -o paper [--seed 1]
"""

from __future__ import annotations

import lab
import numpy as np

import stablepush as sp
from stablepush.geometry.planar import normalize_twist, normalize_wrench, unit

ARRANGEMENT = "30_90_30_30_30_90"


def level_set(surface: sp.LimitSurface, degree: int, steps: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a grid (3, steps, 2 steps) of normalised loads on ``H = 1``; where H is not positive there is none."""
    polar, azimuth = np.meshgrid(np.linspace(0, np.pi, steps), np.linspace(0, 2 * np.pi, 2 * steps), indexing="ij")
    rays = np.stack((np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)), axis=-1)
    value = surface.value(rays * (1, 1, lab.RHO))
    with np.errstate(invalid="ignore", divide="ignore"):
        radius = np.where(value > 0, np.abs(value) ** (-1 / degree), np.nan)
    x, y, z = np.moveaxis(rays * radius[..., None], -1, 0)
    return x, y, z


def main() -> None:
    arguments = lab.parser(__doc__)
    arguments.add_argument("--seed", type=int, default=1)
    options = arguments.parse_args()
    loads, twists, slider = lab.pokes(options.data, "wood")[ARRANGEMENT]
    assert slider.support is not None
    order = np.random.default_rng(options.seed).permutation(len(loads))
    validation, pool = order[:10], order[10:]
    friction = float(np.median(np.linalg.norm(loads[:, :2], axis=1)))
    panels = [("ideal, three feet", sp.IdealLimitSurface(slider.support, friction, lab.RHO), 1, pool[:0])]
    for model, count in (("poly4", 5), ("poly4-cvx", 5), ("quadratic", 10), ("poly4-cvx", 10)):
        fit = lab.fit_as_published(loads, twists, pool[:count], validation[:count], model)
        degree = 2 if model == "quadratic" else 4
        panels.append(
            (f"{model}, {count} + {count} pokes", fit.surface, degree, np.concatenate((pool[:count], validation[:count])))
        )
    rows = pool[:10]
    default = sp.fit_limit_surface(loads[rows], twists[rows], slider=sp.Slider(slider.vertices), characteristic_length=lab.RHO)
    panels.append(("this library's default, 10 pokes", default.surface, 4, rows))

    from matplotlib.colors import LightSource
    from matplotlib.figure import Figure

    figure = Figure((13, 8.6), layout="constrained")
    limit = 1.5 * friction
    light = LightSource(315, 45)
    for i, (title, surface, degree, rows) in enumerate(panels):
        axes = figure.add_subplot(2, 3, i + 1, projection="3d")
        # the authors' loss shrinks surfaces, some to nothing but a shape: they are drawn in the size of the loads
        size = np.mean(np.abs(surface.value(loads[rows])) ** (1 / degree)) if len(rows) else 1.0
        x, y, z = (np.clip(size * c, -limit, limit) for c in level_set(surface, degree))
        axes.plot_surface(x, y, z, color="#56B4E9", alpha=0.55, rstride=1, cstride=1, linewidth=0, lightsource=light)
        if len(rows):
            at, route = normalize_wrench(loads[rows], lab.RHO), unit(normalize_twist(twists[rows], lab.RHO))
            axes.scatter(*at.T, color="#D55E00", s=14, depthshade=False)
            axes.quiver(*at.T, *route.T, length=0.35 * friction, color="#0072B2", linewidth=1)
        error = lab.angle_error(surface, np.delete(loads, rows, axis=0), np.delete(twists, rows, axis=0))
        axes.set_title(f"{title}\n{error:.1f}° on the other pokes", fontsize=10)
        axes.set(xlim=(-limit, limit), ylim=(-limit, limit), zlim=(-limit, limit))
        axes.set(xlabel="fx, N", ylabel="fy, N", zlabel="tau/rho, N")
        axes.set_box_aspect((1, 1, 1))
        axes.view_init(25, -55)
        print(f"{title}: {error:.2f} deg on the other pokes")
    options.output.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.output / "figure4.png", dpi=110)
    print(options.output / "figure4.png")


if __name__ == "__main__":
    main()
