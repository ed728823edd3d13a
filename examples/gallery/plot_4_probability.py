"""
How certain is a stable region?
===============================

Eight pokes leave many limit surfaces likely. The shading is the share of them that calls a rotation centre
stable; the dashed line is where nine in ten do.
"""

import stablepush as sp
from stablepush.demo import demo_pokes
from stablepush.views.plot import plot_regions, save_figure

log = demo_pokes(8)
loads, twists, _ = log.pairs()
slider = log.rig.slider
surface = sp.fit_limit_surface(loads, twists, slider=slider).surface
contact = sp.PushContact.on_edge(slider, edge=0, center=0.05, width=0.05, mu=0.9)

regions = [sp.stable_region(surface, contact), sp.chance_region(surface, contact, 0.9)]
probability = sp.probability_map(surface, contact, extent=0.5, cells=300)
figure = plot_regions(
    regions, contact, slider, extent=0.5, title="After eight pokes", probability=probability
).figure
save_figure(figure, "probability.png")
