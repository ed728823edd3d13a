"""Pictures of regions, contacts and plans. Figures are returned, or written as PNG; nothing is shown on a screen."""

from stablepush.plot.calibration import plot_calibration
from stablepush.plot.canvas import figure_png, save_figure
from stablepush.plot.gaps import plot_effects, plot_ends, plot_residuals, plot_residuals_against
from stablepush.plot.motions import plot_push, plot_slide, plot_wrench_paths
from stablepush.plot.plans import plot_plan
from stablepush.plot.regions import plot_contacts, plot_margins, plot_regions, plot_twist_sphere

__all__ = [
    "figure_png",
    "plot_calibration",
    "plot_contacts",
    "plot_effects",
    "plot_ends",
    "plot_margins",
    "plot_plan",
    "plot_push",
    "plot_regions",
    "plot_residuals",
    "plot_residuals_against",
    "plot_slide",
    "plot_twist_sphere",
    "plot_wrench_paths",
    "save_figure",
]
