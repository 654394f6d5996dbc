"""The inertial model against finite differences and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimators.models.covariance_propagation import propagate_covariance
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.propagation import HELD_VELOCITY
from simnav.geometry import earth, rotation
from simnav.scenario import load
from simnav.simulation.simulator import ideal
from simnav.types import Datasheet, ImuDatasheet, ImuSamples, InitialState, Instruments, Measurement, TriadDatasheet
from tests.cases.closed_form import EVERY_KIND

DEG = np.pi / 180.0


def perturbed(model: InertialModel, e: np.ndarray) -> InertialModel:
    """The same model with an error added: estimate = truth + e, by the definitions of the error and nothing else."""
    other = InertialModel()
    nowhere = InitialState(0.0, np.zeros(3), np.zeros(3), np.zeros(3), np.zeros((9, 9)))
    other.begin(nowhere, model.instruments)
    other.take_over(model)
    other.position[:] = earth.displace(model.position, e[:3])
    other.velocity += e[3:6]
    other.dcm[:] = rotation.dcm_from_rotation_vector(e[6:9]) @ model.dcm
    other.bias += e[9:15]
    other.calibration += e[15:]
    return other


def difference(a: InertialModel, b: InertialModel) -> np.ndarray:
    """Error of a with respect to b, by its definition."""
    return np.concatenate(
        [
            earth.relative_position(a.position, b.position),
            a.velocity - b.velocity,
            rotation.rotation_vector_from_dcm(a.dcm @ b.dcm.T),
            a.bias - b.bias,
            a.calibration - b.calibration,
        ]
    )


#: Attitude, velocity, and size of the biases: as usual, and as a poor start and a cheap IMU bring about.
STATES = {
    "usual": ([0.2, -0.15, 2.5], [3.0, -5.0, 0.4], np.full(6, 1e-4)),
    "large": ([0.5, -0.5, 2.5], [8.0, -6.0, 2.0], np.repeat([np.radians(1.0), 0.981], 3)),
}


@pytest.fixture(params=list(STATES))
def model(recording_of, request) -> InertialModel:
    """A model in the middle of a voyage, turning and pitching, with biases."""
    attitude, velocity, bias = STATES[request.param]
    recording = recording_of(3, 20.0, aids=())
    start = replace(recording.start, attitude=np.array(attitude), velocity=np.array(velocity))
    m = InertialModel()
    P = m.begin(start, Instruments(EVERY_KIND, recording.instruments.imu))
    m.load(recording.data.imu)
    m.propagate(P, 7.004)
    rng = np.random.default_rng(5)
    m.bias += bias * rng.standard_normal(6)
    m.calibration += 0.01 * rng.standard_normal(m.size - 15)
    return m


@pytest.mark.parametrize("sheet", EVERY_KIND, ids=lambda s: s.name)
def test_jacobians_by_finite_differences(model: InertialModel, sheet: Datasheet):
    """The innovation falls by H e when the state has the error e."""
    value = {
        3: np.array([0.9, 0.1, 5.0]) if sheet.kind == "gnss_position" else np.array([3.0, 1.0, 0.5]),
        2: np.array([0.9, 0.1]),
        1: np.array([0.7]),
    }[len(sheet.sigma)]
    m = Measurement(7.0, sheet.name, sheet.kind, value)
    jacobian = model.measure(m).jacobian.copy()
    steps = np.concatenate([np.full(3, 1.0), np.full(3, 1e-2), np.full(3, 1e-5), np.full(6, 1e-5)])
    steps = np.concatenate([steps, np.full(model.size - 15, 1e-4)])
    numeric = np.empty_like(jacobian)
    for k, h in enumerate(steps):
        e = np.zeros(model.size)
        e[k] = h
        numeric[:, k] = (perturbed(model, -e).measure(m).innovation - perturbed(model, e).measure(m).innovation) / (
            2 * h
        )
    # Products of scale and misalignment with other errors are left out: 1 % of calibration times the rest. So is the
    # Earth's rate over the lever arm, as the attitude turns it (6e-4 m/s).
    tolerance, floor = (0.05, 6e-4) if sheet.name in ("dvl", "log") else (1e-5, 6e-4)
    for columns in (*(slice(k, k + 3) for k in range(0, 15, 3)), slice(15, model.size)):
        ours, theirs = jacobian[:, columns], numeric[:, columns]
        small = {0: 3e-5, 6: floor, 9: floor}.get(columns.start, 1e-6)  # radii change with the latitude
        atol = max(tolerance * np.abs(theirs).max(), small)
        np.testing.assert_allclose(ours, theirs, atol=atol, rtol=0, err_msg=f"columns {columns.start} on")


def test_jacobians_of_an_uncalibrated_dvl_and_log_are_exact(model: InertialModel):
    model.calibration[:] = 0.0
    for name in ("dvl", "log"):
        sheet = model.instruments[name]
        m = Measurement(7.0, name, sheet.kind, np.ones(len(sheet.sigma)))
        jacobian = model.measure(m).jacobian.copy()
        for k in range(model.size):
            h = 1e-6
            e = np.zeros(model.size)
            e[k] = h
            numeric = (perturbed(model, -e).measure(m).innovation - perturbed(model, e).measure(m).innovation) / (2 * h)
            # Left out: the Earth's rate over the lever arm, as the attitude turns it.
            np.testing.assert_allclose(jacobian[:, k], numeric, rtol=1e-5, atol=3e-4)


def test_transition_by_finite_differences(model: InertialModel, recording_of, request):
    """A second of the transition matrix against a second of the mechanization, each error in turn."""
    recording = recording_of(3, 20.0, aids=())
    P = np.eye(model.size)
    scale = np.concatenate([np.full(3, 100.0), np.full(3, 1.0), np.full(3, 1e-4), np.full(3, 1e-5), np.full(3, 1e-3)])
    numeric = np.empty((15, 15))

    def after(m: InertialModel) -> InertialModel:
        m.load(recording.data.imu)
        m.propagate(P.copy(), 8.377)
        return m

    base = after(perturbed(model, np.zeros(model.size)))
    for k in range(15):
        e = np.zeros(model.size)
        e[k] = scale[k]
        plus, minus = after(perturbed(model, e)), after(perturbed(model, -e))
        numeric[:, k] = 0.5 * (difference(plus, base) - difference(minus, base))[:15]
    analytic = base.transition * scale
    # Each error against the largest that it causes in a component of the same kind; below the floor it does not matter.
    large = request.node.callspec.params["model"] == "large"
    for first, floor in {0: 1e-5, 3: 2e-6 if large else 1e-6, 6: 1e-7, 9: 1e-13, 12: 1e-13}.items():
        rows = slice(first, first + 3)
        size = np.maximum(np.abs(numeric[rows]).max(axis=0), floor)
        worst = np.max(np.abs(analytic[rows] - numeric[rows]) / size, axis=0)
        # The matrix is of second order in a block; what a gyroscope bias does to the position is of third, and what it
        # does to the velocity of a vehicle that is tilted by 0.5 rad is of second.
        gyroscope = {0: 0.03, 3: 0.01 if large else 5e-3}.get(first, 5e-3)
        limit = np.where(np.arange(15) // 3 == 3, gyroscope, 5e-3)
        assert np.all(worst < limit), (rows, worst)


def test_process_noise_of_a_level_vehicle_at_rest():
    """Closed form: white noise integrates to t, t^2/2, t^3/3; ten blocks come within a percent."""
    gyro, accelerometer = 1e-5, 1e-3
    imu = ImuDatasheet(100.0, TriadDatasheet(random_walk=gyro), TriadDatasheet(random_walk=accelerometer))
    n = 200
    g = float(earth.gravity(0.0, 0.0))
    time = 0.01 * np.arange(1, n + 1)
    model = InertialModel()
    model.begin(InitialState(0.0, np.zeros(3), np.zeros(3), np.zeros(3), np.eye(9)), Instruments((), imu))
    rate = np.tile(earth.earth_rate(0.0), (n, 1))
    model.load(ImuSamples(time, np.full(n, 0.01), rate, np.tile([0.0, 0.0, -g], (n, 1))))
    model.propagate(np.eye(15), 2.0)
    q, a, w, t = model.process_noise, accelerometer**2, gyro**2, 2.0
    assert q[6, 6] == pytest.approx(w * t, rel=1e-6)
    assert q[5, 5] == pytest.approx(a * t, rel=1e-4)
    assert q[3, 3] == pytest.approx(a * t + g**2 * w * t**3 / 3, rel=1e-3)
    assert q[0, 0] == pytest.approx(a * t**3 / 3 + g**2 * w * t**5 / 20, rel=1e-2)
    assert q[0, 3] == pytest.approx(a * t**2 / 2 + g**2 * w * t**4 / 8, rel=1e-2)
    assert abs(q[3, 7]) == pytest.approx(g * w * t**2 / 2, rel=1e-3)
    assert np.array_equal(q, q.T)


def test_splitting_the_way_changes_nothing(recording_of):
    """Propagating in pieces that cut samples apart ends where one piece does."""
    recording = recording_of(1, 10.0, aids=())
    ends = {}
    for name, stops in {"one": [10.0], "many": [0.013, 1.0, 1.007, 2.5, 2.513, 7.77, 10.0]}.items():
        model = InertialModel()
        P = model.begin(recording.start, recording.instruments)
        model.load(recording.data.imu)
        for stop in stops:
            model.propagate(P, stop)
        ends[name] = model, P
    (a, P), (b, Q) = ends["one"], ends["many"]
    e = difference(b, a)
    assert np.abs(e[:3]).max() < 1e-4
    assert np.abs(e[3:6]).max() < 2e-5
    assert np.abs(e[6:9]).max() < 1e-6
    np.testing.assert_allclose(np.diag(P), np.diag(Q), rtol=2e-3)


def test_covariance_propagation_is_phi_p_phi_plus_q():
    rng = np.random.default_rng(0)
    n, m, dt = 18, 15, 0.7
    root = rng.standard_normal((n, n))
    P = root @ root.T
    phi, q = rng.standard_normal((m, m)), np.diag(rng.random(m))
    rate, density = np.array([0.1, 0.0, 2.0]), np.array([0.2, 0.3, 0.4])
    full = np.zeros((n, n))
    full[:m, :m], full[range(m, n), range(m, n)] = phi, np.exp(-rate * dt)
    extra = [0.2 * (1 - np.exp(-0.2 * dt)) / 0.2, 0.3 * dt, 0.4 * (1 - np.exp(-4 * dt)) / 4]
    noise = np.zeros((n, n))
    noise[:m, :m], noise[range(m, n), range(m, n)] = q, extra
    expected = full @ P @ full.T + noise
    calibration = np.ones(3)
    propagate_covariance(P, phi, q, calibration, rate, density, dt)
    np.testing.assert_allclose(P, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(calibration, np.exp(-rate * dt))


def test_a_gap_in_the_imu_is_held_over(recording_of):
    recording = recording_of(0, 300.0, aids=())
    imu = recording.data.imu
    keep = (imu.time <= 60.0) | (imu.time > 240.0)
    model = InertialModel()
    P = model.begin(recording.start, recording.instruments)
    model.load(ImuSamples(imu.time[keep], imu.interval[keep], imu.angular_rate[keep], imu.specific_force[keep]))
    model.propagate(P, 60.0)
    before, sigma = model.velocity.copy(), P[3, 3]
    model.propagate(P, 240.0)
    assert model.held == pytest.approx(180.0, abs=0.05)
    np.testing.assert_allclose(model.velocity, before, atol=0.05)
    assert P[3, 3] > sigma + 0.9 * HELD_VELOCITY**2 * 180.0
    model.propagate(P, 300.0)
    assert model.held == pytest.approx(180.0, abs=0.05)
    assert np.isfinite(P).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e9])
def test_absurd_imu_samples_are_held_over(recording_of, bad: float):
    recording = recording_of(0, 10.0, aids=())
    imu = recording.data.imu
    force = imu.specific_force.copy()
    force[100:150, 1] = bad
    model = InertialModel()
    P = model.begin(recording.start, recording.instruments)
    model.load(replace(imu, specific_force=force))
    model.propagate(P, 10.0)
    assert model.held == pytest.approx(1.0, abs=0.05)
    assert np.isfinite(P).all()
    assert np.linalg.norm(model.velocity) < 10.0


def test_body_rate_is_that_of_the_present_not_of_half_a_sample_ago(recording_of):
    """Over a lever arm, half a sample of a seaway's angular acceleration would pass for a misalignment of the DVL."""
    scenario = load("coastal-voyage").model_copy(update={"duration": 20.0, "faults": ()})
    recording = ideal(scenario, 1)
    model = InertialModel()
    P = model.begin(recording.start, recording.instruments)
    model.load(recording.data.imu)
    imu, late, now = recording.data.imu, [], []
    for k in range(1000, 1900):
        model.propagate(P, float(imu.time[k]))
        # The rate at the end of sample k lies between its mean and the next: their average, to second order.
        truth = 0.5 * (imu.angular_rate[k] + imu.angular_rate[k + 1])
        now.append(model.raw_rate - truth)
        late.append(imu.angular_rate[k] - truth)
    assert np.sqrt(np.mean(np.square(now))) < 0.1 * np.sqrt(np.mean(np.square(late)))
