"""
From the limit surface to a stable push
=======================================

In the upper left panel: the section fx = 0 of the limit surface. Friction can balance the loads inside the
limit surface. While the object slides, its load lies on the surface, and its twist (arrow) along the
outward normal. The fingers can exert the loads of the shaded cone. The load of motion A lies in it: A is
stable, B is not. In the upper right panel: the same two motions as rotation centres. In the lower panel: of
all pressures with that centre of mass, the one that does most to break motion A.
"""

import numpy as np
from matplotlib.figure import Figure

import stablepush as sp
from stablepush.geometry import cor_from_twist
from stablepush.views.plot import plot_regions
from stablepush.views.plot.canvas import fill, save_figure

slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)])
contact = sp.PushContact.on_edge(slider, edge=0, center=0.05, width=0.05, mu=0.5)
even = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.005), friction_load=5.0)
rho = even.characteristic_length

# loads (0, fy, tau) on the surface, and the twists that go with them
angles = np.linspace(-np.pi, np.pi, 361)
loads = np.stack((0 * angles, np.cos(angles), rho * np.sin(angles)), axis=-1)
loads = loads / np.asarray(even.value(loads))[:, None]
moments = [-0.025, 0.025]  # m: moment per force along y at the one finger and at the other
motions = {}
for name, arm in (("A", 0.018), ("B", 0.05)):
    load = np.array((0.0, 1.0, arm))
    load = load / float(even.value(load))
    motions[name] = (load, even.twist(load))

figure = Figure(figsize=(8.6, 8.8), layout="constrained")
(section, chart), (worst, words) = figure.subplots(2, 2)
reach = np.array((0.0, 6.0))
low, high = (reach * moment / rho for moment in moments)
section.fill_between(reach, low, high, color="#56B4E9", alpha=0.4, label="composite friction cone")
section.plot(loads[:, 1], loads[:, 2] / rho, color="black", label="limit surface")
for (name, (load, twist)), color in zip(motions.items(), ("#009E73", "#CC79A7"), strict=True):
    at, along = np.array((load[1], load[2] / rho)), np.array((twist[1], twist[2] * rho))
    end = at + 1.6 * along / np.linalg.norm(along)
    section.annotate("", end, at, arrowprops={"arrowstyle": "->", "color": color, "linewidth": 2})
    section.plot(
        *at,
        marker="o",
        color=color,
        linestyle="none",
        label=f"load and twist, rotation centre of motion {name}",
    )
    section.annotate(name, at, xytext=(-12, 4), textcoords="offset points", ha="center", fontweight="bold")
section.set_aspect("equal")
section.set_xlabel("fy [N]")
section.set_ylabel("τ/ρ [N]")
section.set_title("Loads with fx = 0", fontsize=11)

plot_regions([sp.stable_region(even, contact)], contact, slider, ax=chart)
chart.set_title("Stable rotation centres\n(blue: counter-clockwise)", fontsize=11)
chart.get_legend().remove()
for line in [line for line in chart.lines if line.get_marker() == "D"]:
    line.remove()
chart.set_xlim(-0.22, 0.22)
chart.set_xticks([-0.2, -0.1, 0.0, 0.1, 0.2])
chart.set_ylim(-0.22, 0.22)
for (name, (_, twist)), color in zip(motions.items(), ("#009E73", "#CC79A7"), strict=True):
    center, _ = cor_from_twist(twist)
    chart.plot(*center, marker="o", color=color, markeredgecolor="black", linestyle="none", zorder=5)
    chart.annotate(name, center, xytext=(0, -16), textcoords="offset points", ha="center", fontweight="bold")

found = sp.worst_pressure(slider, contact, motions["A"][1])
fill(worst, slider.polygon, facecolor="0.9", edgecolor="black")
worst.scatter(*found.points.T, s=900 * found.shares, color="#0072B2", zorder=3)
worst.plot(*contact.points.T, marker="o", color="#D55E00", linestyle="none", label="fingers")
worst.plot(0, 0, marker="+", color="black", markersize=10, linestyle="none", label="centre of mass")
worst.set_aspect("equal")
worst.set_xlabel("x in B [m]")
worst.set_ylabel("y in B [m]")
worst.set_xticks([-0.05, 0.0, 0.05, 0.1])
worst.set_title("Worst pressure for A\n(area: share of the weight)", fontsize=11)
words.axis("off")
named = {
    label: handle
    for axes in (section, worst)
    for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
}
words.legend(named.values(), named.keys(), frameon=False, loc="center")

for name, (load, twist) in motions.items():
    margin = np.degrees(sp.StabilityOracle(even, contact).margin(twist))
    print(f"motion {name}: load {load[1]:.2f} N, {1000 * load[2]:.0f} N·mm; margin {margin:.1f} deg")
words = f"{found.height:.3f} (stable for every pressure if at least 0), {len(found.points)} points"
print(f"worst pressure for A: height {words}")
save_figure(figure, "load_and_cone.png")
