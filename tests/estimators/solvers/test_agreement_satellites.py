"""Our tightly coupled window and GTSAM's (`tests.cases.gtsam_channels`): two independent solvers, one estimate.

They share the datasheets and the prediction of a reading; all else is separate, as in ``test_agreement.py``. They agree
to fractions of a millimetre horizontally. In height, and in the clock that goes with it, they agree to millimetres:
that is what GTSAM's one gravity vector a factor is worth while the height is uncertain by metres.
"""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import Estimator, make
from simnav.estimators.solvers.gtsam_solvers import FixedLagEstimator
from simnav.geometry import earth, rotation
from simnav.recording import Recording
from simnav.source import record
from simnav.types import Datasheet, Estimate, Instruments
from tests.cases.gtsam_channels import ChannelFixedLag, ChannelGraph
from tests.cases.raw_gnss import raw_gnss

gtsam = pytest.importorskip("gtsam")


@pytest.fixture(scope="module")
def recording() -> Recording:
    """From an aligned start: priors of the two are linear in different errors (``test_agreement.py``)."""
    scenario = raw_gnss(16.0)
    aligned = scenario.initial_error.model_copy(update={"attitude": tuple(np.deg2rad([0.01, 0.01, 0.05]))})
    return record(scenario.model_copy(update={"initial_error": aligned}), 1)


def run(estimator: Estimator, recording: Recording) -> list[Estimate]:
    estimator.reset(recording.start, recording.instruments)
    return [estimator.update(packet) for packet in recording.steps()]


def test_the_windows_agree(recording: Recording):
    """To a hundredth of a sigma, in states and blocks; sigmas to a thousandth."""
    ours = run(make("sw-fgo", window=6, tolerance=1e-9, iterations=20), recording)
    theirs = run(ChannelFixedLag(window=6, threshold=0.0, iterations=3), recording)
    for a, b in zip(ours, theirs, strict=True):
        apart = earth.relative_position(b.position, a.position)
        assert np.abs(apart[:2]).max() < 1e-3
        assert np.abs(apart[2]) < 1e-2
        turn = rotation.dcm_from_rpy(b.attitude) @ rotation.dcm_from_rpy(a.attitude).T
        error = np.concatenate([apart, b.velocity - a.velocity, rotation.rotation_vector_from_dcm(turn)])
        sigma = np.sqrt(np.diag(a.covariance))
        assert np.abs(error / sigma).max() < 0.01
        np.testing.assert_allclose(
            b.covariance / np.outer(sigma, sigma), a.covariance / np.outer(sigma, sigma), atol=2e-3
        )
        assert a.states.keys() == b.states.keys()
        assert {"gnss.clock", "gnss.troposphere", "gnss.ionosphere", "gnss.signals"} == a.states.keys()
        for name, (value, spread) in a.states.items():
            assert np.abs((b.states[name][0] - value) / spread).max() < 0.01, name
            np.testing.assert_allclose(b.states[name][1], spread, rtol=1e-3)
    # The clock moves by its drift in each second: there is something to agree on.
    clock = np.array([a.states["gnss.clock"][0][0] for a in ours])
    assert np.ptp(clock) > 1.0


def test_the_row_of_gtsam_leaves_satellites_out(recording: Recording):
    """What its documentation says: with nothing else, it is inertial navigation."""
    alone = Instruments([Datasheet("depth", "depth", 1.0, np.array(0.1))], recording.instruments.imu, 1.0)
    with_satellites = run(FixedLagEstimator(window=6), recording)
    inertial = FixedLagEstimator(window=6)
    inertial.reset(recording.start, alone)
    for a, packet in zip(with_satellites, recording.steps(), strict=True):
        b = inertial.update(packet)
        np.testing.assert_array_equal(a.position, b.position)
        np.testing.assert_array_equal(a.covariance, b.covariance)


def test_a_factor_of_all_readings_against_finite_differences(recording: Recording):
    estimator = ChannelFixedLag()
    estimator.reset(recording.start, recording.instruments)
    graph = estimator.tight
    packet = next(recording.steps())
    graph.motion.load(packet.imu)
    graph.motion.advance(packet.time)
    readings = estimator._admission.admit(packet, 0.0)
    assert len(readings) == 8
    _, values = graph.extend()
    factor = graph.aids(readings)
    jacobian, right = factor.linearize(values).jacobian()
    zero, column = values.zeroVectors(), 0
    for key in list(factor.keys()):
        kind, size = chr(gtsam.Symbol(key).chr()), zero.at(key).size
        for j in range(size):
            h = 1.0 if kind == "x" and j >= 3 else 1e-3
            ends = [whitened(graph, readings, values, key, sign * h * np.eye(size)[j]) for sign in (1.0, -1.0)]
            numeric = (ends[0] - ends[1]) / (2.0 * h)
            if kind == "b":  # a window leaves out how the swing of the antenna depends on the gyroscopes' bias
                assert not jacobian[:, column].any()
            else:
                # Left out: how the Earth's rate turns with the attitude over the lever arm, and axes with the place.
                left = earth.ROTATION_RATE * 12.4 / 0.05 if kind == "x" and j < 3 else 5e-5
                np.testing.assert_allclose(jacobian[:, column], numeric, rtol=1e-4, atol=left)
            column += 1
    np.testing.assert_allclose(right, -factor.whitenedError(values), atol=1e-9)


def whitened(graph: ChannelGraph, readings: list, values: object, key: int, step: np.ndarray) -> np.ndarray:
    """The whitened errors of readings after a step of one variable."""
    moved = gtsam.VectorValues()
    zero = values.zeroVectors()
    for other in list(values.keys()):
        moved.insert(other, step if other == key else np.zeros(zero.at(other).size))
    return graph.aids(readings).whitenedError(values.retract(moved))
