"""The share of runs that one row wins against another."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.wins import wins
from tests.leaderboard.ranking.test_ranking import campaign


def test_a_row_that_is_always_better_wins_all_and_equal_rows_half():
    results = campaign({"one-v1": {"ekf": 4.0, "good": 0.01}})
    same = [replace(r, estimator="same", key=f"{r.key}-same") for r in results if r.estimator == "ekf"]
    ranking = rank([*results, *same])
    share = wins(["ekf", "good", "same"], ranking.scenarios)
    np.testing.assert_array_equal(share, [[math.nan, 0.0, 0.5], [1.0, math.nan, 1.0], [0.5, 0.0, math.nan]])


def test_scenarios_count_the_same_and_only_runs_in_common_count():
    errors = {"one-v1": {"ekf": 4.0, "a": 2.0}, "two-v1": {"ekf": 1.0, "a": 2.0, "b": 0.5}}
    results = campaign(errors)
    # Of the first scenario many more runs are there, and row b has one run of the second only.
    few = [r for r in results if r.scenario == "one-v1" or r.seed < 4]
    few = [r for r in few if r.estimator != "b" or r.seed == 1]
    share = wins(["a", "b", "ekf"], rank(few).scenarios)
    assert share[0, 2] == 0.5
    assert share[1, 0] == share[1, 2] == 1.0
    found = share + share.T
    np.testing.assert_allclose(found[~np.eye(3, dtype=bool)], 1.0)


def test_rows_without_a_common_run_have_none():
    results = campaign({"one-v1": {"ekf": 4.0, "a": 2.0}, "two-v1": {"ekf": 1.0, "b": 0.5}})
    share = wins(["a", "b"], rank(results).scenarios)
    assert np.isnan(share).all()
