"""``python -m stablepush``."""

import os
import sys
from contextlib import suppress

if __name__ == "__main__":
    # as for the installed command: no module of the current folder is to stand for one of a library
    with suppress(OSError):
        if sys.path[:1] == [os.getcwd()]:
            del sys.path[0]
    from stablepush.cli import main

    main()
