"""Plan round a wall with every stable rotation centre, and with only those that are stable for every pressure distribution."""

import stablepush as sp
from stablepush.plot import plot_plan, save_figure

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
for region in ("model", "conservative"):
    result = sp.plan(problem, region=region, time_limit=20.0)
    if result.solved:
        print(
            f"{region:12s} {result.duration:.1f} s, {result.length:.2f} m, {len(result.pushes)} pushes, "
            f"valid: {sp.check_plan(problem, result).valid}"
        )
        save_figure(plot_plan(problem, result), f"plan_{region}.png")
    else:
        print(f"{region:12s} {result.status}: {result.message}")
