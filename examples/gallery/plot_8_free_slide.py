"""
A free slide
============

A triangle is flicked and slides until friction stops it. Towards the end of a slide the
direction of the twist settles on one of a few, the eigen-directions of the limit surface.
"""

import stablepush as sp
from stablepush.views.plot import plot_slide, save_figure

slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)], mass=1.0)
surface = sp.IdealLimitSurface(sp.SupportDistribution.from_polygon(slider.vertices, 0.01), friction_load=3.0)
slide = sp.simulate_free_sliding(surface, slider, (0.6, 0.2, 12.0))
print(f"rests after {slide.t[-1]:.2f} s")

figure = plot_slide(slider, slide).figure
save_figure(figure, "free_slide.png")
