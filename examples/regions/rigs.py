"""Random rigs for the studies of this folder: outlines, pressures, surfaces and contacts."""

from __future__ import annotations

import numpy as np
import shapely

import stablepush as sp


def outline(rng: np.random.Generator, convex: bool) -> np.ndarray:
    """Return a random polygon (n, 2) of about 0.1 m, counter-clockwise, with the origin well inside its hull."""
    while True:
        count = int(rng.integers(3, 9))
        angles = np.sort(rng.uniform(0, 2 * np.pi, count))
        radii = np.full(count, 0.1) if convex else rng.uniform(0.03, 0.12, count)
        points = np.stack((np.cos(angles), np.sin(angles)), axis=-1) * radii[:, None] * rng.uniform(0.3, 1.0, 2)
        polygon = shapely.Polygon(points)
        hull = polygon.convex_hull
        if (
            not polygon.is_valid
            or not polygon.exterior.is_ccw
            or polygon.area < 4e-4
            or np.linalg.norm(np.diff(points, axis=0), axis=1).min() < 5e-3
        ):
            continue
        center = np.array(polygon.centroid.coords[0]) + rng.uniform(-0.01, 0.01, 2)
        if hull.exterior.distance(shapely.Point(center)) > 0.01 and hull.contains(shapely.Point(center)):
            return points - center


def pressure(rng: np.random.Generator, outline: np.ndarray) -> sp.SupportDistribution:
    """Return random support points within an outline (n, 2), vertices and edges among them, and shares whose mean is the
    origin."""
    polygon = shapely.Polygon(outline)
    shapely.prepare(polygon)
    while True:
        points = rng.dirichlet(np.ones(len(outline)) * rng.choice((0.2, 1.0)), int(rng.integers(6, 14))) @ outline
        points = points[shapely.contains_xy(polygon, *points.T)][:8]
        if rng.random() < 0.5:
            i = rng.integers(len(outline), size=3)
            share = rng.choice((0.0, rng.random()), size=(3, 1))
            points = np.concatenate((points, outline[i] + share * (outline[(i + 1) % len(outline)] - outline[i])))
        if len(points) < 3:
            continue
        shares = tilted(rng.exponential(size=len(points)), points)
        if shares is not None:
            return sp.SupportDistribution(points, shares)


def tilted(raw: np.ndarray, points: np.ndarray) -> np.ndarray | None:
    """Return ``raw exp(λ·x)``, normalised, with the mean at the origin (Newton on λ); None if the points do not surround it."""
    if not shapely.MultiPoint(points).convex_hull.buffer(-1e-4).contains(shapely.Point(0, 0)):
        return None
    scaled = points / np.abs(points).max()
    slope = np.zeros(2)

    def shares(at: np.ndarray) -> np.ndarray:
        exponent = scaled @ at
        weights = raw * np.exp(exponent - exponent.max())
        return weights / weights.sum()

    for _ in range(200):
        q = shares(slope)
        mean = q @ scaled
        if np.abs(mean).max() < 1e-13:
            return q
        curvature = (scaled * q[:, None]).T @ scaled - np.outer(mean, mean)
        slope = slope - min(1.0, 0.5 / max(np.abs(mean).max(), 1e-9)) * np.linalg.solve(curvature + 1e-12 * np.eye(2), mean)
    return None


def quartic(rng: np.random.Generator) -> sp.PolynomialLimitSurface:
    """Return a random convex quartic: a sum of fourth powers of linear forms, from nearly round to nearly flat."""
    forms = rng.normal(size=(int(rng.integers(5, 16)), 3)) * rng.uniform(0.2, 1.0, 3)
    exponents = sp.monomial_exponents(4)
    factorial = np.array((1, 1, 2, 6, 24))
    coefficients = (24 / factorial[exponents].prod(axis=1) * (forms[:, None, :] ** exponents).prod(axis=-1)).sum(axis=0)
    return sp.PolynomialLimitSurface(coefficients, 4, 0.05)


def contact(rng: np.random.Generator, slider: sp.Slider, mu: float | None = None) -> sp.PushContact:
    """Return two fingers on a random edge of a slider."""
    edge = int(rng.integers(len(slider.vertices)))
    length = float(np.linalg.norm(np.subtract(*slider.edge(edge))))
    width = length * rng.uniform(0.1, 0.9)
    center = rng.uniform(width / 2, length - width / 2)
    return sp.PushContact.on_edge(slider, edge, center, width, rng.uniform(0.1, 1.2) if mu is None else mu)
