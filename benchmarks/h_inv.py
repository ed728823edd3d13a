"""H_inv against what one would otherwise write: scipy's fsolve a query at a time, and a Newton iteration on numpy batches.

Run: python benchmarks/h_inv.py [number of twists]
All three invert the same certified quartic, in one process; fsolve is timed on a part. Prints times a query, the ratios
and the largest error of the twist's direction.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from scipy.optimize import fsolve

import stablepush as sp
from stablepush.demo import demo_pokes
from stablepush.geometry.planar import angle_between, normalize_twist, unit
from stablepush.surfaces.monomials import gradient_rows, hessian_operator, monomials


def numpy_newton(surface: sp.PolynomialLimitSurface, directions: np.ndarray, steps: int = 40) -> np.ndarray:
    """Damped Newton on ``H(F) - V·F`` for all rows at once: each keeps its own step, halved until the objective falls."""
    degree = surface.degree
    a = surface.coefficients
    second = hessian_operator(degree) @ a
    size = float(np.max(a[[0, -1]])) ** (-1 / degree)
    f = directions * size / (degree * (monomials(directions * size, degree) @ a))[:, None] ** (1 / (degree - 1))

    def objective(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        return monomials(x, degree) @ a - (x * v).sum(axis=1)

    active = np.arange(len(f))
    for _ in range(steps):
        x, v = f[active], directions[active]
        gradient = gradient_rows(x, degree) @ a
        far = np.linalg.norm(unit(gradient) - v, axis=1) > 1e-12
        active, x, v, gradient = active[far], x[far], v[far], gradient[far]
        if not len(active):
            break
        xx, xy, xz, yy, yz, zz = (monomials(x, degree - 2) @ second.T).T
        hessian = np.stack((xx, xy, xz, xy, yy, yz, xz, yz, zz), axis=-1).reshape(-1, 3, 3)
        step = np.linalg.solve(hessian, (v - gradient)[..., None])[..., 0]
        share = np.ones(len(x))
        before = objective(x, v)
        for _ in range(20):
            worse = objective(x + share[:, None] * step, v) > before + 1e-12 * np.abs(before)
            if not worse.any():
                break
            share[worse] /= 2
        f[active] = x + share[:, None] * step
    return f * (monomials(f, degree) @ a)[:, None] ** (-1 / degree)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    log = demo_pokes()
    surface = sp.fit_limit_surface(*log.pairs()[:2], slider=log.rig.slider).surface
    rho = surface.characteristic_length
    directions = unit(np.random.default_rng(0).normal(size=(count, 3)))
    twists = directions / (1, 1, rho)
    surface.wrench(twists[:10])  # compiled, or loaded from the cache, before the clock starts

    def error(loads: np.ndarray, part: np.ndarray) -> float:
        return float(angle_between(normalize_twist(surface.twist(loads), rho), part).max())

    rows = []
    rounds = []
    for _ in range(5):
        started = time.perf_counter()
        loads = surface.wrench(twists)
        rounds.append((time.perf_counter() - started) / count)
    rows.append(("stablepush H_inv", float(np.median(rounds)), error(loads, directions)))

    part = min(count, 100_000)
    started = time.perf_counter()
    loads = numpy_newton(surface, directions[:part]) * (1, 1, rho)
    rows.append(("numpy batched Newton", (time.perf_counter() - started) / part, error(loads, directions[:part])))

    part = min(count, 300)
    a = surface.coefficients
    started = time.perf_counter()
    found = []
    for v in directions[:part]:
        f = fsolve(lambda x, v=v: gradient_rows(x, 4) @ a - v, v, xtol=1e-12)
        found.append(f * float(monomials(f, 4) @ a) ** -0.25)
    rows.append(("scipy fsolve", (time.perf_counter() - started) / part, error(np.array(found) * (1, 1, rho), directions[:part])))

    print(f"{count} twists, certified quartic")
    for name, seconds, worst in rows:
        print(
            f"{name:22s} {1e6 * seconds:10.3f} us a query   {seconds / rows[0][1]:9.1f} x   worst direction error {worst:.1e} rad"
        )


if __name__ == "__main__":
    main()
