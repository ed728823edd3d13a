"""Which rotation centres keep the object stuck to two fingers? Writes stable_region.png beside the current folder's files."""

import numpy as np

import stablepush as sp
from stablepush.plot import plot_regions, save_figure

slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)])
contact = sp.PushContact.on_edge(slider, edge=0, center=0.05, width=0.05, mu=1.0)
even = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.005), friction_load=5.0)

model = sp.stable_region(even, contact)
everywhere = sp.all_pressure_region(slider, contact)
conservative = sp.lynch_mason_region(slider, contact)
for region in (model, everywhere, conservative):
    areas = [region.area(sense, 0.5) for sense in (1, -1)]
    low, high = np.degrees(region.translations)
    print(
        f"{region.name:12s} area within 0.5 m: {areas[0]:.3f} m² ccw, {areas[1]:.3f} m² cw; "
        f"translations {low:.0f}° to {high:.0f}°"
    )

save_figure(
    plot_regions([model, everywhere, conservative], contact, slider, title="Full patch contact, fingers 50 mm apart, mu 1"),
    "stable_region.png",
)
print("stable_region.png written")
