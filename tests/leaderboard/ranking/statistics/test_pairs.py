"""Two rows on the same runs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from simnav.leaderboard.ranking.statistics import FAILURE, compare


def by_seed(values: list[float]) -> dict[object, float]:
    return dict(enumerate(values))


def test_a_constant_factor_is_found_exactly():
    base = np.random.default_rng(1).lognormal(0.0, 1.0, 12).tolist()
    c = compare(by_seed([1.1 * x for x in base]), by_seed(base))
    assert (c.ratio, c.low, c.high, c.better, c.pairs) == pytest.approx((1.1, 1.1, 1.1, 0.0, 12))
    assert c.p_value < 0.01


def test_only_common_seeds_count_and_few_have_no_interval():
    c = compare({1: 2.0, 2: 3.0, 9: 1e9}, {1: 1.0, 2: math.nan, 3: 5.0})
    assert (c.pairs, c.ratio, c.p_value) == (1, 2.0, 1.0)
    assert math.isnan(c.low)
    with pytest.raises(ValueError, match="no run in common"):
        compare({1: 1.0}, {2: 1.0})
    with pytest.raises(ValueError, match="positive"):
        compare({1: 0.0}, {1: 1.0})


def test_a_failure_on_one_side_counts_the_cap_and_on_both_nothing():
    a, b = by_seed([1.0, math.inf, math.inf]), by_seed([1.0, 1.0, math.inf])
    assert compare(a, b).ratio == pytest.approx(FAILURE ** (1 / 3))
    assert compare(b, a).ratio == pytest.approx(FAILURE ** (-1 / 3))
    assert compare(a, b).better == pytest.approx((0.5 + 0.0 + 0.5) / 3)


def test_the_p_value_is_that_of_all_sign_flips():
    """Six differences of one sign: only all signs as they are, or all turned, lead as far."""
    assert compare(by_seed([2.0] * 6), by_seed([1.0] * 6)).p_value == 2 / 2**6
    assert compare(by_seed([1.0] * 6), by_seed([1.0] * 6)).p_value == 1.0
