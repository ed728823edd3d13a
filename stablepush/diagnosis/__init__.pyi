from .evidence import Evidence as Evidence, readable as readable
from .gap_report import VERDICTS as VERDICTS, GapReport as GapReport, diagnose as diagnose, shrink_with as shrink_with
from .shrink import percent as percent
