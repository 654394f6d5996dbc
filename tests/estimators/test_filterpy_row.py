"""The row of filterpy's filter against our own over the same model, and what is wrong with its cubature filter."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import UnsuitableScenario, make
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.types import Datasheet, Instruments

DEG = np.pi / 180.0


@pytest.fixture(scope="module")
def voyage() -> Recording:
    """Ten minutes of the ship, with a turn and an outage of GNSS."""
    return record(load("ship-dead-reckoning").model_copy(update={"duration": 600.0}), 4)


#: Horizontal position [m], velocity [m/s], heading [rad]: a hundredth of their sigma, over outage and turn.
TOLERANCE = np.array([0.04, 0.04, 0.0, 2e-3, 2e-3, 0.0, 0.0, 0.0, 5e-5])
USED = [0, 1, 3, 4, 8]


@pytest.mark.parametrize("ours", ["ship-ekf", "ship-ukf"])
def test_it_agrees_with_our_filters(voyage: Recording, run_over, ours: str):
    """Same model, same noise, same points: within 4 cm, 2 mm/s and 0.003 degrees, and 1% in sigma."""
    theirs, P = run_over(make("filterpy-ukf"), voyage)
    errors, covariances = run_over(make(ours), voyage)
    assert np.all(np.abs(theirs - errors)[:, USED] < TOLERANCE[USED])
    ratio = np.diagonal(P, axis1=1, axis2=2) / np.diagonal(covariances, axis1=1, axis2=2)
    np.testing.assert_allclose(ratio[:, USED], 1.0, atol=0.02)


def test_with_every_kind_of_instrument_that_the_model_knows(recording_of, run_over):
    """Vectors and angles, biases and scale, asynchronous; headings across the wrap."""
    aids = (
        Datasheet("gnss", "gnss_position", 1.0, np.array([1.5, 1.5, 3.0]), bias_instability=np.full(3, 1.0),
                  correlation_time=60.0, lever_arm=np.array([2.0, -1.0, -8.0])),
        Datasheet("gnss_velocity", "gnss_velocity", 1.0, 0.1 * np.ones(3), phase=0.25),
        Datasheet("dvl", "dvl", 1.0, 0.02 * np.ones(3), phase=0.333, lever_arm=np.array([1.0, 0.5, 3.0])),
        Datasheet("compass", "magnetic_compass", 2.0, np.array([1.0 * DEG]), bias=np.array([0.5 * DEG])),
        Datasheet("log", "speed_log", 1.0, np.array([0.05]), scale=0.01),
    )  # fmt: skip
    recording = recording_of(3, 60.0, aids=aids, imu=None, sea=0.0)
    theirs, _ = run_over(make("filterpy-ukf"), recording)
    errors, covariances = run_over(make("ship-ukf"), recording)
    sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    assert np.abs((theirs - errors) / sigma)[:, USED].max() < 0.02


def test_what_it_needs():
    gnss = Datasheet("gnss", "gnss_position", 1.0, np.ones(3))
    compass = Datasheet("compass", "gyrocompass", 1.0, np.ones(1))
    for aids, lacks in (((gnss,), "compass"), ((compass,), "GNSS")):
        with pytest.raises(UnsuitableScenario, match=lacks):
            make("filterpy-ukf").reset(None, Instruments(aids))


def test_the_cubature_filter_of_filterpy_lacks_the_process_noise():
    """P = 2, Q = 10, R = 1, H = 1: the innovation's covariance is 13. A failure means that filterpy is mended."""
    from filterpy.kalman import CubatureKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

    def same(x: np.ndarray, dt: float = 1.0) -> np.ndarray:
        return np.array(x)

    points = MerweScaledSigmaPoints(1, 0.5, 2.0, 0.0)
    filters = {
        "cubature": CubatureKalmanFilter(1, 1, 1.0, hx=same, fx=same),
        "unscented": UnscentedKalmanFilter(1, 1, 1.0, hx=same, fx=same, points=points),
    }
    found = {}
    for name, kf in filters.items():
        kf.P, kf.Q, kf.R = np.array([[2.0]]), np.array([[10.0]]), np.array([[1.0]])
        kf.predict()
        kf.update(np.array([0.0]) if name == "unscented" else np.array([[0.0]]))
        found[name] = float(np.squeeze(kf.S))
    assert found["unscented"] == pytest.approx(13.0)
    assert found["cubature"] == pytest.approx(3.0)
