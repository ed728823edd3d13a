"""What fits, regions, plans and diagnoses look like in a notebook, and pages to be put there."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stablepush.core import InputError
from stablepush.diagnosis import GapReport
from stablepush.identify import Fit
from stablepush.io import write_atomically
from stablepush.planning import PlanningProblem, PlanResult
from stablepush.stability import StableRegion
from stablepush.views.gap_page import gap_html
from stablepush.views.pages import plan_html
from stablepush.views.plot.canvas import SENSES, canvas, figure_png, fill, legend
from stablepush.views.plot.surfaces import plot_limit_surface

if TYPE_CHECKING:
    from stablepush.views.plot.canvas import Drawn

#: Height (pixels) of a page in a notebook until it is known; most rows of a table.
_HEIGHT, _ROWS = 760, 30


@dataclass(frozen=True, slots=True)
class Page:
    """A page of HTML that needs no network. A notebook shows it; :meth:`save` writes it."""

    html: str

    def _repr_html_(self) -> str:
        return _embedded(self.html)

    def __repr__(self) -> str:
        return f"Page of {len(self.html) / 1000:.0f} kB"

    def save(self, path: str | Path) -> None:
        """Write the page as a file."""
        write_atomically(path, self.html)


def animate(problem: PlanningProblem, result: PlanResult, title: str = "Plan of stable pushes") -> Page:
    """Return the animation of a plan: slider, pusher and rotation centres among the obstacles, with a slider for time.

    Parameters
    ----------
    problem : PlanningProblem
    result : PlanResult
        A plan for the problem.
    title : str

    Returns
    -------
    Page
        Shown by notebooks as it is; ``.save("plan.html")`` writes it, ``.html`` is its text.

    Raises
    ------
    InputError
        For anything but a problem and a result of a planner.
    """
    for name, value, wanted in (("problem", problem, PlanningProblem), ("result", result, PlanResult)):
        if not isinstance(value, wanted):
            raise InputError(name, f"expected a {wanted.__name__}", type(value).__name__)
    return Page(plan_html(problem, result, title))


def fit_html(fit: Fit) -> str:
    """Return a fit as a table and its surface as a picture."""
    rows = [
        ("model", fit.model), ("status", fit.status), ("pokes", str(len(fit.angle_errors))),
        ("angle error on the pokes used", f"{math.degrees(float(np.mean(fit.angle_errors))):.2f} deg"),
    ]  # fmt: skip
    if fit.validation_error is not None:
        rows.append(("angle error on held-out folds", f"{math.degrees(fit.validation_error):.2f} deg"))
    if fit.certificate is not None:
        rows.append(("SOS-convex", "yes" if fit.certificate.sos_convex else "NOT certified"))
    rows += [("note", note) for note in fit.warnings]
    picture = "" if fit.model == "gp" else _image(plot_limit_surface(fit.surface, fit.wrenches, fit.twists))
    return _table(("fit", ""), rows) + picture


def region_html(region: StableRegion) -> str:
    """Return a region in the COR plane of B."""
    extent = min(region.default_extent, 10 * region.characteristic_length)
    axes = canvas((5.6, 5.6))
    for sense, word, color in SENSES:
        label = word
        for polygon in region.polygons(sense, extent):
            fill(axes, polygon, facecolor=color, alpha=0.5, edgecolor=color, label=label)
            label = "_"
    axes.plot(0, 0, marker="+", color="black", markersize=9, linestyle="none", label="centre of mass")
    axes.set_xlim(-extent, extent)
    axes.set_ylim(-extent, extent)
    axes.set_xlabel("x in B [m]")
    axes.set_ylabel("y in B [m]")
    axes.set_title(f"Stable rotation centres: {region.name}")
    legend(axes, columns=3)
    spans = [f"{math.degrees(a):.1f} to {math.degrees(b):.1f} deg" for a, b in region.translation_intervals]
    return _image(axes) + _table(("stable translations", ""), [(span, "") for span in spans] or [("none", "")])


def result_html(result: PlanResult) -> str:
    """Return a plan as a table of its pushes."""
    if not result.solved:
        return _table(("plan", ""), [("status", str(result.status)), ("", result.message)])
    rows = []
    for number, push in enumerate(result.pushes[:_ROWS], 1):
        vx, vy, omega = push.twist
        twist = f"{1000 * vx:.1f}, {1000 * vy:.1f}, {math.degrees(omega):.1f}"
        rows.append((str(number), str(push.contact), twist, f"{push.duration:.2f}", f"{math.degrees(push.margin):.2f}"))
    if len(result.pushes) > _ROWS:
        rows.append(("…", "", f"{len(result.pushes) - _ROWS} more", "", ""))
    summary = [
        ("duration", f"{result.duration:.2f} s"), ("length", f"{result.length:.3f} m"),
        ("changes of contact", str(result.switches)), ("outlook", result.outlook),
    ]  # fmt: skip
    return _table(("plan", ""), summary) + _table(
        ("push", "contact", "twist in B [mm/s, mm/s, deg/s]", "duration [s]", "margin [deg]"), rows
    )


def report_html(report: GapReport) -> str:
    """Return the page of a diagnosis."""
    return _embedded(gap_html(report))


def _image(drawn: Drawn) -> str:
    data = base64.b64encode(figure_png(drawn)).decode()
    return f'<img alt="picture" style="width:560px;max-width:100%;height:auto" src="data:image/png;base64,{data}">'


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    def row(cells: Sequence[str], tag: str) -> str:
        style = "text-align:left;padding:2px 14px 2px 0;border-bottom:1px solid #8884"
        return "<tr>" + "".join(f'<{tag} style="{style}">{html.escape(cell)}</{tag}>' for cell in cells) + "</tr>"

    return (
        '<table style="border-collapse:collapse;margin:.8em 0">'
        + row(head, "th")
        + "".join(row(cells, "td") for cells in rows)
        + "</table>"
    )


def _embedded(page: str) -> str:
    # as high as the page is, where scripts may run
    fit = "this.height=this.contentDocument.documentElement.scrollHeight+8"
    frame = f'width="100%" height="{_HEIGHT}" style="border:0" title="page" onload="{fit}"'
    return f'<iframe srcdoc="{html.escape(page)}" {frame}></iframe>'
