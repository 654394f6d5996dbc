"""The history of the benchmarks: the times that ``make bench`` measured, for each edition of the standard result.

``python -m tests.benchmarks.history results/bench.json`` puts them into `FILE`, in place of those that the present
edition has there. Times of other processors do not compare, so each line names its processor; ratios of two benchmarks
of one run do.
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

__all__ = ["COLUMNS", "FILE", "benchmark_name", "lines", "present_edition", "updated"]

FILE = Path(__file__).with_name("history.csv")
COLUMNS = ("edition", "date", "commit", "processor", "benchmark", "median_s", "least_s", "rounds")
_EDITIONS = Path(__file__).parents[2] / "leaderboard" / "standard" / "history.csv"


def present_edition(path: Path = _EDITIONS) -> int:
    """The newest edition of the standard result."""
    with path.open(newline="") as file:
        return max(int(line["edition"]) for line in csv.DictReader(file))


def benchmark_name(one: Mapping[str, Any]) -> str:
    """File and name of a benchmark of a report: several files have benchmarks of the same name."""
    return str(one["fullname"]).rpartition("/")[2]


def lines(report: Mapping[str, Any], edition: int) -> list[dict[str, str]]:
    """The lines of a report of pytest-benchmark, in the order of the names.

    Parameters
    ----------
    report : mapping
        What ``--benchmark-json`` writes.
    edition : int
        The edition that they belong to.

    Raises
    ------
    ValueError
        If the report has no benchmarks; one sentence.
    """
    if not report.get("benchmarks"):
        raise ValueError("the report has no benchmarks; 'make bench' writes one with them")
    commit = report.get("commit_info", {})
    shared = {
        "edition": str(edition),
        "date": str(report["datetime"])[:10],
        "commit": str(commit.get("id", ""))[:12] + ("+" if commit.get("dirty") else ""),
        "processor": str(report["machine_info"].get("cpu", {}).get("brand_raw", "")),
    }
    return [
        {
            **shared,
            "benchmark": benchmark_name(one),
            "median_s": f"{one['stats']['median']:.4g}",
            "least_s": f"{one['stats']['min']:.4g}",
            "rounds": str(one["stats"]["rounds"]),
        }
        for one in sorted(report["benchmarks"], key=benchmark_name)
    ]


def updated(kept: Sequence[Mapping[str, str]], new: Sequence[Mapping[str, str]]) -> list[Mapping[str, str]]:
    """The history with new lines in place of those of their edition."""
    editions = {line["edition"] for line in new}
    return sorted(
        [*(line for line in kept if line["edition"] not in editions), *new], key=lambda line: int(line["edition"])
    )


def main() -> int:
    """Put a report into the history; 2 where it cannot be read."""
    if len(sys.argv) != 2:
        print("usage: python -m tests.benchmarks.history results/bench.json", file=sys.stderr)
        return 2
    try:
        new = lines(json.loads(Path(sys.argv[1]).read_bytes()), present_edition())
    except (OSError, ValueError) as error:
        print(f"{sys.argv[1]}: {error}", file=sys.stderr)
        return 2
    kept: list[dict[str, str]] = []
    if FILE.exists():
        with FILE.open(newline="") as file:
            kept = list(csv.DictReader(file))
    with FILE.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(updated(kept, new))
    print(f"{FILE}: {len(new)} benchmarks of edition {new[0]['edition']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
