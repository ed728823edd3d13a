"""``python -m stablepush``."""

from stablepush.cli import main

if __name__ == "__main__":
    main()
