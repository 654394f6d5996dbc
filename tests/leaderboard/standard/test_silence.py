"""The audit of lost runs that say nothing: which runs are lost, and what counts as a warning."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.audit.__main__ import sections
from tests.audit.silence import lost_runs
from tests.leaderboard.ranking.test_ranking import campaign

SILENT = {"nees_horizontal": 400.0, "protection_exceeded": 0.9}


def lost(**fields):
    """The runs of a row that has a hundred times the error of the plain row."""
    scores = SILENT | fields.pop("scores", {})
    results = [
        replace(r, scores=r.scores | scores, **fields) if r.estimator == "far" else r
        for r in campaign({"one-v1": {"ekf": 1.0, "far": 100.0, "near": 5.0, "oracle": 60.0}}, seeds=4)
    ]
    return lost_runs(results)


def test_a_lost_run_that_says_nothing_is_found():
    found = lost()
    assert found.keys() == {"ekf", "far", "near"}  # references are not judged
    assert not found["near"]
    assert not found["ekf"]
    assert [one.admitted for one in found["far"]] == [False] * 4
    assert min(one.ratio for one in found["far"]) > 50.0


@pytest.mark.parametrize(
    "fields",
    [
        {"status": "diverged"},
        {"status": "inconsistent"},
        {"scores": {"nees_horizontal": 9.0}},
        {"scores": {"protection_exceeded": 0.01}},
    ],
)
def test_status_sigma_and_protection_level_are_warnings(fields):
    assert all(one.admitted for one in lost(**fields)["far"])


def test_without_a_protection_level_there_is_no_warning_of_it():
    assert not any(one.admitted for one in lost(scores={"protection_exceeded": float("nan")})["far"])


def test_the_audit_has_the_section():
    assert "silence" in sections()
