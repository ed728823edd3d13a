"""
Plan round a wall
=================

A path of stable pushes around an obstacle: the slider sticks to two fingers throughout, so no feedback is
needed. Every push has a load that is 0.03 rad or more inside the friction cone; with
``region="all-pressure"`` it would hold for every pressure distribution.
"""

import stablepush as sp
from stablepush.views.plot import plot_plan, save_figure

slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)])
feet = sp.SupportDistribution([(-0.02, -0.02), (0.04, -0.02), (-0.02, 0.04)], [1, 1, 1])
surface = sp.IdealLimitSurface(feet, friction_load=5.0)
contact = sp.PushContact.on_edge(slider, edge=0, center=0.05, width=0.05, mu=0.9)
problem = sp.PlanningProblem(
    slider,
    surface,
    [contact],
    start=(0.2, 0.2, 0.0),
    goal=(1.1, 0.35, -1.57),
    obstacles=[[(0.55, 0.0), (0.65, 0.0), (0.65, 0.45), (0.55, 0.45)]],
    bounds=(0.0, 0.0, 1.5, 1.0),
    pusher=[(-0.03, -0.035), (0.0, -0.035), (0.0, 0.035), (-0.03, 0.035)],
    min_margin=0.03,
)
result = sp.plan(problem, time_limit=20.0)
print(result.status, f"{result.duration:.1f} s, {result.length:.2f} m, {len(result.pushes)} pushes")
print("valid by an independent check:", sp.check_plan(problem, result).valid)

figure = plot_plan(problem, result).figure
save_figure(figure, "plan.png")
