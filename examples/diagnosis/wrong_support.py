"""Real poking logs diagnosed with the support of another arrangement as the nominal one: is the pressure found elsewhere?

stablepush import DATA --kind mlab-poke -o logs
python examples/diagnosis/wrong_support.py logs
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import stablepush as sp

PRESSURE = {"pressure-shift", "pressure-spread", "anisotropy-object", "model-capacity"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", type=Path)
    options = parser.parse_args()
    logs = {folder.name: sp.read_pushlog(folder) for folder in sorted(options.logs.iterdir()) if folder.is_dir()}
    supports = {name.partition("_")[2]: log.rig.slider.support for name, log in logs.items()}
    heads = ("log", "nominal support", "verdict", "named", "wrench N: before, after, floor", "closed")
    print("{:<36s} {:<32s} {:<10s} {:<28s} {:>32s} {:>7s}".format(*heads))
    right = wrong = found = shrunk = 0
    for name, log in logs.items():
        own = name.partition("_")[2]
        for arrangement, support in supports.items():
            slider = sp.Slider(log.rig.slider.vertices, log.rig.slider.mass, support)
            report = sp.diagnose(sp.PushLog(replace(log.rig, slider=slider), log.trials, log.samples), name=name)
            entry = next(e for e in report.shrink if e["channel"] == "wrench")
            mark = "" if arrangement != own else "*"
            sizes = f"{entry['before']:.2f} {entry['after']:.2f} {entry['floor']:.2f}"
            words = f"{report.verdict:<10s} {' '.join(report.named):<28s} {sizes:>32s} {100 * entry['closed']:>5.0f} %"
            print(f"{name:<36s} {arrangement + mark:<32s} {words}", flush=True)
            if mark:
                right += 1
                continue
            wrong += 1
            found += bool(set(report.named) & PRESSURE) or report.verdict == "absorbed"
            shrunk += entry["after"] < entry["before"]
    print(
        f"{wrong} wrong supports: pressure named or absorbed {found}, wrench closer after mending {shrunk}; * {right} right ones"
    )


if __name__ == "__main__":
    main()
