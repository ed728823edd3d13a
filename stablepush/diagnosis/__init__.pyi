from .pipeline import diagnose as diagnose, gap_reductions_with as gap_reductions_with
from .results import (
    ChannelGap as ChannelGap,
    GapReduction as GapReduction,
    NextExperiment as NextExperiment,
    ParameterEstimate as ParameterEstimate,
    RankedEffect as RankedEffect,
    Verdict as Verdict,
    readable as readable,
    shown_unit as shown_unit,
    size_in_words as size_in_words,
)
from .telling.evidence import Evidence as Evidence
from .telling.report import VERDICTS as VERDICTS, GapReport as GapReport
from .telling.signatures import Estimates as Estimates, Signature as Signature
from .telling.wording import estimate_in_words as estimate_in_words
