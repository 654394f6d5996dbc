"""The papers' comparisons: the rule on chosen intervals, rows from made results, the command with a small paper."""

from __future__ import annotations

import csv
import dataclasses
import itertools
import json
import math
import os
import re
from pathlib import Path

import matplotlib.figure
import numpy as np
import pytest
from typer.testing import CliRunner

import simnav
from simnav.estimator import make
from simnav.leaderboard.cli import app
from simnav.leaderboard.figures.panels import Bar, bars, broken
from simnav.leaderboard.figures.style import Style
from simnav.leaderboard.papers import ALIASES, PAPERS, key_of, reading, sequential, stored
from simnav.leaderboard.papers.comparison import (
    FEWEST,
    GAIN,
    MANY,
    TOLERANCE,
    judge,
    judge_gain,
    judge_single,
    single_runs,
)
from simnav.leaderboard.papers.contents import contents
from simnav.leaderboard.papers.figures import ERRORS
from simnav.leaderboard.papers.measures import measure, value_of
from simnav.leaderboard.papers.page import pages_in as find_pages
from simnav.leaderboard.papers.paper import Figure, Gain, Method, NotShown, Paper, Table, Value
from simnav.leaderboard.papers.ratio_figure import ratio_figure, ratios
from simnav.leaderboard.papers.report import paper_tables, summary, write_csv
from simnav.leaderboard.papers.reproduction import Reproduction, fill, find_method, finding_of
from simnav.leaderboard.ranking.statistics import Interval, mean, mean_ratio
from simnav.leaderboard.results.plain import as_json
from simnav.leaderboard.results.provenance import Provenance
from simnav.leaderboard.results.result import Result
from simnav.scenario import load
from simnav.scoring import SCORES
from simnav.source import record
from simnav.trial import run_trial
from tests.cases import ship

ROOT = Path(__file__).parents[3]
ALL = [reading.paper_of(key) for key in PAPERS]


# -- the rule ------------------------------------------------------------------------------------------------


def exactly(value: float, half: float = 0.0, runs: int = 10) -> Interval:
    return Interval(value, value - half, value + half, runs)


def test_interval_is_students():
    """Known value of the t distribution: 2.262 with 9 degrees of freedom, for a sample of sigma 1."""
    x = np.array([-1.0, 1.0] * 5) * math.sqrt(0.9) + 5.0  # sample variance 10 * 0.9 / 9 = 1
    found = mean(x)
    assert found.value == pytest.approx(5.0)
    assert found.high - 5.0 == pytest.approx(2.2622 / math.sqrt(10.0), rel=1e-4)
    assert (found.low + found.high) / 2.0 == pytest.approx(5.0)
    assert found.runs == 10


def test_interval_covers_as_often_as_it_says():
    rng = np.random.default_rng(5)
    inside = sum(i.low <= 3.0 <= i.high for i in (mean(3.0 + rng.standard_normal(5)) for _ in range(1000)))
    assert 0.93 <= inside / 1000 <= 0.97


def test_what_is_unknown_is_left_out():
    assert mean([1.0, math.nan, 3.0, math.inf]).runs == 2
    assert mean([math.nan]).runs == 0
    alone = mean([4.0])
    assert (alone.value, alone.runs) == (4.0, 1)
    assert math.isnan(alone.low)


def test_ratio_is_geometric_and_paired():
    found = mean_ratio({0: 1.0, 1: 8.0, 2: 3.0}, {0: 2.0, 1: 4.0, 3: 9.0})
    assert found.value == pytest.approx(1.0)  # 1/2 and 2
    assert found.runs == 2
    swapped = mean_ratio({0: 2.0, 1: 4.0, 3: 9.0}, {0: 1.0, 1: 8.0, 2: 3.0})
    assert (swapped.low, swapped.high) == pytest.approx((1.0 / found.high, 1.0 / found.low))


@pytest.mark.parametrize(
    ("ours", "paper", "word", "side"),
    [
        (exactly(1.25), 1.0, "agrees", 0),
        (exactly(0.8), 1.0, "agrees", 0),
        (exactly(1.26), 1.0, "differs", 1),
        (exactly(0.79), 1.0, "differs", -1),
        (exactly(1.1, 0.1), 1.0, "agrees", 0),
        (exactly(1.1, 0.2), 1.0, "undecided", 0),  # it may be beyond 25 %
        (exactly(1.5, 0.6), 1.0, "undecided", 1),  # the interval holds the paper's figure, and does not agree by that
        (exactly(1.5, 0.2), 1.0, "differs", 1),
        (exactly(9.0, 5.0), 1.0, "differs", 1),
        (exactly(1.0, runs=2), 1.0, "undecided", 0),
        (Interval(1.0, math.nan, math.nan, 10), 1.0, "undecided", 0),
        (exactly(5.0), (4.0, 6.0), "agrees", 0),
        (exactly(3.2), (4.0, 6.0), "agrees", 0),
        (exactly(3.1), (4.0, 6.0), "differs", -1),
        (exactly(7.6), (4.0, 6.0), "differs", 1),
    ],
)
def test_figures(ours, paper, word, side):
    verdict = judge(ours, paper)
    assert (verdict.word, verdict.side) == (word, side)


def test_a_wide_interval_never_agrees():
    """Whatever the mean: where the interval is wider than the band, a row cannot agree."""
    for value in np.linspace(0.5, 2.0, 31):
        assert judge(exactly(float(value), 0.3), 1.0).word != "agrees"  # the band is 0.45 wide
        assert judge_gain(exactly(float(value), 0.2), 0.7).word != "agrees"  # 0.20 wide


def test_bounds():
    assert judge(exactly(14.9, 5.0), 20.0, "at-most").word == "agrees"
    assert judge(exactly(19.9, 5.0), 20.0, "at-most").word == "undecided"
    assert judge(exactly(0.1), 20.0, "at-most").word == "agrees"
    assert judge(exactly(21.0, 2.0), 20.0, "at-most").word == "undecided"
    found = judge(exactly(21.0, 0.5), 20.0, "at-most")
    assert (found.word, found.side) == ("differs", 1)
    assert judge(exactly(600.0), 500.0, "at-least").word == "agrees"
    found = judge(exactly(5.0, 1.0), 500.0, "at-least")
    assert (found.word, found.side) == ("differs", -1)


@pytest.mark.parametrize(
    ("ours", "paper", "word", "side"),
    [
        (exactly(0.7, 0.05), 0.7, "agrees", 0),
        (exactly(0.9, 0.05), 0.7, "differs", 1),  # a gain, but a third of the paper's
        (exactly(0.3, 0.05), 0.7, "differs", -1),
        (exactly(0.5, 0.25), 0.7, "undecided", -1),  # the paper's ratio is in the interval, and much else
        (exactly(1.3, 0.1), 0.7, "differs", 1),  # worse
        (exactly(0.9, 0.3), 0.7, "undecided", 1),
        (exactly(1.0, 0.01), 0.7, "differs", 1),  # no gain
        (exactly(1.5, 0.1), 1.5, "agrees", 0),  # the paper's method is worse
        (exactly(0.7, runs=2), 0.7, "undecided", 0),
    ],
)
def test_gains(ours, paper, word, side):
    verdict = judge_gain(ours, paper)
    assert verdict.word == word
    if word == "differs":
        assert verdict.side == side


def test_size_of_a_gain_is_on_the_scale_of_ratios():
    """28.1 % agrees with 20 to 39 %: logarithms within a factor of 1.5."""
    edge = 1.0 - math.exp(math.log(0.719) / 1.5), 1.0 - math.exp(math.log(0.719) * 1.5)
    assert edge == pytest.approx((0.1974, 0.3904), abs=1e-3)
    for gain, word in ((edge[0] + 0.01, "agrees"), (edge[0] - 0.01, "differs"), (edge[1] + 0.01, "differs")):
        assert judge_gain(exactly(1.0 - gain, 1e-6), 0.719).word == word


def test_gross_errors_of_zhan_are_on_pseudoranges_as_printed():
    """From 1 to 60 m with either sign on half of the readings; the receiver's fixes have what follows from them."""
    scenario = reading.paper_of("zhan-2026").scenario("uuv-lake-pseudoranges")
    drift, gross, _ = scenario.faults
    gross = gross.model_copy(update={"start": 10.0})
    recording = record(scenario.model_copy(update={"duration": 30.0, "faults": (drift, gross)}), 500)
    ranges, fixes = recording.data.aids["satellites"], recording.data.aids["gnss"]
    error, after = ranges.fault_error, ranges.time > 9.5
    assert not error[~after].any()
    hit = error[after, 0] != 0.0
    assert hit.mean() == pytest.approx(0.5, abs=0.1)
    assert (abs(error[after][hit, 0]) >= 1.0).all()
    assert (abs(error[after][hit, 0]) <= 60.0).all()
    assert not error[:, 1].any()
    spread = np.sqrt(np.mean(fixes.fault_error**2, axis=1))
    assert spread[fixes.time > 9.5].mean() > 2.0 * spread[fixes.time < 9.5].mean()
    trial = run_trial(make("ekf-23", loose=True), recording)
    assert trial.status == "ok", trial.reason
    assert not any(label.startswith("nis.satellites") for label in trial.diagnostics)


# -- rows ----------------------------------------------------------------------------------------------------


def result(estimator: str, seed: int, status: str = "ok", **scores: float) -> Result:
    return Result("pond-v1", seed, estimator, {}, False, status, "" if status == "ok" else "why not", scores,
                  peak_memory=3_000_000)  # fmt: skip


def runs_of(estimator: str, values: list[float], score: str = "north_rmse") -> list[Result]:
    return [result(estimator, seed, **{score: v}) for seed, v in enumerate(values)]


def found(row, results, labels=None):
    by = {}
    for r in results:
        by.setdefault((r.scenario, r.estimator), []).append(r)
    return finding_of("table", row, "pond-v1", labels or {"A": "a", "B": "b"}, by)


@pytest.mark.parametrize("runs", [FEWEST, 10, MANY, 200])
def test_the_range_of_single_runs_holds_95_percent_of_further_runs(runs):
    """One more run of the same kind, 4000 times: log-normal errors, as those of navigation are."""
    rng = np.random.default_rng(runs)
    inside = 0
    for _ in range(4000):
        *seen, another = np.exp(0.5 * rng.standard_normal(runs + 1))
        inside += judge_single(single_runs(seen), another) == "inside"
    assert inside / 4000 == pytest.approx(0.95, abs=0.015)


def test_too_few_single_runs_decide_nothing():
    assert judge_single(single_runs([1.0] * (FEWEST - 1)), 1.0) == ""
    assert judge_single(single_runs([0.0, 1.0, 2.0]), 1.0) == ""  # no logarithm
    assert judge_single(single_runs([1.0, 2.0, 3.0, math.nan]), 2.0) == "inside"


def single_row(row, *runs):
    """A row from the figures of each run, for each of its methods."""
    names = ("a", "b")[: len(runs)]
    made = {
        ("s-v1", n): [Result("s-v1", k, n, {}, False, "ok", "", {"heading_rmse": v}) for k, v in enumerate(values)]
        for n, values in zip(names, runs, strict=True)
    }
    return finding_of("t", row, "s-v1", {n: n for n in names}, made)


def test_a_printed_run_may_lie_in_the_range_where_the_mean_differs():
    spread = np.radians(np.exp(np.linspace(-1.0, 1.0, 60)))
    found = single_row(Value("s", "a", "heading_rmse", 2.2), spread)
    assert (found.verdict, found.single_verdict) == ("differs", "inside")
    assert found.single.low == pytest.approx(math.exp(-0.95), rel=0.05)
    far = single_row(Value("s", "a", "heading_rmse", 9.0), spread)
    assert (far.verdict, far.single_verdict) == ("differs", "above")
    assert single_row(Value("s", "a", "heading_rmse", 9.0, "at-most"), spread).single is None


def test_the_range_of_a_gain_is_of_the_ratios_on_the_same_seeds():
    theirs = np.radians(np.exp(np.linspace(-1.0, 1.0, 60)))
    found = single_row(Gain("s", "a", "b", "heading_rmse", 0.3), 0.9 * theirs, theirs)
    assert (found.verdict, found.single_verdict) == ("differs", "above")  # the paper's gain is above ours
    assert found.single.low == pytest.approx(0.9)
    assert found.single.high == pytest.approx(0.9)
    scattered = 0.9 * theirs * np.exp(0.5 * np.sin(np.arange(60.0)))
    assert single_row(Gain("s", "a", "b", "heading_rmse", 0.3), scattered, theirs).single_verdict == "inside"


def test_a_row_that_agrees_gives_no_reason():
    row = Value("pond", "A", "north_rmse", 2.0, lower="lower", higher="higher")
    f = found(row, runs_of("a", [1.9, 2.0, 2.1, 2.0]))
    assert (f.verdict, f.why, f.estimators) == ("agrees", "", ("a",))
    assert f.ours is not None
    assert f.ours.value == pytest.approx(2.0)


def test_reasons_go_by_the_side():
    row = Value("pond", "A", "north_rmse", 2.0, lower="ours is better", higher="ours is worse")
    assert found(row, runs_of("a", [1.0, 1.01, 1.02])).why == "ours is better"
    assert found(row, runs_of("a", [4.0, 4.01, 4.02])).why == "ours is worse"
    silent = Value("pond", "A", "north_rmse", 2.0)
    assert found(silent, runs_of("a", [4.0, 4.01, 4.02])).why == "the reason is not known"
    gain = Gain("pond", "A", "B", "north_rmse", 0.3, lower="smaller", higher="larger")
    b = runs_of("b", [1.0, 1.01, 1.02])
    assert found(gain, runs_of("a", [0.95, 0.96, 0.965]) + b).why == "smaller"
    assert found(gain, runs_of("a", [0.3, 0.31, 0.3]) + b).why == "larger"
    assert found(gain, runs_of("a", [0.70, 0.71, 0.70]) + b).verdict == "agrees"


def test_what_is_not_there_is_said():
    f = found(Gain("pond", "A", "C", "north_rmse", 0.3), runs_of("a", [1.0] * 3))
    assert (f.verdict, f.why) == ("absent", "not registered: C")
    assert found(Value("pond", "A", "north_rmse"), runs_of("a", [1.0] * 3)).verdict == "ours"
    beside = Value("pond", "A", "north_rmse", 9.0, rule="beside", lower="never said")
    assert (found(beside, runs_of("a", [1.0] * 3)).verdict, found(beside, runs_of("a", [1.0] * 3)).why) == ("ours", "")


def test_failures_are_never_dropped():
    row = Value("pond", "A", "north_rmse", 1.0, higher="it fell over")
    good = runs_of("a", [1.0, 1.0, 1.01, 0.99])
    f = found(row, [*good, result("a", 9, "diverged")])
    assert (f.verdict, f.why, f.failed) == ("differs", "it fell over", 1)
    assert found(row, [result("a", 0, "diverged")]).verdict == "failed"
    assert found(row, [result("a", 0, "unsuitable")]).verdict == "unsuitable"
    gain = Gain("pond", "A", "B", "north_rmse", 0.3, lower="smaller", higher="larger")
    f = found(gain, [*good, *runs_of("b", [1.4] * 4), result("b", 9, "error")])
    assert (f.verdict, f.why) == ("differs", "larger")


def test_another_score_of_the_other():
    row = Gain("pond", "A", "B", "smoothed_north_rmse", 0.75, than_score="north_rmse")
    f = found(row, runs_of("a", [1.0, 1.1, 0.9], "smoothed_north_rmse") + runs_of("b", [4.0, 4.4, 3.6]))
    assert f.verdict == "agrees"
    assert f.ours is not None
    assert f.ours.value == pytest.approx(0.25)


def test_measures():
    r = result("a", 0, heading_rmse=math.pi / 180.0, horizontal_rmse=3.0, vertical_rmse=4.0, update_mean=0.002)
    assert value_of(r, "heading_rmse") == pytest.approx(1.0)
    assert measure("heading_rmse").unit == "deg"
    assert value_of(r, "position_rmse") == 5.0
    assert value_of(r, "update_mean") == pytest.approx(2.0)
    assert value_of(r, "peak_memory") == pytest.approx(3.0)
    assert math.isnan(value_of(r, "north_rmse"))


def test_kinds_of_rows_are_counted_apart():
    rows = (
        Value("pond", "A", "north_rmse", 2.0),
        Value("pond", "A", "east_rmse", 3.0, rule="at-most"),
        Value("pond", "A", "update_mean", 5.0, rule="at-most"),
        Value("pond", "A", "peak_memory", 1.0, rule="at-most", higher="libraries"),
        Gain("pond", "A", "B", "north_rmse"),  # without a figure of the paper: no verdict
    )
    scores = {"north_rmse": 2.0, "east_rmse": 1.0, "update_mean": 0.001}
    results = [result(e, seed, **scores) for e in "ab" for seed in range(3)]
    findings = [found(row, results) for row in rows]
    assert [f.verdict for f in findings] == ["agrees", "agrees", "agrees", "differs", "ours"]
    nothing = Reproduction(reading.paper_of("guo-2026"), range(3), findings, {}, [])
    assert summary(nothing).endswith(
        "figures: 1 agrees; one-sided bounds: 1 agrees; one-sided bounds on time and memory: 1 agrees, 1 differs"
    )


# -- more runs for undecided rows ----------------------------------------------------------------------------


@pytest.fixture
def pond_paper(tmp_path, monkeypatch):
    """A paper with three methods whose results are made here and not run; returns it and the seeds that were run."""
    (tmp_path / "pond.toml").write_text(POND)
    where, ran, results = str(tmp_path / "pond.toml"), [], {}
    methods = (Method("Clear", ("ekf",)), Method("Close", ("ukf",)), Method("Other", ("gnss-only",)))
    rows = (
        Value(where, "Clear", "north_rmse", 2.0),
        Value(where, "Close", "north_rmse", 2.0),
        Gain(where, "Other", "Close", "north_rmse", 0.5),
    )
    paper = Paper("guo-2026", "N. Body", "Nobody (2026)", "Tiny", "Nowhere", "", "a pond", 4, 9, methods,
                  (Table("Errors", rows),))  # fmt: skip
    means = {"ekf": (2.0, 0.01), "ukf": (2.4, 0.3), "gnss-only": (1.2, 0.01)}

    def run(paper, scenario, names, stands_for, seeds, folder, **_):
        for name in names:
            label = stands_for[name].label
            for seed in seeds:
                ran.append((name, seed))
                mean_, spread = means[label]
                value = mean_ + spread * np.random.default_rng(seed).standard_normal()
                results[label, seed] = result(label, seed, north_rmse=value)

    monkeypatch.setattr(sequential, "run", run)
    monkeypatch.setattr(sequential, "load_results", lambda *_: list(results.values()))
    return paper, ran


def test_only_undecided_rows_get_more_runs(pond_paper, tmp_path):
    paper, ran = pond_paper
    done = sequential.decide(paper, tmp_path, limit=64)
    counts = {m.name: 1 + max(seed for name, seed in ran if name == m.name) for m in paper.methods}
    assert [f.verdict for f in done.findings if f.verdict == "undecided"] == [] or counts["Close"] == 64
    assert counts["Clear"] == 4
    assert counts["Close"] > 4
    assert len(ran) == len(set(ran))  # nothing is run twice


def test_no_more_runs_than_the_limit_and_the_time(pond_paper, tmp_path):
    paper, ran = pond_paper
    done = sequential.decide(paper, tmp_path, limit=6)
    assert max(seed for _, seed in ran) < 6
    assert sequential.undecided(done, 6) == {}
    ran.clear()
    sequential.decide(paper, tmp_path, limit=64, minutes=0.0)
    assert not ran


# -- stored results ------------------------------------------------------------------------------------------


def test_stored_results_come_back(pond_paper, tmp_path):
    paper, _ = pond_paper
    before = sequential.decide(paper, tmp_path, limit=8)
    before.results[0] = dataclasses.replace(before.results[0], status="timeout", reason="after 9 s")
    before.results[1] = dataclasses.replace(before.results[1], provenance=Provenance(commit="abc", cpu="fast"))
    before = fill(paper, before.stands_for, before.results, before.seeds)
    stored.save(before, tmp_path)
    after = stored.shipped_reproduction(paper, tmp_path)
    assert [f.verdict for f in after.findings] == [f.verdict for f in before.findings]
    assert {"timeout", "ok"} == {r.status for r in after.results}
    for a, b in zip(after.findings, before.findings, strict=True):
        assert (a.ours.value, a.ours.low, a.failed) == pytest.approx((b.ours.value, b.ours.low, b.failed), rel=1e-6)
    assert [p.cpu for p in stored.provenance(paper, tmp_path)] == ["fast"]


@pytest.mark.parametrize("paper", ALL, ids=lambda p: p.key)
def test_what_is_undecided_in_the_stored_results_is_so_for_no_lack_of_runs(paper):
    """Its interval is narrower than the band of figures that agree, and lies across one end of it."""
    for f in stored.shipped_reproduction(paper).findings:
        if f.verdict != "undecided":
            continue
        assert f.ours is not None
        if isinstance(f.row, Gain):
            width, band = math.log(f.ours.high / f.ours.low), (GAIN - 1.0 / GAIN) * abs(math.log(1.0 - f.row.paper))
        else:
            least, most = f.row.paper if isinstance(f.row.paper, tuple) else (f.row.paper, f.row.paper)
            width, band = f.ours.high - f.ours.low, most * (1.0 + TOLERANCE) - least / (1.0 + TOLERANCE)
        assert width < band or f.ours.runs >= sequential.LIMIT, (f.table, f.row, f.ours)


def test_stored_results_that_are_missing_or_damaged_get_a_sentence(tmp_path):
    with pytest.raises(ValueError, match=r"no stored results of guo-2026: .*guo-2026.parquet is missing"):
        stored.shipped_reproduction(reading.paper_of("guo-2026"), tmp_path)
    (tmp_path / "guo-2026.parquet").write_bytes(b"PAR1 not really")
    with pytest.raises(ValueError, match="cannot be read"):
        stored.shipped_reproduction(reading.paper_of("guo-2026"), tmp_path)


# -- the papers ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("paper", ALL, ids=lambda p: p.key)
def test_every_row_can_be_filled(paper):
    methods = {m.name for m in paper.methods}
    for row in paper.rows():
        assert measure(row.score).title
        assert {row.method, row.than if isinstance(row, Gain) else row.method} <= methods
        if isinstance(row, Gain) and row.than_score:
            assert measure(row.than_score)
        if isinstance(row.paper, tuple):
            assert row.paper[0] < row.paper[1]
    scenarios = [paper.scenario(name) for name in paper.participants()]
    assert len({s.id for s in scenarios}) == len(scenarios)
    assert 3 <= paper.runs <= paper.full


@pytest.mark.parametrize("paper", ALL, ids=lambda p: p.key)
def test_every_figure_can_be_drawn(paper):
    methods, scores = {m.name for m in paper.methods}, {*SCORES, "position_rmse", "peak_memory"}
    for figure in paper.figures:
        assert set(figure.methods) <= methods
        assert paper.scenario(figure.scenario)
        known = {
            "run": lambda name: name in ERRORS or "." in name,
            "spread": {"horizontal", "vertical", "north", "east", "velocity", "heading"}.__contains__,
            "bars": scores.__contains__,
            "gains": scores.__contains__,
        }.get(figure.draw)
        assert bool(figure.series) == (known is not None)
        assert known is None or all(known(name) for name in figure.series.values()), figure.number
    names = [f.name for f in paper.figures]
    assert len(set(names)) == len(names)


# Tables and figures, as the papers count them.
COUNTS = dict(zip(PAPERS, ((3, 11), (3, 5), (4, 15), (3, 8), (2, 13)), strict=True))


@pytest.mark.parametrize("paper", ALL, ids=lambda p: p.key)
def test_every_table_and_figure_of_a_paper_has_its_place(paper):
    tables, figures = COUNTS[paper.key]
    items = contents(paper)
    assert [i.number for i in items] == [
        *(f"Table {k + 1}" for k in range(tables)),
        *(f"Figure {k + 1}" for k in range(figures)),
    ]
    for item in items:
        assert bool(item.shown) != bool(item.why), item.number


@pytest.mark.parametrize("paper", ALL, ids=lambda p: p.key)
def test_filters_are_there_and_fit(paper):
    wanted = {
        "guo-2026": ["KF", "EKF", "UKF"],
        "mao-2025": ["Sage-Husa filter", "IAE filter"],
        "jiang-2026": ["EKF", "UKF"],
        "zhan-2026": ["KF", "ADKF, two segments", "ADKF, three segments", "ADKF, exponential"],
        "auv-smoothing-2022": ["Federated KF", "Central EKF"],
    }
    for name in wanted[paper.key]:
        assert find_method(paper.method(name)) is not None, name


def test_papers_figures():
    """Table 2 of Mao, Wang and Fu (2025) and Table 3 of Zhan et al. (2026), as printed."""
    rows = {(r.method, r.score): r.paper for r in reading.paper_of("mao-2025").rows() if isinstance(r, Value)}
    east, north = (
        [figure for (_, score), figure in rows.items() if score == f"sigma_{axis}_rmse" and figure is not None]
        for axis in ("east", "north")
    )
    assert east == [3.65, 1.86, 1.28, 1.20]
    assert north == [3.55, 1.65, 1.37, 1.07]
    first = [r for r in reading.paper_of("zhan-2026").tables[0].rows if isinstance(r, Value)]
    position = {r.method: r.paper for r in first if r.score == "east_rmse"}
    assert position["KF"] == 2.6649
    # The gains that the paper prints follow from its table.
    gains = (r for r in reading.paper_of("zhan-2026").rows() if isinstance(r, Gain))
    claims = {r.score: r.paper for r in gains if r.paper is not None}
    for score in ("east_rmse", "north_rmse"):
        of = {r.method: r.paper for r in first if r.score == score}
        assert 1.0 - of["ADKF, three segments"] / of["KF"] == pytest.approx(claims[score], abs=5e-4)


def test_second_set_of_intervals():
    sheets = load("auv-survey-sparse").instruments_sheet()
    intervals = {name: 1.0 / sheet.rate for name, sheet in sheets.items()}
    assert intervals == pytest.approx({"dvl": 0.3, "terrain_fix": 7.0, "magnetic_compass": 0.1, "depth": 2.0})


def test_a_variant_is_a_scenario_of_its_own():
    paper = reading.paper_of("zhan-2026")
    clean = paper.scenario("uuv-lake-clean")
    assert clean.id == "uuv-lake-clean-v1"
    assert {f.kind for f in clean.faults} == {"multipath"}
    assert clean.content_hash() != load("uuv-lake").content_hash()


def test_the_best_candidate_that_is_there_is_taken():
    request = find_method(Method("A", ("nobody", "ekf:nonsense=1", "ekf:calibrate=false", "gnss-only")))
    assert request is not None
    assert (request.name, request.parameters) == ("ekf", {"calibrate": "false"})
    assert find_method(Method("A", ("nobody",))) is None


# -- tables and the command ----------------------------------------------------------------------------------

POND = ship("pond", 10.0, 1.0, "[1.0, 1.0, 1.0]")

FAKE = '''
import numpy as np
from simnav import Estimate, Estimator, register

@register("fake")
class Fake(Estimator):
    """The last fix; says that its sigma is what the parameter says."""

    def __init__(self, sigma: float = 1.0):
        self.sigma = sigma

    def reset(self, start, instruments):
        self.position = start.position.copy()

    def update(self, measurements):
        for m in measurements.aids:
            self.position = m.value
        return Estimate(measurements.time, self.position,
                        diagnostics={"sigma_north.gnss": self.sigma, "sigma_east.gnss": self.sigma})
'''


NUMBERS = itertools.count()


@pytest.fixture
def tiny(tmp_path, monkeypatch):
    """A paper about a scenario and estimators in files."""
    monkeypatch.chdir(tmp_path)
    scenario, estimator = tmp_path / "pond.toml", tmp_path / "fake.py"
    scenario.write_text(POND)
    # The process remembers names: each test needs its own.
    estimator.write_text(FAKE.replace('"fake"', f'"fake-{next(NUMBERS)}"'))
    where = str(scenario)
    paper = Paper(
        key="mao-2025",
        authors="N. Body",
        short="Nobody (2026)",
        title="Tiny",
        published="Nowhere 2026",
        doi="10.1000/nothing",
        about="a pond",
        runs=3,
        full=9,
        methods=(
            Method("Right", (f"{estimator}:Fake",)),
            Method("Wrong", ("nobody", f"{estimator}:Fake:sigma=3.0")),
            Method("Future", ("nobody",)),
        ),
        tables=(
            Table(
                "Sigma",
                (
                    Value(where, "Right", "sigma_north_rmse", 0.5, lower="it is told"),
                    Value(where, "Wrong", "sigma_north_rmse", 2.0),
                    Value(where, "Future", "sigma_north_rmse", 1.0),
                    Value(where, "Future", "sigma_east_rmse"),
                    Value(where, "Wrong", "horizontal_rmse"),
                ),
                "Table 1",
            ),
            Table("Claims", (Gain(where, "Wrong", "Right", "horizontal_rmse", 0.5, lower="they are the same"),)),
        ),
        figures=(
            Figure("Figure 1", "Errors", "spread", where, ("Right", "Wrong"), {"Error [m]": "horizontal"}),
            Figure("Figure 2", "Sigma", "run", where, ("Right", "Wrong", "Future"), {"Sigma": "sigma_north.gnss"}),
            Figure("Figure 2", "Errors", "run", where, ("Right",), {"North": "north", "All": "position"}, part="b"),
            Figure("Figure 3", "Nothing", "spread", where, ("Future",), {"Error [m]": "horizontal"}),
            Figure("Figure 4", "Tracks", "track", where, ("Right",)),
            Figure("Figure 4", "Route", "track", where, (), part="route"),
            Figure("Figure 5", "Sigma by method", "bars", where, ("Right", "Wrong"), {"Sigma": "sigma_north_rmse"}),
            Figure("Figure 6", "Gain", "gains", where, ("Wrong", "Right"), {"Gain [%]": "horizontal_rmse"}),
            Figure("", "Distribution", "distribution", where, ("Right",)),
        ),
        not_shown=(NotShown(number="Figure 7", what="The pond", why="a photograph"),),
        notes=("One note.",),
    )
    monkeypatch.setattr("simnav.leaderboard.papers.reading.paper_of", lambda key: paper)

    def none_are_stored(paper: Paper) -> Reproduction:
        raise ValueError

    monkeypatch.setattr("simnav.leaderboard.papers.stored.shipped_reproduction", none_are_stored)
    return tmp_path


def call(*words: str):
    return CliRunner().invoke(app, ["paper", "reproduce", *words], env={"COLUMNS": "200"})


@pytest.mark.skipif(os.name != "posix", reason="isolation without fork takes seconds a run")
def test_the_command(tiny):
    done = call("mao-2025", "--workers", "1", "--output", "out", "--json")
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    verdicts = [r["verdict"] for r in document["rows"]]
    assert verdicts == ["differs", "agrees", "absent", "absent", "ours", "differs"]
    assert [r["why"] for r in document["rows"]] == [
        "it is told", "", "not registered: Future", "not registered: Future", "", "they are the same",
    ]  # fmt: skip
    right, wrong = document["rows"][:2]
    assert (right["ours"], wrong["ours"], wrong["runs"]) == (0.0, 2.0, 3)
    claim = document["rows"][-1]
    assert (claim["ours"], claim["paper"], claim["than"]) == (0.0, 0.5, "Right")
    assert document["methods"]["Future"] is None

    with open(document["csv"], encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [r["verdict"] for r in rows] == verdicts
    assert float(rows[1]["ours"]) == 2.0
    assert [os.path.basename(p) for p in document["figures"]] == [
        "figure-1.png", "figure-2.png", "figure-2-b.png", "figure-4.png", "figure-4-route.png", "figure-5.png",
        "figure-6.png", "distribution.png", "sigma.png", "claims.png",
    ]  # fmt: skip
    assert [(c["number"], c["where"]) for c in document["contents"]] == [
        ("Table 1", "table 'Sigma'"),
        ("Figure 1", "figure-1.png"),
        ("Figure 2", "figure-2.png; figure-2-b.png"),
        ("Figure 3", "figure-3.png (no results of Future)"),
        ("Figure 4", "figure-4.png; figure-4-route.png"),
        ("Figure 5", "figure-5.png"),
        ("Figure 6", "figure-6.png"),
        ("Figure 7", "not shown: a photograph"),
    ]
    page = Path(document["page"]).read_text(encoding="utf-8")
    for text in ("Tiny", "it is told", "One note.", "figure-2-b.png", "a photograph", "not registered: Future"):
        assert text in page
    assert "index.html" not in page  # it stands alone
    for path in document["figures"]:
        with open(path, "rb") as file:
            assert file.read(8) == b"\x89PNG\r\n\x1a\n"

    shown = call("mao-2025", "--workers", "1", "--output", "out").stdout  # nothing is run again
    for text in (
        "N. Body: Tiny. Nowhere 2026. doi:10.1000/nothing",
        "not registered: Future",
        "(a) it is told",
        "note: One note.",
        "figures: 1 agrees, 2 differ",
    ):
        assert text in shown
    more = json.loads(call("mao-2025", "--workers", "1", "--output", "out", "--json", "-n", "4").stdout)
    assert more["rows"][1]["runs"] == 4
    fewer = json.loads(call("mao-2025", "--workers", "1", "--output", "out", "--json", "-n", "2").stdout)
    assert fewer["rows"][1]["runs"] == 2
    assert fewer["rows"][1]["verdict"] == "undecided"


@pytest.mark.skipif(os.name != "posix", reason="isolation without fork takes seconds a run")
def test_the_site_shows_what_was_reproduced(tiny):
    assert call("mao-2025", "--workers", "1", "--output", "reproduced/mao-2025", "-n", "2").exit_code == 0
    site = CliRunner().invoke(app, ["leaderboard", "reproduced/mao-2025/results", "--workers", "1"])
    assert site.exit_code == 0, site.output
    page = Path("site/paper-mao-2025.html").read_text(encoding="utf-8")
    shown = re.findall(r'<img src="([^"]+)"', page)
    assert len(shown) == 15  # two of them are of its tables, five of its claims
    assert all((Path("site") / name).is_file() for name in shown)
    assert 'href="paper-mao-2025.html"' in Path("site/about.html").read_text(encoding="utf-8")
    assert 'href="index.html"' in page
    # One that is damaged is left out.
    (Path("reproduced") / "mao-2025" / "figure-1.png").unlink()
    assert find_pages(Path("reproduced")) == []
    assert CliRunner().invoke(app, ["leaderboard", "reproduced/mao-2025/results", "--workers", "1"]).exit_code == 0
    assert not Path("site/paper-mao-2025.html").exists()


@pytest.mark.skipif(os.name != "posix", reason="isolation without fork takes seconds a run")
def test_the_command_and_its_call_say_the_same(tiny):
    done = call("mao-2025", "--workers", "1", "--output", "out", "--json")
    document = json.loads(done.stdout)
    found = simnav.reproduce("mao-2025", output="out", workers=1)
    called = as_json(found.to_dict())
    assert {key: document[key] for key in called} == called
    assert set(document) - set(called) == {"contents", "csv", "page", "figures"}
    assert len(found.to_frame()) == len(document["rows"])
    assert isinstance(found.plot(), matplotlib.figure.Figure)
    assert isinstance(found.plot("Figure 5"), matplotlib.figure.Figure)
    with pytest.raises(simnav.RequestError, match="nothing to draw of Figure 3; it has Figure 1"):
        found.plot("Figure 3")


def test_a_curve_is_broken_where_nothing_was_measured():
    time = np.arange(20.0)
    values = np.where((time > 5.0) & (time < 14.0), np.nan, time)
    t, v = broken(time, values)
    assert np.isnan(v).sum() == 1
    assert t[np.isnan(v)] == 5.0
    sparse = np.where(time % 3.0 == 0.0, time, np.nan)  # every third epoch is no gap
    assert np.isfinite(broken(time, sparse)[1]).all()


def test_bars_show_the_papers_figure():
    of = [Bar("A", 2.0, 1.5, 2.5, [1.9, 2.1], (3.0, 3.0)), Bar("B", 1.0, math.nan, math.nan, [1.0], (0.5, 1.5))]
    (axes,) = bars({"Error [m]": of}, Style(["A", "B"])).axes
    xs = [line.get_xdata() for line in axes.lines]
    assert any(np.array_equal(x, [3.0]) for x in xs)  # the paper's figure
    assert any(np.array_equal(x, [0.5, 1.5]) for x in xs)  # its range
    assert any(np.array_equal(x, [1.5, 2.5]) for x in xs)  # our interval
    assert axes.get_xscale() == "linear"
    wide = [Bar("A", 1.0, 1.0, 1.0, []), Bar("B", 5000.0, 5000.0, 5000.0, [])]
    assert bars({"Error [m]": wide}, Style(["A", "B"])).axes[0].get_xscale() == "log"


def test_mistakes_get_a_sentence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = call("guo-2025")
    assert done.exit_code == 2
    assert "there is no paper 'guo-2025'; there are guo-2026, mao-2025" in done.stderr
    assert "Did you mean 'guo-2026'?" in done.stderr
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "results").write_text("a file")
    done = call("mao-2025", "--output", "taken")
    assert done.exit_code == 2
    assert len(done.stderr.strip().splitlines()) == 1


def test_tables_hold_every_figure_of_the_papers(tmp_path):
    """Without any estimator all rows with a figure are shown as not registered."""
    for paper in ALL:
        findings = [finding_of(t.title, row, "x", {}, {}) for t in paper.tables for row in t.rows]
        nothing = Reproduction(paper, range(3), findings, dict.fromkeys(m.name for m in paper.methods), [])
        assert nothing.count("absent") == len(findings)
        shown = list(paper_tables(nothing))
        assert sum(t.row_count for t in shown) == sum(r.paper is not None for r in paper.rows())
        assert f"{len(findings)} rows without a registered estimator" in summary(nothing)
        with write_csv(nothing, tmp_path / "t.csv").open(encoding="utf-8") as file:
            assert len(file.readlines()) == len(findings) + 1


def test_the_pages_show_every_drawn_figure_and_no_other():
    folder = ROOT / "docs" / "papers"
    shown = {image for page in folder.glob("*.md") for image in re.findall(r"\((figures/[^)]*)\)", page.read_text())}
    assert shown == {p.relative_to(folder).as_posix() for p in folder.glob("figures/*/*.png")}
    assert len(shown) > len(PAPERS)


def a_ratio(value: float, paper: float = 1.0):
    """A row whose 60 runs have a figure, beside a paper's."""
    spread = np.radians(value * np.exp(0.1 * np.linspace(-1.0, 1.0, 60)))
    return single_row(Value("s", "a", "heading_rmse", paper), spread)


def test_figures_over_the_papers_are_drawn_within_the_axis():
    """A method that is 600 times worse is written at the edge, and does not change where the others are."""
    near, far = ratios([a_ratio(1.1), a_ratio(600.0)])
    assert near.value == pytest.approx(1.1, rel=0.01)
    assert near.single_low < near.low < near.high < near.single_high
    assert (near.verdict, far.verdict) == ("agrees", "differs")
    fig = ratio_figure([near, far], "Errors")
    (ax,) = fig.axes
    assert ax.get_xlim()[1] < 6.0
    assert ["600 times" in text.get_text() or "601 times" in text.get_text() for text in ax.texts] == [True]


def test_of_a_gain_the_ratio_of_the_errors_is_compared():
    theirs = np.radians(np.exp(np.linspace(-1.0, 1.0, 60)))
    (found,) = ratios([single_row(Gain("s", "a", "b", "heading_rmse", 0.5), 0.5 * theirs, theirs)])
    assert found.value == pytest.approx(1.0)
    assert found.band == pytest.approx((0.5**0.5, 0.5 ** (1.0 / 1.5 - 1.0)))
    assert ratios([single_row(Gain("s", "a", "b", "heading_rmse"), theirs, theirs)]) == []  # the paper has no figure


def test_keys_and_aliases():
    assert [key_of(alias) for alias in ALIASES] == list(PAPERS)
    assert reading.paper_of("003") is reading.paper_of("zhan-2026")
    for paper in ALL:
        assert paper.doi or paper.key == "mao-2025"
        assert paper.title in paper.citation
        assert paper.authors in paper.citation


def test_options_that_contradict_each_other_get_a_sentence():
    with pytest.raises(simnav.RequestError, match="fixed number of runs"):
        simnav.reproduce("guo-2026", stored=True, runs=3)
    with pytest.raises(simnav.RequestError, match="give 'limit' in place of 'runs'"):
        simnav.reproduce("guo-2026", until_decided=True, runs=3)


def test_a_paper_can_be_cut_to_some_methods():
    """So that a comparison of two quick filters can have its 200 runs."""
    whole = reading.paper_of("jiang-2026")
    part = whole.only(["EKF", "UKF"])
    assert {m.name for m in part.methods} == {"EKF", "UKF"}
    assert 0 < len(list(part.rows())) < len(list(whole.rows()))
    assert set().union(*part.participants().values()) == {"EKF", "UKF"}
    with pytest.raises(ValueError, match=r"no method 'PF'; it has GNSS alone, EKF"):
        whole.only(["PF"])
