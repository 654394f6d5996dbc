"""One table of the benchmarks: ours, a peer in the same run, their ratio, the goal, and the commit before.

    python -m tests.benchmarks.table results/bench.json    # what ``make bench`` shows at the end

A line is a benchmark of ours and, where there is one, that of a peer. The times are the least of all rounds, for one
unit of work (an epoch, a sample). The commit before is the newest other one in `tests.benchmarks.history` that was
measured on the same processor. A goal is a time, or a ratio to the peer.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.benchmarks.history import FILE, benchmark_name, lines, present_edition

__all__ = ["COMPARISONS", "Comparison", "Time", "least_times", "table"]


@dataclass(frozen=True)
class Time:
    """A benchmark, and how many units of work a round of it has."""

    benchmark: str
    units: float = 1.0

    def least(self, times: Mapping[str, float]) -> float | None:
        """The least time for a unit of work [s], if it was measured."""
        seconds = times.get(self.benchmark)
        return None if seconds is None else seconds / self.units


@dataclass(frozen=True)
class Comparison:
    """A line of the table.

    Attributes
    ----------
    what : str
        What is timed.
    ours : Time
        The benchmark of simnav.
    peer : Time or None
        What it is compared with, in the same run.
    peer_name : str
        Its name.
    goal : float or None
        The largest time [s].
    ratio : float or None
        The largest ratio to the peer.
    """

    what: str
    ours: Time
    peer: Time | None = None
    peer_name: str = ""
    goal: float | None = None
    ratio: float | None = None


def _window(name: str) -> Time:
    return Time(f"test_bench_window.py::test_an_epoch[{name}]")


def _satellites(name: str) -> Time:
    return Time(f"test_bench_satellites.py::test_an_epoch_with_twenty_satellites[{name}]", 60.0)


def _second(name: str) -> Time:
    return Time(f"test_bench_sigma_point.py::{name}")


def _two_minutes(name: str) -> Time:
    return Time(f"test_bench_adaptations.py::test_two_minutes_at_sea[{name}]", 120.0)


def _simulation(name: str, units: float = 120_000.0) -> Time:
    return Time(f"test_bench_simulation.py::{name}", units)


COMPARISONS: tuple[Comparison, ...] = (
    Comparison(
        "an IMU sample simulated", _simulation("test_simulate_own_truth"),
        _simulation("test_simulate_python_ins", 6000.0), "python-ins", goal=200e-9,
    ),
    Comparison(
        "an IMU sample integrated", _simulation("test_integrate"), _simulation("test_integrate_python_ins"),
        "python-ins",
    ),
    Comparison("6000 s with all instruments", _simulation("test_simulate_6000_s_with_all_instruments", 1.0)),
    Comparison("an epoch of ekf", _second("test_a_second_at_15_states[ekf]")),
    Comparison("an epoch of iae", _two_minutes("iae"), _two_minutes("ekf"), "ekf", ratio=1.3),
    Comparison("an epoch of vb-akf", _two_minutes("vb-akf"), _two_minutes("ekf"), "ekf", ratio=1.3),
    Comparison("an epoch of imm", _two_minutes("imm"), _two_minutes("ekf"), "ekf", ratio=1.3),
    Comparison(
        "an epoch of ukf", _second("test_a_second_at_15_states[ukf]"),
        _second("test_a_second_of_filterpy_at_15_states"), "filterpy", ratio=0.05,
    ),
    Comparison(
        "an epoch of ship-ukf", _second("test_a_second_of_the_ship[ship-ukf]"),
        _second("test_a_second_of_the_ship[filterpy-ukf]"), "filterpy",
    ),
    Comparison(
        "an epoch of federated", _second("test_a_second_at_15_states[federated]"),
        _second("test_a_second_at_15_states[ekf]"), "ekf", ratio=3.0,
    ),
    Comparison("an epoch of sw-fgo", _window("sw-fgo"), _window("gtsam-fixed-lag"), "GTSAM", goal=140e-6, ratio=0.1),
    Comparison("an epoch of gnc-fgo", _window("gnc-fgo"), _window("sw-fgo"), "sw-fgo", ratio=1.25),
    Comparison("an epoch of huber-fgo", _window("huber-fgo"), _window("sw-fgo"), "sw-fgo", ratio=1.25),
    Comparison("20 satellites, ekf", _satellites("ekf"), goal=0.30e-3),
    Comparison("20 satellites, sw-fgo", _satellites("sw-fgo"), _satellites("gtsam"), "GTSAM", goal=1.5e-3),
    Comparison(
        "6000 s of ekf with its smoother", Time("test_bench_smoother.py::test_filter_and_smoother[ekf-rts]"),
        Time("test_bench_smoother.py::test_filter_and_smoother[ekf]"), "ekf",
    ),
)  # fmt: skip


def least_times(report: Mapping[str, Any]) -> dict[str, float]:
    """The least time of a round of each benchmark in a report of pytest-benchmark [s]."""
    return {benchmark_name(one): float(one["stats"]["min"]) for one in report["benchmarks"]}


def before(history: Sequence[Mapping[str, str]], commit: str, processor: str) -> tuple[str, dict[str, float]]:
    """The newest commit of a history that is another one and was measured on this processor, and its least times."""
    others = [line for line in history if line["commit"] != commit and line["processor"] == processor]
    if not others:
        return "", {}
    newest = others[-1]["commit"]
    return newest, {line["benchmark"]: float(line["least_s"]) for line in others if line["commit"] == newest}


def _shown(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def _row(one: Comparison, now: Mapping[str, float], earlier: Mapping[str, float]) -> tuple[str, ...]:
    ours, peer = one.ours.least(now), one.peer.least(now) if one.peer else None
    ratio = ours / peer if ours is not None and peer else None
    goals, kept = [], []
    if one.goal is not None:
        goals.append(_shown(one.goal))
        kept += [] if ours is None else [ours <= one.goal]
    if one.ratio is not None:
        goals.append(f"{one.ratio:g} times")
        kept += [] if ratio is None else [ratio <= one.ratio]
    return (
        one.what,
        _shown(ours),
        f"{one.peer_name} {_shown(peer)}" if one.peer else "-",
        f"{ratio:.3g}" if ratio is not None else "-",
        " and ".join(goals) or "-",
        "-" if not kept else "yes" if all(kept) else "NO",
        _shown(one.ours.least(earlier)),
    )


def table(report: Mapping[str, Any], history: Sequence[Mapping[str, str]]) -> str:
    """The table of a report of pytest-benchmark as text.

    Parameters
    ----------
    report : mapping
        What ``--benchmark-json`` writes.
    history : sequence of mappings
        The lines of `tests.benchmarks.history`.

    Raises
    ------
    ValueError
        If the report has no benchmarks; one sentence.
    """
    own = lines(report, present_edition())[0]
    commit, earlier = before(history, own["commit"], own["processor"])
    now = least_times(report)
    rows = [("what", "ours", "peer", "ratio", "goal", "met", f"before ({commit[:8] or 'none'})")]
    rows += [_row(one, now, earlier) for one in COMPARISONS]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)


def main() -> int:
    """The command of the module; 2 where a report cannot be read."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=Path, help="what 'make bench' writes: results/bench.json")
    given = parser.parse_args()
    try:
        with FILE.open(newline="") as file:
            print(table(json.loads(given.report.read_bytes()), list(csv.DictReader(file))))
    except (OSError, ValueError) as error:
        print(f"{given.report}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
