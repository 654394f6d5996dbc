"""Paired comparisons: known differences, failures, and what the tests promise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from simnav.scoring import compare, paired_test


def by_seed(values: object) -> dict[int, float]:
    return dict(enumerate(np.asarray(values, dtype=float).tolist()))


def test_a_constant_ratio_is_found_whatever_the_spread_of_the_runs() -> None:
    base = np.random.default_rng(1).lognormal(0.0, 2.0, 30)
    c = compare(by_seed(1.1 * base), by_seed(base))
    assert c.pairs == 30
    assert c.ratio == pytest.approx(1.1)
    assert (c.low, c.high) == pytest.approx((np.log(1.1), np.log(1.1)))
    assert c.better == 0.0
    assert c.p_value < 1e-5


def test_plain_differences() -> None:
    c = compare(by_seed([1.0, 2.0, 6.0]), by_seed([2.0, 2.0, 3.0]), logarithmic=False)
    assert (c.mean, c.median) == (pytest.approx(2.0 / 3.0), 0.0)
    assert c.better == 0.5
    assert np.isnan(c.ratio)


def test_only_common_runs_are_paired() -> None:
    c = compare({1: 2.0, 2: 3.0, 9: 1e9}, {1: 1.0, 2: np.nan, 3: 5.0})
    assert c.pairs == 1
    assert c.ratio == pytest.approx(2.0)
    assert np.isnan(c.low)
    with pytest.raises(ValueError, match="no run in common"):
        compare({1: 1.0}, {2: 1.0})
    with pytest.raises(ValueError, match="need positive scores"):
        compare({1: 0.0}, {1: 1.0})


def test_failures_count_against_the_one_that_failed() -> None:
    a = by_seed([np.inf] * 6 + [np.inf] * 2)
    b = by_seed([1.0] * 6 + [np.inf] * 2)
    c = compare(a, b)
    assert c.better == pytest.approx(1 / 8)  # two ties
    assert c.mean == np.inf
    assert c.p_value < 0.05
    assert compare(b, a).p_value == c.p_value


def test_wilcoxon_agrees_with_enumeration() -> None:
    d = np.array([1.0, -2.0, 3.0, 4.0, 5.0, 6.0])
    signs = np.array(np.meshgrid(*[[-1, 1]] * 6)).reshape(6, -1)
    sums = (signs > 0).T @ np.arange(1, 7)
    observed = 1 + 3 + 4 + 5 + 6
    expected = np.mean(np.abs(sums - 10.5) >= abs(observed - 10.5))
    assert paired_test(d) == pytest.approx(expected)


def test_only_ranks_matter_so_infinite_differences_are_welcome() -> None:
    d = np.array([0.3, -0.1, 0.2, 0.5, 0.4])
    assert paired_test(np.append(d, np.inf)) == paired_test(np.append(d, 7.0))


def test_nothing_to_tell_apart() -> None:
    assert paired_test([]) == 1.0
    assert paired_test([0.0, 0.0]) == 1.0
    assert paired_test([0.0, 0.0], method="sign") == 1.0


def test_the_sign_test_is_binomial() -> None:
    d = [1.0] * 9 + [-5.0] + [0.0] * 3
    assert paired_test(d, method="sign") == pytest.approx(2 * (1 + 10) / 2**10)


@pytest.mark.parametrize("method", ["wilcoxon", "sign"])
def test_the_level_is_kept_and_a_difference_found(method: str) -> None:
    rng = np.random.default_rng(2)
    null = [paired_test(rng.normal(size=20), method=method) for _ in range(500)]  # type: ignore[arg-type]
    assert stats.binomtest(int(np.sum(np.array(null) < 0.05)), 500, 0.05, "greater").pvalue > 1e-3
    assert paired_test(rng.normal(1.5, 1.0, 20), method=method) < 0.01  # type: ignore[arg-type]
