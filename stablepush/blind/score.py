"""What a blind check shows: detection, names, probabilities, parameters and shares of the gap against the opened labels.

Measures as fault diagnosis has them: false alarms with Clopper and Pearson's interval, whether the cause was named, alone or in
the reported set, Brier score and calibration, accuracy against coverage.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from stablepush.core import binomial_interval
from stablepush.effects import CATALOGUE

Row = dict[str, Any]
#: Channel of the strongest finding of ``where``, the wrench unless another is given, and the covariates expected for an effect.
CHANNEL = {"latency": "pose"}
COVARIATE = {
    "anisotropy-world": ("world heading",), "drift": ("order",), "spatial-variation": ("place",), "speed-dependence": ("speed",),
    "latency": ("speed", "acceleration"), "tilt": ("world heading", "slider heading"),
    "force-bias": ("world heading", "slider heading"),
}  # fmt: skip
#: Effects that are no wrong names where the rig believes in even pressure.
OF_SURFACE = {"pressure-shift", "pressure-spread", "anisotropy-object", "model-capacity"}
#: Edges of the bins of reported probabilities.
BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0)


def share(count: int, total: int) -> str:
    """A share in words: of how many, and its interval."""
    if total == 0:
        return "none to judge"
    low, high = binomial_interval(count, total)
    return f"{count} of {total}, {100 * count / total:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """``lines``: measures in words; ``by_effect``, ``by_form``: rows of tables; ``rows``: one per set, as the CSV has them;
    ``calibration``: bins (reported, acting, count);
    ``coverage``: (share of sets with an effect, accuracy), by falling probability;
    ``refused``: sets that do not count, with the reason."""

    lines: list[tuple[str, str]]
    by_effect: list[tuple[str, str]]
    by_form: list[tuple[str, str]]
    rows: list[dict[str, Any]]
    calibration: list[tuple[float, float, int]]
    coverage: list[tuple[float, float]]
    refused: dict[int, str]


def refused_words(refused: dict[int, str], codes: int) -> str:
    """What a reader must know of how the check was made."""
    words = "".join(f"; set {number} refused: {why}" for number, why in refused.items())
    return words + (f"; diagnosed by {codes} versions of the code" if codes > 1 else "")


def truth_of(row: Row) -> set[str]:
    return {a["effect"] for a in row["label"]["applied"]}


def named_in(row: Row) -> set[str]:
    return set(row["answer"]["effects"])


def outcome(row: Row) -> str:
    """One word for the answer to a set."""
    truth, reported, verdict = truth_of(row) & set(CATALOGUE), named_in(row), row["answer"]["verdict"]
    if verdict == "failed":
        return "failed"
    if row["label"]["trap"] == "patch":
        # the feet do press elsewhere than the rig has it
        reported = reported - OF_SURFACE
    if not truth:
        return "wrong name" if reported else "unknown" if verdict == "unknown" else "quiet"
    if verdict == "ambiguous" and truth & reported:
        return "in the set"
    if reported == truth:
        return "right"
    if reported - truth:
        return "wrong name" if not truth & reported else "right and more"
    if reported:
        return "one of two"
    return "unknown" if verdict == "unknown" else "missed"


def score_of(rows: list[Row], refused: dict[int, str], codes: int, seed: int, head: str) -> Score:
    """Return the score of opened sets: ``set``, ``label``, ``answer`` (``diagnosis/1``) and ``known`` (explained fractions)."""
    kinds = {kind: [r for r in rows if r["label"]["kind"] == kind] for kind in ("clean", "trap", "effect", "pair", "outside")}
    detectable = [r for r in kinds["effect"] if r["label"]["applied"][0]["detectable"]]
    lines = [("sets", f"{len(rows)}, seed {seed}{refused_words(refused, codes)}"), *_outcomes(rows, kinds, detectable)]
    brier, calibration, coverage = _calibration(rows)
    lines += brier
    lines += _explained(detectable) + _parameters(kinds["effect"]) + _where(detectable)
    seconds = [float(r["answer"].get("seconds", np.nan)) for r in rows]
    if seconds:
        lines.append(("time of a diagnosis", f"median {np.median(seconds):.1f} s, longest {np.max(seconds):.1f} s"))
    lines.append(("last entry of the ledger", head))
    by_effect, by_form = _by_effect(kinds), _by_form(rows, kinds)
    return Score(lines, by_effect, by_form, [_row(r) for r in rows], calibration, coverage, refused)


def _outcomes(rows: list[Row], kinds: dict[str, list[Row]], detectable: list[Row]) -> list[tuple[str, str]]:
    """How often causes are named, rightly or wrongly, by kind of set."""
    lines = []
    alarms = sum(outcome(r) != "quiet" for r in kinds["clean"])
    lines.append(("false alarms, clean sets", share(alarms, len(kinds["clean"]))))
    lines.append(("names in trap sets", share(sum(outcome(r) == "wrong name" for r in kinds["trap"]), len(kinds["trap"]))))
    # nothing explains these, and they are more than noise
    bad = [r for r in kinds["trap"] if r["label"]["trap"] != "patch"]
    lines.append(("outliers and scatter that are called unknown", share(sum(outcome(r) == "unknown" for r in bad), len(bad))))
    exact = [r for r in kinds["clean"] if r["label"]["friction_off"] == 0.0]
    recalibrated = sum(r["answer"]["verdict"] == "absorbed" for r in exact)
    lines.append(("clean sets explained by recalibration though the rig is exact", share(recalibrated, len(exact))))
    right = sum(outcome(r) == "right" for r in detectable)
    in_set = sum(outcome(r) in ("right", "in the set", "right and more") for r in detectable)
    top = sum(r["answer"]["ranking"][0]["effect"] in truth_of(r) for r in detectable if r["answer"]["ranking"])
    judged = [r for r in rows if r["label"]["kind"] != "outside"]
    wrong = sum(outcome(r) in ("wrong name", "right and more") for r in judged)
    both = sum(_both(r) for r in kinds["pair"])
    plain = [r for r in kinds["pair"] if all(a["detectable"] for a in r["label"]["applied"])]
    both_plain = sum(_both(r) for r in plain)
    taken = sum(bool(named_in(r)) for r in kinds["outside"])
    lines += [
        ("named, and nothing else, of detectable effects", share(right, len(detectable))),
        ("named or in the reported set", share(in_set, len(detectable))),
        ("most probable effect acts", share(top, len(detectable))),
        ("wrong names, all sets but those out of the catalogue", share(wrong, len(judged))),
        ("pairs: both named", f"{share(both, len(kinds['pair']))}; of those detectable {share(both_plain, len(plain))}"),
        ("out of the catalogue: named as an effect of it", share(taken, len(kinds["outside"]))),
        ("verdicts out of the catalogue", _counts(r["answer"]["verdict"] for r in kinds["outside"])),
    ]
    return lines


def _calibration(
    rows: list[Row],
) -> tuple[list[tuple[str, str]], list[tuple[float, float, int]], list[tuple[float, float]]]:
    """The Brier score in words, what acts of effects that have a probability, by its size, and :func:`_coverage`."""
    lines: list[tuple[str, str]] = []
    probabilities, acting, tops = [], [], []
    for r in rows:
        # an effect that the rig leaves out silently is no label
        if r["label"]["kind"] == "outside" or r["label"]["trap"] == "patch" or not r["answer"]["ranking"]:
            continue
        for entry in r["answer"]["ranking"]:
            probabilities.append(entry["probability"])
            acting.append(entry["effect"] in truth_of(r))
        if truth_of(r):
            first = r["answer"]["ranking"][0]
            tops.append((first["probability"], first["effect"] in truth_of(r)))
    reported, acts = np.array(probabilities), np.array(acting, dtype=float)
    calibration = []
    if len(reported):
        base = float(acts.mean())
        lines.append(
            ("Brier score of all probabilities", f"{((reported - acts) ** 2).mean():.4f} (base rate: {base * (1 - base):.4f})")
        )
        for low, high in pairwise(BINS):
            chosen = (reported >= low) & ((reported < high) | (high == 1.0))
            if chosen.any():
                calibration.append((float(reported[chosen].mean()), float(acts[chosen].mean()), int(chosen.sum())))
    return lines, calibration, _coverage(tops)


def _by_effect(kinds: dict[str, list[Row]]) -> list[tuple[str, str]]:
    by_effect = []
    for effect in CATALOGUE:
        mine = [r for r in kinds["effect"] if effect in truth_of(r)]
        if mine:
            by_effect.append((effect, _counts(_detected(r) for r in mine)))
    return by_effect


def _by_form(rows: list[Row], kinds: dict[str, list[Row]]) -> list[tuple[str, str]]:
    by_form = []
    for word, matches in (("the catalogue's form", True), ("another form", False)):
        mine = [r for r in kinds["effect"] if r["label"]["applied"][0]["matches"] is matches]
        by_form.append((word, _counts(_detected(r) for r in mine)))
    for form in dict.fromkeys(a["form"] for r in kinds["outside"] for a in r["label"]["applied"]):
        mine = [r for r in kinds["outside"] if r["label"]["applied"][0]["form"] == form]
        word = mine[0]["label"]["applied"][0]["effect"]
        by_form.append((f"{word} (in no catalogue)", _counts(r["answer"]["verdict"] for r in mine)))
    for engine in dict.fromkeys(r["label"]["engine"] for r in rows):
        mine = [r for r in rows if r["label"]["engine"] == engine]
        by_form.append((f"engine {engine}", _counts(_detected(r) for r in mine)))
    return by_form


def _both(row: Row) -> bool:
    """Whether all effects that act are named; an ambiguous set names none."""
    return bool(row["answer"]["verdict"] == "named" and truth_of(row) <= named_in(row))


def _coverage(tops: list[tuple[float, bool]]) -> list[tuple[float, float]]:
    """Share of sets and accuracy of the first guess, most certain first; equally certain guesses count together."""
    tops = sorted(tops, reverse=True)
    found, hits = [], 0
    for k, (probability, hit) in enumerate(tops):
        hits += hit
        if k + 1 == len(tops) or tops[k + 1][0] < probability:
            found.append(((k + 1) / len(tops), hits / (k + 1)))
    return found


def _detected(row: Row) -> str:
    faint = row["label"]["applied"] and not all(a["detectable"] for a in row["label"]["applied"])
    return f"{outcome(row)}{' (faint)' if faint else ''}"


def _counts(words: Any) -> str:
    return ", ".join(f"{word} {count}" for word, count in Counter(words).most_common()) or "none"


def _explained(detectable: list[Row]) -> list[tuple[str, str]]:
    """Explained fraction over that of a fit that knows the cause, in the channel in which the latter is largest."""
    ratios = []
    for r in detectable:
        best = max(r["known"], key=lambda c: r["known"][c], default=None)
        if best is None or r["known"][best] < 0.2:
            continue
        mine = next((e["closed"] for e in r["answer"]["shrink"] if e["channel"] == best), 0.0)
        ratios.append(max(0.0, mine) / r["known"][best])
    if not ratios:
        return []
    low, median = np.quantile(ratios, (0.1, 0.5))
    return [
        (
            "explained fraction, over that of a fit that knows the cause",
            f"mean {np.mean(np.minimum(ratios, 1.0)):.2f}, median {median:.2f}, a tenth below {low:.2f}, {len(ratios)} sets",
        )
    ]


def _parameters(effects: list[Row]) -> list[tuple[str, str]]:
    """Whether intervals hold the truth, and how far estimates are off, where the form is the catalogue's."""
    inside, off = [], []
    for r in effects:
        applied = r["label"]["applied"][0]
        if not applied["matches"] or applied["effect"] not in named_in(r):
            continue
        entry = next(e for e in r["answer"]["ranking"] if e["effect"] == applied["effect"])
        for name, truth in applied["parameters"].items():
            if name == "direction" or name not in entry["parameters"]:
                continue
            found = entry["parameters"][name]
            pairs = np.reshape(found["ci95"], (-1, 2))
            values, estimates = np.atleast_1d(truth), np.atleast_1d(found["estimate"])
            inside += [bool(a <= v <= b) for (a, b), v in zip(pairs, values, strict=True)]
            nominal = applied["nominal"]
            if np.linalg.norm(values - nominal) > 0:
                off.append(float(np.linalg.norm(estimates - values) / np.linalg.norm(values - nominal)))
    if not inside:
        return []
    return [
        ("95 % intervals of parameters that hold the truth", share(sum(inside), len(inside))),
        (
            "parameters off, of the effect's size",
            f"median {100 * np.median(off):.0f} %, nine of ten below {100 * np.quantile(off, 0.9):.0f} %",
        ),
    ]


def _where(detectable: list[Row]) -> list[tuple[str, str]]:
    hits = total = 0
    for r in detectable:
        effect = r["label"]["applied"][0]["effect"]
        wanted = COVARIATE.get(effect)
        if wanted is None:
            continue
        total += 1
        found = r["answer"]["where"]
        hits += bool(found) and found[0]["channel"] == CHANNEL.get(effect, "wrench") and found[0]["covariate"] in wanted
    return [("strongest finding of where names the expected covariate", share(hits, total))]


def _row(row: Row) -> dict[str, Any]:
    applied = row["label"]["applied"]
    first = (row["answer"]["ranking"] or [{}])[0]
    return {
        "set": row["set"], "kind": row["label"]["kind"], "trap": row["label"]["trap"], "contacts": row["label"]["contacts"],
        "effects": " ".join(a["effect"] for a in applied), "forms": " ".join(a["form"] for a in applied),
        "sizes": " ".join(f"{a['size']:.1f}" for a in applied), "verdict": row["answer"]["verdict"],
        "named": " ".join(row["answer"]["effects"]), "outcome": outcome(row),
        "most_probable": first.get("effect", ""), "probability": first.get("probability", ""),
        "seconds": row["answer"].get("seconds", ""),
    }  # fmt: skip
