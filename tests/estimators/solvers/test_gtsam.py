"""GTSAM's rows: factors by finite differences, preintegration against the strapdown, solvers against each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav import inverse_strapdown
from simnav.estimator import make
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.gtsam_graph import InertialGraph
from simnav.estimators.solvers.gtsam_solvers import FixedLagEstimator
from simnav.estimators.solvers.tangent_frame import GeodeticState, TangentFrame
from simnav.geometry import earth, rotation
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.types import (
    Datasheet,
    ImuDatasheet,
    ImuSamples,
    InitialState,
    Instruments,
    Measurement,
    TriadDatasheet,
)

gtsam = pytest.importorskip("gtsam")

ARM = np.array([3.0, -1.0, -8.0])
#: One of each kind, with what it might read in the state below.
KINDS = {
    "gnss_position": (3.0, np.array([0.9 + 2e-7, 0.1 - 3e-7, 7.0])),
    "gnss_velocity": (0.1, np.array([5.0, 4.0, 0.1])),
    "dvl": (0.05, np.array([6.5, 0.1, -0.2])),
    "magnetic_compass": (0.02, np.array([0.7])),
    "gyrocompass": (0.01, np.array([0.75])),
    "speed_log": (0.1, np.array([6.0])),
    "depth": (0.3, np.array([-2.0])),
    "terrain_fix": (10.0, np.array([0.9 + 1e-6, 0.1 - 1e-6])),
}
IMU = ImuDatasheet(
    100.0,
    TriadDatasheet(bias=5e-6, random_walk=1e-5, rate_random_walk=1e-8),
    TriadDatasheet(bias=2e-3, random_walk=5e-4, rate_random_walk=1e-5),
)


def seaway(duration: float, rate: float = 100.0) -> tuple[np.ndarray, ImuSamples, np.ndarray, np.ndarray, np.ndarray]:
    """Times, perfect samples, positions, velocities and attitudes of a ship that rolls by 11 degrees."""
    t = np.arange(round(duration * rate) + 1) / rate
    yaw = 0.7 + 0.3 * np.sin(t / 5.0)
    rpy = np.stack([0.2 * np.sin(0.7 * t), 0.1 * np.sin(0.9 * t + 1.0), yaw], axis=1)
    velocity = np.stack([8.0 * np.cos(yaw), 8.0 * np.sin(yaw), np.sin(0.8 * t)], axis=1)
    samples, position = inverse_strapdown.increments(t, np.array([0.9, 0.1, 5.0]), velocity, rpy)
    return t, samples, position, velocity, rpy


def begun(samples: ImuSamples, velocity: np.ndarray, rpy: np.ndarray, aids: list[Datasheet]) -> InertialGraph:
    """A graph at the start, its samples loaded."""
    P = np.diag([4.0, 4.0, 9.0, 0.01, 0.01, 0.01, 1e-6, 1e-6, 1e-4])
    graph = InertialGraph()
    graph.begin(InitialState(0.0, np.array([0.9, 0.1, 5.0]), velocity[0], rpy[0], P), Instruments(aids, IMU))
    graph.motion.load(samples)
    return graph


def attitude_error(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rotation vector of C_a C_b'."""
    turn = rotation.dcm_from_rpy(a) @ np.swapaxes(rotation.dcm_from_rpy(b), -1, -2)
    return rotation.rotation_vector_from_dcm(turn)


@pytest.mark.parametrize("position", [(0.9, 0.1, 20.0), (0.91, 0.12, -3000.0), (-0.5, 3.1, 8000.0), (0.0, -3.14, 0.0)])
def test_the_frame_and_back(position: tuple[float, float, float]):
    frame = TangentFrame(np.array([0.9, 0.1, 20.0]))
    there = np.array(position)
    back = frame.state(np.eye(3), frame.local(there), np.zeros(3)).position
    np.testing.assert_allclose(back[:2], there[:2], atol=1e-14)
    np.testing.assert_allclose(back[2], there[2], atol=1e-8)


def test_neighbours_in_the_frame_are_north_and_east_of_each_other():
    a = np.array([0.7, -0.3, 50.0])
    offset = np.array([30.0, -20.0, 5.0])
    frame = TangentFrame(a)
    np.testing.assert_allclose(frame.local(earth.displace(a, offset)), offset, atol=2e-3)


def test_gravity_in_the_frame_lacks_the_centrifugal_acceleration_about_the_origin():
    a = np.array([0.7, -0.3, 50.0])
    frame = TangentFrame(a)
    np.testing.assert_allclose(frame.gravity(np.zeros(3)), [0.0, 0.0, earth.gravity(0.7, 50.0)], atol=1e-12)
    b = np.array([0.71, -0.28, 50.0])
    there, w = frame.local(b), frame.rotation
    full = frame.gravity(there) - np.cross(w, np.cross(w, there))
    np.testing.assert_allclose(full, frame.turn(b) @ [0.0, 0.0, earth.gravity(0.71, 50.0)], atol=1e-12)


def test_the_error_map_is_the_derivative_of_the_conversion():
    frame = TangentFrame(np.array([0.9, 0.1, 20.0]))
    R = rotation.dcm_from_rpy(np.array([0.1, 0.2, 2.0]))
    place, speed = frame.local(np.array([0.901, 0.102, 5.0])), np.array([3.0, -4.0, 0.5])

    def state(step: np.ndarray) -> GeodeticState:
        return frame.state(R @ rotation.dcm_from_rotation_vector(step[:3]), place + R @ step[3:6], speed + step[6:])

    p0, v0, c0, error_map = state(np.zeros(9))
    for j, h in enumerate([1e-3] * 3 + [100.0] * 3 + [1.0] * 3):
        ends = []
        for sign in (h, -h):
            p, v, c, _ = state(sign * np.eye(9)[j])
            phi = rotation.rotation_vector_from_dcm(c @ c0.T)
            ends.append(np.concatenate([earth.relative_position(p, p0), v - v0, phi]))
        numeric = (ends[0] - ends[1]) / (2.0 * h)
        # 1e-13 rad/m is a millionth of the turn of the axes with the place.
        np.testing.assert_allclose(error_map[:6, j], numeric[:6], atol=1e-9)
        np.testing.assert_allclose(error_map[6:, j], numeric[6:], atol=1e-13 if 3 <= j < 6 else 1e-9)


@pytest.mark.parametrize("ends", [(1.0,), (0.333, 0.3371, 1.0)])
def test_a_second_of_preintegration_is_the_strapdowns(ends: tuple[float, ...]):
    """A noise-free second in a seaway, in one factor or with nodes between samples."""
    _, samples, position, velocity, rpy = seaway(3.0)
    graph = begun(samples, velocity, rpy, [])
    for end in ends:
        graph.motion.advance(end)
        if end != ends[-1]:
            graph.extend()
    p, v, a = graph.navigation(graph.motion.predict())
    assert np.abs(earth.relative_position(p, position[100])).max() < (1e-5 if len(ends) == 1 else 1e-4)
    assert np.abs(v - velocity[100]).max() < (1e-6 if len(ends) == 1 else 1e-5)
    assert np.abs(attitude_error(a, rpy[100])).max() < 1e-8 if len(ends) == 1 else 1e-6


def test_the_imu_factor_is_satisfied_by_the_motion():
    _, samples, _, velocity, rpy = seaway(3.0)
    graph = begun(samples, velocity, rpy, [])
    state, bias = graph.motion.state, graph.motion.bias
    values = graph.values(0, state, bias)
    graph.motion.advance(1.0)
    factor, end = graph.extend()
    values.insert(end)
    assert factor.error(values) < 1e-12
    # Half a sigma of the accelerometers' noise more in the velocity: 50 ug for a second.
    values.update(graph.keys(1)[1], values.atPoint3(graph.keys(1)[1]) + np.array([0.0, 0.0, 5e-4]))
    assert 0.1 < factor.error(values) < 10.0


@pytest.mark.parametrize("seconds", [1.0, 10.0])
def test_motion_spreads_errors_as_the_inertial_model_does(seconds: float):
    """Transition and process noise, in one factor: sigmas within 0.5 %, gravity's gradient being left out."""
    _, samples, position, velocity, rpy = seaway(12.0)
    graph = begun(samples, velocity, rpy, [])
    estimate = None
    covariance = graph.start_covariance
    graph.motion.advance(seconds)
    estimate = graph.estimate(covariance)
    model = InertialModel(calibrate=False)
    P = np.diag([4.0, 4.0, 9.0, 0.01, 0.01, 0.01, 1e-6, 1e-6, 1e-4])
    start = InitialState(0.0, position[0], velocity[0], rpy[0], P)
    expected = model.begin(start, Instruments([], IMU))
    model.load(samples)
    model.propagate(expected, seconds)
    scale = np.sqrt(np.diag(expected)[:9])
    np.testing.assert_allclose(
        estimate.covariance / np.outer(scale, scale), expected[:9, :9] / np.outer(scale, scale), atol=5e-3
    )


@pytest.mark.parametrize("bias_size", [1e-3, 0.981], ids=["usual bias", "0.1 g"])
@pytest.mark.parametrize("lever", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_aiding_factors_against_finite_differences(kind: str, lever: bool, bias_size: float):
    sigma, value = KINDS[kind]
    sheet = Datasheet("aid", kind, 1.0, np.array(sigma), lever_arm=ARM if lever else np.zeros(3))
    _, samples, _, velocity, rpy = seaway(2.0)
    graph = begun(samples, velocity, rpy, [sheet])
    graph.motion.advance(0.7)
    measurement = Measurement(0.7, "aid", kind, value)
    linearised = graph.linearise(measurement)
    assert linearised is not None
    _, values = graph.extend()
    gyroscope = min(bias_size / 10.0, np.radians(1.0)) * np.array([1.0, 2.0, -3.0])
    bias = gtsam.imuBias.ConstantBias(bias_size * np.array([1.0, -2.0, 3.0]), gyroscope)
    factor = graph.aid(graph.observe(measurement, linearised.noise))
    # The error is prediction less measurement; of GNSS positions in the axes of the frame, all but those of the place.
    np.testing.assert_allclose(factor.unwhitenedError(values), -linearised.innovation, atol=2e-5)

    values.update(graph.keys(1)[2], bias)
    jacobian, right = factor.linearize(values).jacobian()
    zero = values.zeroVectors()
    column = 0
    for key in list(factor.keys()):
        for j in range(zero.at(key).size):
            h = 1e-5 if gtsam.Symbol(key).chr() != ord("x") or j < 3 else 1.0
            ends = []
            for sign in (h, -h):
                step = values.zeroVectors()
                step.update(_vector(step, key, sign * np.eye(zero.at(key).size)[j]))
                ends.append(factor.whitenedError(values.retract(step)))
            numeric = (ends[0] - ends[1]) / (2.0 * h)
            # Left out: how the Earth's rate turns with the attitude over the lever arm, and radii with the latitude.
            tolerance = (1e-4 if lever else 2e-5) * np.abs(jacobian).max()
            np.testing.assert_allclose(jacobian[:, column], numeric, atol=tolerance, rtol=1e-4)
            column += 1
    np.testing.assert_allclose(right, -factor.whitenedError(values), atol=1e-9)


def _vector(like: object, key: int, value: np.ndarray) -> object:
    """VectorValues with one entry."""
    vectors = gtsam.VectorValues()
    vectors.insert(key, value)
    return vectors


# Solvers --------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def clean(recording_of) -> Recording:
    """A minute at sea."""
    return recording_of(0, 60.0)


def test_the_fixed_lag_smoother_is_the_filter_on_clean_data(clean: Recording, run_over):
    """Within centimetres: it linearises anew, its biases walk instead of decaying."""
    expected, P = run_over(make("ekf", calibrate=False), clean)
    found, Q = run_over(make("gtsam-fixed-lag"), clean)
    assert np.abs(found[10:, :3] - expected[10:, :3]).max() < 0.05
    assert np.abs(found[10:, 3:6] - expected[10:, 3:6]).max() < 0.01
    sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))[10:]
    np.testing.assert_allclose(np.sqrt(np.diagonal(Q, axis1=1, axis2=2))[10:] / sigma, 1.0, atol=0.08)


def test_isam2_ends_where_the_batch_does(clean: Recording, run_over):
    isam2, batch = make("gtsam-isam2", threshold=0.1), make("gtsam-batch")
    run_over(isam2, clean)
    run_over(batch, clean)
    a, b = isam2.smooth(), batch.smooth()
    np.testing.assert_array_equal(a.time, clean.data.truth.time)
    np.testing.assert_array_equal(b.time, clean.data.truth.time)
    assert np.abs(earth.relative_position(a.position, b.position)).max() < 1e-3
    assert np.abs(a.velocity - b.velocity).max() < 1e-4
    assert np.abs(attitude_error(a.attitude, b.attitude)).max() < 1e-5
    truth = clean.data.truth
    smoothed = np.sqrt(np.mean(earth.relative_position(b.position, truth.position) ** 2))
    assert smoothed < 0.35  # fixes of 1.5 and 3 m


def test_graduated_non_convexity_leaves_outliers_out(clean: Recording, run_over):
    """Positions 30 m off and DVL readings 1 m/s off: the batch believes them, its robust twin finds every one."""
    gnss, dvl = clean.data.aids["gnss"], clean.data.aids["dvl"]
    position, speed = gnss.value.copy(), dvl.value.copy()
    position[3::7, 0] += 30.0 / 6.37e6
    speed[4::9, 1] += 1.0
    aids = {**clean.data.aids, "gnss": replace(gnss, value=position), "dvl": replace(dvl, value=speed)}
    bad = replace(clean, data=replace(clean.data, aids=aids))
    rmse = {}
    for name in ("gtsam-batch", "gtsam-gnc"):
        estimator = make(name)
        run_over(estimator, bad)
        smoothed = estimator.smooth()
        rmse[name] = np.sqrt(np.mean(earth.relative_position(smoothed.position, clean.data.truth.position)[:, :2] ** 2))
    assert rmse["gtsam-batch"] > 2.0
    assert rmse["gtsam-gnc"] < 0.4
    out = {(name, round(time, 3)) for name, time, weight in estimator.weights if weight < 0.5}
    spoiled = {("gnss", round(t, 3)) for t in gnss.time[3::7]} | {("dvl", round(t, 3)) for t in dvl.time[4::9]}
    assert spoiled <= out
    assert len(out - spoiled) < 0.05 * len(estimator.weights)


def test_its_covariance_is_honest():
    """Six runs of the matched model: ANEES in a wide band."""
    nees = []
    for seed in range(6):
        recording = record(load("open-sea").model_copy(update={"duration": 40.0}), seed)
        estimator = make("gtsam-fixed-lag", window=5)
        estimator.reset(recording.start, recording.instruments)
        for k, packet in enumerate(recording.steps()):
            out, truth = estimator.update(packet), recording.data.truth
            if k < 5:
                continue
            e = np.concatenate([
                earth.relative_position(out.position, truth.position[k]),
                out.velocity - truth.velocity[k],
                attitude_error(out.attitude, truth.attitude[k]),
            ])  # fmt: skip
            nees.append(e @ np.linalg.solve(out.covariance, e) / 9.0)
    assert 0.6 < np.mean(nees) < 1.6


@pytest.mark.parametrize("name", ["gtsam-fixed-lag", "gtsam-isam2"])
def test_minutes_without_aids_or_imu(name: str):
    """Two minutes without any aid, then 10 s without IMU: errors stay within what the covariance says, as the EKF's."""
    whole = record(load("open-sea").model_copy(update={"duration": 240.0}), 2)
    aids = {}
    for key, stream in whole.data.aids.items():
        left = (stream.time < 30.0) | (stream.time > 150.0)
        rows = {n: getattr(stream, n)[left] for n in ("time", "value", "faults", "fault_error", "sigma")}
        aids[key] = replace(stream, **rows)
    imu = whole.data.imu
    left = (imu.time <= 200.0) | (imu.time > 210.0)
    samples = ImuSamples(imu.time[left], imu.interval[left], imu.angular_rate[left], imu.specific_force[left])
    recording = replace(whole, data=replace(whole.data, aids=aids, imu=samples))
    estimates = {}
    for row, parameters in (("ekf", {"calibrate": False}), (name, {})):
        estimator = make(row, **parameters)
        estimator.reset(recording.start, recording.instruments)
        estimates[row] = [estimator.update(p) for p in recording.steps()]
    found, expected = estimates[name], estimates["ekf"]
    assert found[-1].diagnostics["restarts"] == 0.0
    for k in (29, 90, 149, 160, 199, 230, 239):
        sigma, reference = (np.sqrt(np.diag(e[k].covariance))[:3] for e in (found, expected))
        np.testing.assert_allclose(sigma / reference, 1.0, atol=0.1)
        error = earth.relative_position(found[k].position, recording.data.truth.position[k])
        assert np.all(np.abs(error) < 4.0 * sigma), k


# Failure --------------------------------------------------------------------------------------------------------------


class Failing(FixedLagEstimator):
    """Its solver gives up at times."""

    def __init__(self, fails):
        super().__init__(window=5)
        self.fails, self.calls = fails, 0

    def update(self, measurements):
        estimate = super().update(measurements)
        self.diagnostics = estimate.diagnostics
        return estimate

    def _solve(self, factors, values):
        self.calls += 1
        if self.fails(self.calls):
            raise RuntimeError("\nIndeterminate linear system detected while working near variable x1")
        return super()._solve(factors, values)


def test_a_solver_that_fails_begins_again(clean: Recording, run_over):
    """Once, with all measurements kept; twice running, without those of the step."""
    expected, _ = run_over(FixedLagEstimator(window=5), clean)
    for failures, skipped in (((30,), 0.0), ((30, 31), 6.0)):
        estimator = Failing(failures.__contains__)
        errors, covariances = run_over(estimator, clean)
        assert estimator.diagnostics["restarts"] == 1
        assert estimator.diagnostics["skipped"] == skipped
        assert np.abs(errors[-1, :3] - expected[-1, :3]).max() < 0.1
        assert np.isfinite(covariances).all()


def test_a_solver_that_never_succeeds_says_so(clean: Recording):
    estimator = Failing(lambda call: call > 1)
    estimator.reset(clean.start, clean.instruments)
    with pytest.raises(
        RuntimeError, match=r"^GTSAM has no solution at 1 s, not even without aids: Indeterminate linear"
    ):
        estimator.update(next(clean.steps()))


@pytest.mark.parametrize(
    ("name", "parameters", "sentence"),
    [
        ("gtsam-fixed-lag", {"window": 1}, "window is a number of epochs: at least 2, not 1"),
        ("gtsam-fixed-lag", {"threshold": -1.0}, "0 or more, not -1"),
        ("gtsam-isam2", {"iterations": 0}, "at least 1, not 0"),
        ("gtsam-batch", {"most": 0}, "at least 1, not 0"),
        ("gtsam-gnc", {"probability": 1.0}, "between 0 and 1, not 1"),
        ("gtsam-gnc", {"loss": "huber"}, "is one of tls, gm, not 'huber'"),
    ],
)
def test_parameters_that_make_no_sense(name: str, parameters: dict, sentence: str):
    with pytest.raises(ValueError, match=sentence):
        make(name, **parameters)
