"""Score ``stablepush diagnose`` on logs of another generator: a folder with ``sets/*`` (``pushlog/1``) and ``labels.json``.

    python benchmarks/strangers.py FOLDER [--keep diagnoses.json]

All logs are diagnosed by the command line first, each in a process that is given the log alone; then the labels are read. Right
is what ``accept`` of a label says: every cause that must be named and none that may not; a verdict without a name that is
accepted; or an "ambiguous" verdict with the causes that must be there and none but those that may be. Intervals are of 95 %.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scipy.stats import beta

#: Size of an effect, over the noise of all rows together, from which on it counts as visible.
VISIBLE = 15.0


def diagnosed(log: Path, folder: Path) -> dict[str, Any]:
    """The ``diagnosis/1`` of a log; only an error of a command that fails."""
    out = folder / "diagnosis.json"
    out.unlink(missing_ok=True)
    done = subprocess.run(
        [sys.executable, "-m", "stablepush", "--quiet", "diagnose", log, "--json", out],
        capture_output=True,
        check=False,
        text=True,
    )
    if done.returncode or not out.exists():
        return {"verdict": "error", "effects": [], "shrink": [], "said": done.stderr[-300:]}
    found: dict[str, Any] = json.loads(out.read_text())
    return found


def names(diagnosis: dict[str, Any]) -> set[str]:
    return {entry["effect"] if isinstance(entry, dict) else entry for entry in diagnosis["effects"]}


def is_right(diagnosis: dict[str, Any], accept: dict[str, Any]) -> bool:
    verdict, named = diagnosis["verdict"], names(diagnosis)
    must, may = set(accept["named_must"]), set(accept["named_may"])
    if verdict == "ambiguous":
        return bool(must) and must <= named <= must | may | set(accept["ambiguous_may"])
    if verdict == "named":
        return must <= named <= must | may
    return verdict in accept["verdicts"]


def is_wrong_name(diagnosis: dict[str, Any], accept: dict[str, Any]) -> bool:
    allowed = set(accept["named_must"]) | set(accept["named_may"])
    allowed |= set(accept["ambiguous_may"]) if diagnosis["verdict"] == "ambiguous" else set()
    return not names(diagnosis) <= allowed


def share(right: Sequence[bool]) -> str:
    n, k = len(right), sum(right)
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    return f"{k} of {n} ({100 * k / max(n, 1):.1f} %, {100 * low:.0f} to {100 * high:.0f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--keep", type=Path, help="where the diagnoses go, as JSON")
    options = parser.parse_args()
    found: dict[str, dict[str, Any]] = {}
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for log in sorted((options.folder / "sets").iterdir()):
            found[log.name] = diagnosed(log, Path(folder))
            print(
                f"{log.name}: {found[log.name]['verdict']} {' '.join(sorted(names(found[log.name])))}",
                file=sys.stderr,
                flush=True,
            )
    if options.keep:
        options.keep.write_text(json.dumps(found))
    labels = json.loads((options.folder / "labels.json").read_text())
    rows = {name: (found[name], label["accept"]) for name, label in labels.items() if name in found}
    visible = [n for n in rows if labels[n]["role"] == "effect" and labels[n]["signal"]["size"] >= VISIBLE]
    clean = [n for n in rows if labels[n]["role"] == "none"]
    other = [n for n in rows if labels[n]["role"] != "none"]
    wrong = {n for n in rows if is_wrong_name(*rows[n])}
    right = {n for n in rows if is_right(*rows[n])}
    print(f"visible causes answered rightly: {share([n in right for n in visible])}; missed: {', '.join(set(visible) - right)}")
    print(f"wrong names, of logs with an effect: {share([n in wrong for n in other])}; {', '.join(wrong & set(other))}")
    print(f"false alarms, of logs without: {share([n in wrong for n in clean])}; {', '.join(wrong & set(clean))}")
    print(f"logs without an effect answered rightly: {share([n in right for n in clean])}; not: {', '.join(set(clean) - right)}")
    errors = [n for n in rows if found[n]["verdict"] == "error"]
    print(f"errors: {len(errors)} {', '.join(errors)}; {time.perf_counter() - began:.0f} s for {len(found)} logs")


if __name__ == "__main__":
    main()
