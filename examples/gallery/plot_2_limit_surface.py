"""
A limit surface in three dimensions
===================================

Loads ``(fx, fy, tau/rho)`` that make the triangle of the built-in rig slide: the surface that 15 pokes identify, with the
pokes on it. Arrows are the measured slip twists; on the true surface they stand upright.
"""

import matplotlib.pyplot as plt
import numpy as np

import stablepush as sp
from stablepush.demo import demo_pokes

log = demo_pokes(15)
loads, twists, _ = log.pairs()
slider = log.rig.slider
unit = np.array((1, 1, slider.characteristic_length))
surface = sp.fit_limit_surface(loads, twists, slider=slider).surface


def stretched(wrenches):
    """Wrenches stretched onto the level set ``H = 1``, their moments over ``rho``."""
    size = surface.value(wrenches) ** (1 / surface.degree)
    return wrenches / size[..., None] / unit


azimuth, height = np.meshgrid(np.linspace(0, 2 * np.pi, 73), np.linspace(-1, 1, 37))
ring = np.sqrt(1 - height**2)
shape = stretched(np.stack((ring * np.cos(azimuth), ring * np.sin(azimuth), height), axis=-1) * unit)

figure = plt.figure(figsize=(6, 5), layout="constrained")
axes = figure.add_subplot(projection="3d")
axes.plot_surface(*np.moveaxis(shape, -1, 0), color="#56B4E9", alpha=0.5, linewidth=0)
pokes, slips = stretched(loads), twists * unit
axes.scatter(*pokes.T, color="black", s=12)
axes.quiver(*pokes.T, *(slips / np.linalg.norm(slips, axis=1, keepdims=True)).T, length=0.4, color="#D55E00")
axes.set(xlabel="fx", ylabel="fy", zlabel="tau / rho")
axes.set_aspect("equal")
figure.savefig("limit_surface.png")
