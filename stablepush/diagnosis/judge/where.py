"""Where the gap lies: residuals of the nominal simulation by covariate, on held-out trials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from stablepush.core import FloatArray, order_with_ties
from stablepush.diagnosis.likelihood.experiment import Experiment
from stablepush.diagnosis.likelihood.likelihood import Likelihood
from stablepush.diagnosis.likelihood.robust import robust_variance
from stablepush.diagnosis.rows.observations import heading
from stablepush.geometry import rotate_vectors

#: Permutations of whole trials behind a p-value, and false discoveries that are let through.
_PERMUTATIONS, _FALSE = 1999, 0.05
#: Ridge on standardised features.
_RIDGE = 3.0
#: Components of final poses.
FINAL_POSE = ("end x body", "end y body", "end turn")
_FOLDS = 5


@dataclass(frozen=True, slots=True)
class Finding:
    """Share of a component's residual variance (between trials, held out) that depends on a covariate, with its p-value."""

    channel: str
    component: str
    covariate: str
    share: float
    p_value: float
    #: Robust variance explained by the covariate, in units of the noise variance; findings are sorted by it.
    strength: float


def covariates(experiment: Experiment) -> dict[str, FloatArray]:
    """Features (n, q) of the rows by covariate."""
    o = experiment.observations
    angle, body = heading(o), np.arctan2(o.twist[:, 1], o.twist[:, 0])
    x, y = o.pose[:, 0], o.pose[:, 1]
    speed = np.log(np.maximum(o.speed, 1e-6))
    turn = o.twist[:, 2] * experiment.rho / np.maximum(o.speed, 1e-6)
    turn = np.clip(turn, -5, 5)
    return {
        "world heading": np.stack([f(k * angle) for k in (1, 2) for f in (np.cos, np.sin)], axis=-1),
        "body direction": np.stack([f(k * body) for k in (1, 2) for f in (np.cos, np.sin)], axis=-1),
        "place": np.stack((x, y, x * x, x * y, y * y), axis=-1),
        "order": np.stack((o.order, o.order**2), axis=-1),
        "speed": np.stack((speed, speed**2), axis=-1),
        "acceleration": o.acceleration[:, :2],
        "rotation centre": np.stack((turn, turn**2, np.abs(turn)), axis=-1),
        "slider heading": np.stack((np.cos(o.pose[:, 2]), np.sin(o.pose[:, 2])), axis=-1),
    }


#: Residuals by (channel, component): trials (m,) of the rows, and values (m,).
Residuals = Mapping[tuple[str, str], tuple[np.ndarray, FloatArray]]


def residuals(
    likelihood: Likelihood,
    wrenches: FloatArray | None,
    ends: FloatArray,
    trials_of_errors: np.ndarray,
    floors: Mapping[str, float],
) -> Residuals:
    """Return the residuals of the nominal simulation in the frames that separate causes, in units of the noise.

    ``wrenches`` (n, 3) that it predicts, in B, if the log has forces: their size as a whole, the level of friction, is fitted;
    ``ends`` (m, 3): pose errors ``(x, y, rho θ)`` in B, of the trials ``trials_of_errors``. Clearances are the
    observations'. ``floors``: mean squares of the noise by channel.
    """
    o = likelihood.experiment.observations
    found: dict[tuple[str, str], tuple[np.ndarray, FloatArray]] = {}
    if wrenches is not None:
        unit = np.array((1.0, 1.0, likelihood.experiment.rho)) * np.sqrt(floors["wrench"] / 3)
        measured, predicted = o.wrench / unit, wrenches / unit
        off = measured - predicted * (measured * predicted).sum() / (predicted**2).sum()
        world = rotate_vectors(o.pose[:, 2], off[:, :2])
        along = o.wrench[:, :2] / np.maximum(np.linalg.norm(o.wrench[:, :2], axis=1, keepdims=True), 1e-9)
        parts = {
            "fx body": off[:, 0], "fy body": off[:, 1], "tau": off[:, 2], "fx world": world[:, 0],
            "fy world": world[:, 1], "size": (off[:, :2] * along).sum(axis=1),
        }  # fmt: skip
        found |= {("wrench", name): (o.trial, values) for name, values in parts.items()}
    touch = likelihood.clearance
    if touch.is_seen:
        found["pose", "clearance of fingers"] = touch.trial, touch.measured / touch.noise
    good = np.isfinite(ends).all(axis=1)
    for k, name in enumerate(FINAL_POSE):
        found["pose", name] = trials_of_errors[good], ends[good, k] / np.sqrt(floors.get("pose", 1.0) / 3)
    return found


def localise(experiment: Experiment, residuals: Residuals, seed: int = 0) -> list[Finding]:
    """Return the covariates that residuals depend on, false discoveries controlled (Benjamini and Hochberg 1995).

    What stands out most from the noise comes first. Final poses come last: all that acts during a push shows in them.
    """
    features = covariates(experiment)
    found: list[Finding] = []
    # components that the same trials have are tested side by side
    alike: dict[bytes, list[tuple[str, str]]] = {}
    for key, (trial, _) in residuals.items():
        alike.setdefault(np.unique(trial).tobytes(), []).append(key)
    for keys in alike.values():
        found += _findings(experiment.observations.trial, features, {key: residuals[key] for key in keys}, seed)
    found.sort(key=lambda f: (f.p_value, -f.share))
    kept = 0
    for rank, finding in enumerate(found, start=1):
        if finding.p_value <= _FALSE * rank / len(found):
            kept = rank
    shown = sorted((f for f in found[:kept] if f.share > 0), key=lambda f: f.component in FINAL_POSE)
    # findings as strong as each other, of covariates that are one on this log, stay in the order in which they were looked for
    last = 1 + max((f.strength for f in shown), default=0.0)
    return [shown[k] for k in order_with_ties([last * (f.component in FINAL_POSE) - f.strength for f in shown], 1e-9 * last)]


def _findings(rows: np.ndarray, features: Mapping[str, FloatArray], residuals: Residuals, seed: int) -> list[Finding]:
    """Findings for residuals of the same trials; ``features`` (n, q) are of rows of trials ``rows`` (n,)."""
    trials = np.intersect1d(np.concatenate([trial for trial, _ in residuals.values()]), rows)
    if len(trials) < 2 * _FOLDS:
        return []
    rng = np.random.default_rng(seed)
    folds = rng.permutation(len(trials)) % _FOLDS
    orders = np.array([np.arange(len(trials)), *(rng.permutation(len(trials)) for _ in range(_PERMUTATIONS))])

    def means(of: np.ndarray, values: FloatArray) -> FloatArray:
        mine = np.isin(of, trials)
        at = np.searchsorted(trials, of[mine])
        counts = np.bincount(at, minlength=len(trials))
        return np.stack([np.bincount(at, column, len(trials)) / counts for column in values[mine].T], axis=-1)

    targets = np.concatenate([means(trial, values[:, None]) for trial, values in residuals.values()], axis=1)
    # the robust variance: a few outlying pushes do not make a finding strong
    sizes = robust_variance((targets - np.median(targets, axis=0)) ** 2, axis=0)
    targets = targets - targets.mean(axis=0)
    # a column for every order and component
    permuted = np.ascontiguousarray(targets[orders].transpose(1, 0, 2)).reshape(len(trials), -1)
    spread = np.maximum((permuted**2).sum(axis=0), 1e-30)
    found: list[Finding] = []
    for covariate, columns in features.items():
        x = means(rows, columns)
        x = (x - x.mean(axis=0)) / np.maximum(x.std(axis=0), 1e-12)
        x = np.concatenate((np.ones((len(x), 1)), x), axis=1)
        ridge = np.diag([1e-9] + [_RIDGE] * (x.shape[1] - 1))
        # by moments: |y - x w|² = |y|² - 2 w·(xᵀ y) + w·(xᵀ x) w
        squares = [x[folds == k].T @ x[folds == k] for k in range(_FOLDS)]
        products = [x[folds == k].T @ permuted[folds == k] for k in range(_FOLDS)]
        left = spread.copy()
        for k in range(_FOLDS):
            weights = np.linalg.solve(sum(squares) - squares[k] + ridge, sum(products) - products[k])
            left += (weights * (squares[k] @ weights - 2 * products[k])).sum(axis=0)
        table = (1 - left / spread).reshape(len(orders), -1)
        for k, (channel, component) in enumerate(residuals):
            # ties count, whatever rounding made of them
            p, share = float((table[:, k] >= table[0, k] - 1e-12).mean()), float(np.clip(table[0, k], 0.0, 1.0))
            found.append(Finding(channel, component, covariate, share, p, share * sizes[k]))
    return found


def repeats_share(experiment: Experiment, white: FloatArray) -> tuple[float, float]:
    """Robust mean square of what is left of trials' mean wrenches over what noise leaves, from whitened rows (n, 3), and the
    p-value of an F-test that repeats of one push have it in common: scatter they do not, an effect that no fit has they do.

    The rows are to be those of a fit to all trials: on trials left out, repeats share what the fit to the others lacks.
    """
    o = experiment.observations
    means = np.array([white[o.trial == t].sum(axis=0) / np.sqrt(max(1, (o.trial == t).sum())) for t in range(len(o.names))])
    size = float(np.median(np.sum(means[np.unique(o.trial)] ** 2, axis=1)) / 2.366)
    groups = np.array([g if t in set(o.trial) else "" for t, g in enumerate(o.group)], dtype=object)
    between = within = 0.0
    shared = own = 0
    for name in dict.fromkeys(group for group in groups if group):
        mine = means[groups == name]
        if len(mine) > 1:
            between += float(len(mine) * (mine.mean(axis=0) ** 2).sum())
            within += float(((mine - mine.mean(axis=0)) ** 2).sum())
            shared, own = shared + 3, own + 3 * (len(mine) - 1)
    if not own or within <= 0:
        return size, 1.0
    return size, float(f_distribution.sf(between / shared / (within / own), shared, own))


def flexible_share(experiment: Experiment, whitened: FloatArray, seed: int = 0) -> tuple[float, float]:
    """Share of what is left of the wrenches, beyond noise, that a Gaussian process of place, heading, order and speed could
    explain, on held-out trials, and its p-value by permuting trials.

    ``whitened`` (n, 3): residuals in units of the noise.
    """
    o = experiment.observations
    trials, rows = np.unique(o.trial, return_inverse=True)
    if len(trials) < 20:
        return 0.0, 1.0
    rng = np.random.default_rng(seed)
    # along the measured load, which is what friction that varies changes; rows are inputs of their own, trials are left out as
    # a whole
    load = o.wrench[:, :2]
    target = (whitened[:, :2] * load / np.maximum(np.linalg.norm(load, axis=1, keepdims=True), 1e-9)).sum(axis=1)
    target = np.clip(target - np.median(target), -8, 8)
    angle = heading(o)
    inputs = {
        "place": (o.pose[:, :2], (0.03, 0.1)),
        "heading": (np.stack((np.cos(angle), np.sin(angle)), axis=-1), (0.3, 0.8)),
        "order": (o.order[:, None], (0.1, 0.3)),
        "speed": (np.log(np.maximum(o.speed, 1e-6))[:, None], (0.3, 1.0)),
    }
    folds = (rng.permutation(len(trials)) % _FOLDS)[rows]
    of_trial = [target[rows == k] for k in range(len(trials))]
    best, p_best = 0.0, 1.0
    for points, lengths in inputs.values():
        for length in lengths:
            root = _kernel_root(points / length)
            inner = [root[folds != k].T @ root[folds != k] + np.eye(root.shape[1]) for k in range(_FOLDS)]

            def shares(y: FloatArray, root: FloatArray = root, inner: list[FloatArray] = inner) -> FloatArray:
                """Shares (m,) of targets (n, m)."""
                left = np.zeros(y.shape[1])
                for k, matrix in enumerate(inner):
                    test, train = folds == k, folds != k
                    predicted = root[test] @ np.linalg.solve(matrix, root[train].T @ y[train])
                    left += ((y[test] - predicted) ** 2).sum(axis=0)
                return np.asarray(1 - left / np.maximum((y**2).sum(axis=0), 1e-30))

            true = float(shares(target[:, None])[0])
            if true <= best:
                continue
            # whole trials change places: their rows keep together as far as numbers of rows allow
            orders = [rng.permutation(len(trials)) for _ in range(39)]
            shuffled = np.stack([np.concatenate([of_trial[k] for k in order]) for order in orders], axis=-1)
            best, p_best = true, float(1 + (shares(shuffled) >= true - 1e-12).sum()) / 40
    return best, p_best


def _kernel_root(points: FloatArray) -> FloatArray:
    """Matrix ``R`` (n, r) with ``R Rᵀ`` the squared-exponential kernel of points (n, d) in units of its length, to 1e-8 in every
    entry: Cholesky's factor with pivots, which ends early since the kernel is smooth (Harbrecht, Peters and Schneider 2012)."""
    columns: list[FloatArray] = []
    left = np.ones(len(points))
    while left.max() > 1e-8:
        pivot = int(np.argmax(left))
        column = np.exp(-((points - points[pivot]) ** 2).sum(axis=1) / 2)
        if columns:
            root = np.array(columns)
            column -= root[:, pivot] @ root
        column /= np.sqrt(left[pivot])
        columns.append(column)
        left = left - column**2
    return np.array(columns).T
