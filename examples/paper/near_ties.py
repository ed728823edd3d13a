"""How much of a cell of Tables I and II is settled by the choice among nearly equal weights?

The authors choose between 24 settings of the weights by the angle error on 10 held-out pokes. For every split: all 24 fits, their
error, and the accuracy and recall of the stable class; then the lowest and highest mean over splits that settings whose error
is within 0, 1, 2 and 5 % of the best can give, for each of the paper's polynomials.

    python examples/paper/near_ties.py DATA [--jobs 2]
"""

from __future__ import annotations

from itertools import product
from pathlib import Path

import lab
import numpy as np
import tables

import stablepush as sp
from stablepush.geometry.planar import angle_between
from stablepush.identify.estimator import NormLoss
from stablepush.identify.fit import POLYNOMIALS
from stablepush.identify.pairs import Pairs
from stablepush.surfaces.monomials import gradient_rows

SLACKS = (0.0, 0.01, 0.02, 0.05)


def evaluate(data: Path, arrangement: str, model: str, count: int, turn: int) -> np.ndarray:
    """Return validation error (rad), accuracy and recall (%) of every setting (24, 3)."""
    degree, convex = POLYNOMIALS[model]
    loads, twists, _ = lab.patch_pokes(data) if arrangement == "patch" else lab.pokes(data, "wood")[arrangement]
    contacts, rotations, labels = lab.labelled_rotations(data)[arrangement]
    train, validation = tables.splits()[count][turn]
    rows = np.concatenate((train, validation))
    pairs = Pairs.from_data(loads[rows], twists[rows], None, lab.RHO)
    held_out = pairs.take(np.arange(count, len(rows)))
    loss = NormLoss(degree, convex, pairs.force_scale)
    part = loss.prepare(pairs.take(np.arange(count)))
    found = []
    for weights in loss.candidates:
        coefficients = loss.solve(part, weights).coefficients
        error = angle_between(gradient_rows(held_out.loads, degree) @ coefficients, held_out.directions).mean()
        surface = sp.PolynomialLimitSurface(coefficients / pairs.force_scale**degree, degree, pairs.rho)
        found.append([error, *tables.score(surface, contacts, rotations, labels)[:2]])
    return np.array(found)


def main() -> None:
    options = lab.parser(__doc__).parse_args()
    arrangements = sorted(lab.labelled_rotations(options.data))
    for arrangement, model, count in product(arrangements, lab.PUBLISHED[:3], tables.TRAIN):
        jobs = [(options.data, arrangement, model, count, turn) for turn in range(tables.EVALUATIONS)]
        scores = np.array(lab.run_all(evaluate, jobs, options))
        line = f"{arrangement:>18s} {model:>9s} {count:2d} + 10"
        for slack in SLACKS:
            near = scores[:, :, 0] <= scores[:, :, 0].min(axis=1, keepdims=True) * (1 + slack) + 1e-12
            low = [np.where(near, scores[:, :, k], np.inf).min(axis=1).mean() for k in (1, 2)]
            high = [np.where(near, scores[:, :, k], -np.inf).max(axis=1).mean() for k in (1, 2)]
            line += f"   {slack:4.0%}: {low[0]:5.1f}-{high[0]:5.1f} / {low[1]:5.1f}-{high[1]:5.1f}"
        print(line)


if __name__ == "__main__":
    main()
