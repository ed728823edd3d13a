from .calibration import plot_calibration as plot_calibration
from .canvas import figure_png as figure_png, save_figure as save_figure
from .gaps import (
    drawn_forms as drawn_forms,
    plot_effects as plot_effects,
    plot_final_poses as plot_final_poses,
    plot_forms as plot_forms,
    plot_residuals as plot_residuals,
    plot_residuals_against as plot_residuals_against,
    plot_signatures as plot_signatures,
)
from .headings import plot_headings as plot_headings
from .motions import plot_push as plot_push, plot_slide as plot_slide, plot_wrench_paths as plot_wrench_paths
from .plans import plot_plan as plot_plan
from .regions import (
    plot_contacts as plot_contacts,
    plot_margins as plot_margins,
    plot_regions as plot_regions,
    plot_twist_sphere as plot_twist_sphere,
)
from .surfaces import plot_limit_surface as plot_limit_surface
