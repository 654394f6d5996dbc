"""Equivalent weights, adaptive factors, the gate, correntropy and fading: closed forms, ranges, continuity."""

from __future__ import annotations

from math import exp, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from simnav.estimators.adaptations.adkf import FACTORS, AdaptiveFactor
from simnav.estimators.adaptations.base import Innovation
from simnav.estimators.adaptations.correntropy import MaximumCorrentropy
from simnav.estimators.adaptations.fading import FadingMemory
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.adaptations.robust import HuberWeights, Igg3Weights, huber, igg3
from simnav.types import Datasheet, Instruments, Measurement
from tests.cases.judged_predictions import JudgedPredictions

SHEETS = Instruments(
    (
        Datasheet("gnss", "gnss_position", 1.0, np.array([1.0, 1.0, 2.0])),
        Datasheet("dvl", "dvl", 1.0, 0.1 * np.ones(3)),
        Datasheet("compass", "magnetic_compass", 1.0, np.array([0.1])),
    )
)
R = np.diag([1.0, 1.0, 4.0])
RNG = np.random.default_rng(0)
ROOT = RNG.standard_normal((6, 6))
P, H = ROOT @ ROOT.T / 6.0, RNG.standard_normal((3, 6))


def innovation(v, time=1.0, name="gnss", noise=R, covariance=P, jacobian=H) -> Innovation:
    cross = np.ascontiguousarray(covariance @ jacobian.T)
    m = Measurement(time, name, SHEETS[name].kind, np.zeros(3))
    return Innovation(m, np.asarray(v, dtype=float), jacobian @ cross, noise.copy(), covariance.copy(), cross)


WEIGHTS = {
    "huber": lambda u: huber(u),
    "igg3": lambda u: igg3(u),
    **{name: (lambda u, f=f: f(abs(u), 1.5, 4.0)) for name, f in FACTORS.items()},
}


@pytest.mark.parametrize("weight", WEIGHTS.values(), ids=WEIGHTS)
@given(u=st.floats(0.0, 1e6), step=st.floats(0.0, 0.01))
@settings(max_examples=200)
def test_a_weight_lies_in_its_range_falls_and_has_no_jump(weight, u: float, step: float):
    w = weight(u)
    assert 0.0 <= w <= 1.0
    assert weight(-u) == w
    assert weight(u + step) <= w + 1e-12
    assert w - weight(u + step) <= 2.0 * step + 1e-9  # no slope is steeper than 2 per sigma


@pytest.mark.parametrize(
    ("name", "at"), [("two-segment", [2.0]), ("three-segment", [2.0, 5.0]), ("exponential", [2.0])]
)
def test_factors_are_continuous_at_their_thresholds(name: str, at: list[float]):
    for c in at:
        below, above = (FACTORS[name](c + d, 2.0, 5.0) for d in (-1e-9, 1e-9))
        assert below == pytest.approx(above, abs=1e-8)


def test_factors_as_printed():
    assert FACTORS["two-segment"](5.0, 1.0, 0.0) == pytest.approx(0.2)  # eq. 34
    assert FACTORS["three-segment"](2.0, 1.5, 4.0) == pytest.approx(1.5 / 2.0 * (2.0 / 2.5) ** 2)  # eq. 35
    assert FACTORS["three-segment"](4.1, 1.5, 4.0) == 0.0
    assert FACTORS["exponential"](2.5, 1.0, 0.0) == pytest.approx(exp(-2.25))  # eq. 36


def test_equivalent_weights_divide_the_variances():
    v = np.array([0.1, 30.0, -12.0])
    given = innovation(v)
    adaptation = HuberWeights(1.345)
    adaptation.reset(SHEETS)
    got = adaptation.adapt(given)
    u = np.abs(v) / np.sqrt(np.diag(given.predicted) + np.diag(R))
    weights = np.array([1.0 if x <= 1.345 else 1.345 / x for x in u])
    np.testing.assert_allclose(np.diag(got), np.diag(R) / weights)
    assert adaptation.diagnostics()["weight.gnss"] == pytest.approx(weights.min())
    assert adaptation.adapt(innovation(0.1 * np.ones(3))) is not None
    np.testing.assert_array_equal(adaptation.adapt(innovation(0.1 * np.ones(3))), R)


@pytest.mark.parametrize("statistic", ["discrepancy", "residual", "ratio"])
@pytest.mark.parametrize("printed", [False, True])
def test_statistics_against_the_whole_state(statistic: str, printed: bool):
    """The statistics come from the innovation alone; here from dx, P and e themselves."""
    v = np.array([4.0, -9.0, 2.0])
    given = innovation(v)
    S = given.predicted + R
    dx = P @ H.T @ np.linalg.solve(S, v)
    e = v - H @ dx
    r_x = np.trace(np.linalg.solve(S, given.predicted))
    moved, left = dx @ np.linalg.solve(P, dx) / r_x, e @ np.linalg.solve(R, e) / (3 - r_x)
    expected = {
        ("discrepancy", False): sqrt(moved),
        ("residual", False): sqrt(v @ np.linalg.solve(S, v) / 3),
        ("ratio", False): sqrt(moved),  # the mean s_0^2 starts at 1
        ("discrepancy", True): np.linalg.norm(dx) / sqrt(np.trace(P)),
        ("residual", True): v @ v / sqrt(np.trace(S)),
        ("ratio", True): moved / left,
    }[statistic, printed]
    for target in ("R", "P"):
        preset = "paper" if printed else "default"
        adaptation = AdaptiveFactor(statistic, "two-segment", target, preset, c0=0.05)
        adaptation.reset(SHEETS)
        noise = adaptation.adapt(given)
        factor = 0.05 / expected
        assert adaptation.diagnostics()["factor.gnss"] == pytest.approx(factor)
        if target == "R":
            np.testing.assert_allclose(noise, R / factor)
            assert adaptation.inflation == 1.0
        else:
            np.testing.assert_array_equal(noise, R)
            assert adaptation.inflation == pytest.approx(min(1.0 / factor, 100.0))


@pytest.mark.parametrize("statistic", ["discrepancy", "residual", "ratio"])
def test_whitened_statistics_are_one_on_average(statistic: str):
    """Mean square on clean innovations, read off the two-segment factor; eq. 31 as printed fires most of the time."""
    whitened = AdaptiveFactor(statistic, "two-segment", "P", c0=0.02)
    printed = AdaptiveFactor("residual", "two-segment", preset="paper")
    whitened.reset(SHEETS)
    printed.reset(SHEETS)
    squares, fired = [], []
    for v in np.random.default_rng(1).multivariate_normal(np.zeros(3), H @ P @ H.T + R, 3000):
        given = innovation(v)
        whitened.adapt(given)
        printed.adapt(given)
        squares.append((0.02 / whitened.diagnostics()["factor.gnss"]) ** 2)
        fired.append(printed.diagnostics()["factor.gnss"] < 1.0)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.1)
    assert np.mean(fired) > 0.5


def test_a_factor_never_divides_by_nothing():
    adaptation = AdaptiveFactor()
    adaptation.reset(SHEETS)
    assert np.diag(adaptation.adapt(innovation([1e5, 0.0, 0.0])))[0] == pytest.approx(1e3)
    adaptation = AdaptiveFactor(target="P")
    adaptation.reset(SHEETS)
    for _ in range(5):
        adaptation.adapt(innovation([1e5, 0.0, 0.0]))
        assert adaptation.inflation == pytest.approx(100.0)
    adaptation.adapt(innovation([1e7, 0.0, 0.0], covariance=1e8 * P))  # grown as far as it may
    assert adaptation.inflation == pytest.approx(1.0)


def test_gnss_and_dvl_that_fail_together_three_times_blame_the_prediction():
    far, near = 50.0 * np.ones(3), np.zeros(3)
    test = JudgedPredictions(SHEETS, 3)
    outcome = []
    for k in range(5):
        outcome += [test.fails(innovation(far, k, "gnss")), test.fails(innovation(far, k + 0.5, "dvl"))]
    assert outcome == [False] * 5 + [True] * 5
    assert not test.fails(innovation(near, 6.0, "dvl"))
    assert not test.fails(innovation(far, 6.5, "gnss"))  # alone again
    assert not test.fails(innovation([9.0], 7.0, "compass", np.eye(1), jacobian=H[:1]))
    alone = JudgedPredictions(SHEETS, 3)
    assert not any(alone.fails(innovation(far, k)) for k in range(20))
    late = JudgedPredictions(SHEETS, 1)
    late.fails(innovation(far, 0.0, "dvl"))
    assert late.fails(innovation(far, 1.0))
    assert not late.fails(innovation(far, 60.0))


def test_blamed_the_prediction_is_inflated_and_the_noise_stands():
    adaptation = AdaptiveFactor()
    weights = Igg3Weights()
    adaptation.reset(SHEETS)
    weights.reset(SHEETS)
    far = 50.0 * np.ones(3)
    inflations = []
    for k in range(12):
        for name in ("gnss", "dvl"):
            given = innovation(far, k, name)
            noises = adaptation.adapt(given), weights.adapt(given)
            inflations.append(adaptation.inflation)
            assert weights.inflation == 1.0
            if k > 2:
                np.testing.assert_array_equal(noises, [R, R])
    expected = 0.5 * sqrt(np.mean(far**2 / np.diag(given.predicted + R)))
    at = [k for k, x in enumerate(inflations) if x != 1.0]
    assert at == [5, 11, 17, 23]  # one for three rounds of two
    np.testing.assert_allclose(np.array(inflations)[at], expected)


def test_a_gate_passes_what_it_should_and_opens_again():
    adaptation = ChiSquareGate(0.95, patience=10.0)
    adaptation.reset(SHEETS)
    rng = np.random.default_rng(2)
    S = H @ P @ H.T + R
    passed = [adaptation.adapt(innovation(v, 0.0)) is not None for v in rng.multivariate_normal(np.zeros(3), S, 4000)]
    assert np.mean(passed) == pytest.approx(0.95, abs=0.015)
    adaptation.reset(SHEETS)
    far = 100.0 * np.ones(3)
    taken = [adaptation.adapt(innovation(far, t)) is not None for t in range(15)]
    assert taken == [False] * 10 + [True] * 5  # locked out for the patience, no longer
    assert adaptation.adapt(innovation(np.zeros(3), 15.0)) is not None
    assert adaptation.adapt(innovation(far, 16.0)) is None  # one that passes closes it


def test_gate_limits_are_chi_square():
    adaptation = ChiSquareGate(0.99)
    for d in (1, 2, 3):
        covariance, noise = 0.75 * np.eye(d), 0.25 * np.eye(d)
        for factor, passes in ((0.999, True), (1.001, False)):
            v = np.sqrt(factor * chi2.ppf(0.99, d) / d) * np.ones(d)
            adaptation.reset(SHEETS)
            found = adaptation.adapt(innovation(v, noise=noise, covariance=covariance, jacobian=np.eye(d)))
            assert (found is not None) is passes


def test_correntropy_is_a_fixed_point():
    """The weights belong to the residual that they lead to; with a large bandwidth nothing changes."""
    given = innovation([3.0, -6.0, 4.0])
    adaptation = MaximumCorrentropy(bandwidth=2.0, iterations=200, smallest=1e-9)
    adaptation.reset(SHEETS)
    noise = adaptation.adapt(given)
    left = given.residual - given.predicted @ np.linalg.solve(given.predicted + noise, given.residual)
    np.testing.assert_allclose(np.diag(noise), np.diag(R) * np.exp(left**2 / np.diag(R) / 8.0), rtol=0.02)
    wide = MaximumCorrentropy(bandwidth=1e9)
    wide.reset(SHEETS)
    np.testing.assert_allclose(wide.adapt(given), R)


def test_correntropy_as_printed_locks_out_where_the_default_does_not():
    """After an outage P is large, and a good measurement is far from the prediction."""
    given = innovation([100.0, 80.0, -90.0], covariance=1e4 * P)
    weights = {}
    for begin in ("update", "prediction"):
        adaptation = MaximumCorrentropy(begin=begin)
        adaptation.reset(SHEETS)
        adaptation.adapt(given)
        weights[begin] = adaptation.diagnostics()["weight.gnss"]
    assert weights["update"] > 0.9
    assert weights["prediction"] == pytest.approx(1e-3)


def test_fading_memory_weighs_by_age():
    """A constant, measured with equal noise: the estimate is the mean weighted by exp(-age/memory)."""
    adaptation = FadingMemory(memory=7.0)
    adaptation.reset(SHEETS)
    z = np.random.default_rng(3).standard_normal(30)
    x, p = 0.0, 1e12
    for k, value in enumerate(z):
        adaptation.adapt(innovation([value - x], 2.0 * k, "compass", np.eye(1), np.array([[p]]), np.eye(1)))
        p *= adaptation.inflation
        gain = p / (p + 1.0)
        x, p = x + gain * (value - x), (1.0 - gain) * p
    weights = np.exp(-2.0 * np.arange(29, -1, -1.0) / 7.0)
    assert x == pytest.approx(weights @ z / weights.sum(), abs=1e-7)
