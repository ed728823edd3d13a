"""``python -m stablepush``."""

import sys

if __name__ == "__main__":
    # as for the installed command: no module of the current folder is to stand for one of a library
    if not sys.flags.safe_path:
        del sys.path[0]
    from stablepush.cli import main

    main()
