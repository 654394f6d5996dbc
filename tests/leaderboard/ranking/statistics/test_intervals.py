"""Intervals: closed forms, worked examples, and how often they hold the truth, by simulation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from simnav.leaderboard.ranking.statistics import FAILURE, median, score, share, weighted_quantile
from tests.audit.statistics import coverage


def test_a_score_is_a_geometric_mean_in_which_scenarios_count_the_same():
    logs = np.log([2.0, 8.0, 9.0])
    assert score(logs[:2]).value == pytest.approx(4.0)
    assert score(logs, ["a", "a", "b"]).value == pytest.approx(6.0)
    assert math.isnan(score([]).value)


def test_a_failed_run_counts_the_cap_and_no_run_counts_more():
    assert score([0.0, math.nan], failed=[False, True]).value == pytest.approx(math.sqrt(FAILURE))
    assert score([0.0, 99.0]).value == pytest.approx(math.sqrt(FAILURE))


def test_the_interval_of_one_scenario_is_students():
    x = np.random.default_rng(1).normal(0.3, 0.5, 16)
    found = score(x)
    low, high = stats.t.interval(0.95, 15, x.mean(), x.std(ddof=1) / 4.0)
    assert (found.low, found.high) == pytest.approx((math.exp(low), math.exp(high)))


def test_the_upper_end_allows_for_one_more_unlucky_run():
    x = np.random.default_rng(1).normal(0.3, 0.5, 16)
    found, wider = score(x), score(x, excess=4.0)
    more = np.append(x, x.mean() + 4.0)
    high = more.mean() + stats.t.ppf(0.975, 15) * more.std(ddof=1) / math.sqrt(17)
    assert (wider.low, wider.high) == pytest.approx((found.low, math.exp(high)))
    assert score(x, excess=0.0).high == found.high


def test_the_interval_of_seeds_that_run_through_all_scenarios_is_that_of_their_means():
    """Runs of one seed are not independent: three scenarios that are the same say no more than one."""
    x = np.random.default_rng(2).normal(0.0, 0.5, 12)
    once = score(x)
    thrice = score(np.tile(x, 3), np.repeat(["a", "b", "c"], 12), np.tile(np.arange(12), 3))
    assert (thrice.low, thrice.high) == pytest.approx((once.low, once.high), rel=1e-9)
    other = score(np.tile(x, 3), np.repeat(["a", "b", "c"], 12), np.arange(36))  # as if they were independent
    assert other.high / other.low < 0.8 * once.high / once.low


def test_failures_shift_the_interval_and_do_not_widen_it():
    x = np.random.default_rng(3).normal(0.0, 0.2, 20)
    bad = np.arange(20) < 4
    found, clean = score(x, failed=bad), score(x[4:])
    cost = FAILURE**0.2
    assert (found.low, found.high) == pytest.approx((clean.low**0.8 * cost, clean.high**0.8 * cost), rel=0.02)


def test_few_runs_have_no_interval():
    assert math.isnan(score([0.0, 1.0, 0.5] * 3).low)
    assert math.isfinite(score([0.0, 1.0] * 5).low)
    assert math.isnan(score([0.0, 1.0] * 9, ["a"] * 9 + ["b"] * 9).low)
    assert math.isnan(score([0.0, 1.0] * 5, failed=[False] + 9 * [True]).low)
    assert score([0.5] * 10).low == score([0.5] * 10).value


@given(st.lists(st.tuples(st.floats(-3.0, 9.0), st.booleans()), min_size=1, max_size=12), st.data())
def test_a_score_never_improves_when_a_run_gets_worse_or_fails(runs: list[tuple[float, bool]], data: Any):
    values, failed = np.array([v for v, _ in runs]), np.array([f for _, f in runs])
    strata = [k % 3 for k in range(len(runs))]
    before = score(values, strata, failed=failed).value
    k = data.draw(st.integers(0, len(runs) - 1))
    worse, lost = values.copy(), failed.copy()
    worse[k] += data.draw(st.floats(0.0, 9.0))
    lost[k] |= data.draw(st.booleans())
    assert score(worse, strata, failed=lost).value >= before * (1.0 - 1e-12)


@pytest.mark.parametrize("failing", [0.0, 0.02])
@pytest.mark.parametrize("scenarios", [1, 7])
def test_intervals_cover_as_they_say(scenarios: int, failing: float):
    """A sample of what `tests/audit` measures; 1000 boards leave a standard error of 0.7 %."""
    found = coverage(boards=1000, seeds=10, scenarios=scenarios, scale=0.3, failing=failing, shared=0.5)
    assert 0.925 <= found.value <= 0.975


def test_an_exact_share():
    low, high = stats.binomtest(3, 50).proportion_ci(method="exact")
    assert (share(3, 50).low, share(3, 50).high) == pytest.approx((low, high))
    assert share(50, 50).high == 1.0
    assert math.isnan(share(0, 0).value)


def test_median_interval_is_that_of_order_statistics():
    assert median([3.0, 1.0, 2.0, 6.0, 5.0, 4.0]).value == 3.5
    found = median(range(1, 7))  # [1, 6] holds it in 31/32, [2, 5] in 25/32: a share of 0.1, 5/14 after Hettmansperger
    assert found.low == pytest.approx(1.0 + 5.0 / 14.0)
    assert found.high == pytest.approx(7.0 - found.low)
    values = np.random.default_rng(1).normal(10.0, 1.0, 400)
    spread = 1.2533 / math.sqrt(400)  # standard error of a normal sample's median
    found = median(values)
    assert found.low == pytest.approx(found.value - 1.96 * spread, abs=0.05)
    assert found.high == pytest.approx(found.value + 1.96 * spread, abs=0.05)
    assert math.isnan(median([math.nan]).value)
    assert math.isnan(median(range(5)).low)


@pytest.mark.parametrize("n", [6, 7, 10, 25])
def test_median_interval_covers_as_it_says(n: int):
    rng = np.random.default_rng(n)
    inside = [(m := median(rng.lognormal(0.0, 1.0, n))).low <= 1.0 <= m.high for _ in range(1500)]
    assert 0.93 <= np.mean(inside) <= 0.975


def test_a_weighted_quantile():
    assert weighted_quantile(range(1, 101), np.ones(100), 0.95) == 95.0
    assert weighted_quantile([5.0, 1.0], [1.0, 99.0], 0.95) == 1.0
    assert math.isnan(weighted_quantile([], [], 0.5))
