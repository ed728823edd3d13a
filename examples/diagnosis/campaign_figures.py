"""Pictures of a campaign of diagnoses: the confusion matrix of the effects, and the reliability of the reported
probabilities.

python examples/diagnosis/campaign_figures.py campaign.csv [-o .]
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path

import campaign
import numpy as np
from matplotlib.figure import Figure

from stablepush.views.plot.canvas import save_figure

#: What a log is called that gets no name.
VERDICTS = ("none", "absorbed", "unknown")
#: What logs may have, of those with forces; two effects at once are no row of the matrix.
TRUTHS = (*campaign.LARGEST, *(word for word in campaign.OTHERS if word != "pair"))
CALLED = (*campaign.LARGEST, *VERDICTS)


def confusion(rows: list[dict[str, str]]) -> np.ndarray:
    """Logs (truths, called) by what they have and by what they are called; one with two names counts in both."""
    counts = np.zeros((len(TRUTHS), len(CALLED)), dtype=int)
    for row in rows:
        if row["effect"] in TRUTHS:
            for name in row["named"].split() or [row["verdict"]]:
                counts[TRUTHS.index(row["effect"]), CALLED.index(name)] += 1
    return counts


def reliability(rows: list[dict[str, str]]) -> list[tuple[float, float, float, float, int]]:
    """Between two levels each: mean reported probability, share that act, its 95 % interval, number.

    Clopper and Pearson's intervals, as if the effects of a log were independent.
    """
    stated, acts = campaign.probabilities(rows)
    found = []
    for low, high in pairwise(campaign.LEVELS):
        here = (stated >= low) & (stated < high)
        if n := int(here.sum()):
            count = int(acts[here].sum())
            found.append((float(stated[here].mean()), count / n, *campaign.bounds(count, n), n))
    return found


def draw_confusion(counts: np.ndarray) -> Figure:
    """Counts, the darker the larger the share of their row."""
    figure = Figure(figsize=(10.0, 9.0), layout="constrained")
    axes = figure.add_subplot()
    shares = counts / np.maximum(1, counts.sum(axis=1, keepdims=True))
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (i, j), n in np.ndenumerate(counts):
        if n:
            axes.text(j, i, str(n), ha="center", va="center", color="white" if shares[i, j] > 0.5 else "black")
    axes.set_xticks(range(len(CALLED)), CALLED, rotation=60, ha="right")
    axes.set_yticks(range(len(TRUTHS)), TRUTHS)
    axes.axvline(len(campaign.LARGEST) - 0.5, color="0.6", linewidth=0.8)
    axes.axhline(len(campaign.LARGEST) - 0.5, color="0.6", linewidth=0.8)
    axes.set_xlabel("named, or verdict")
    axes.set_ylabel("what the log has")
    axes.set_title("Logs with forces and one effect at most")
    return figure


def draw_reliability(found: list[tuple[float, float, float, float, int]]) -> Figure:
    figure = Figure(figsize=(6.0, 5.6), layout="constrained")
    axes = figure.add_subplot()
    stated, share, low, high, _ = np.array(found).T
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=0.8)
    axes.errorbar(stated, share, (share - low, high - share), fmt="o", capsize=3, color="#0072B2")
    for x, y, _, _, n in found:
        # those near 0 stand close together
        right, below = x < 0.8, x < campaign.LEVELS[1]
        at = (8 if right else -8, -16 if below else -4)
        axes.annotate(str(n), (x, y), at, textcoords="offset points", ha="left" if right else "right")
    axes.grid(visible=True, color="0.9", linewidth=0.6)
    axes.set_aspect("equal")
    axes.set_xlabel("reported probability")
    axes.set_ylabel("share that act")
    axes.set_title("Effects of all logs but squares: 95 % intervals, numbers")
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", type=Path, help="CSV that campaign.py wrote")
    parser.add_argument("-o", "--output", type=Path, default=Path(), help="folder for confusion.png and reliability.png")
    options = parser.parse_args()
    if not options.rows.is_file():
        parser.error(f"{options.rows}: expected a CSV that campaign.py wrote")
    rows = campaign.read_rows(options.rows)
    if not campaign.probabilities(rows)[0].size:
        parser.error(f"{options.rows}: expected logs with probabilities, there are none")
    options.output.mkdir(parents=True, exist_ok=True)
    save_figure(draw_confusion(confusion(rows)), options.output / "confusion.png")
    save_figure(draw_reliability(reliability(rows)), options.output / "reliability.png")
    print(f"{options.output / 'confusion.png'}\n{options.output / 'reliability.png'}")


if __name__ == "__main__":
    main()
