"""The history of the benchmarks as a figure: the ratio of each time to that of its peer, edition by edition.

``python -m tests.benchmarks.history_figure`` draws ``docs/figures/benchmarks.png`` from `tests.benchmarks.history`.
Ratios of two benchmarks of one run compare across machines; times do not, so they are not drawn.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.benchmarks.history import FILE
from tests.benchmarks.table import COMPARISONS, Comparison

__all__ = ["draw", "ratios"]

FIGURE = Path(__file__).parents[2] / "docs" / "figures" / "benchmarks.png"


def ratios(history: Sequence[Mapping[str, str]]) -> dict[str, dict[Comparison, float]]:
    """By edition and commit, the ratio of each comparison whose two times were measured there."""
    times: dict[str, dict[str, float]] = {}
    for line in history:
        label = f"edition {line['edition']} ({line['commit'][:7]}, {line['date']})"
        times.setdefault(label, {})[line["benchmark"]] = float(line["least_s"])
    found: dict[str, dict[Comparison, float]] = {label: {} for label in times}
    for label, measured in times.items():
        for one in COMPARISONS:
            ours, peer = one.ours.least(measured), one.peer.least(measured) if one.peer else None
            if ours is not None and peer is not None:
                found[label][one] = ours / peer
    return found


def draw(history: Sequence[Mapping[str, str]], path: Path = FIGURE) -> None:
    """A line for each comparison, a dot for each edition, and a tick for the goal."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    found = ratios(history)
    compared = [one for one in COMPARISONS if one.peer is not None][::-1]
    fig, ax = plt.subplots(figsize=(8.0, 0.34 * len(compared) + 1.4), layout="constrained")
    for k, (label, by_comparison) in enumerate(found.items()):
        shade = 0.25 + 0.75 * (k + 1) / len(found)
        known = [(by_comparison[one], i) for i, one in enumerate(compared) if one in by_comparison]
        ax.scatter([x for x, _ in known], [y for _, y in known], color="#0072b2", alpha=shade, label=label, zorder=3)
    goals = [(one.ratio, i) for i, one in enumerate(compared) if one.ratio is not None]
    ax.scatter([x for x, _ in goals], [y for _, y in goals], marker="|", s=150, color="#d55e00", label="goal: at most")
    ax.axvline(1.0, color="grey", lw=0.8)
    ax.set_xscale("log")
    ax.set_yticks(range(len(compared)), [f"{one.what} / {one.peer_name}" for one in compared])
    ax.set_xlabel("Time, relative to that of the peer in the same run")
    ax.grid(axis="x", alpha=0.3)
    ax.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    fig.savefig(path, dpi=120)
    plt.close(fig)


if __name__ == "__main__":
    with FILE.open(newline="") as file:
        draw(list(csv.DictReader(file)))
