"""
Stable pushes on a slope
========================

The table slopes by 4 degrees. The load of the pusher is the friction load less the component of the weight
along the slope, as vectors, so which rotation centres are stable depends on the slider's heading. Filled is
what is stable at a heading, dashed what would be on a level table. A plan is stable all along its arcs,
whose headings change.
"""

import math

import stablepush as sp
from stablepush.views.plot import plot_headings, save_figure

slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)], mass=1.2)
feet = sp.SupportDistribution([(-0.03, -0.03), (0.06, -0.02), (-0.03, 0.05)], [1, 1, 1])
surface = sp.IdealLimitSurface(feet, friction_load=0.3 * 1.2 * 9.81)
contact = sp.PushContact.on_edge(slider, edge=0, center=0.075, width=0.06, mu=0.5)
slope = sp.parse_effect(f"tilt:slope={math.tan(math.radians(4)):.4f}/0")
problem = sp.PlanningProblem(
    slider,
    surface,
    [contact],
    start=(0.3, 0.3, 0.0),
    goal=(1.0, 0.6, 1.0),
    bounds=(0, 0, 1.5, 1.0),
    effects=[slope],
)
figure = plot_headings(problem, headings=4)[0, 0].figure
save_figure(figure, "slope.png")

result = sp.plan(problem)
print(
    result.status,
    f"{result.duration:.1f} s, stable throughout with probability {result.success_probability:.3f}",
)
