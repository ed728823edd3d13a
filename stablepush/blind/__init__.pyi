from .check import BlindCheck as BlindCheck, alone as alone
from .score import Score as Score
