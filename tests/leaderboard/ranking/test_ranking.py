"""Ranking: ratios to the oracle, failures, coverage, and what must not matter."""

from __future__ import annotations

import json
import math
import random
from typing import Any

import numpy as np
import pytest

from simnav.leaderboard.ranking.ranking import WORST, Ranking, ScenarioRow, rank
from simnav.leaderboard.ranking.ranking_table import score_caption
from simnav.leaderboard.results.result import Result


def result(scenario: str, estimator: str, seed: int, rmse: float, **fields: Any) -> Result:
    scores = {"horizontal_rmse": rmse, "availability": 1.0, "nees_horizontal": 1.0, "update_median": 1e-4}
    scores |= fields.pop("scores", {})
    given = {"parameters": {}, "reference": estimator == "oracle", "status": "ok", "reason": "", "peak_memory": 10}
    return Result(scenario=scenario, seed=seed, estimator=estimator, scores=scores, **(given | fields))


def campaign(factors: dict[str, dict[str, float]], seeds: int = 12) -> list[Result]:
    """Results with ratios to the oracle spread by 5 % around ``factors[scenario][estimator]``."""
    results = []
    for scenario, by in factors.items():
        rng = np.random.default_rng(len(scenario))
        truth = rng.lognormal(0.0, 1.0, seeds)
        for estimator, factor in sorted(by.items()):
            spread = np.ones(seeds) if estimator == "oracle" else np.exp(rng.normal(0.0, 0.05, seeds))
            results += [result(scenario, estimator, k, truth[k] * factor * spread[k]) for k in range(seeds)]
    return results


SIMPLE = {
    "one-v1": {"oracle": 1.0, "good": 1.2, "fair": 2.0, "poor": 30.0},
    "two-v1": {"oracle": 1.0, "good": 1.1, "fair": 1.5, "poor": 10.0},
}


def row(ranking: Ranking, estimator: str, scenario: str | None = None) -> Any:
    rows: Any = ranking.rows
    if scenario is not None:
        (rows,) = (s.rows for s in ranking.scenarios if s.scenario == scenario)
    (found,) = (r for r in rows if r.estimator == estimator)
    return found


def without(results: list[Result], *cells: tuple[str, str]) -> list[Result]:
    return [r for r in results if (r.scenario, r.estimator) not in cells]


def replaced(results: list[Result], estimator: str, seeds: Any, **fields: Any) -> list[Result]:
    return [
        result(r.scenario, r.estimator, r.seed, fields.get("rmse", r.scores["horizontal_rmse"]),
               **{k: v for k, v in fields.items() if k != "rmse"})
        if r.estimator == estimator and r.seed in seeds else r
        for r in results
    ]  # fmt: skip


def test_scores_are_ratios_to_the_oracle_on_the_same_run() -> None:
    ranking = rank(campaign(SIMPLE))
    assert [s.scenario for s in ranking.scenarios] == ["one-v1", "two-v1"]
    for scenario, by in SIMPLE.items():
        for estimator, factor in by.items():
            r = row(ranking, estimator, scenario)
            assert r.score == pytest.approx(factor, rel=0.04), (scenario, estimator)
            assert r.low <= r.score <= r.high
            assert r.high / r.low < 1.15  # the spread of the runs themselves, a factor of 20, has gone
            assert (r.runs, r.failed, r.statuses) == (12, 0, {"ok": 12})
    assert ranking.scenarios[0].baseline == "oracle, on the same run"
    assert row(ranking, "good").score == pytest.approx(math.sqrt(1.2 * 1.1), rel=0.03)
    assert [r.rank for r in ranking.rows] == [1, 2, 3, None]
    assert [r.estimator for r in ranking.rows] == ["good", "fair", "poor", "oracle"]
    assert [r.tier for r in ranking.rows] == [1, 2, 3, None]
    assert row(ranking, "oracle").reference
    assert row(ranking, "oracle").score == pytest.approx(1.0)


def test_the_score_is_the_interquartile_mean_of_the_log_ratios() -> None:
    ratios = [1.0, 2.0, 4.0, 1000.0]
    results = [result("one-v1", "oracle", k, 3.0) for k in range(4)]
    results += [result("one-v1", "a", k, 3.0 * f) for k, f in enumerate(ratios)]
    assert row(rank(results), "a", "one-v1").score == pytest.approx(math.sqrt(2.0 * 4.0))


def test_the_order_of_the_results_does_not_matter() -> None:
    results = campaign(SIMPLE)
    results = replaced(results, "fair", range(2), status="timeout")
    expected = rank(results, resamples=200).to_dict()
    for seed in range(3):
        random.Random(seed).shuffle(results)
        assert rank(results, resamples=200).to_dict() == expected


def test_units_and_hardness_of_a_scenario_do_not_matter() -> None:
    results = campaign(SIMPLE)
    scaled = [
        result(
            r.scenario, r.estimator, r.seed, r.scores["horizontal_rmse"] * (1000.0 if r.scenario == "two-v1" else 1.0)
        )
        for r in results
    ]
    for a, b in zip(rank(results, resamples=100).rows, rank(scaled, resamples=100).rows, strict=True):
        assert (a.estimator, a.rank, a.tier) == (b.estimator, b.rank, b.tier)
        assert a.score == pytest.approx(b.score)


def test_failures_count_and_are_never_dropped() -> None:
    clean = row(rank(campaign(SIMPLE)), "good", "one-v1").score
    scores = []
    for failures in (1, 3, 6, 12):
        results = replaced(campaign(SIMPLE), "good", range(failures), status="error", scores={"horizontal_rmse": 1e-9})
        r = row(rank(results), "good", "one-v1")
        assert (r.runs, r.failed, r.statuses.get("error")) == (12, failures, failures)
        scores.append(r.score)
    assert clean < scores[0] < scores[1] < scores[2] < scores[3]
    assert scores[3] == pytest.approx(WORST)


def test_an_estimator_that_fails_everywhere_is_last_and_finite() -> None:
    results = replaced(campaign(SIMPLE), "good", range(12), status="timeout", rmse=math.nan)
    ranking = rank(results)
    assert [r.estimator for r in ranking.rows] == ["fair", "poor", "good", "oracle"]
    last = row(ranking, "good")
    assert (last.score, last.low, last.high) == pytest.approx((WORST, WORST, WORST))
    assert math.isnan(row(ranking, "good", "one-v1").median)


def test_half_a_track_is_a_failure() -> None:
    results = replaced(campaign(SIMPLE), "good", range(12), rmse=1e-3, scores={"availability": 0.5})
    r = row(rank(results), "good", "one-v1")
    assert r.statuses == {"incomplete": 12}
    assert r.score == pytest.approx(WORST)


def test_no_completed_run_counts_for_more_than_a_failure() -> None:
    results = replaced(campaign(SIMPLE), "poor", range(12), rmse=1e30)
    assert row(rank(results), "poor", "one-v1").score == pytest.approx(WORST)
    results = replaced(campaign(SIMPLE), "good", range(12), rmse=0.0)
    assert row(rank(results), "good", "one-v1").score == pytest.approx(1.0 / WORST)


def test_without_an_oracle_the_best_estimator_is_the_measure_and_it_is_said() -> None:
    results = without(campaign(SIMPLE), ("one-v1", "oracle"))
    ranking = rank(results)
    assert ranking.scenarios[0].baseline == "median of good, the best here: no oracle ran"
    assert ranking.scenarios[1].baseline == "oracle, on the same run"
    assert "Where no oracle ran (one-v1), 1 is the best estimator's median." in score_caption(ranking)
    assert "no oracle" not in score_caption(rank(campaign(SIMPLE)))
    r = row(ranking, "fair", "one-v1")
    assert r.score / row(ranking, "good", "one-v1").score == pytest.approx(2.0 / 1.2, rel=0.3)
    assert r.tier == 2


def test_where_the_oracle_failed_a_run_its_median_stands_in() -> None:
    results = [result("one-v1", "oracle", k, 2.0) for k in range(3)]
    results += [result("one-v1", "oracle", 3, math.nan, status="error")]
    results += [result("one-v1", "a", k, 6.0) for k in range(4)]
    ranking = rank(results)
    assert row(ranking, "a", "one-v1").score == pytest.approx(3.0)
    assert row(ranking, "oracle", "one-v1").failed == 1


def test_another_reference_is_no_oracle_unless_its_label_says_so() -> None:
    results = campaign({"one-v1": {"a": 2.0, "bound": 0.9, "ship-oracle": 1.0}}, seeds=6)
    results = [result(r.scenario, r.estimator, r.seed, r.scores["horizontal_rmse"], reference=r.estimator != "a")
               for r in results]  # fmt: skip
    ranking = rank(results)
    assert ranking.scenarios[0].baseline == "ship-oracle, on the same run"
    assert [(r.estimator, r.rank) for r in ranking.scenarios[0].rows] == [
        ("a", 1),
        ("bound", None),
        ("ship-oracle", None),
    ]


def test_unsuitable_is_no_failure_and_leaves_the_coverage_smaller() -> None:
    results = without(campaign(SIMPLE), ("two-v1", "poor"))
    results += [result("two-v1", "poor", k, math.nan, status="unsuitable", reason="needs a DVL") for k in range(12)]
    ranking = rank(results)
    assert ranking.scenarios[1].unsuitable == {"poor": "needs a DVL"}
    assert "poor" not in [r.estimator for r in ranking.scenarios[1].rows]
    r = row(ranking, "poor")
    assert (r.covered, r.scenarios, r.runs, r.failed) == (1, 2, 12, 0)
    assert list(r.ratios) == ["one-v1"]


def test_a_run_that_nobody_could_start_is_nobodys_failure() -> None:
    results = [*campaign(SIMPLE), *(result("one-v1", n, 99, math.nan, status="no-recording") for n in SIMPLE["one-v1"])]
    assert row(rank(results), "good", "one-v1").runs == 12


def test_an_estimator_without_positions_has_no_score() -> None:
    results = [*campaign(SIMPLE), *(result("one-v1", "heading-only", k, math.nan, scores={"availability": 0.0})
                                    for k in range(12))]  # fmt: skip
    assert rank(results).scenarios[0].unsuitable == {"heading-only": "has no horizontal_rmse"}


HARD_AND_EASY = {
    "easy-v1": {"oracle": 1.0, "allround": 1.5, "other": 2.0, "picky": 1.8},
    "hard-v1": {"oracle": 1.0, "allround": 40.0, "other": 60.0},
    "harder-v1": {"oracle": 1.0, "allround": 200.0, "other": 300.0, "picky": 240.0},
}


def test_leaving_out_the_hard_scenario_is_no_advantage() -> None:
    ranking = rank(campaign(HARD_AND_EASY))
    # Its plain mean over what it covers, sqrt(1.8 * 240) = 21, beats that of allround, 23; yet it is worse throughout.
    picky, allround = row(ranking, "picky"), row(ranking, "allround")
    assert math.sqrt(1.8 * 240.0) < (1.5 * 40.0 * 200.0) ** (1 / 3) < picky.score
    assert picky.score == pytest.approx(1.2 * allround.score, rel=0.05)
    assert allround.score == pytest.approx((1.5 * 40.0 * 200.0) ** (1 / 3), rel=0.04)  # full coverage: the plain mean
    assert [r.estimator for r in ranking.rows] == ["allround", "picky", "other", "oracle"]
    assert (picky.covered, picky.scenarios) == (2, 3)


def test_who_covers_too_little_is_listed_and_not_ranked() -> None:
    results = without(campaign(HARD_AND_EASY), ("harder-v1", "picky"))
    ranking = rank(results)
    picky = row(ranking, "picky")
    assert (picky.rank, picky.tier, picky.covered) == (None, None, 1)
    assert math.isfinite(picky.score)
    assert [r.estimator for r in ranking.rows] == ["allround", "other", "picky", "oracle"]
    assert row(ranking, "picky", "easy-v1").rank == 2


def test_estimators_without_a_common_scenario_are_not_adjusted_to_each_other() -> None:
    ranking = rank(campaign({"sea-v1": {"oracle": 1.0, "ship": 2.0}, "dive-v1": {"oracle": 1.0, "uuv": 3.0}}))
    assert row(ranking, "ship").score == pytest.approx(2.0, rel=0.04)
    assert row(ranking, "uuv").score == pytest.approx(3.0, rel=0.04)
    assert row(ranking, "uuv").p_value == 1.0  # nothing to compare


def test_intervals_narrow_with_runs_and_one_run_has_none() -> None:
    wide, narrow = (row(rank(campaign(SIMPLE, seeds=n)), "good") for n in (5, 80))
    assert math.log(narrow.high / narrow.low) < 0.5 * math.log(wide.high / wide.low)
    single = row(rank(campaign(SIMPLE, seeds=1)), "good")
    assert math.isnan(single.low)
    assert math.isfinite(single.score)


def test_runs_of_several_logs_are_told_apart_by_their_note_and_duplicates_refused() -> None:
    results = [result("log-v1", "a", 0, 1.0, note="dive 1"), result("log-v1", "a", 0, 2.0, note="dive 2")]
    assert row(rank(results), "a", "log-v1").runs == 2
    with pytest.raises(ValueError, match=r"two results of 'a' on log-v1 for seed 0"):
        rank([*results, results[0]])


def test_badge_cost_and_memory() -> None:
    results = replaced(campaign(SIMPLE), "fair", range(12), scores={"nees_horizontal": 9.0, "update_median": 2e-3},
                       peak_memory=77)  # fmt: skip
    results = replaced(results, "poor", range(12), scores={"nees_horizontal": math.nan})
    ranking = rank(results)
    r: ScenarioRow = row(ranking, "fair", "one-v1")
    assert (r.badge, r.nees, r.update_median, r.peak_memory) == ("optimistic", 9.0, 2e-3, 77)
    assert row(ranking, "good").badge == "consistent"
    assert row(ranking, "poor").badge == "unknown"
    assert row(ranking, "fair").update_median == 2e-3


def test_another_score_can_be_ranked() -> None:
    results = [result("one-v1", n, k, 1.0, scores={"smoothed_horizontal_rmse": s})
               for n, s in (("oracle", 1.0), ("smoother", 2.0), ("filter", math.nan)) for k in range(4)]  # fmt: skip
    ranking = rank(results, score="smoothed_horizontal_rmse")
    assert ranking.score == "smoothed_horizontal_rmse"
    assert row(ranking, "smoother", "one-v1").score == pytest.approx(2.0)
    assert ranking.scenarios[0].unsuitable == {"filter": "has no smoothed_horizontal_rmse"}


def test_to_dict_is_json() -> None:
    results = replaced(
        campaign(SIMPLE, seeds=1), "poor", [0], status="error", rmse=math.nan, scores={"nees_horizontal": math.nan}
    )
    text = json.dumps(rank(results).to_dict(), allow_nan=False)
    assert json.loads(text)["rows"][0]["estimator"] == "good"
    assert rank([]).to_dict() == {"score": "horizontal_rmse", "rows": [], "scenarios": []}
