"""The table of the benchmarks, and the figure of their history."""

from __future__ import annotations

import csv
from typing import Any

import pytest

from tests.benchmarks.history import FILE
from tests.benchmarks.history_figure import ratios
from tests.benchmarks.table import COMPARISONS, table

OURS = "test_bench_sigma_point.py::test_a_second_at_15_states[ukf]"
PEER = "test_bench_sigma_point.py::test_a_second_of_filterpy_at_15_states"


def report(ours: float, peer: float | None) -> dict[str, Any]:
    times = {OURS: ours} | ({} if peer is None else {PEER: peer})
    return {
        "datetime": "2026-11-27T21:00:00+00:00",
        "commit_info": {"id": "0123456789abcdef", "dirty": False},
        "machine_info": {"cpu": {"brand_raw": "A processor"}},
        "benchmarks": [
            {"fullname": f"tests/benchmarks/{name}", "stats": {"median": t, "min": t, "rounds": 3}}
            for name, t in times.items()
        ],
    }


def history(*lines: tuple[str, str, str]) -> list[dict[str, str]]:
    return [{"commit": c, "processor": p, "benchmark": OURS, "least_s": s, "edition": "15"} for c, p, s in lines]


def line_of(text: str) -> list[str]:
    (line,) = [line for line in text.splitlines() if line.startswith("an epoch of ukf ")]
    return [cell for cell in line.split("  ") if cell.strip()]


def test_a_line_shows_ours_the_peer_their_ratio_the_goal_and_the_commit_before():
    kept = history(("aaaa", "A processor", "2e-4"), ("bbbb", "A processor", "3e-4"), ("cccc", "Another", "9e-4"))
    text = table(report(1.5e-4, 1.5e-2), kept)
    assert [c.strip() for c in line_of(text)] == [
        "an epoch of ukf", "150 us", "filterpy 15 ms", "0.01", "0.05 times", "yes", "300 us",
    ]  # fmt: skip
    assert "before (bbbb)" in text.splitlines()[0]
    assert "NO" in line_of(table(report(1.5e-3, 1.5e-2), kept))[-2]


def test_the_commit_itself_is_not_the_one_before_and_what_was_not_measured_is_a_dash():
    text = table(report(1.5e-4, None), history(("0123456789ab", "A processor", "2e-4")))
    assert "before (none)" in text.splitlines()[0]
    assert [c.strip() for c in line_of(text)][1:] == ["150 us", "filterpy -", "-", "0.05 times", "-", "-"]


def test_a_report_without_benchmarks_is_refused():
    with pytest.raises(ValueError, match="no benchmarks"):
        table({**report(1.0, 1.0), "benchmarks": []}, [])


def test_all_that_is_compared_is_in_the_history_and_can_be_drawn():
    with FILE.open(newline="") as file:
        kept = list(csv.DictReader(file))
    newest = list(ratios(kept).values())[-1]
    assert set(newest) == {one for one in COMPARISONS if one.peer is not None}
    assert all(0.0 < ratio < 20.0 for ratio in newest.values())
