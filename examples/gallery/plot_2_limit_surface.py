"""
A limit surface in three dimensions
===================================

Loads ``(fx, fy, tau/rho)`` that make the triangle of the built-in rig slide: the surface that 15 pokes
identify, with the pokes on it. Arrows are the measured slip twists; to the true surface they would be
normal.
"""

import stablepush as sp
from stablepush.demo import demo_pokes
from stablepush.views.plot import plot_limit_surface, save_figure

log = demo_pokes(15)
fit = sp.fit_limit_surface(log.pairs(), slider=log.rig.slider)
print(f"{len(fit.wrenches)} pokes")

figure = plot_limit_surface(fit.surface, fit.wrenches, fit.twists, "15 pokes of the built-in rig").figure
save_figure(figure, "limit_surface.png")
