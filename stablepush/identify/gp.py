"""The paper's baseline: Gaussian processes from unit loads to twists and back, without physics."""

from __future__ import annotations

import time
import warnings

import numpy as np

from stablepush.core import FloatArray, InputError
from stablepush.geometry import unit
from stablepush.identify.pairs import Pairs
from stablepush.surfaces import GaussianProcessSurface, KernelSum


def fit_gaussian_process(pairs: Pairs) -> tuple[GaussianProcessSurface, float]:
    """Fit a Gaussian process for each of the surface's maps; returns it and the time (s) that took.

    Squared exponential kernel on unit vectors plus white noise, hyperparameters by maximum marginal likelihood, every pair with
    its negative (Zhou et al. 2016, section IV): unit load to unit twist, unit load to the logarithm of its size, and unit twist
    to load.
    """
    started = time.perf_counter()
    loads = unit(pairs.loads)
    sizes = np.linalg.norm(pairs.loads, axis=1, keepdims=True) * pairs.force_scale
    both, flipped = (np.concatenate((x, -x)) for x in (loads, pairs.directions))
    level = np.log(np.concatenate((sizes, sizes)))
    mean_level = float(level.mean())
    surface = GaussianProcessSurface(
        _fit(both, flipped),
        _fit(both, level - mean_level),
        _fit(flipped, np.concatenate((pairs.loads, -pairs.loads)) * pairs.force_scale),
        float(np.exp(mean_level)),
        pairs.rho,
        provenance={"model": "gp", "pairs": len(pairs)},
    )
    return surface, time.perf_counter() - started


def _fit(inputs: FloatArray, outputs: FloatArray) -> KernelSum:
    try:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    except ImportError:
        raise InputError("model", "expected scikit-learn to be installed for 'gp' (pip install 'stablepush[gp]')") from None
    scale = float(np.sqrt((outputs**2).mean())) or 1.0
    # a pair and its negative leave no unit vector farther than sqrt(2) from an input: with a shorter length than this the
    # likelihood may make every pair its own island, and the process is silent between them
    kernel = ConstantKernel(1.0, (1e-3, 1e3)) * RBF(0.7, (0.3, 20.0)) + WhiteKernel(0.01, (1e-6, 1.0))
    # the kernel is even in a pair and its negative, so the mean is odd (or even) as the outputs are
    regressor = GaussianProcessRegressor(kernel, n_restarts_optimizer=0, alpha=1e-8)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        regressor.fit(inputs, outputs / scale)
    signal = regressor.kernel_.k1
    amplitude, length = float(signal.k1.constant_value), float(signal.k2.length_scale)
    coefficients = amplitude * scale * np.asarray(regressor.alpha_).reshape(len(inputs), -1)
    return KernelSum(inputs, coefficients, length)
