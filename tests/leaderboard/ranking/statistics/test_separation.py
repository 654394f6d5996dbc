"""Who can be told apart: exact small cases, invariance, and what the test promises, by simulation."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from simnav.leaderboard.ranking.statistics import separate, smallest_p_value, tiers
from tests.audit.statistics import null_boards, power

Array = NDArray[np.float64]


def brute_force(x: Array) -> Array:
    """Adjusted p-values of all pairs, one flip and one pair at a time."""
    runs, n = x.shape
    pairs = list(itertools.combinations(range(n), 2))

    def size(signs: tuple[int, ...], pair: tuple[int, int]) -> float:
        d = x[:, pair[0]] - x[:, pair[1]]
        return abs(float(np.dot(signs, d))) / float(np.sqrt(np.sum(d * d)))

    flips = list(itertools.product((1, -1), repeat=runs))
    observed = {p: size((1,) * runs, p) for p in pairs}
    p_values, left, last = np.ones((n, n)), sorted(pairs, key=lambda p: -observed[p]), 0.0
    while left:
        worst = left[0]
        share = np.mean([max(size(f, p) for p in left) >= observed[worst] - 1e-9 for f in flips])
        last = max(last, float(share))
        p_values[worst] = p_values[worst[::-1]] = last
        left = left[1:]
    return p_values


def test_small_boards_agree_with_all_flips_by_hand():
    rng = np.random.default_rng(1)
    for _ in range(3):
        x = rng.normal(size=(7, 4)) + np.array([0.0, 0.3, 1.0, 3.0])
        np.testing.assert_allclose(separate(x).p_values, brute_force(x), atol=1e-9)


def test_rank_intervals_follow_from_the_pairs():
    rng = np.random.default_rng(2)
    x = rng.normal(size=(40, 1)) + 0.1 * rng.normal(size=(40, 5)) + np.array([0.0, 0.0, 0.5, 0.5, 2.0])
    found = separate(x)
    assert found.rank_low.tolist() == [1, 1, 3, 3, 5]
    assert found.rank_high.tolist() == [2, 2, 4, 4, 5]
    assert found.may_be_best.tolist() == [True, True, False, False, False]
    assert tiers(range(5), found.better) == [1, 1, 2, 2, 3]
    assert not (found.better & found.better.T).any()


def test_few_seeds_tell_nothing_apart_however_many_scenarios():
    """Runs of one seed share random streams: 7 scenarios of 5 seeds are 5 independent units."""
    x = np.random.default_rng(3).normal(size=(35, 3)) * 0.01 + np.array([0.0, 1.0, 2.0])
    strata, seeds = np.repeat(np.arange(7), 5), np.tile(np.arange(5), 7)
    assert not separate(x, strata, seeds).any
    assert separate(x, strata).any  # had they been independent
    assert smallest_p_value(5) == 1 / 16 > 0.05 > smallest_p_value(6)


def test_scenarios_count_the_same_whatever_their_number_of_runs():
    rng = np.random.default_rng(4)
    many, few = rng.normal(0.1, 0.05, 40), rng.normal(-1.0, 0.05, 10)
    x = np.column_stack([np.concatenate([many, few]), np.zeros(50)])
    found = separate(x, ["many"] * 40 + ["few"] * 10)
    assert found.better[0, 1]
    assert separate(x[:40]).better[1, 0]


def test_identical_rows_are_never_told_apart():
    x = np.repeat(np.random.default_rng(5).normal(size=(30, 1)), 3, axis=1)
    found = separate(x)
    assert (found.p_values == 1.0).all()
    assert found.may_be_best.all()
    x[:, 2] += 1.0
    assert separate(x).rank_low.tolist() == [1, 1, 3]


def test_rows_with_fewer_seeds_are_compared_over_the_common_ones():
    rng = np.random.default_rng(6)
    x = rng.normal(size=(30, 4)) * 0.1 + np.array([0.0, 1.0, 0.0, 1.0])
    x[12:, 2:] = np.nan
    x[12:, 0] += 50.0  # where the last two have no runs
    found = separate(x)
    np.testing.assert_allclose(found.better[2:, 2:], separate(x[:12, 2:]).better)
    assert found.better[0, 3]
    assert not found.better[2, 0]
    assert not found.better[0, 2]


def test_nothing_depends_on_the_order_of_rows():
    rng = np.random.default_rng(7)
    x = rng.normal(size=(25, 6)) + 0.4 * np.arange(6)
    order = rng.permutation(6)
    a, b = separate(x), separate(x[:, order])
    np.testing.assert_array_equal(a.p_values[np.ix_(order, order)], b.p_values)
    np.testing.assert_array_equal(a.may_be_best[order], b.may_be_best)


def test_one_row_and_no_runs():
    assert separate(np.zeros((4, 1))).rank_high.tolist() == [1]
    assert separate(np.zeros((0, 3))).rank_high.tolist() == [3, 3, 3]
    assert separate(np.full((3, 2), np.nan)).any is False


def test_a_tier_ends_where_a_row_is_worse_than_any_of_it():
    better = np.zeros((3, 3), dtype=bool)
    better[0, 2] = True
    assert tiers([0, 1, 2], better) == [1, 1, 2]
    better[0, 1] = True
    assert tiers([0, 1, 2], better) == [1, 2, 2]
    assert tiers([], better) == []


@pytest.mark.parametrize("shape", ["normal", "skewed", "failing"])
def test_equal_rows_are_separated_in_five_percent_of_the_boards_at_most(shape: str):
    """A sample of what `tests/audit` measures."""
    found = null_boards(boards=150, shapes=(shape,), seed=11)
    assert found.low < 0.05  # not shown to be more often
    assert found.value < 0.12


def test_a_difference_of_five_percent_is_found_where_the_runs_allow_it():
    assert power(boards=60, rows=10, seeds=50, scale=0.03, difference=0.05) > 0.95
    assert power(boards=60, rows=10, seeds=50, scale=1.0, difference=0.05) < 0.2


def test_the_set_of_the_best_holds_the_best():
    """40 rows of which the first is best by 3 %: it is rarely left out, and most others are."""
    rng = np.random.default_rng(8)
    held, sizes = 0, []
    for _ in range(100):
        x = rng.normal(size=(50, 1)) + 0.1 * rng.normal(size=(50, 20)) + np.array([0.0] + [0.05] * 9 + [0.3] * 10)
        found = separate(x)
        held += found.may_be_best[0]
        sizes.append(found.may_be_best.sum())
    assert held >= 90
    assert np.mean(sizes) < 9.0
