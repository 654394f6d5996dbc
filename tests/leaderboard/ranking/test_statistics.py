"""Statistics: closed forms, worked examples, and what bootstrap and tests promise, by simulation."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from simnav.leaderboard.ranking.statistics import (
    bootstrap_means,
    holm,
    interquartile_mean,
    interval,
    median,
    stratified_test,
    tiers,
)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([7.0], 7.0),
        ([1.0, 2.0], 1.5),
        ([1.0, 2.0, 9.0], (0.25 * 1.0 + 1.0 * 2.0 + 0.25 * 9.0) / 1.5),  # a quarter of each end
        ([8.0, 1.0, 5.0, 3.0], 4.0),
        ([1e9, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, -1e9], 4.5),
    ],
)
def test_interquartile_mean(values: list[float], expected: float) -> None:
    assert interquartile_mean(values) == pytest.approx(expected)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=12).map(lambda v: v * 4))
def test_interquartile_mean_agrees_with_trimming_where_n_is_a_multiple_of_four(values: list[float]) -> None:
    assert interquartile_mean(values) == pytest.approx(float(stats.trim_mean(values, 0.25)), abs=1e-6)


@pytest.mark.parametrize("values", [[], [1.0, np.nan], [np.inf, 1.0], [[1.0]]])
def test_interquartile_mean_refuses_what_has_none(values: list[float]) -> None:
    with pytest.raises(ValueError, match="finite values, at least one"):
        interquartile_mean(values)


def test_bootstrap_distribution_is_that_of_naive_resampling() -> None:
    x = np.random.default_rng(1).lognormal(size=15)
    fast = bootstrap_means([x], resamples=4000)[:, 0]
    rng = np.random.default_rng(2)
    naive = [interquartile_mean(rng.choice(x, 15)) for _ in range(4000)]
    assert stats.ks_2samp(fast, naive).pvalue > 1e-3
    assert stats.ks_2samp(fast, np.array(naive) * 1.1).pvalue < 1e-6  # the test has teeth


def test_strata_are_resampled_independently_and_reproducibly() -> None:
    x, y = np.arange(20.0), np.arange(20.0)
    a = bootstrap_means([x, y])
    assert abs(np.corrcoef(a.T)[0, 1]) < 0.08
    np.testing.assert_array_equal(a, bootstrap_means([x[::-1], y]))  # the order of the runs does not matter
    assert not np.array_equal(a, bootstrap_means([x, y], seed=1))


def test_bootstrap_interval_covers_the_truth_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(3)
    truth = 0.0  # of a symmetric heavy-tailed distribution
    hits = 0
    for _ in range(400):
        low, high = interval(bootstrap_means([rng.standard_t(2, 40)], resamples=500)[:, 0])
        hits += low <= truth <= high
    assert 0.90 <= hits / 400 <= 0.98


def test_stratified_interval_of_a_mean_over_scenarios_covers_too() -> None:
    rng = np.random.default_rng(4)
    centres, hits = np.array([0.0, 3.0, -1.0, 10.0]), 0
    for _ in range(300):
        strata = [rng.normal(c, 1.0 + k, 25) for k, c in enumerate(centres)]
        low, high = interval(bootstrap_means(strata, resamples=500).mean(axis=1))
        hits += low <= centres.mean() <= high
    assert 0.90 <= hits / 300 <= 0.98


def test_holm_on_a_worked_example() -> None:
    # Five tests at 5 %: compare with 0.05/5, 0.05/4, ...; only the two smallest are rejected.
    p = [0.011, 0.02, 0.001, 0.04, 0.3]
    np.testing.assert_allclose(holm(p), [0.044, 0.06, 0.005, 0.08, 0.3])
    assert holm([]).tolist() == []
    np.testing.assert_allclose(holm([0.6, 0.7]), [1.0, 1.0])


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8))
def test_holm_rejects_what_the_step_down_procedure_rejects(p: list[float]) -> None:
    rejected = set()
    for k, i in enumerate(np.argsort(p, kind="stable")):
        if p[i] * (len(p) - k) >= 0.05:
            break
        rejected.add(int(i))
    assert {i for i, q in enumerate(holm(p)) if q < 0.05} == rejected


def test_tiers_hold_together_what_cannot_be_told_apart() -> None:
    rng = np.random.default_rng(5)
    base = rng.normal(0.0, 1.0, 40)  # hard and easy runs: only pairs tell
    runs = {
        "first": base,
        "alike": base + rng.normal(0.02, 0.3, 40),
        "worse": base + rng.normal(0.5, 0.2, 40),
        "as-bad": base + 0.5 + rng.normal(0.0, 0.3, 40),
        "worst": base + 3.0,
    }
    places = tiers({n: float(np.mean(x)) for n, x in runs.items()}, lambda a, b: [runs[a] - runs[b]])
    assert {n: p.tier for n, p in places.items()} == {"first": 1, "alike": 1, "worse": 2, "as-bad": 2, "worst": 3}
    assert sum(p.p_value is None for p in places.values()) == 1
    assert places["worst"].p_value is not None
    assert places["worst"].p_value < 1e-6
    assert all(a.tier <= b.tier for a, b in pairwise(places.values()))


def test_a_noisy_entry_never_stands_above_a_better_one_that_was_told_apart() -> None:
    steady, noisy = np.full(30, 0.5) + 0.01 * np.arange(30), np.linspace(-10.0, 12.0, 30)
    runs = {"best": np.zeros(30), "steady": steady, "noisy": noisy}
    places = tiers({"best": 0.0, "steady": 0.65, "noisy": 1.0}, lambda a, b: [runs[a] - runs[b]])
    assert {n: p.tier for n, p in places.items()} == {"best": 1, "steady": 2, "noisy": 2}


def test_a_stratified_test_asks_what_a_mean_over_scenarios_asks() -> None:
    """A little better in most scenarios, far worse in one: the median run says one thing, the score another."""
    rng = np.random.default_rng(7)
    differences = [rng.normal(-0.05, 0.02, 30) for _ in range(4)] + [rng.normal(2.0, 0.3, 30)]
    assert np.median(np.concatenate(differences)) < 0.0
    assert stratified_test(differences) < 1e-3
    places = tiers({"a": 0.0, "b": 0.3}, lambda a, b: differences)
    assert places["b"].tier == 2


def test_strata_count_the_same_whatever_their_size() -> None:
    rng = np.random.default_rng(8)
    many, few = rng.normal(0.1, 0.5, 400), rng.normal(-1.0, 0.5, 10)
    assert stratified_test([many, few]) < 0.05  # as the ten have it
    assert stratified_test([many]) < 0.05
    assert np.mean([many.mean(), few.mean()]) < 0.0


def test_a_stratified_test_keeps_its_level() -> None:
    rng = np.random.default_rng(9)
    scales = [0.1, 1.0, 3.0]
    p = np.array([stratified_test([s * rng.standard_t(3, n) for s, n in zip(scales, (15, 8, 20))]) for _ in range(400)])
    assert 0.02 <= np.mean(p < 0.05) <= 0.08
    assert 0.4 <= np.mean(p < 0.5) <= 0.6


def test_what_is_always_the_same_cannot_be_told_apart() -> None:
    assert stratified_test([np.zeros(9), np.zeros(4)]) == 1.0
    assert stratified_test([[], []]) == 1.0
    assert stratified_test([[1.0], [2.0]]) == 0.5  # two runs: one flip in two leads as far


def test_few_runs_and_no_common_runs_tell_nothing_apart() -> None:
    places = tiers({"a": 0.0, "b": 9.0}, lambda a, b: [np.full(5, 9.0)])
    assert places["b"].tier == 1  # p = 1/16
    assert tiers({"a": 0.0, "b": 9.0}, lambda a, b: [])["b"].p_value == 1.0
    assert tiers({}, lambda a, b: []) == {}


def test_equal_entries_rarely_fall_into_different_tiers() -> None:
    rng = np.random.default_rng(6)
    split = 0
    for _ in range(150):
        runs = {str(k): rng.normal(size=20) for k in range(4)}
        places = tiers({n: interquartile_mean(x) for n, x in runs.items()}, lambda a, b, r=runs: [r[a] - r[b]])
        split += max(p.tier for p in places.values()) > 1
    # The leader is chosen for its luck, so somewhat more than 5 % is expected.
    assert split / 150 < 0.2


def test_median_interval_is_that_of_the_bootstrap():
    values = np.random.default_rng(1).normal(10.0, 1.0, 400)
    found = median(values)
    spread = 1.2533 / math.sqrt(400)  # standard error of a normal sample's median
    assert found.value == np.median(values)
    assert found.low == pytest.approx(found.value - 1.96 * spread, abs=0.05)
    assert found.high == pytest.approx(found.value + 1.96 * spread, abs=0.05)
    assert math.isnan(median([math.nan]).value)
    assert math.isnan(median([1.0, 2.0]).low)
