"""The program ``stablepush``: commands as thin shells around the library, exit codes, errors of one line.

Options are read and results printed here; computation and checks are in the other subpackages. Nothing imports this one.
"""

from stablepush.cli.program import main

__all__ = ["main"]
