"""Boards in stages: excluded rows stay excluded, levels are divided, and the plan of the next runs follows."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.leaderboard.ranking.next_runs import NextRuns, core_minutes, next_runs
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.statistics import STAGES, separate_in_stages
from simnav.leaderboard.results.result import Result

ROWS = ("ekf", "gated-ekf", "huber-kf", "vb-akf", "iae", "imm")
SCENARIO = "gnss-spoofing-v1"


def board(seeds: int, offsets: list[float], scatter: float = 0.1) -> np.ndarray:
    noise = np.random.default_rng(11).standard_normal((seeds, len(offsets)))
    return scatter * noise + np.array(offsets)


def results(seeds: dict[str, int], offsets: dict[str, float], scatter: float = 0.3) -> list[Result]:
    found = []
    for k, (row, count) in enumerate(seeds.items()):
        for seed in range(count):
            value = float(np.exp(offsets[row] + scatter * np.random.default_rng([seed, k]).standard_normal()))
            found.append(Result(SCENARIO, seed, row, {}, row == "oracle", "ok", "", {"horizontal_rmse": value},
                                seconds=6.0))  # fmt: skip
    return found


def test_the_levels_add_up_to_five_per_cent():
    assert sum(stage.level for stage in STAGES) == pytest.approx(0.05)
    assert [stage.seeds for stage in STAGES] == [30, 100, 300]


def test_an_excluded_row_stays_excluded_and_the_rest_is_told_apart_by_more_seeds():
    x = board(300, [0.0, 0.1, 1.0], 0.25)
    x[30:, 2] = -9.0  # whatever it does later
    found = separate_in_stages(x, ["one"] * 300, range(300))
    assert found.separation.may_be_best.tolist() == [True, False, False]
    assert found.separation.better[0].tolist() == [False, True, True]
    assert found.wanted == 0
    first = separate_in_stages(x[:30], ["one"] * 30, range(30))
    assert first.separation.may_be_best.tolist() == [True, True, False]
    assert first.wanted == 100


def test_a_stage_counts_only_if_all_rows_that_are_left_have_it_whole():
    x = board(100, [0.0, 0.1, 1.0], 0.25)
    x[99, 1] = np.nan
    found = separate_in_stages(x, ["one"] * 100, range(100))
    assert found.separation.may_be_best.tolist() == [True, True, False]
    assert found.wanted == 100


def test_rows_that_are_alike_get_no_more_seeds():
    found = separate_in_stages(board(30, [0.0, 0.001, 0.002], 0.01), ["one"] * 30, range(30))
    assert found.separation.may_be_best.all()
    assert found.wanted == 0


def test_the_plan_names_the_rows_that_may_be_the_best_the_plain_row_and_the_oracle():
    offsets = dict(zip((*ROWS, "oracle"), (3.0, 0.5, 0.62, 2.0, 2.1, 2.2, 0.0), strict=True))
    thirty = results(dict.fromkeys(offsets, 30), offsets)
    (wanted,) = next_runs(thirty)
    assert wanted == NextRuns(SCENARIO, ("ekf", "gated-ekf", "huber-kf", "oracle"), 100)
    assert core_minutes([wanted], thirty) == pytest.approx(4 * 70 * 6.0 / 60.0)
    more = results({n: 100 if n in wanted.estimators else 30 for n in offsets}, offsets)
    (later,) = next_runs(more)
    assert later.seeds == 300
    assert next_runs(more, most=100) == []
    track = rank(more).track("aided-ins")
    assert {r.estimator: r.runs for r in track.rows if r.ranked} == {
        n: 100 if n in wanted.estimators else 30 for n in ROWS
    }
    assert [r.estimator for r in track.rows if r.may_be_best] == ["gated-ekf", "huber-kf"]
    assert track.rows[0].ranked
    assert not any("incomplete" in remark for remark in track.remarks)
    assert rank(more).track("aided-ins") == rank(more[::-1]).track("aided-ins")
