"""Sigma-point filters: linear problems, closed forms, the points of both models, consistency."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from simnav.estimator import EstimatorError, make
from simnav.estimators.adaptations.adkf import AdaptiveFactor
from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.adaptations.sage_husa import SageHusa
from simnav.estimators.models.base import Linearised
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_points import InertialPoints
from simnav.estimators.models.points import PointModel, draw_points
from simnav.estimators.models.ship_points import ShipPoints
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.sigma_point import SigmaPointEstimator
from simnav.geometry import earth, rotation
from simnav.types import (
    Datasheet,
    Estimate,
    InitialState,
    Instruments,
    Measurement,
    Measurements,
)
from tests.cases.closed_form import EVERY_KIND

DEG = np.pi / 180.0
#: alpha, beta, kappa: unscented of three kinds, and cubature.
SETS = {"default": (0.5, 2.0, 0.0), "narrow": (1e-2, 2.0, 0.0), "julier": (1.0, 0.0, 1.0), "cubature": (1.0, 0.0, 0.0)}
START = InitialState(0.0, np.zeros(3), np.zeros(3), np.zeros(3), np.eye(9))
GNSS = Datasheet("gnss", "gnss_position", 1.0, np.full(3, 1.0))
COMPASS = Datasheet("compass", "magnetic_compass", 2.0, np.array([0.5 * DEG]), bias=np.array([0.5 * DEG]))
METER = Datasheet("meter", "gnss_velocity", 1.0, np.full(3, 0.5))


class Linear(PointModel):
    """Four states, linear motion and one linear measurement."""

    size = 4
    F = np.array([[1.0, 0.5, 0.1, 0.0], [0.0, 0.9, 0.3, 0.0], [0.0, 0.0, 1.0, 0.2], [0.0, 0.0, 0.0, 0.8]])
    Q = np.diag([0.01, 0.02, 0.03, 0.5])
    H = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 1.0], [0.5, 0.0, 1.0, 0.0]])
    P0 = np.diag([1.0, 4.0, 0.0, 2.0]) + np.pad(np.full((2, 2), 0.3), (0, 2))
    R = 0.25 * np.eye(3)

    def begin(self, start, instruments):
        self.time, self.x = 0.0, np.arange(4.0)
        return self.P0.copy()

    def observes(self, instrument):
        return True

    def _advance(self, until):
        self.x, self.time = self.F @ self.x, until

    def propagate(self, covariance, until):
        if until > self.time:
            self._advance(until)
            covariance[:] = self.F @ covariance @ self.F.T + self.Q

    def propagate_points(self, errors, until):
        self._advance(until)
        errors[:] = errors @ self.F.T
        return self.Q

    def measure(self, measurement):
        return Linearised(measurement.value - self.H @ self.x, self.H, self.R)

    def observe_points(self, measurement, errors):
        return errors @ self.H.T

    def correct(self, dx):
        self.x = self.x + dx

    def estimate(self, covariance):
        return Estimate(self.time)


@pytest.mark.parametrize("numbers", SETS.values(), ids=SETS)
def test_a_linear_problem_is_the_kalman_filter_to_rounding(numbers):
    """Also with a state that is known exactly, and against the equations written out."""
    rng = np.random.default_rng(1)
    ours = SigmaPointEstimator(Linear(), **dict(zip(("alpha", "beta", "kappa"), numbers)))
    theirs = KalmanEstimator(Linear())
    for filter_ in (ours, theirs):
        filter_.reset(START, Instruments((METER,)))
    x, P = np.arange(4.0), Linear.P0.copy()
    for k in range(1, 31):
        z = rng.standard_normal(3)
        packet = Measurements(k - 1.0, float(k), None, [Measurement(float(k), "meter", METER.kind, z)])
        ours.update(packet), theirs.update(packet)
        x, P = Linear.F @ x, Linear.F @ P @ Linear.F.T + Linear.Q
        gain = P @ Linear.H.T @ np.linalg.inv(Linear.H @ P @ Linear.H.T + Linear.R)
        x, P = x + gain @ (z - Linear.H @ x), P - gain @ Linear.H @ P
        for filter_ in (ours, theirs):
            np.testing.assert_allclose(filter_.model.x, x, rtol=0, atol=1e-10)
            np.testing.assert_allclose(filter_.covariance, P, rtol=0, atol=1e-10)


class Listener(Adaptation):
    """Changes nothing, and keeps the innovation that a solver hands to adaptations."""

    heard: Innovation

    def adapt(self, innovation):
        self.heard = innovation
        return innovation.noise


def innovation_of(model: PointModel, value: np.ndarray, **numbers: float) -> Innovation:
    """What the filter finds in a measurement at the start of a run."""
    listener = Listener()
    estimator = SigmaPointEstimator(model, listener, **numbers)
    estimator.reset(START, Instruments((METER,)))
    estimator.update(Measurements(0.0, 0.0, None, [Measurement(0.0, "meter", METER.kind, value)]))
    return listener.heard


class Polar(Linear):
    """Range and bearing, seen in Cartesian axes."""

    size = 2

    def __init__(self, mean, sigma):
        self.mean, self.sigma = np.array(mean), np.array(sigma)

    def begin(self, start, instruments):
        self.time, self.x = 0.0, self.mean.copy()
        return np.diag(self.sigma**2)

    @staticmethod
    def cartesian(x):
        return np.stack([x[..., 0] * np.cos(x[..., 1]), x[..., 0] * np.sin(x[..., 1]), np.zeros(x[..., 0].shape)], -1)

    def measure(self, measurement):
        return Linearised(measurement.value - self.cartesian(self.x), np.zeros((3, 2)), np.eye(3))

    def observe_points(self, measurement, errors):
        return self.cartesian(self.x + errors) - self.cartesian(self.x)


@pytest.mark.parametrize("numbers", SETS.values(), ids=SETS)
def test_the_mean_of_polar_coordinates_in_closed_form(numbers):
    """E[r cos(b)] = r exp(-s^2/2); the points give r (1 + (cos(k s) - 1) / k^2) at k sigma, equal to fourth order."""
    r, bearing_sigma, range_sigma = 50.0, 0.25, 0.5
    model = Polar((r, 0.0), (range_sigma, bearing_sigma))
    innovation = innovation_of(model, np.zeros(3), **dict(zip(("alpha", "beta", "kappa"), numbers)))
    residual, covariance = innovation.residual, innovation.predicted
    alpha, _, kappa = numbers
    k = alpha * np.sqrt(2 + kappa)
    assert -residual[0] == pytest.approx(r * (1 + (np.cos(k * bearing_sigma) - 1) / k**2), rel=1e-9)
    assert residual[1] == pytest.approx(0.0, abs=1e-9)
    true_mean = r * np.exp(-0.5 * bearing_sigma**2)
    assert abs(-residual[0] - true_mean) < 1.05 * r * abs(k**2 - 3) / 24 * bearing_sigma**4 + r * bearing_sigma**6 / 100
    assert abs(-residual[0] - true_mean) < 0.15 * (r - true_mean)  # a linearised filter is off by all of it
    second = r**2 + range_sigma**2
    across = second * (1 - np.exp(-2 * bearing_sigma**2)) / 2
    assert covariance[1, 1] == pytest.approx(across, rel=0.08)


def test_the_moments_are_those_of_the_scaled_unscented_transform():
    """Against the textbook's weights, the centre's included; positive semi-definite where beta >= alpha^2."""
    rng = np.random.default_rng(0)
    n = 4
    for alpha, beta, kappa in [(0.5, 2.0, 0.0), (0.1, 2.0, 1.0), (1.0, 0.0, 0.0), (0.3, 0.09, -1.0)]:
        values = rng.standard_normal((2 * n, 3)) + 2.0
        model = Linear()
        model.observe_points = lambda measurement, errors, values=values: values
        found = innovation_of(model, Linear.H @ np.arange(4.0), alpha=alpha, beta=beta, kappa=kappa)
        mean, covariance = -found.residual, found.predicted
        lam = alpha**2 * (n + kappa) - n
        w = np.full(2 * n + 1, 0.5 / (n + lam))
        wc = w.copy()
        w[0] = lam / (n + lam)
        wc[0] = w[0] + 1 - alpha**2 + beta
        every = np.concatenate([np.zeros((1, 3)), values])
        expected = w @ every
        np.testing.assert_allclose(mean, expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(covariance, (wc * (every - expected).T) @ (every - expected), rtol=1e-8, atol=1e-8)
        assert np.linalg.eigvalsh(covariance)[0] >= -1e-9
        assert np.array_equal(covariance, covariance.T)


def test_points_reproduce_a_covariance_of_any_rank():
    rng = np.random.default_rng(2)
    for rank in (0, 2, 5):
        root = rng.standard_normal((5, rank)) * np.array([1e6, 1.0, 1e-3, 1e-9, 1.0])[:, None]
        P = np.ascontiguousarray(root @ root.T)
        points = np.full((10, 5), np.nan)
        draw_points(P, 1.7, points)
        assert np.array_equal(points[5:], -points[:5])
        scale = np.where(np.diag(P) > 0.0, np.sqrt(np.diag(P)), 1.0)
        np.testing.assert_allclose(
            points.T @ points / (2 * 1.7**2) / np.outer(scale, scale), P / np.outer(scale, scale), atol=1e-6
        )


def inertial(recording_of, kind: type[InertialModel]) -> InertialModel:
    recording = recording_of(3, 20.0, aids=())
    start = replace(recording.start, attitude=np.array([0.2, -0.15, 3.1]), velocity=np.array([3.0, -5.0, 0.4]))
    model = kind()
    P = model.begin(start, Instruments(EVERY_KIND, recording.instruments.imu))
    model.load(recording.data.imu)
    model.propagate(P, 7.004)
    rng = np.random.default_rng(5)
    model.bias += 1e-4 * rng.standard_normal(6)
    model.calibration += 0.01 * rng.standard_normal(model.size - 15)
    return model


def displaced(model: InertialModel, e: np.ndarray) -> None:
    """Give the state an error, by the definitions of the error and nothing else."""
    model.position[:] = earth.displace(model.position, e[:3])
    model.velocity += e[3:6]
    model.dcm[:] = rotation.dcm_from_rotation_vector(e[6:9]) @ model.dcm
    model.bias += e[9:15]
    model.calibration += e[15:]


def errors_of(a: InertialModel, b: InertialModel) -> np.ndarray:
    turn = rotation.rotation_vector_from_dcm(a.dcm @ b.dcm.T)
    position = earth.relative_position(a.position, b.position)
    return np.concatenate([position, a.velocity - b.velocity, turn, a.bias - b.bias, a.calibration - b.calibration])


def test_points_move_as_a_state_through_every_sample(recording_of):
    """Through equivalent samples, against the mechanization of each point at the IMU's rate; errors small and large."""
    rng = np.random.default_rng(8)
    sigma = np.concatenate([np.full(3, 10.0), np.full(3, 0.1), np.full(3, 1e-3), np.full(3, 1e-5), np.full(3, 1e-3)])
    center = inertial(recording_of, InertialPoints)
    sigma = np.concatenate([sigma, np.full(center.size - 15, 0.01)])
    errors = sigma * rng.standard_normal((6, center.size))
    errors[3, 6:9] = [0.3, -0.2, 1.5]  # a heading that is not known
    errors[4, 3:6] = [5.0, -3.0, 2.0]
    errors[5, :15] = 0.0
    before = errors.copy()
    noise = center.propagate_points(errors, 8.377)
    plain = inertial(recording_of, InertialModel)
    Q = np.zeros((plain.size, plain.size))
    plain.propagate(Q, 8.377)
    size = np.sqrt(np.diag(Q))
    within = size > 0.0
    scale = np.outer(size, size)[np.ix_(within, within)]
    np.testing.assert_allclose((noise - Q)[np.ix_(within, within)] / scale, 0.0, atol=2e-3)
    np.testing.assert_allclose(errors_of(center, plain), 0.0, atol=1e-6)  # pieces cut samples apart
    for e, expected_before in zip(errors, before):
        point = inertial(recording_of, InertialModel)
        displaced(point, expected_before)
        point.propagate(np.zeros_like(Q), 8.377)
        expected = errors_of(point, plain)
        for part in (slice(0, 3), slice(3, 6), slice(6, 9)):
            size = np.abs(expected_before[:9]).max() if part.start == 0 else np.abs(expected[part]).max()
            np.testing.assert_allclose(e[part], expected[part], atol=1e-4 * size + 1e-9)
        np.testing.assert_allclose(e[9:], expected[9:], rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("calibration", [False, True], ids=["navigation", "calibration"])
@pytest.mark.parametrize("sheet", EVERY_KIND, ids=lambda s: s.name)
def test_points_read_what_the_instrument_would(recording_of, sheet: Datasheet, calibration: bool):
    """Against the innovation at a state that is where the point is; a heading over the wrap among them.

    Products of calibration and navigation errors are left out, so one of the two is exact at a time; those of a log's
    scale factor and its current, too.
    """
    center = inertial(recording_of, InertialPoints)
    if not calibration:
        center.calibration[:] = 0.0
    value = {3: np.array([0.9, 0.1, 5.0]), 2: np.array([0.9, 0.1]), 1: np.array([3.0])}[len(sheet.sigma)]
    m = Measurement(7.0, sheet.name, sheet.kind, value)
    sigma = np.concatenate([np.full(3, 3.0), np.full(3, 1.0), np.full(3, 0.2), np.full(6, 1e-2)])
    sigma = np.concatenate([sigma, np.full(center.size - 15, 0.05)])
    sigma[slice(15) if calibration else slice(15, None)] = 0.0
    errors = sigma * np.random.default_rng(4).standard_normal((7, center.size))
    here = center.measure(m).innovation
    readings = center.observe_points(m, errors)
    for e, reading in zip(errors, readings):
        point = inertial(recording_of, InertialPoints)
        point.calibration[:] = center.calibration
        displaced(point, e)
        expected = here - point.measure(m).innovation
        if sheet.kind in ("magnetic_compass", "gyrocompass"):
            expected = rotation.wrap_angle(expected)
        # Positions: 600 km away in this test, where a metre of latitude changes the scale of the longitude.
        near = {"gnss": 2.0, "terrain": 2.0, "log": 0.01 if calibration else 1e-9}.get(sheet.name, 1e-9)
        np.testing.assert_allclose(reading, expected, atol=near)


SHIP = (
    *(s for s in EVERY_KIND if s.kind not in ("depth",)),
    Datasheet("fix", "gnss_position", 1.0, np.ones(3), bias=np.ones(3), lever_arm=np.array([2.0, -1.0, -8.0])),
)


def ship() -> ShipPoints:
    model = ShipPoints()
    start = InitialState(0.0, np.array([0.9, 0.1, 0.0]), np.array([3.0, 4.0, 0.0]), np.array([0, 0, 3.1]), np.eye(9))
    model.begin(start, Instruments(SHIP))
    rng = np.random.default_rng(5)
    model.x[2:] += 0.1 * rng.standard_normal(model.size - 2)
    return model


def test_ship_points_move_and_read_as_the_model_does():
    rng = np.random.default_rng(3)
    n = ship().size
    errors = np.concatenate([[30.0, 20.0, 1.0, 0.5, 0.02], np.full(n - 5, 0.2)]) * rng.standard_normal((5, n))
    at = np.array([0.9, 0.1, 0.0])
    for sheet in SHIP:
        value = np.concatenate([at[:2] + 1e-6, [1.0]])[: len(sheet.sigma)]
        m = Measurement(0.0, sheet.name, sheet.kind, value)
        center = ship()
        readings = center.observe_points(m, errors)
        for e, reading in zip(errors, readings):
            point = ship()
            point.correct(e)
            expected = center.measure(m).innovation - point.measure(m).innovation
            if sheet.kind in ("magnetic_compass", "gyrocompass"):
                expected = rotation.wrap_angle(expected)
            np.testing.assert_allclose(
                reading, expected, atol=1e-3 if sheet.name in ("gnss", "fix", "terrain") else 1e-9
            )
    moved = errors.copy()
    center = ship()
    noise = center.propagate_points(moved, 2.6)
    assert np.linalg.eigvalsh(noise)[0] > -1e-12
    for e, expected_before in zip(moved, errors):
        point = ship()
        point.correct(expected_before)
        point.propagate(np.zeros((n, n)), 2.6)
        position = earth.relative_position(point.position, center.position)[:2]
        np.testing.assert_allclose(e[:2], position, atol=2e-3)
        np.testing.assert_allclose(e[2:], (point.x - center.x)[2:], atol=1e-12)


class ByMethods(SigmaPointEstimator):
    """The filter whose functions are methods in Python."""

    def _kernels(self):
        return None


@pytest.mark.parametrize("adaptation", [None, SageHusa, AdaptiveFactor])
@pytest.mark.parametrize("model", [InertialPoints, ShipPoints])
def test_kernels_and_methods_are_the_same_filter(recording_of, model, adaptation):
    recording = recording_of(2, 40.0) if model is InertialPoints else recording_of(2, 40.0, aids=(GNSS, COMPASS))
    inflated = 0
    filters = [kind(model(), adaptation and adaptation()) for kind in (SigmaPointEstimator, ByMethods)]
    for estimator in filters:
        estimator.reset(recording.start, recording.instruments)
    assert [f._compiled for f in filters] == [True, False]
    for k, packet in enumerate(recording.steps()):
        if 20 <= k < 28:  # all at once: the motion is taken as wrong, and inflated
            wrong = [m._replace(value=m.value + (1e-4 if m.kind == "gnss_position" else 0.2)) for m in packet.aids]
            packet = replace(packet, aids=wrong)
        a, b = (estimator.update(packet) for estimator in filters)
        inflated += np.sum(filters[0]._arrays.fill(()).inflation != 1.0)
        assert a.diagnostics == pytest.approx(b.diagnostics, rel=1e-6, abs=1e-7, nan_ok=True)
        for state in filters[0].model.state:
            np.testing.assert_allclose(*(getattr(f.model, state) for f in filters), rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-6, atol=1e-10)
    assert (inflated > 0) == (model is InertialPoints and adaptation is AdaptiveFactor)


def test_points_of_another_kind_are_not_passed_over():
    with pytest.raises(TypeError, match="observe_points of its own; it has to say: fused = False"):
        type("Own", (InertialPoints,), {"observe_points": lambda self, measurement, errors: errors[:, :3]})


@pytest.fixture(scope="module")
def clean(recording_of):
    return [recording_of(seed, 60.0) for seed in range(20, 32)]


@pytest.mark.parametrize("name", ["ukf", "ckf"])
def test_on_clean_data_it_is_the_ekf_and_consistent(clean, run_over, name: str):
    """RMSE within 2% of the EKF's in position, velocity and attitude; ANEES in its 99.8% band."""
    squares, nees = {}, []
    for kind in ("ekf", name):
        every = []
        for recording in clean:
            errors, covariances = run_over(make(kind), recording)
            every.append(errors)
            if kind == name:
                for k in (29, 59):
                    nees.append(errors[k] @ np.linalg.solve(covariances[k], errors[k]))
        squares[kind] = np.sqrt(np.mean(np.array(every) ** 2, axis=(0, 1)))
    np.testing.assert_allclose(squares[name], squares["ekf"], rtol=0.02)
    last = np.array(nees[1::2])  # one a run: independent of each other
    low, high = stats.chi2.ppf([0.001, 0.999], 9 * len(last)) / len(last)
    assert low < last.mean() < high


def test_points_drawn_ten_times_as_often_gain_nothing(clean, run_over):
    """Once between measurements is enough: the estimates differ by less than a hundredth of their sigma."""

    class Often(SigmaPointEstimator):
        pieces = 0

        def functions(self):
            functions = super().functions()

            def propagate(dynamics, samples, until):
                while until - self.model.time > 0.1:
                    functions.propagate(dynamics, samples, self.model.time + 0.05)
                    self.pieces += 1
                functions.propagate(dynamics, samples, until)

            return functions.replaced(propagate=propagate)

    once, covariances = run_over(make("ukf"), clean[0])
    estimator = Often(InertialPoints())
    often, _ = run_over(estimator, clean[0])
    assert estimator.pieces > 500
    sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    assert np.abs((often - once) / sigma).max() < 0.01


def test_with_calibration_states_it_is_still_the_ekf(recording_of, run_over):
    aids = (
        Datasheet("gnss", "gnss_position", 1.0, np.array([1.5, 1.5, 3.0]), bias_instability=np.full(3, 1.0),
                  correlation_time=60.0, lever_arm=np.array([2.0, -1.0, -8.0])),
        Datasheet("dvl", "dvl", 1.0, np.full(3, 0.02), bias=np.full(3, 0.01), scale=0.01,
                  misalignment=np.full(3, 0.005), lever_arm=np.array([1.0, 0.5, 3.0])),
        Datasheet("compass", "magnetic_compass", 2.0, np.array([0.5 * DEG]), bias=np.array([0.5 * DEG])),
    )  # fmt: skip
    recording = recording_of(7, 90.0, aids=aids)
    reference, P = run_over(make("ekf"), recording)
    for name in ("ukf", "ckf"):
        errors, covariances = run_over(make(name), recording)
        sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
        assert np.abs((errors - reference) / sigma).max() < 0.1
        np.testing.assert_allclose(np.diagonal(covariances, axis1=1, axis2=2), sigma**2, rtol=0.05)


@pytest.mark.parametrize("off", [60.0, -80.0])
def test_a_heading_hardly_known_is_found(recording_of, run_over, off: float):
    """A heading wrong by 60 or 80 degrees, its sigma 45: the attitude's points are rotations, not angles."""
    aids = (
        Datasheet("gnss", "gnss_position", 1.0, np.full(3, 1.0)),
        Datasheet("gnss_velocity", "gnss_velocity", 1.0, np.full(3, 0.1)),
    )
    sigmas = np.array([2.0, 2.0, 3.0, 0.2, 0.2, 0.2, 0.1 * DEG, 0.1 * DEG, 45 * DEG])
    recording = recording_of(4, 90.0, aids=aids, sigmas=sigmas)
    attitude = recording.initial_truth.attitude[0] + [0.0, 0.0, off * DEG]
    recording = replace(recording, start=replace(recording.start, attitude=attitude))
    errors, covariances = run_over(make("ukf"), recording)
    assert np.all(np.abs(errors[:, 8]) < 3.0 * np.sqrt(covariances[:, 8, 8]))
    assert abs(errors[-1, 8]) < 4 * DEG


@pytest.mark.parametrize("bad", [{"alpha": 0.0}, {"alpha": float("nan")}, {"alpha": -1.0}])
def test_a_scale_that_means_nothing(bad):
    with pytest.raises(EstimatorError, match="alpha"):
        make("ukf", **bad)


def test_kappa_below_minus_n(recording_of):
    recording = recording_of(1, 10.0)
    with pytest.raises(ValueError, match="kappa"):
        make("ukf", kappa=-15.0).reset(recording.start, recording.instruments)
