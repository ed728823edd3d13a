from .all_pressure import (
    WorstPressure as WorstPressure,
    all_pressure_region as all_pressure_region,
    worst_pressure as worst_pressure,
)
from .common import Case as Case, common_region as common_region
from .contact_ranking import MEASURES as MEASURES, RankedContact as RankedContact, rank_contacts as rank_contacts
from .lynch_mason import lynch_mason_region as lynch_mason_region
from .oracle import BOUNDARY_SLACK as BOUNDARY_SLACK, StabilityOracle as StabilityOracle
from .probability import ProbabilityMap as ProbabilityMap, chance_region as chance_region, probability_map as probability_map
from .region import StableRegion as StableRegion, regions_to_json as regions_to_json, stable_region as stable_region
