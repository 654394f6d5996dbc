"""Figures of the site's data: shortened, and then rounded again by the page."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.site.rounding import short, shorts


@pytest.mark.parametrize("value", [12.3504, 12.3449, 12.35, 0.053504, 1.0005001, 99.95003, 1235001.0, -12.3504])
def test_a_page_rounds_a_short_figure_like_the_figure_itself(value: float) -> None:
    assert tables.number(short(value)) == tables.number(value)
    assert shorts([value]) == [short(value)]


@pytest.mark.parametrize("share", [0.053504, 0.0525001, 0.82350003, 0.99949])
def test_so_does_it_with_a_share_in_percent(share: float) -> None:
    assert tables.percent(short(share)) == tables.percent(share)


@given(st.integers(1000, 9999), st.floats(-0.499, 0.499), st.integers(-6, 6))
def test_every_figure_is_rounded_so(digits: int, rest: float, exponent: int) -> None:
    # Figures have twelve digits at most: what stands behind them is the rounding of a computation (9005 * 1e-4).
    value = float(f"{(digits + rest) * 10.0**exponent:.12g}")
    for found in (short(value), shorts([value])[0]):
        assert found == pytest.approx(value, rel=1e-3)
        assert f"{found:.2e}" == f"{value:.2e}"


def test_most_figures_have_four_digits_and_missing_ones_none() -> None:
    values = np.random.default_rng(0).uniform(1.0, 10.0, 1000)
    assert sum(len(str(short(v))) <= 5 for v in values) > 850
    assert shorts([math.nan, 0.0, math.inf]) == [short(math.nan), short(0.0), short(math.inf)] == [None, 0.0, None]
