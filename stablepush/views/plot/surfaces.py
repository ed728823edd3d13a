"""A picture of a limit surface in three dimensions, with pokes on it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stablepush.core import InputError
from stablepush.geometry import unit
from stablepush.surfaces import LimitSurface
from stablepush.views.plot.canvas import COUNTER_CLOCKWISE, PUSHER, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Length of the arrows over the size of the surface.
_ARROW = 0.14


def plot_limit_surface(
    surface: LimitSurface,
    wrenches: ArrayLike = (),
    twists: ArrayLike = (),
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a limit surface in ``(fx, fy, tau/rho)``, with measured loads as dots and the twists that went with them as arrows.

    On the true surface, without noise, dots lie on the surface and arrows stand upright on it.

    Parameters
    ----------
    surface : LimitSurface
    wrenches, twists : array-like, shape (n, 3)
        Loads (in the unit of force of the surface, and m times that) and slip twists (m/s, rad/s) of pokes, in B.
    title : str, optional
    ax : Axes, optional
        Three-dimensional axes to draw in.
    """
    rho = surface.characteristic_length
    loads, slips = (np.reshape(given, (-1, 3)).astype(np.float64) for given in (wrenches, twists))
    loads, slips = loads / (1, 1, rho), slips * (1, 1, rho)
    if loads.shape != slips.shape:
        raise InputError("wrenches, twists", "expected as many of one as of the other", f"{len(loads)} and {len(slips)}")
    axes: Any = canvas((6.0, 5.4), equal=False, ax=ax, projection="3d")
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 73), np.linspace(-np.pi / 2, np.pi / 2, 37))
    around = np.stack((np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v) / rho), axis=-1)
    shape = surface.wrench(around) / (1, 1, rho)
    axes.plot_surface(*np.moveaxis(shape, -1, 0), color=COUNTER_CLOCKWISE, alpha=0.35, linewidth=0)
    if len(loads):
        length = _ARROW * float(np.linalg.norm(shape, axis=-1).max())
        axes.scatter(*loads.T, color="black", s=14, depthshade=False, label="load of a poke")
        axes.quiver(*loads.T, *unit(slips).T, length=length, color=PUSHER, label="its slip twist")
        axes.legend(loc="upper left", frameon=False, fontsize=9)
    for name, label in (("x", "fx"), ("y", "fy"), ("z", "tau/rho")):
        getattr(axes, f"set_{name}label")(f"{label} [{surface.force_unit}]")
    axes.set_aspect("equal")
    axes.set_title(title or "Limit surface")
    return axes  # type: ignore[no-any-return]
