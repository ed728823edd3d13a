from .evidence import Evidence as Evidence, readable as readable
from .gap_report import VERDICTS as VERDICTS, GapReport as GapReport, diagnose as diagnose, shrink_with as shrink_with
from .results import (
    ChannelGap as ChannelGap,
    GapReduction as GapReduction,
    NextExperiment as NextExperiment,
    ParameterEstimate as ParameterEstimate,
    RankedEffect as RankedEffect,
    Verdict as Verdict,
)
from .shrink import percent as percent
