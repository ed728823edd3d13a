"""
Why does reality differ?
========================

A simulated robot pushes a triangle sixty times over a table that is not level: 0.02 rad. The diagnosis sees
the log and the nominal simulation, and finds the slope. Shown is what the nominal simulation and the
corrected one leave of the forces.
"""

import numpy as np

import stablepush as sp
from stablepush.views.plot import plot_residuals_against, save_figure

feet = sp.SupportDistribution([(-0.03, -0.03), (0.07, -0.03), (-0.03, 0.07)], [1, 1, 1])
slider = sp.Slider([(-0.05, -0.05), (0.10, -0.05), (-0.05, 0.10)], mass=1.2, support=feet)
surface = sp.IdealLimitSurface(feet, friction_load=3.5)
noise = sp.Noise(force=0.03, position=1e-4, angle=2e-3)
rig = sp.VirtualRig(
    slider, surface, 0.6, sp.Pusher.finger(0.005), [sp.parse_effect("tilt:slope=0.02/0")], noise
)
log = rig.execute(sp.random_pushes(slider, rig.pusher, 60, seed=2), seed=3).log

report = sp.diagnose(log)
print(report.sentence)
for name, parameter in report.ranking[0].parameters.items():
    print(
        name,
        [round(x, 4) for x in parameter.estimate],
        parameter.unit,
        "95 %:",
        np.round(parameter.ci95, 4).tolist(),
    )

figure = plot_residuals_against(report)[0, 0].figure
save_figure(figure, "diagnosis.png")
