"""The bank of headings: its prior, that it is the EKF in the end, and that it finds a heading that an EKF does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.heading_bank import HeadingBank, initial_headings
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.geometry.rotation import wrap_angle
from simnav.types import Datasheet, InitialState, Instruments, Measurements

DEG = np.pi / 180.0
GNSS = Datasheet("gnss", "gnss_position", 1.0, np.array([1.5, 1.5, 3.0]), lever_arm=np.array([2.0, -1.0, -8.0]))
DVL = Datasheet("dvl", "dvl", 1.0, np.full(3, 0.05), phase=0.333, lever_arm=np.array([1.0, 0.5, 3.0]))


def unknown(recording, off: float, sigma: float):
    """The recording with a heading that is off, and a sigma that says how little is known."""
    start = recording.start
    covariance, attitude = start.covariance.copy(), start.attitude.copy()
    covariance[8, :8] = covariance[:8, 8] = 0.0
    covariance[8, 8] = sigma**2
    attitude[2] = wrap_angle(recording.initial_truth.attitude[0, 2] + off)
    return replace(recording, start=replace(start, attitude=attitude, covariance=covariance))


@pytest.mark.parametrize("sigma_deg", [20.0, 40.0, 100.0, 300.0])
def test_the_mixture_is_the_density_of_the_heading(sigma_deg: float):
    sigma = sigma_deg * DEG
    offsets, weights = initial_headings(sigma, 20.0 * DEG)
    assert weights.sum() == pytest.approx(1.0)
    assert np.all(np.abs(np.asarray(wrap_angle(np.diff(np.sort(offsets))))) <= 20.0 * DEG + 1e-9)
    if sigma_deg <= 40.0:  # not round the circle: moments of the mixture's centres
        assert weights @ offsets == pytest.approx(0.0, abs=1e-12)
        assert np.sqrt(weights @ offsets**2) == pytest.approx(sigma, rel=0.05)
    if sigma_deg == 300.0:
        np.testing.assert_allclose(weights, 1.0 / len(weights), rtol=1e-4)


def test_a_known_heading_makes_one_filter_the_ekf(recording_of, run_over):
    recording = recording_of(3, 30.0)
    expected, P = run_over(make("ekf"), recording)
    errors, Q = run_over(make("heading-bank"), recording)
    np.testing.assert_array_equal(errors, expected)
    np.testing.assert_array_equal(Q, P)


@pytest.mark.parametrize("off", [60.0, 120.0, 180.0, -90.0])
def test_it_finds_a_heading_that_is_far_off(recording_of, run_over, off: float):
    """Fixes and a DVL, MEMS-like; after 60 s the heading is known, and one filter is left."""
    recording = unknown(recording_of(7, 60.0, aids=(GNSS, DVL)), off * DEG, 104.0 * DEG)
    estimator = make("heading-bank")
    errors, P = run_over(estimator, recording)
    hypotheses = estimator.update(Measurements(60.0, 60.0, None, [])).diagnostics["hypotheses"]
    assert abs(errors[-1, 8]) < 3.0 * DEG
    assert abs(errors[-1, 8]) < 4.0 * np.sqrt(P[-1, 8, 8])
    assert hypotheses == 1.0
    assert np.hypot(*errors[-1, :2]) < 5.0


def test_what_is_left_is_the_filter_that_began_there(recording_of, monkeypatch: pytest.MonkeyPatch):
    """The bank's last filter gives what a Kalman filter gives that is told the same start."""
    recording = unknown(recording_of(7, 60.0, aids=(GNSS, DVL)), 120.0 * DEG, 104.0 * DEG)
    starts: dict[KalmanEstimator, InitialState] = {}

    def noted(self: KalmanEstimator, start: InitialState, instruments: Instruments) -> None:
        starts[self] = start
        reset(self, start, instruments)

    reset = KalmanEstimator.reset
    monkeypatch.setattr(KalmanEstimator, "reset", noted)
    estimator = make("heading-bank")
    estimator.reset(recording.start, recording.instruments)
    for packet in recording.steps():
        last = estimator.update(packet)
    assert last.diagnostics["hypotheses"] == 1.0
    alone = KalmanEstimator(InertialModel())
    alone.reset(starts[estimator.best], recording.instruments)
    for packet in recording.steps():
        expected = alone.update(packet)
    np.testing.assert_allclose(last.position, expected.position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(last.covariance, expected.covariance, rtol=1e-5, atol=1e-10)


def test_the_covariance_holds_the_spread_while_nothing_is_known(recording_of):
    recording = unknown(recording_of(7, 5.0, aids=(GNSS,)), 0.0, 104.0 * DEG)
    estimator = make("heading-bank")
    estimator.reset(recording.start, recording.instruments)
    estimate = estimator.update(next(iter(recording.steps())))
    assert np.sqrt(estimate.covariance[8, 8]) > 50.0 * DEG
    assert estimate.diagnostics["hypotheses"] > 10


def test_a_gross_error_does_not_decide(recording_of, run_over):
    recording = unknown(recording_of(7, 60.0, aids=(GNSS, DVL)), 120.0 * DEG, 104.0 * DEG)
    gnss = recording.data.aids["gnss"]
    gnss.value[2, 0] += 200.0 / 6.37e6
    errors, _ = run_over(make("heading-bank"), recording)
    assert abs(errors[-1, 8]) < 10.0 * DEG


@pytest.mark.parametrize(("name", "value"), [("above_deg", 0.0), ("spacing_deg", 0.5), ("spacing_deg", 120.0)])
def test_a_senseless_parameter_is_refused(name: str, value: float):
    with pytest.raises(ValueError, match=name):
        HeadingBank(InertialModel(), **{name: value})
