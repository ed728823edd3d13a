from .check import BlindCheck as BlindCheck, alone as alone
from .loop import LoopCheck as LoopCheck, summary as summary
from .score import Score as Score
