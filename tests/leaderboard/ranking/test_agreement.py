"""Two boards agree as far as their orders do."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from simnav.leaderboard.ranking.agreement import LEADING, correlation_table, rank_correlations
from simnav.leaderboard.ranking.ranking import rank
from simnav.leaderboard.ranking.voyages import side_by_side, voyage_tables
from simnav.leaderboard.results.result import Result


def board(scenario: str, errors: dict[str, float]):
    """A board of one scenario, its errors the same on three seeds but for a per mille."""
    results = [
        Result(scenario, seed, name, {}, False, "ok", "", {"horizontal_rmse": error * (1.0 + 0.001 * seed)})
        for name, error in errors.items()
        for seed in range(3)
    ]
    return rank(results, tracks={scenario: f"track-of-{scenario}"})


NAMES = "abcdefgh"


def test_the_same_order_in_other_figures_is_one():
    first = board("one-v1", {n: float(k + 1) for k, n in enumerate(NAMES)})
    second = board("two-v1", {n: 10.0 * 2.0**k for k, n in enumerate(NAMES)} | {"new": 1.0})
    (found,) = rank_correlations(first, second)
    assert (found.track, found.other) == ("track-of-one-v1", "track-of-two-v1")
    assert found.rows == tuple(NAMES)
    assert found.value == pytest.approx(1.0)
    assert found.low > 0.99


def test_the_reverse_order_is_minus_one_and_a_swap_costs_little():
    first = board("one-v1", {n: float(k + 1) for k, n in enumerate(NAMES)})
    (reverse,) = rank_correlations(first, board("two-v1", {n: 9.0 - k for k, n in enumerate(NAMES)}))
    assert reverse.value == pytest.approx(-1.0)
    swapped = dict(zip("bacdefgh", range(1, 9)))
    (found,) = rank_correlations(first, board("two-v1", {n: float(e) for n, e in swapped.items()}))
    assert found.value == pytest.approx(1.0 - 6.0 * 2.0 / (8.0 * 63.0))
    assert found.low < found.value < found.high
    screen = Console(file=io.StringIO(), width=120)
    screen.print(correlation_table([found]))
    assert " 0.98 " in screen.file.getvalue()


def test_a_few_rows_say_nothing():
    four = {n: float(k + 1) for k, n in enumerate("abcd")}
    assert rank_correlations(board("one-v1", four), board("two-v1", four)) == []


def test_tracks_of_one_board_are_compared_once():
    first = board("one-v1", {n: float(k + 1) for k, n in enumerate(NAMES)})
    assert rank_correlations(first, first) == []


def test_the_leading_rows_have_a_correlation_of_their_own():
    """Thirty rows; both boards agree on who is good, and are opposite within the first twenty."""
    names = [f"row-{k:02d}" for k in range(30)]
    first = board("one-v1", {n: float(k + 1) for k, n in enumerate(names)})
    second = board("two-v1", {n: float(20 - k if k < 20 else k + 1) for k, n in enumerate(names)})
    (found,) = rank_correlations(first, second)
    assert (found.leading, found.leading_value) == (LEADING, pytest.approx(-1.0))
    assert found.value > 0.0


def test_simulated_and_recorded_voyages_side_by_side():
    tracks = {"sea-v1": "no-imu", "log-v1": "recordings", "deep-v1": "underwater"}
    there = dict(zip("bacdefgh", range(1, 9)))
    results = [
        Result(scenario, seed, name, {}, False, "ok", "", {"horizontal_rmse": error * (1.0 + 0.001 * seed)})
        for scenario, errors in (
            ("sea-v1", {n: k + 1.0 for k, n in enumerate(NAMES)} | {"only-here": 0.5}),
            ("log-v1", {n: float(e) for n, e in there.items()}),
            ("deep-v1", {"a": 1.0, "b": 2.0}),
        )
        for name, error in errors.items()
        for seed in range(3)
    ]
    (found,) = side_by_side(rank(results, tracks=tracks))
    assert (found.simulated, found.recorded) == ("no-imu", "recordings")
    assert [(r.estimator, r.simulated, r.recorded) for r in found.rows[:3]] == [("a", 1, 2), ("b", 2, 1), ("c", 3, 3)]
    assert found.correlation.value == pytest.approx(1.0 - 6.0 * 2.0 / (8.0 * 63.0))
    screen = Console(file=io.StringIO(), width=120)
    screen.print(*voyage_tables([found]))
    assert "rank correlation of 8 rows is 0.98" in screen.file.getvalue()
    assert "1.5 times the error of the plain row" in " ".join(screen.file.getvalue().split())
