"""The program ``stablepush``: commands as thin shells around the library, exit codes, errors of one line.

Options are read and results printed here; what is computed and checked is in the other rooms. Nothing imports this room.
"""

from stablepush.cli.program import main

__all__ = ["main"]
