"""Seven simulators beside 23 repeats of one real push: how far each is off, against how well the real push repeats itself.

``logs.csv`` holds the data of experiment 3 of Collins, Howard and Leitner, "Quantifying the reality gap in robotic manipulation
tasks" (2019): an arm pushes a 75 mm cube by about 0.1 m. Each source becomes a ``pushlog/1``; the real one is diagnosed with each
simulator's as its nominal simulation.

    python examples/diagnosis/collins2018.py LOGS.CSV -o DIR
    stablepush diagnose DIR/real --simulated DIR/Mujoco --html mujoco.html
"""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path
from typing import Any

import stablepush as sp

#: Side of the cube, and what is no place on the table (m).
SIDE, FAR = 0.075, 100.0


def read_logs(path: Path) -> dict[str, sp.PushLog]:
    """A log for each source, one trial a run, all of one group: the same push was commanded every time."""
    slider = sp.Slider.rectangle(SIDE, SIDE)
    runs: dict[str, dict[str, Any]] = {}
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            log = runs.setdefault(row["source"], {"trials": {}, "samples": []})
            log["trials"].setdefault(row["run"], len(log["trials"]))
            keys = ("t", "cube_x", "cube_y", "cube_yaw", "ee_x", "ee_y")
            log["samples"].append([row["run"], *(_number(row[key]) for key in keys)])
    found = {}
    for source, log in runs.items():
        names = list(log["trials"])
        columns = list(zip(*log["samples"], strict=True))
        trials = {"trial": names, "start_time": [60.0 * k for k in range(len(names))], "group": ["push"] * len(names)}
        samples = dict(zip(("trial", "t", "x", "y", "theta", "px", "py"), columns, strict=True))
        found[source] = sp.PushLog(sp.Rig(slider), trials, samples)
    return found


def _number(cell: str) -> float:
    """A cell, NaN where it is blank or an arm has flown off."""
    value = float(cell) if cell else math.nan
    return value if abs(value) < FAR else math.nan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", type=Path)
    parser.add_argument("-o", "--output", type=Path, help="folder for the logs")
    options = parser.parse_args()
    logs = read_logs(options.logs)
    if options.output:
        for source, log in logs.items():
            sp.write_pushlog(log, options.output / source)
    real = logs.pop("real")
    for source, log in logs.items():
        report = sp.diagnose(real, name="real", simulated=log)
        print(f"{source:14s} {report.verdict:8s} {report.sentence}")


if __name__ == "__main__":
    main()
