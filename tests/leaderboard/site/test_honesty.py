"""The chart of accuracy against honesty: its points are those of the ranking, and references are open points."""

from __future__ import annotations

from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.site.honesty import honesty
from simnav.leaderboard.site.overview import _front
from tests.leaderboard.ranking.test_ranking import campaign, changed

ERRORS = {"one-v1": {"oracle": 1.0, "ekf": 4.0, "bold": 1.5, "honest": 2.0, "both-worse": 3.0}}


def covered(results, by):
    for row, coverage in by.items():
        results = changed(results, row, range(99), scores={"coverage_95_faulty": coverage})
    return results


def test_the_front_holds_who_is_not_beaten_in_both():
    coverage = {"oracle": 0.95, "ekf": 0.6, "bold": 0.5, "honest": 0.93, "both-worse": 0.7}
    (track,) = rank(covered(campaign(ERRORS), coverage)).tracks
    chart = honesty(track, "x", 10.0, _front)
    points = {name: k for k, name in enumerate(chart.data["rows"]["row"])}
    rows = chart.data["rows"]
    assert points.keys() == coverage.keys()
    assert {name: rows["covered"][k] for name, k in points.items()} == {n: 100.0 * c for n, c in coverage.items()}
    assert {name for name, k in points.items() if rows["front"][k]} == {"oracle", "bold", "honest"}
    assert [name for name, k in points.items() if rows["reference"][k]] == ["oracle"]


def test_rows_far_off_and_rows_without_a_covariance_are_left_out():
    results = covered(campaign(ERRORS), {"ekf": float("nan"), "bold": 0.5, "honest": 0.93})
    (track,) = rank(results).tracks
    assert "ekf" not in honesty(track, "x", 10.0, _front).data["rows"]["row"]
    assert honesty(track, "x", 1.6, _front) is None
