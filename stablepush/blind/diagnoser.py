"""The process that diagnoses: it gets a folder with a log, and knows nothing else.

python -m stablepush.blind.diagnoser LOG ANSWER
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from stablepush.core import end_with_parent
from stablepush.diagnosis import diagnose
from stablepush.io import read_pushlog


def main() -> None:
    end_with_parent()
    log = read_pushlog(Path(sys.argv[1]))
    begin = time.perf_counter()
    answer = diagnose(log).to_json()
    seconds = round(time.perf_counter() - begin, 2)
    Path(sys.argv[2]).write_text(json.dumps({**answer, "seconds": seconds}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
