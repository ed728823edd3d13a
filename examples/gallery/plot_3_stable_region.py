"""
Which rotation centres are stable?
==================================

Two fingers push a right triangle that lies flat on the table. Shown are the rotation centres about which it
turns without slipping at the fingers: for even pressure ("model" in the legend), for every
pressure distribution ("all-pressure"), and by Lynch and Mason's STABLE ("conservative").
"""

import numpy as np

import stablepush as sp
from stablepush.views.plot import plot_regions, save_figure

slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)])
contact = sp.PushContact.on_edge(slider, edge=0, center=0.05, width=0.05, mu=1.0)
even = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.005), friction_load=5.0)

regions = [
    sp.stable_region(even, contact),
    sp.all_pressure_region(slider, contact),
    sp.lynch_mason_region(slider, contact),
]
for region in regions:
    areas = [region.area(sense, 0.5) for sense in (1, -1)]
    low, high = np.degrees(region.translations)
    words = f"{areas[0]:.3f} m² ccw, {areas[1]:.3f} m² cw; translations {low:.0f}° to {high:.0f}°"
    print(f"{region.name:12s} within 0.5 m: {words}")

figure = plot_regions(regions, contact, slider, title="Even pressure, fingers 50 mm apart, mu 1").figure
save_figure(figure, "stable_region.png")
