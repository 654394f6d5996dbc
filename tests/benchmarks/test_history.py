"""The history of the benchmarks: what is kept of a run, and for how long."""

from __future__ import annotations

import csv
from typing import Any

import pytest

from tests.benchmarks.history import COLUMNS, FILE, lines, present_edition, updated

REPORT: dict[str, Any] = {
    "datetime": "2026-11-26T21:00:00+00:00",
    "commit_info": {"id": "0123456789abcdef", "dirty": True},
    "machine_info": {"cpu": {"brand_raw": "A processor"}},
    "benchmarks": [
        {"fullname": "tests/test_bench_x.py::test_b", "stats": {"median": 0.25, "min": 0.2, "rounds": 5}},
        {
            "fullname": "tests/test_bench_x.py::test_a",
            "stats": {"median": 1.23456e-5, "min": 1e-5, "rounds": 9},
        },
    ],
}


def test_a_line_says_what_was_measured_where_and_of_what():
    first, second = lines(REPORT, 15)
    assert tuple(first) == COLUMNS
    assert first["benchmark"] == "test_bench_x.py::test_a"
    assert (first["edition"], first["commit"], first["median_s"]) == ("15", "0123456789ab+", "1.235e-05")
    assert (second["benchmark"], second["least_s"], second["rounds"]) == ("test_bench_x.py::test_b", "0.2", "5")


def test_lines_of_an_edition_are_replaced_and_others_stay():
    old = lines(REPORT, 14) + lines(REPORT, 15)
    new = lines({**REPORT, "benchmarks": REPORT["benchmarks"][:1]}, 15)
    assert [(line["edition"], line["benchmark"]) for line in updated(old, new)] == [
        ("14", "test_bench_x.py::test_a"), ("14", "test_bench_x.py::test_b"), ("15", "test_bench_x.py::test_b"),
    ]  # fmt: skip


def test_a_report_without_benchmarks_is_refused():
    with pytest.raises(ValueError, match="no benchmarks"):
        lines({**REPORT, "benchmarks": []}, 15)


def test_the_history_that_is_kept_can_be_read_and_is_of_known_editions():
    with FILE.open(newline="") as file:
        kept = list(csv.DictReader(file))
    assert kept
    assert {int(line["edition"]) for line in kept} <= set(range(1, present_edition() + 1))
    assert all(float(line["least_s"]) <= float(line["median_s"]) for line in kept)
