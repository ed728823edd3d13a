from .baselines import (
    GridPressure as GridPressure,
    ellipsoid_from_pressure as ellipsoid_from_pressure,
    fit_pressure_grid as fit_pressure_grid,
)
from .certificate import Certificate as Certificate, certify as certify
from .cross_validation import CrossValidation as CrossValidation, cross_validate as cross_validate
from .fit import (
    LOSSES as LOSSES,
    MODELS as MODELS,
    POLYNOMIALS as POLYNOMIALS,
    WITH_PRIOR as WITH_PRIOR,
    Fit as Fit,
    fit_limit_surface as fit_limit_surface,
)
from .next_poke import poke_candidates as poke_candidates, poke_outcome as poke_outcome, rank_pokes as rank_pokes
from .online import OnlineEstimate as OnlineEstimate, OnlineIdentifier as OnlineIdentifier
from .pairs import SlipPairs as SlipPairs
from .pressure import PressureSampler as PressureSampler, predict_loads as predict_loads
from .stand_in import on_few_points as on_few_points, sample_loads as sample_loads, support_for as support_for
