"""Error processes against closed forms, and their independence of block boundaries."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simnav.sensors.processes import GaussMarkov, HeldGaussMarkov
from simnav.streams import stream

# Components double as an ensemble of independent realisations.
ENSEMBLE = 4000


def allan_deviation(rate: np.ndarray, m: int) -> float:
    """Non-overlapping Allan deviation of samples, over clusters of m, all columns pooled."""
    n = len(rate) // m
    means = rate[: n * m].reshape(n, m, -1).mean(axis=1)
    return float(np.sqrt(0.5 * np.mean(np.diff(means, axis=0) ** 2)))


def test_random_walk_starts_at_zero_and_has_the_allan_slope_of_plus_a_half():
    density, dt = 0.2, 0.5
    x = GaussMarkov(np.full(200, density), np.inf, stream(2, "r")).sample(dt * np.arange(20_000))
    assert np.all(x[0] == 0.0)
    for m in (10, 100, 1000):
        assert allan_deviation(x, m) == pytest.approx(density * np.sqrt(m * dt / 3.0), rel=0.05)


def test_random_walk_counts_the_time_before_its_first_sample():
    x = GaussMarkov(np.full(ENSEMBLE, 2.0), np.inf, stream(3, "r")).sample(np.array([9.0, 25.0]))
    assert np.std(x, axis=1) == pytest.approx([6.0, 10.0], rel=0.04)


def test_gauss_markov_is_stationary_from_its_first_sample_on():
    time = np.array([0.0, 0.3, 5.0, 5.0, 40.0, 1e4])
    x = GaussMarkov(np.full(ENSEMBLE, 0.7), 10.0, stream(4, "g")).sample(time)
    assert np.std(x, axis=1) == pytest.approx(np.full(6, 0.7), rel=0.04)
    assert np.array_equal(x[2], x[3])


def test_gauss_markov_has_an_exponential_autocorrelation_over_irregular_intervals():
    time = np.array([0.0, 1.0, 3.0, 10.0])
    x = GaussMarkov(np.ones(ENSEMBLE), 5.0, stream(5, "g")).sample(time)
    correlation = np.corrcoef(x)
    assert correlation == pytest.approx(np.exp(-np.abs(time[:, None] - time) / 5.0), abs=0.05)


def test_gauss_markov_of_a_log_that_starts_before_zero():
    x = GaussMarkov(np.ones(ENSEMBLE), 5.0, stream(5, "g")).sample(np.array([-3.0, 2.0]))
    assert np.std(x, axis=1) == pytest.approx([1.0, 1.0], rel=0.04)


def test_times_that_run_backwards_are_refused():
    process = GaussMarkov(1.0, 5.0, stream(6, "g"))
    process.sample(np.array([1.0, 2.0]))
    with pytest.raises(ValueError, match="run backwards"):
        process.sample(np.array([1.5]))
    with pytest.raises(ValueError, match="run backwards"):
        process.sample(np.array([np.nan]))


@pytest.mark.parametrize("correlation_time", [0.0, -1.0, np.nan])
def test_a_correlation_time_is_positive(correlation_time):
    with pytest.raises(ValueError, match="positive"):
        GaussMarkov(1.0, correlation_time, stream(1, "g"))


@given(cuts=st.lists(st.integers(0, 50), max_size=6), infinite=st.booleans())
@settings(max_examples=40)
def test_blocks_of_any_length_give_the_same_bits(cuts, infinite):
    time = np.cumsum(np.tile([0.1, 0.25, 0.0, 1.0, 0.1], 10))
    sigma, correlation_time = np.array([1.0, 0.5]), np.inf if infinite else 3.0
    edges = [0, *sorted(cuts), 50]

    def process() -> GaussMarkov:
        return GaussMarkov(sigma, correlation_time, stream(7, "g"))

    whole, parts = process(), process()
    blocks = [parts.sample(time[a:b]) for a, b in itertools.pairwise(edges)]
    assert np.array_equal(np.concatenate(blocks), whole.sample(time))


def test_held_process_steps_on_its_grid_with_the_autocovariance_of_the_continuous_one():
    held = HeldGaussMarkov(np.full(ENSEMBLE, 0.5), 20.0, 2.0, stream(8, "h"))
    values, first = held.table(10.0)
    assert (len(values), first) == (6, 0)
    assert np.std(values, axis=1) == pytest.approx(np.full(6, 0.5), rel=0.04)
    assert np.corrcoef(values)[0, 3] == pytest.approx(np.exp(-6.0 / 20.0), abs=0.04)
    again, first = held.table(11.9)
    assert first == 5
    assert np.array_equal(again, values[-1:])
    on, first = held.table(14.0)
    assert (len(on), first) == (3, 5)
    assert np.array_equal(on[0], values[-1])
