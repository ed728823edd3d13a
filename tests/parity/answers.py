"""What the diagnoses of fixed logs say, and what changed: ``python tests/parity/answers.py [WORD ...] [--write]``.

Without a word all logs are diagnosed: 225, or 300 with the folder of other people's logs beside the project; with words those
whose names hold one. ``--write`` keeps the answers; the commit that does so says why those that changed are right. Logs of the
engines depend on the engine's version, which is kept beside the answers.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import math
import sys
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from parity.logs import recipes

import stablepush as sp

FILE = Path(__file__).with_name("answers.json")
#: Numbers that differ by a larger share of themselves, or of one, have changed.
SAME = 1e-6


def answer(name: str) -> dict[str, Any]:
    """What a diagnosis says of a log: verdict, named effects, and the probability and the estimates of each effect."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            value = sp.diagnose(recipes()[name]()).to_json()
        except sp.StablepushError as error:
            return {"verdict": "error", "words": str(error)}
    return {
        "verdict": value["verdict"],
        "effects": sorted(value["effects"]),
        "probabilities": {entry["effect"]: entry["probability"] for entry in value["ranking"]},
        "estimates": {
            f"{entry['effect']}.{name}": parameter["estimate"]
            for entry in value["ranking"]
            for name, parameter in entry["parameters"].items()
        },
    }


def differences(before: Any, after: Any, place: str = "") -> Iterator[str]:
    """Places at which two answers differ. Numbers differ if they do by more than :data:`SAME`."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in sorted(before.keys() | after.keys()):
            if key not in before or key not in after:
                yield f"{place}{key}: {'new' if key in after else 'gone'}"
            else:
                yield from differences(before[key], after[key], f"{place}{key}.")
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for k, (old, new) in enumerate(zip(before, after, strict=True)):
            yield from differences(old, new, f"{place}{k}.")
    elif isinstance(before, float | int) and isinstance(after, float | int):
        if not math.isclose(before, after, rel_tol=SAME, abs_tol=SAME * 1e-3):
            yield f"{place[:-1]}: {before:.9g} -> {after:.9g}"
    elif before != after:
        yield f"{place[:-1]}: {before} -> {after}"


def read() -> tuple[dict[str, Any], dict[str, str]]:
    """The answers that are kept, and the versions of the engines that made their logs."""
    kept = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {"answers": {}, "versions": {}}
    return kept["answers"], kept["versions"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", help="names of logs, or parts of them")
    parser.add_argument("--write", action="store_true", help="keep the answers")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    names = [name for name in recipes() if not options.words or any(word in name for word in options.words)]
    versions = {engine: importlib.metadata.version(engine) for engine in ("mujoco", "drake")}
    kept, of_kept = read()
    for engine, version in of_kept.items():
        if version != versions[engine]:
            print(f"logs of {engine} differ: the answers are those of {engine} {version}, this is {versions[engine]}")
    found, changed, numbers = {}, 0, 0
    with ProcessPoolExecutor(options.processes) as pool:
        for name, said in zip(names, pool.map(answer, names), strict=True):
            found[name] = said
            lines = list(differences(kept[name], said)) if name in kept else ["new"]
            changed, numbers = changed + bool(lines), numbers + len(lines)
            words = f"{said['verdict']} {' '.join(said.get('effects', ()))}"
            print(f"{name}: {words}" + "".join(f"\n    {line}" for line in lines), flush=True)
    print(f"{len(found)} logs, {changed} with differences, in {numbers} places")
    if options.write:
        text = json.dumps({"versions": versions, "answers": kept | found}, indent=1, sort_keys=True)
        FILE.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
