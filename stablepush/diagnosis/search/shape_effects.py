"""Effects that only reshape the limit surface in the body frame: whether one does as well as a free pressure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.likelihood import Likelihood
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.search.folds import predicted
from stablepush.diagnosis.search.plausibility import exceeds_model_error, possible
from stablepush.effects import CATALOGUE, PRESSURE_SHIFT

#: Effects that only reshape the surface in the body frame.
OF_BODY = tuple(id for id, kind in CATALOGUE.items() if kind.reshapes)
#: An effect in the body frame does nearly as well as the free surface with this share of its gain. A change of the pressure in
#: another form than the catalogue's has the second and more, a surface that the nominal pressure cannot have leaves half or less.
#: Beside a nominal surface that was fitted to pokes, whose errors look alike, and for a grain it is the first.
_ALL_BUT, _ALL_BUT_OF_PRESSURE = 0.9, 0.75
#: Where a free surface, of many parameters, gains nothing clear, an effect in the body frame must pass
#: this multiple of the demands.
_ALONE = 15.0
#: The centre of pressure has moved if it is off by this many standard deviations, and brings this share of a refit's gain.
_MOVED, _MOST_OF = 8.0, 0.4


def held_out_of_body(likelihood: Likelihood, folds: np.ndarray, certain: bool) -> dict[str, FloatArray]:
    """Return log densities (trials,) of held-out trials by the effects in the body frame alone; only by those that gain enough in
    one step from the nominal surface, if it is not ``certain`` that a free surface is better."""
    tried = list(OF_BODY)
    if not certain:
        tests = likelihood.tests(likelihood.fit(Model(free=False)), False, OF_BODY)
        tried = [id for id, test in tests.items() if test.gain > _ALONE * likelihood.demands.density]
    return {id: predicted(likelihood, Model((id,), False), folds).density for id in tried}


def reshaping(likelihood: Likelihood, scores: Mapping[str, FloatArray], certain: bool) -> tuple[list[str], bool]:
    """Return the effects in the body frame that do as well as the free surface, or all but, best first; and whether, if there are
    none, the pressure has moved in another form than all of it alike.

    ``scores``: log densities (trials,) of held-out trials, of the ``"free"`` and the ``"scaled"`` surface and of effects alone.
    """
    # one that is too small to matter stands for something else
    fits = {id: likelihood.fit(Model((id,), False)) for id in OF_BODY if id in scores}
    body = {
        id: scores[id]
        for id, fitted in fits.items()
        if possible(likelihood, id, fitted.values[id])
        and exceeds_model_error(likelihood, id, fitted.values[id], fitted)
        and (certain or likelihood.significantly_better(scores[id], scores["scaled"], times=_ALONE))
    }
    named = _as_good_as_free(likelihood, scores, body) if body else []
    return named, not named and certain and PRESSURE_SHIFT in body and _center_has_moved(likelihood, scores)


def _as_good_as_free(likelihood: Likelihood, scores: Mapping[str, FloatArray], body: Mapping[str, FloatArray]) -> list[str]:
    """Effects in the body frame that predict held-out trials as well as the free surface does, or all but, best first, if the
    best does."""
    lenient = [id for id in OF_BODY if CATALOGUE[id].reshapes == "pressure" and likelihood.experiment.rig.model is None]
    gain = float((scores["free"] - scores["scaled"]).sum())
    enough = [
        id
        for id, density in body.items()
        if likelihood.significantly_better(density, scores["scaled"])
        and (
            not likelihood.significantly_better(scores["free"], density)
            or float((density - scores["scaled"]).sum()) > (_ALL_BUT_OF_PRESSURE if id in lenient else _ALL_BUT) * gain
        )
    ]
    enough.sort(key=lambda id: -float(body[id].sum()))
    best = max(body, key=lambda id: float(body[id].sum()))
    return (
        [id for id in enough if id == best or not likelihood.significantly_better(body[best], body[id])] if best in enough else []
    )


def _center_has_moved(likelihood: Likelihood, scores: Mapping[str, FloatArray]) -> bool:
    """Whether the centre of the refitted pressure is clearly elsewhere, and that is most of what a refit gains."""
    if likelihood.experiment.logs > 1:
        # each log has a pressure of its own
        return False
    fitted = likelihood.fit(Model())
    off, deviation = likelihood.prior.moved_center(fitted.loads, likelihood.deviations(fitted, True))
    most = float((scores[PRESSURE_SHIFT] - scores["scaled"]).sum()) > _MOST_OF * float((scores["free"] - scores["scaled"]).sum())
    return most and bool(np.linalg.norm(off / deviation) > _MOVED) and possible(likelihood, PRESSURE_SHIFT, off)
