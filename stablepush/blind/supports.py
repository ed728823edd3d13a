"""Real pokes as blind cases: which support the slider stood on is sealed, the rig that is diagnosed has that of any arrangement.

The labels are the importer's: it knows the arrangement from the name of the log, which the diagnosis does not see.
"""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from stablepush.blind.score import Row, Score, refused_words, share
from stablepush.core import InputError, scratch_folder
from stablepush.io import PushLog, write_pushlog
from stablepush.io.importers import Source, find_sources, import_source, triangle_slider

#: Effects that rightly name a wrong support: all reshape the limit surface in the body frame.
OF_PRESSURE = ("pressure-shift", "pressure-spread", "anisotropy-object", "model-capacity")


def cases(data: Path) -> list[tuple[Source, str]]:
    """Return every poking log of a clone with every arrangement of supports that any of them has."""
    sources = find_sources(data, "mlab-poke")
    arrangements = sorted(
        {s.labels["arrangement"] for s in sources if triangle_slider(s.labels["arrangement"]).support is not None}
    )
    if len(arrangements) < 2:
        raise InputError(
            "", f"expected poking logs on two arrangements of supports at least, found {len(arrangements)}", file=data
        )
    return [
        (source, arrangement)
        for source in sources
        if source.labels["arrangement"] in arrangements
        for arrangement in arrangements
    ]


def imported(number: int, data: Path, key: bytes) -> tuple[int, dict[str, bytes]]:
    """Return the files of a case: a log with the support of some arrangement, and the sealed label."""
    from cryptography.fernet import Fernet

    source, arrangement = cases(data)[number]
    log, _ = import_source(source)
    slider = triangle_slider(arrangement)
    wrong = {"effect": "support", "form": "arrangement", "matches": False, "size": 0.0, "detectable": True}
    label = {
        "kind": "real", "trap": "", "contacts": "one", "engine": "robot", "surface": source.labels["surface"],
        "arrangement": source.labels["arrangement"], "nominal": arrangement,
        "applied": [] if arrangement == source.labels["arrangement"] else [wrong],
    }  # fmt: skip
    with scratch_folder() as place:
        # nothing of the source's name goes with it
        write_pushlog(PushLog(replace(log.rig, slider=slider, extra=None), log.trials, log.samples), place / "log")
        files = {f"log/{f.name}": f.read_bytes() for f in sorted((place / "log").iterdir())}
    return number, {**files, "label.sealed": Fernet(key).encrypt(json.dumps(label).encode())}


def score_of_supports(rows: list[Row], refused: dict[int, str], codes: int, head: str) -> Score:
    """Return the answers to wrong supports, and to the right ones as a control."""
    wrong, right = ([r for r in rows if bool(r["label"]["applied"]) is kind] for kind in (True, False))
    words = {number: Counter(_outcome(r) for r in rows) for number, rows in enumerate((wrong, right))}
    closer = [r for r in wrong if (e := _wrench(r)) and e["after"] < e["before"]]
    closed = [e["closed"] for r in wrong if (e := _wrench(r))]
    lines = [
        ("cases", f"{len(rows)} of real pokes{refused_words(refused, codes)}"),
        (
            "wrong support: the pressure named, or explained by recalibration",
            share(words[0]["pressure"] + words[0]["absorbed"], len(wrong)),
        ),
        ("wrong support: another cause named", share(words[0]["another cause"], len(wrong))),
        ("wrong support: no cause, nothing to recalibrate", share(words[0]["nothing"], len(wrong))),
        ("wrong support: the corrected wrench is closer", share(len(closer), len(wrong))),
        ("wrong support: explained fraction of the gap", f"median {np.median(closed):.2f}" if closed else "none"),
        ("right support: no cause named", share(words[1]["nothing"] + words[1]["absorbed"], len(right))),
        ("last entry of the ledger", head),
    ]
    by_log = [
        (
            f"{r['label']['surface']} {r['label']['arrangement']}, believed {r['label']['nominal']}",
            f"{_outcome(r)}: {_reported(r)}",
        )
        for r in rows
    ]
    table = [
        {
            "set": r["set"], "surface": r["label"]["surface"], "arrangement": r["label"]["arrangement"],
            "nominal": r["label"]["nominal"], "verdict": r["answer"]["verdict"], "named": " ".join(r["answer"]["effects"]),
            "outcome": _outcome(r), "closed": (_wrench(r) or {}).get("closed", ""),
        }
        for r in rows
    ]  # fmt: skip
    return Score(lines, by_log, [], table, [], [], refused)


def _wrench(row: Row) -> dict[str, float] | None:
    return next((entry for entry in row["answer"]["shrink"] if entry["channel"] == "wrench"), None)


def _reported(row: Row) -> str:
    entry = _wrench(row)
    closed = f", {100 * entry['closed']:.0f} % of the wrench's gap is explained" if entry else ""
    return f"{row['answer']['verdict']} {' '.join(row['answer']['effects'])}".strip() + closed


def _outcome(row: Row) -> str:
    reported, verdict = set(row["answer"]["effects"]), row["answer"]["verdict"]
    if reported & set(OF_PRESSURE):
        return "pressure"
    if reported:
        return "another cause"
    return "absorbed" if verdict == "absorbed" else "nothing"
