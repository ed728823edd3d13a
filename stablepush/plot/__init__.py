"""Pictures of regions, contacts and plans. Figures are returned, or written as PNG; nothing is shown on a screen."""

from stablepush.plot.canvas import figure_png, save_figure
from stablepush.plot.motions import plot_slide
from stablepush.plot.plans import plot_plan
from stablepush.plot.regions import plot_contacts, plot_margins, plot_regions, plot_twist_sphere

__all__ = [
    "figure_png",
    "plot_contacts",
    "plot_margins",
    "plot_plan",
    "plot_regions",
    "plot_slide",
    "plot_twist_sphere",
    "save_figure",
]
