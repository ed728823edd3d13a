"""Which effects act on a log: steps over the catalogue, alternatives to what was found, and whether a refit does it alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from stablepush.core import FloatArray
from stablepush.diagnosis.likelihood.channel import Values
from stablepush.diagnosis.likelihood.likelihood import Fitted, Likelihood
from stablepush.diagnosis.likelihood.model import Model
from stablepush.diagnosis.likelihood.score_test import ScoreTest
from stablepush.diagnosis.search.alternatives import VAGUE, exchanged
from stablepush.diagnosis.search.contact_friction import P_SLIP, ContactFriction, slip_friction
from stablepush.diagnosis.search.folds import folds_of, predicted
from stablepush.diagnosis.search.plausibility import possible
from stablepush.diagnosis.search.screening import Screening, replicates
from stablepush.diagnosis.search.shape_effects import held_out_of_body, reshaping
from stablepush.diagnosis.search.steps import Search, steps
from stablepush.effects import FINGER_FRICTION, FITTED, PRESSURE_SHIFT


@dataclass(frozen=True, slots=True, eq=False)
class Attribution:
    """What acts on a log.

    ``likelihood``: the log's, whose fits begin at what was found; ``model``: the effects that act, and whether a refitted
    pressure is needed; ``confounded``: those that are confounded with one of them in this log, ``confounded_with``; ``final``:
    the fit with all of it; ``tests`` of all effects, each given the others that are chosen; ``scores`` by name: held-out log
    densities (trials,) of the nominal simulation and its refits; ``screened``: how effects fared that pressure cannot take in;
    ``single``: effects that stood out but act in one half of the pushes only, or not in all of several logs that would show them.
    """

    likelihood: Likelihood
    model: Model
    confounded: list[str]
    confounded_with: str
    recalibrated: bool
    final: Fitted
    tests: dict[str, ScoreTest]
    scores: dict[str, FloatArray]
    contact: ContactFriction | None
    screened: Mapping[str, Screening]
    single: Sequence[str] = ()

    @property
    def chosen(self) -> list[str]:
        """Effects that are fitted."""
        return list(self.model.effects)

    @property
    def free(self) -> bool:
        """Whether the refitted pressure is needed."""
        return self.model.free

    @property
    def named(self) -> list[str]:
        """All effects that act."""
        slips = self.contact is not None and self.contact.p_value < P_SLIP and FINGER_FRICTION not in self.chosen
        return [*self.chosen, FINGER_FRICTION] if slips else self.chosen

    @property
    def refit(self) -> Fitted:
        """The fit of any pressure, in place of a change of it that acts."""
        kinds = self.likelihood.experiment.effects
        beyond = [id for id in self.chosen if kinds[id].reshapes != "pressure"]
        return self.likelihood.fit(self.model.of(beyond).on(True))

    @property
    def moves_freely(self) -> bool:
        """Whether the pressure has moved in another form than all of it alike: the shift beside a free pressure is arbitrary,
        and one that puts the centre of pressure outside the slider is impossible."""
        if PRESSURE_SHIFT not in self.chosen or self.free:
            return PRESSURE_SHIFT in self.chosen
        experiment = self.likelihood.experiment
        center = experiment.center + self.final.values[PRESSURE_SHIFT][:2]
        return not shapely.MultiPoint(experiment.rig.slider.vertices).convex_hull.covers(shapely.Point(center))

    @property
    def slips(self) -> Values:
        """What the fingers' friction adds to the rig's, if it is known from forces and acts."""
        mu = self.likelihood.experiment.rig.contact_friction
        if self.contact is None or mu is None or FINGER_FRICTION not in self.named:
            return {}
        return {FINGER_FRICTION: self.contact.beside(mu)}

    @property
    def in_own_forms(self) -> Attribution:
        """What acts in the catalogue's forms alone, fitted anew: no simulation has the terms of families."""
        model = self.model.in_own_forms
        likelihood = self.likelihood.from_nominal
        final = likelihood.fit(model) if self.model.families else self.final
        return replace(self, likelihood=likelihood, model=model, final=final)


def attribute(likelihood: Likelihood, progress: Callable[[str], None], aside: frozenset[str] = frozenset()) -> Attribution:
    """Find which effects act on a log; none that is set ``aside``."""
    at = steps(likelihood, aside, progress)
    at, single = _that_replicate(at)
    at, rivals = exchanged(at, aside)
    as_well = [rival for rival in rivals if rival.as_well]
    confounded_with = as_well[0].id if as_well else ""
    confounded = [rival.other for rival in as_well if rival.id == confounded_with]
    likelihood, base = at.likelihood, _Base(at.model, {}, False)
    if likelihood.prior.has_surface:
        progress("held-out trials")
        base = _base(at)
        if not at.model.effects and base.model.effects:
            confounded_with, confounded = base.model.effects[0], list(base.confounded)
    model = base.model
    final = likelihood.fit(model)
    small = [] if model.free else [id for id in model.effects if not possible(likelihood, id, final.values[id])]
    if small:
        # such an effect was large only where the surface was free to change
        confounded = [] if confounded_with in small else confounded
        model = model.without(*small)
        final = likelihood.fit(model)
    tests = _tests(likelihood, model, final, confounded, confounded_with)
    contact = slip_friction(likelihood, final)
    return Attribution(
        likelihood, model, confounded, confounded_with, base.recalibrated, final, tests, base.scores, contact, at.screened, single
    )


def _that_replicate(at: Search) -> tuple[Search, list[str]]:
    """The search without effects that act in a part of the log only, or whose values may be none; and the former."""
    likelihood, model = at.likelihood, at.model
    single = [id for id in model.effects if not replicates(likelihood, model, id)]
    # beside the others an effect may be left with values that are none, within their errors
    vague = [id for id in model.effects if id not in model.families and at.fit.errors_of(id) < VAGUE]
    if single or vague:
        model = model.without(*single, *vague)
        at = replace(at, model=model, fit=likelihood.fit(model))
    return at, single


@dataclass(frozen=True, slots=True, eq=False)
class _Base:
    """The model on the surface that it needs, held-out log densities (trials,) by name, whether a refit predicts better than the
    nominal surface, and effects that do what that of the model does."""

    model: Model
    scores: dict[str, FloatArray]
    recalibrated: bool
    confounded: Sequence[str] = ()


def _base(at: Search) -> _Base:
    """The surface that the effects need: the nominal or a refitted one; without effects also one that another effect makes."""
    likelihood, model = at.likelihood, at.model
    better, folds = likelihood.significantly_better, folds_of(likelihood.experiment)
    scaled, refitted = (predicted(likelihood, model.on(free), folds) for free in (False, True))
    scores = {"nominal": _nominal_density(likelihood, model), "scaled": scaled.density, "free": refitted.density}
    certain = better(scores["free"], scores["scaled"])
    # which base the rest is judged on matters less than what is said: one standard error is enough
    free = better(scores["free"], scores["scaled"], 1.0)
    if free and model.effects and likelihood.wrench is not None:
        # nor may a pressure that few pushes determine be far off in some rows, which a density of heavy tails forgives
        free = refitted.square < scaled.square
    recalibrated = certain or better(scores["scaled"], scores["nominal"])
    experiment = likelihood.experiment
    # beside a surface that was fitted to pokes no change of its shape is more than its error: a refit absorbs that
    if model.effects or experiment.open_modes.size or not (certain or experiment.rig.model is None):
        return _Base(model.on(free), scores, recalibrated)
    scores |= held_out_of_body(likelihood, folds, certain)
    named, moved = reshaping(likelihood, scores, certain)
    if named:
        return _Base(Model((named[0],), False), scores, recalibrated, named[1:])
    # a pressure that has moved in another form is fitted freely beside
    return _Base(Model((PRESSURE_SHIFT,) if moved else (), free), scores, recalibrated)


def _tests(
    likelihood: Likelihood, model: Model, final: Fitted, confounded: Sequence[str], confounded_with: str
) -> dict[str, ScoreTest]:
    """Tests of all effects, each given the others that act."""
    tests: dict[str, ScoreTest] = {}
    for id in model.effects:
        # beside a free pressure nothing is left of what only moves it
        beside = model.free and likelihood.experiment.effects[id].reshapes != "pressure"
        others = likelihood.fit(model.without(id).on(beside))
        tests |= likelihood.tests(others, beside, [id], whole=id in model.families)
    own = [id for id, kind in likelihood.experiment.effects.items() if kind.of_lab]
    tests |= likelihood.tests(final, model.free, [id for id in (*FITTED, *own) if id not in (*model.effects, *confounded)])
    if confounded:
        # each in the place of the cause that it is confounded with
        tests |= likelihood.tests(likelihood.fit(model.without(confounded_with)), model.free, confounded)
    return tests


def _nominal_density(likelihood: Likelihood, model: Model) -> FloatArray:
    """Log density (trials,) of the nominal loads, the friction as it is believed, with the effects fitted to a scaled surface."""
    fitted = likelihood.fit(model.on(False))
    loads = likelihood.prior.nominal if likelihood.experiment.known_scale else fitted.loads
    residual = likelihood.residual(loads, fitted.values)
    return likelihood.density(residual, np.ones(len(residual), dtype=bool))
