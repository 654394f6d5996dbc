"""Ranking: fixed figures, failures, tracks, what must not pay, and what must not matter."""

from __future__ import annotations

import io
import json
import math
import random
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simnav.estimator import describe
from simnav.leaderboard.ranking import failures, reference
from simnav.leaderboard.ranking.board import Ranking, Reference
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.ranking_table import track_table
from simnav.leaderboard.ranking.statistics import FAILURE
from simnav.leaderboard.ranking.tracks import SMOOTHED
from simnav.leaderboard.results.result import Result

TRACK = {"one-v1": "sea", "two-v1": "sea", "three-v1": "lake"}


def result(scenario: str, estimator: str, seed: int, rmse: float, **fields: Any) -> Result:
    scores = {"horizontal_rmse": rmse, "update_median": 1e-4}
    scores |= {f"{n}{p}": v for p in ("_clean", "_faulty") for n, v in (("nees_horizontal", 1.0), ("coverage_95", 0.9))}
    scores |= fields.pop("scores", {})
    given = {"parameters": {}, "reference": "oracle" in estimator, "status": "ok", "reason": "", "peak_memory": 10}
    return Result(scenario=scenario, seed=seed, estimator=estimator, scores=scores, **(given | fields))


def campaign(factors: dict[str, dict[str, float]], seeds: int = 20, spread: float = 0.05) -> list[Result]:
    """Results with errors spread by 5 % around ``factors[scenario][estimator]`` metres."""
    results = []
    for scenario, by in factors.items():
        rng = np.random.default_rng(len(scenario))
        for estimator, factor in sorted(by.items()):
            noise = np.exp(rng.normal(0.0, spread, seeds))
            results += [result(scenario, estimator, k, float(factor * noise[k])) for k in range(seeds)]
    return results


SIMPLE = {
    "one-v1": {"oracle": 1.0, "good": 1.2, "fair": 2.0, "ekf": 4.0, "poor": 30.0, "bad": 60.0},
    "two-v1": {"oracle": 2.0, "good": 2.2, "fair": 3.0, "ekf": 5.0, "poor": 20.0, "bad": 50.0},
}


def ranked(results: list[Result]) -> Ranking:
    return rank(results, tracks=TRACK)


def row(ranking: Ranking, estimator: str, scenario: str | None = None, track: str = "sea") -> Any:
    rows: Any = ranking.track(track).rows if scenario is None else ranking.scenario(scenario).rows
    (found,) = (r for r in rows if r.estimator == estimator)
    return found


def changed(results: list[Result], estimator: str, seeds: Any, scenario: str = "", **fields: Any) -> list[Result]:
    def new(r: Result) -> Result:
        if r.estimator != estimator or r.seed not in seeds or scenario not in ("", r.scenario):
            return r
        own = dict(fields)
        scores = r.scores | own.pop("scores", {})
        if "rmse" in own:
            scores["horizontal_rmse"] = own.pop("rmse")
        return replace(r, scores=scores, **own)

    return [new(r) for r in results]


@pytest.fixture(autouse=True)
def no_stored_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference, "stored", dict)


def test_scores_are_ratios_to_the_oracle_on_the_same_runs():
    ranking = ranked(campaign(SIMPLE))
    for scenario, by in SIMPLE.items():
        for estimator, factor in by.items():
            r = row(ranking, estimator, scenario)
            assert r.score == pytest.approx(factor / by["oracle"], rel=0.06), (scenario, estimator)
            assert r.low <= r.score <= r.high
            assert r.p95 <= r.worst == pytest.approx(max(r.ratios.values()))
            assert (r.runs, r.failed, r.statuses) == (20, 0, {"ok": 20})
        found = ranking.scenario(scenario).reference
        assert (found.estimator, found.runs, found.stored, found.paired) == ("oracle", 20, False, True)
    assert row(ranking, "good").score == pytest.approx(math.sqrt(1.2 * 1.1), rel=0.04)
    rows = ranking.track("sea").rows
    assert [r.estimator for r in rows] == ["good", "fair", "ekf", "poor", "bad", "oracle"]
    assert [r.ranks for r in rows] == ["1", "2", "3", "4", "5", ""]
    assert [r.may_be_best for r in rows] == [True, False, False, False, False, False]
    assert rows[1].worse_than == ("good",)
    assert rows[1].better_than == ("ekf", "poor", "bad")
    assert row(ranking, "oracle").score == pytest.approx(1.0)
    assert row(ranking, "oracle").standing == "reference"


def test_a_stored_figure_is_used_whoever_ran(monkeypatch: pytest.MonkeyPatch):
    figures = {"one-v1": {"horizontal_rmse": Reference(0.5, "oracle", 200, 0.2, stored=True)}}
    monkeypatch.setattr(reference, "stored", lambda: figures)
    ranking = ranked([r for r in campaign(SIMPLE) if not r.reference])
    assert row(ranking, "good", "one-v1").score == pytest.approx(2.4, rel=0.05)
    assert ranking.scenario("two-v1").reference == Reference()
    assert "1 of 2 scenarios have no reference figure" in " ".join(ranking.track("sea").remarks)


def test_without_a_figure_errors_are_in_metres_and_it_is_said():
    ranking = ranked([r for r in campaign(SIMPLE) if not r.reference])
    assert row(ranking, "poor", "one-v1").score == pytest.approx(30.0, rel=0.05)
    assert not ranking.track("sea").relative
    assert "Errors are in metres: there is no reference figure." in ranking.track("sea").remarks


def test_the_order_of_the_results_does_not_matter():
    results = changed(campaign(SIMPLE), "fair", range(2), status="timeout")
    expected = ranked(results).to_dict()
    for seed in range(3):
        random.Random(seed).shuffle(results)
        assert ranked(results).to_dict() == expected


def test_failures_count_and_are_never_dropped():
    scores = [row(ranked(campaign(SIMPLE)), "good").score]
    for count in (1, 3, 6, 20):
        r = row(ranked(changed(campaign(SIMPLE), "good", range(count), status="error", rmse=1e-9)), "good")
        assert (r.runs, r.failed) == (40, 2 * count)
        assert r.failed_low < count / 20 <= r.failed_high
        scores.append(r.score)
    assert scores == sorted(scores)
    assert scores[-1] == pytest.approx(FAILURE)
    assert r.worst == pytest.approx(FAILURE)


def test_a_run_without_any_position_is_a_failure():
    results = changed(campaign(SIMPLE), "good", range(3), rmse=math.nan)
    assert row(ranked(results), "good").failed == 6


def test_failing_a_sixth_of_the_runs_cannot_rank_first():
    results = changed(campaign(SIMPLE, seeds=12), "good", range(2), rmse=math.nan, status="diverged")
    assert [r.estimator for r in ranked(results).track("sea").rows][:3] == ["fair", "ekf", "good"]


@settings(max_examples=20)
@given(data=st.data())
def test_nothing_that_makes_a_run_worse_improves_score_or_place(data: Any):
    results = campaign(SIMPLE, seeds=6, spread=0.4)
    name = data.draw(st.sampled_from(["good", "fair", "poor"]))
    first = ranked(results)
    before, order = row(first, name), [r.estimator for r in first.track("sea").rows]
    for _ in range(data.draw(st.integers(1, 3))):
        k = data.draw(st.sampled_from([i for i, r in enumerate(results) if r.estimator == name]))
        r = results[k]
        worse = float(r.scores["horizontal_rmse"] * data.draw(st.floats(1.0, 1e6)))
        status = data.draw(st.sampled_from(["ok", "ok", "error", "timeout", "diverged", "invalid-output"]))
        results[k] = replace(r, status=status, scores=r.scores | {"horizontal_rmse": worse})
    second = ranked(results)
    after = row(second, name)
    assert after.score >= before.score * (1.0 - 1e-12)
    assert [r.estimator for r in second.track("sea").rows].index(name) >= order.index(name)
    assert after.worst >= before.worst * (1.0 - 1e-12)
    assert after.p95 >= before.p95 * (1.0 - 1e-12)


def test_refusing_a_hard_scenario_does_not_pay():
    """A refusal is a failure where the instruments are there; a row that declares other needs is not in the track."""
    hard = {"one-v1": {"a": 2.0, "b": 2.2}, "two-v1": {"a": 50.0, "b": 40.0}}
    refused = changed(campaign(hard), "b", range(20), "two-v1", status="error", reason="it refused the scenario")
    assert [r.estimator for r in ranked(refused).track("sea").rows] == ["a", "b"]
    declared = changed(campaign(hard), "b", range(20), "two-v1", status="unsuitable", reason="it needs a DVL")
    b = row(ranked(declared), "b")
    assert (b.standing, b.ranks, b.covered, b.scenarios) == ("unsuitable", "", 1, 2)
    assert b.why == "two-v1: it needs a DVL"
    assert ranked(declared).scenario("two-v1").unsuitable == {"b": "it needs a DVL"}


def test_a_row_covers_the_whole_track_or_is_not_ranked():
    results = [r for r in campaign(SIMPLE) if (r.scenario, r.estimator) != ("two-v1", "good")]
    good = row(ranked(results), "good")
    assert (good.standing, good.why, good.covered) == ("incomplete", "it has not run two-v1", 1)
    assert row(ranked(results), "good", "one-v1").ranks == "1"
    assert [r.estimator for r in ranked(results).track("sea").rows if r.ranked] == ["fair", "ekf", "poor", "bad"]


def test_tracks_are_ranked_apart():
    results = campaign({**SIMPLE, "three-v1": SIMPLE["one-v1"] | {"poor": 1.1, "good": 9.0}})
    ranking = ranked(results)
    assert [t.track for t in ranking.tracks] == ["lake", "sea"]
    assert row(ranking, "poor", track="lake").ranks == "1"
    assert row(ranking, "poor").ranks == "4"
    assert ranking.track("lake").scenarios == ("three-v1",)
    with pytest.raises(KeyError, match="pond"):
        ranking.track("pond")


def without(results: list[Result], estimator: str, seeds: Any, scenario: str = "") -> list[Result]:
    return [
        r for r in results
        if r.estimator != estimator or r.seed not in seeds or scenario not in ("", r.scenario)
    ]  # fmt: skip


@pytest.mark.parametrize("lacking", [[4], [0], range(1, 20), range(10, 20)])
def test_a_row_with_fewer_seeds_has_a_score_and_no_rank(lacking: Any):
    """Whoever stops where he is lucky, or leaves seeds out, is in no set and takes no place from the others."""
    results = campaign(SIMPLE, spread=0.4)
    every, fewer = ranked(results), ranked(without(results, "good", lacking))
    good, have = row(fewer, "good"), 20 - len(lacking)
    assert (good.standing, good.ranks, good.may_be_best, good.runs) == ("incomplete", "", False, 2 * have)
    assert good.why == f"it has run {have} of 20 seeds of one-v1, and lacks seeds of 1 scenario more"
    assert math.isfinite(good.score)
    assert [r.estimator for r in fewer.track("sea").rows if r.ranked] == ["fair", "ekf", "poor", "bad"]
    assert fewer.track("sea").remarks[1] == "1 row is incomplete: not all seeds and scenarios of the others were run."
    for name in ("fair", "poor"):  # they are judged as before
        assert row(fewer, name).score == row(every, name).score
    one = row(ranked(without(results, "good", lacking, "two-v1")), "good")
    assert (one.standing, one.why) == ("incomplete", f"it has run {have} of 20 seeds of two-v1")


def test_a_copy_of_the_best_row_with_one_seed_is_in_no_set():
    results = campaign(SIMPLE)
    copies = [replace(r, estimator=f"copy-{k}") for r in results if r.estimator == "good" and r.seed == 0 for k in "ab"]
    found = ranked([*results, *copies]).track("sea")
    assert [r.estimator for r in found.rows if r.may_be_best] == ["good"]
    assert {r.standing for r in found.rows if r.estimator.startswith("copy")} == {"incomplete"}


def test_seeds_that_most_rows_have_not_run_do_not_count():
    """Nor can a row push the others aside with more seeds."""
    results = campaign(SIMPLE)
    more = [replace(r, seed=r.seed + 20, scores=r.scores | {"horizontal_rmse": 1e-3}) for r in results
            if r.estimator == "fair"]  # fmt: skip
    assert ranked([*results, *more]).to_dict() == ranked(results).to_dict()


def test_harder_seeds_are_harder_for_the_oracle_too():
    results = campaign(SIMPLE)
    factors = np.exp(np.random.default_rng(5).normal(0.0, 1.0, 20))
    harder = [replace(r, scores=r.scores | {"horizontal_rmse": r.scores["horizontal_rmse"] * factors[r.seed]})
              for r in results]  # fmt: skip
    for name in SIMPLE["one-v1"]:
        mine, his = row(ranked(harder), name), row(ranked(results), name)
        assert (mine.score, mine.low, mine.ranks) == (pytest.approx(his.score), pytest.approx(his.low), his.ranks)


def test_the_gain_is_over_the_plain_row_on_the_same_runs():
    ranking = ranked(campaign(SIMPLE))
    track = ranking.track("sea")
    assert (track.plain, track.reference) == ("ekf", "oracle")
    fair = row(ranking, "fair")
    assert fair.gain.value == pytest.approx(math.sqrt(2.0 / 4.0 * 3.0 / 5.0), rel=0.04)
    assert fair.gain.low < fair.gain.value < fair.gain.high < 1.0
    assert (fair.gain.won, fair.gain.scenarios, fair.gain.worse) == (2, 2, 0.0)
    assert (row(ranking, "poor").gain.won, row(ranking, "poor").gain.worse) == (0, 1.0)
    assert row(ranking, "ekf").gain.value == 1.0
    assert (row(ranking, "fair").far, row(ranking, "bad").far) == (0.0, 1.0)
    assert row(ranking, "fair", "one-v1").gain.value == pytest.approx(0.5, rel=0.05)


def test_the_sentence_names_the_set_and_its_gain():
    text = ranked(campaign(SIMPLE)).track("sea").sentence
    assert text.startswith("On 2 scenarios of the track Sea (20 seeds), the row `good` has 6")
    assert text.endswith("less horizontal error than `ekf`.")


def test_where_rows_cannot_be_ordered_none_has_a_rank():
    four = {s: {n: f for n, f in by.items() if n not in ("bad", "poor")} for s, by in SIMPLE.items()}
    track = ranked(campaign(four)).track("sea")
    assert track.insufficient
    assert {(r.ranks, r.may_be_best) for r in track.rows} == {("", False)}
    assert [r.estimator for r in track.rows] == ["good", "fair", "ekf", "oracle"]
    assert track.rows[0].better_than == ("fair", "ekf")
    assert track.remarks[0].startswith("Not enough data: ")
    assert "not enough data to order the rows" in track.sentence
    equal = campaign({"one-v1": {"oracle": 1.0, **{f"row-{k}": 2.0 + 0.001 * k for k in range(6)}}})
    assert ranked(equal).track("sea").insufficient


def test_many_variants_of_a_row_cost_the_others_nothing():
    results = campaign(SIMPLE)
    rng = np.random.default_rng(1)
    own = [r for r in results if r.estimator == "fair"]
    near = [
        replace(r, estimator=f"fair-{k:02d}", scores=r.scores | {"horizontal_rmse": r.scores["horizontal_rmse"] * f})
        for k in range(30)
        for r in own
        for f in [1.0 + 0.004 * rng.normal()]
    ]
    named = [replace(r, estimator=f"fair(window={k})") for k in range(30) for r in own]
    for copies in (near, named):
        found = ranked([*results, *copies]).track("sea")
        rows = {r.estimator: r for r in found.rows}
        family = [r for n, r in rows.items() if n.startswith("fair")]
        assert sorted(r.standing for r in family) == ["ranked"] * 3 + ["variant"] * 28
        assert rows["fair"].ranked
        assert (rows["good"].ranks, rows["ekf"].ranks) == ("1", "5")
        assert all(math.isfinite(r.score) and r.why.startswith("it is one of 31 variants of fair") for r in family
                   if not r.ranked)  # fmt: skip
        assert any("28 variants of other rows are listed apart" in remark for remark in found.remarks)


def test_a_forged_note_does_not_make_a_scenario_recorded():
    results = campaign(SIMPLE)
    forged = changed(results, "poor", range(20), note="recording 'dive 1'", rmse=1e-6)
    found = ranked(forged)
    assert found.track("sea").unit == "seed"
    assert row(found, "poor").standing == "implausible"


def test_a_run_that_nobody_could_start_is_nobodys_failure():
    results = [*campaign(SIMPLE), *(result("one-v1", n, 99, math.nan, status="no-recording") for n in SIMPLE["one-v1"])]
    assert row(ranked(results), "good", "one-v1").runs == 20


def test_few_seeds_are_provisional_and_decide_nothing():
    track = ranked(campaign(SIMPLE, seeds=3)).track("sea")
    assert track.provisional
    assert {r.ranks for r in track.rows if r.ranked} <= {"", "1-5"}
    assert not any(r.better_than for r in track.rows)
    assert all(math.isnan(r.low) for r in track.rows)
    assert "Provisional: fewer than ten seeds." in track.remarks
    assert (
        "With 3 seeds no difference can be significant; 6 or more are needed. The rows are in order of score, and all "
        "are tied."
    ) in track.remarks
    assert not ranked(campaign(SIMPLE, seeds=10)).track("sea").provisional


def test_a_board_says_what_its_test_promises_with_few_seeds():
    said = "equal rows may be told apart on more than 5 % of boards"
    assert any(said in remark for remark in ranked(campaign(SIMPLE, seeds=12)).track("sea").remarks)
    assert not any(said in remark for remark in ranked(campaign(SIMPLE, seeds=30)).track("sea").remarks)


def test_equal_scores_share_a_rank():
    results = campaign({"one-v1": {"a": 1.0, "c": 9.0, "d": 20.0, "e": 40.0}})
    results += [replace(r, estimator="b") for r in results if r.estimator == "a"]
    rows = ranked(results).track("sea").rows
    assert {r.estimator: r.ranks for r in rows} == {"a": "1-2", "b": "1-2", "c": "3", "d": "4", "e": "5"}


def test_who_is_better_than_possible_is_not_ranked():
    results = changed(campaign(SIMPLE), "poor", range(20), "one-v1", rmse=1e-6)
    poor = row(ranked(results), "poor")
    assert (poor.standing, poor.ranks) == ("implausible", "")
    assert poor.why.startswith("its errors on one-v1 are below those of an oracle")
    assert row(ranked(results), "poor", "one-v1").standing == "implausible"
    assert row(ranked(results), "poor", "two-v1").standing == "ranked"
    lucky = changed(campaign(SIMPLE), "good", range(20), "one-v1", rmse=0.97)
    assert row(ranked(lucky), "good").standing == "ranked"


def recorded(estimator: str, factor: float, recordings: int, seeds: int = 20) -> list[Result]:
    """Seeds over few recordings: the errors of a recording are the same but for 1 %."""
    rng = np.random.default_rng(3)
    results = []
    for k in range(seeds):
        dive = k % recordings
        rmse = (1.0 + dive) * factor * (1.0 + 0.2 * ((dive * 7) % 5 - 2) * (factor > 1.0)) * (1.0 + 0.01 * rng.normal())
        results.append(result("log-v1", estimator, k, float(rmse), note=f"recording 'dive {dive}'; IMU samples"))
    return results


def test_the_unit_of_a_recorded_scenario_is_the_recording():
    results = recorded("a", 1.0, 5) + recorded("b", 1.05, 5)
    track = rank(results, tracks={"log-v1": "recorded"}).track("recorded")
    assert (track.unit, track.units, track.provisional) == ("recording", 5, True)
    assert not any(r.better_than for r in track.rows)
    assert math.isnan(track.rows[0].low)
    assert track.rows[0].runs == 20
    one = rank(recorded("a", 1.0, 1) + recorded("b", 3.0, 1)).scenario("log-v1")
    assert (one.unit, one.units) == ("recording", 1)
    assert not any(r.better_than for r in one.rows)
    assert list(one.rows[0].ratios) == ["dive 0"]


def test_each_recording_counts_the_same_whatever_its_scenario():
    results = recorded("a", 1.0, 2, seeds=8)
    results += [replace(r, scenario="other-v1", note="") for r in campaign({"other-v1": {"a": 4.0}}, seeds=8)]
    found = rank(results, tracks={"log-v1": "recorded", "other-v1": "recorded"}).track("recorded").rows[0]
    assert found.score == pytest.approx((1.0 * 2.0 * 4.0) ** (1 / 3), rel=0.05)


def test_consistency_is_judged_without_and_with_faults():
    bad = {"nees_horizontal_faulty": 9.0, "coverage_95_faulty": 0.2, "update_median": 2e-3}
    results = changed(campaign(SIMPLE, seeds=12), "fair", range(12), scores=bad, peak_memory=77)
    results = changed(results, "fair", [3], scores={"coverage_95_clean": 0.038})
    results = changed(results, "poor", range(12), scores={"nees_horizontal_clean": math.nan})
    r = row(ranked(results), "fair", "one-v1")
    assert (r.clean.badge, r.faulty.badge, r.faulty.nees) == ("consistent", "optimistic", 9.0)
    assert r.clean.worst_coverage == 0.038
    assert r.clean.coverage == pytest.approx((11 * 0.9 + 0.038) / 12)
    assert (r.update_median, r.peak_memory) == (2e-3, 77)
    assert row(ranked(results), "poor").clean.badge == "unknown"
    assert (r.faulty.words, r.clean.words) == ("horizontal only", "horizontal only")  # as in results of old


def test_the_worst_of_what_a_row_states_is_shown():
    nees = {f"nees_{group}_clean": 1.0 for group in ("vertical", "velocity", "heading")}
    results = changed(campaign(SIMPLE, seeds=12), "fair", range(12), scores=nees | {"nees_heading_clean": 400.0})
    ranking = ranked(results)
    clean = row(ranking, "fair").clean
    assert (clean.badge, clean.nees, clean.group) == ("optimistic", 400.0, "heading")
    cells = [cell for line in track_table(ranking.track("sea")).rows for cell in line]
    assert "optimistic 400 (heading)" in cells
    assert "consistent 1.00 (horizontal only)" in cells


def test_a_lost_run_is_counted_and_has_its_own_error():
    results = campaign(SIMPLE, seeds=12)
    lost = changed(results, "good", [0, 1], scores={"beyond_sigma": 0.11})
    kept = changed(results, "good", [0, 1], scores={"beyond_sigma": 0.1})
    assert row(ranked(lost), "good", "one-v1").statuses == {"lost": 2, "ok": 10}
    assert [row(ranked(r), "good").failed for r in (lost, kept)] == [0, 0]
    assert row(ranked(lost), "good").score == row(ranked(results), "good").score
    assert failures.failures(lost) == {"lost": 4}
    assert failures.failures(kept) == {}
    (reason, *_) = failures.failure_table(lost)[0].columns[4].cells
    assert str(reason) == "an error is beyond 100 times its stated sigma at 11 % of the epochs"


def test_post_processing_ranks_those_who_smooth():
    results = []
    for name, smoothed in (("oracle-rts", 1.0), ("smoother", 2.0), ("filter", math.nan)):
        results += [result("one-v1", name, k, 3.0, scores={"smoothed_horizontal_rmse": smoothed}) for k in range(12)]
    results = changed(results, "smoother", [1], scores={"smoothed_horizontal_rmse": math.nan})
    track = rank(results, tracks={"one-v1": "aided-ins"}).track("post-processing")
    assert track.score == "smoothed_horizontal_rmse"
    assert [r.estimator for r in track.rows] == ["smoother", "oracle-rts"]
    assert track.rows[0].failed == 1
    assert track.rows[0].score == pytest.approx(2.0 ** (11 / 12) * FAILURE ** (1 / 12))
    only = rank(results, score="smoothed_horizontal_rmse", tracks={"one-v1": "aided-ins"})
    assert [t.track for t in only.tracks] == ["aided-ins"]
    assert row(only, "filter", track="aided-ins").failed == 12


def test_two_results_for_one_run_are_refused():
    results = campaign(SIMPLE)
    with pytest.raises(ValueError, match=r"two results of 'good' on one-v1 for seed 0"):
        ranked([*results, next(r for r in results if r.estimator == "good")])


def test_a_board_is_json_and_a_frame():
    results = changed(campaign(SIMPLE, seeds=1), "poor", [0], status="error", rmse=math.nan)
    ranking = ranked(results)
    text = json.dumps(ranking.to_dict(), allow_nan=False)
    assert json.loads(text)["tracks"][0]["rows"][0]["estimator"] == "good"
    assert rank([]).to_dict() == {"tracks": [], "scenarios": []}
    columns = getattr(ranking.to_frame(), "column_names", None) or list(ranking.to_frame().columns)
    assert {"track", "estimator", "score", "clean_badge", "one-v1"} <= set(columns)


@pytest.mark.parametrize("width", [40, 80, 150])
def test_the_names_are_the_last_to_go_from_a_narrow_terminal(width: int):
    from rich.console import Console

    results = campaign({"one-v1": {"oracle": 1.0, "a-row-with-a-long-name": 1.2, "short": 3.0}})
    console = Console(width=width, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    table = track_table(ranked(results).track("sea"))
    console.print(table)
    text = console.export_text()
    assert max(map(len, text.splitlines())) <= width
    assert "a-row-with-a-long-name" in text
    assert "Left out for want of width" in " ".join(text.split())
    assert "estimator" in table.shown(10)


@pytest.mark.parametrize(("seeds", "known"), [(3, False), (20, True)])
def test_the_interval_is_explained_only_where_the_table_has_one(seeds: int, known: bool) -> None:
    from rich.console import Console

    table = track_table(ranked(campaign(SIMPLE, seeds)).track("sea"))
    for width in (500, 40):
        console = Console(width=width, record=True, file=io.StringIO())
        console.print(table)
        text = " ".join(console.export_text().partition("Left out for want of width")[0].split())
        shown = known and width == 500
        assert ("95 % interval" in table.shown(width)) == shown
        assert ("95 % interval: over seeds, of the errors" in text) == shown
        assert "counts 1000. Rank: rows that share a rank" in text


def test_a_row_that_only_smooths_beside_another_is_ranked_by_what_it_smooths() -> None:
    """As it declares, and only where the results agree in every run."""
    assert describe("ekf-rts").real_time_as == "ekf"
    base = campaign({"one-v1": {"ekf": 1.2, "iae": 1.3}, "two-v1": {"ekf": 2.2, "iae": 2.3}})
    twins = [replace(r, estimator="ekf-rts", scores=r.scores | {SMOOTHED: 0.5}) for r in base if r.estimator == "ekf"]
    found = row(ranked([*base, *twins]), "ekf-rts")
    assert (found.standing, found.ranks) == ("identical", "")
    assert found.why == "in real time it is ekf, to the bit; it is ranked by what it smooths"
    assert row(ranked([*base, *twins]), "ekf-rts", "one-v1").standing == "identical"
    assert row(ranked([*base, *twins]), "ekf").ranked
    # What declares nothing, differs in one run, or is alone is ranked.
    copied = [replace(r, estimator="copy") for r in twins]
    assert row(ranked([*base, *copied]), "copy").ranked
    assert row(ranked([*base, *changed(twins, "ekf-rts", [3], "one-v1", rmse=1.0)]), "ekf-rts").ranked
    assert row(ranked([*twins, *(r for r in base if r.estimator == "iae")]), "ekf-rts").ranked


def test_a_board_says_what_its_ratios_are_to() -> None:
    remarks = " ".join(ranked(campaign(SIMPLE)).track("sea").remarks)
    assert "Scores are multiples of the error of oracle on the same runs." in remarks
    late = without(campaign(SIMPLE), "oracle", [19])
    remarks = " ".join(ranked(late).track("sea").remarks)
    assert "the error of oracle over 19 runs, of this campaign" in remarks  # it has not run all seeds that count


def test_rows_that_learned_are_ranked_among_themselves_by_the_number_of_voyages():
    """Those within a budget, on the scenarios of other tracks, which keep all their rows."""
    results = campaign(SIMPLE, seeds=12)
    for name, voyages in (("good", 1000), ("fair", 64), ("poor", 20_000), ("bad", 20_001)):
        results = changed(results, name, range(12), learned={"trained_on": {"voyages": voyages}})
    of = {"one-v1": "generalisation", "two-v1": "generalisation-no-imu"}
    found = rank(results, tracks=of)
    budgets = ["learned-1000", "learned-20000"]
    assert [t.track for t in found.tracks] == ["generalisation", "generalisation-no-imu", *budgets]
    track = found.track("learned-1000")
    assert [(r.estimator, r.ranked) for r in track.rows] == [("good", True), ("fair", True), ("oracle", False)]
    assert track.rows[0].score == pytest.approx((1.2 * 2.2 / 2.0) ** 0.5, rel=0.05)
    assert {r.estimator for r in found.track("learned-20000").rows} == {"good", "fair", "poor", "oracle"}
    assert {r.estimator for r in found.scenario("one-v1").rows} == set(SIMPLE["one-v1"])
    more = changed(results, "fair", range(12), learned={"trained_on": {"voyages": 1001}})
    assert [t.track for t in rank(more, tracks=of).tracks][2:] == ["learned-20000"]
    untold = changed(results, "fair", [3], learned={})
    assert [t.track for t in rank(untold, tracks=of).tracks][2:] == ["learned-20000"]
    few = changed(results, "poor", range(12), learned={})
    assert [t.track for t in rank(few, tracks=of).tracks][2:] == ["learned-1000"]
