"""Inertial, GNSS only, dead reckoning, the oracle and the filterpy adapter, as whole estimators."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from filterpy.common import Q_discrete_white_noise
from filterpy.kalman import KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

from simnav.estimator import UnsuitableScenario, make, names
from simnav.estimators.filterpy_adapter import FilterpyEstimator
from simnav.estimators.rows.dead_reckoning import DeadReckoning
from simnav.labels import FaultLabel
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.testing.altered_recordings import until
from simnav.testing.contract_check import CHECKS, Candidate, check, contract_recording
from simnav.types import Datasheet, Instruments
from tests.cases.sorts_of_rows import first_of_each_solver

# All checks of one of these take from three to twelve seconds.
SLOW = {"fgo-unsimplified", "filterpy-ukf", "gtsam-batch", "gtsam-fixed-lag", "gtsam-gnc", "solution-separation"}
WHOLE = [name for name in first_of_each_solver() if name not in SLOW]


@pytest.mark.parametrize("name", WHOLE)
def test_the_contract(name: str):
    """All checks, for one row of each solver and model; ``python -m tests.audit contract`` does it for every row."""
    report = check(name)
    assert report.passed, str(report)


@pytest.fixture(scope="module")
def beginning() -> Recording:
    return until(contract_recording(0), 12.0)


@pytest.mark.parametrize("name", sorted(set(names()) - set(WHOLE)))
def test_the_contract_of_rows_of_the_same_pieces(name: str, beginning: Recording):
    """What an estimator returns in the first seconds, and its units; the golden comparison runs each row as well."""
    candidate = Candidate(lambda: make(name))
    candidate.recording = beginning
    for one in CHECKS:
        if one.name in ("output", "units"):
            finding = one(candidate)
            assert finding.ok, finding.sentence


def test_pure_inertial_is_the_free_strapdown_solution(recording_of, run_over):
    """With a perfect IMU and start it is the truth; the aids are not looked at."""
    from simnav.types import ImuDatasheet, TriadDatasheet

    recording = recording_of(
        0, 60.0, imu=ImuDatasheet(50.0, TriadDatasheet(), TriadDatasheet()), sigmas=np.full(9, 1e-12)
    )
    errors, _ = run_over(make("inertial"), recording)
    assert np.abs(errors[:, :3]).max() < 1e-4
    assert np.abs(errors[:, 6:]).max() < 1e-7


def test_gnss_only_smooths_the_fixes_and_carries_on_in_an_outage(recording_of, run_over):
    """A receiver of 1.5 m on a vessel that goes straight ahead; then 20 s without it."""
    recording = recording_of(2, 200.0, turning=0.0, sea=0.0)
    for name in ("gnss", "gnss_velocity"):
        stream = recording.data.aids[name]
        keep = stream.time <= 180.0
        for column in ("time", "value", "faults", "fault_error", "sigma"):
            object.__setattr__(stream, column, getattr(stream, column)[keep])
    errors, covariances = run_over(make("gnss-only"), recording)
    assert np.sqrt(np.mean(errors[20:180, :2] ** 2)) < 0.75 * 1.5
    assert np.abs(errors[199, :2]).max() < 20.0
    assert covariances[199, 0, 0] > 20 * covariances[179, 0, 0]
    assert np.isnan(errors[:, 6:]).all()


def test_dead_reckoning_with_perfect_instruments_comes_home(recording_of, run_over):
    """Perfect DVL and compass: what is left is the second between readings."""
    from simnav.types import ImuDatasheet, TriadDatasheet

    perfect = ImuDatasheet(50.0, TriadDatasheet(), TriadDatasheet())
    for imu, sea, limit in ((perfect, 1.0, 5.0), (None, 0.0, 5.0)):
        aids = (
            Datasheet("dvl", "dvl", 5.0, np.zeros(3), lever_arm=np.array([1.0, 0.0, 2.0]) * (imu is not None)),
            Datasheet("compass", "gyrocompass", 10.0, np.zeros(1)),
        )
        recording = recording_of(0, 300.0, imu=imu, aids=aids, sigmas=np.full(9, 1e-9), sea=sea)
        errors, _ = run_over(DeadReckoning(), recording)
        assert np.abs(errors[:, :2]).max() < limit  # of 1200 m travelled
        assert np.abs(errors[:, 8]).max() < 0.02


def test_dead_reckoning_covariance_covers_its_errors(recording_of, run_over):
    """Over 20 runs the position's NEES is of the order of one a component."""
    aids = (
        Datasheet("dvl", "dvl", 1.0, np.full(3, 0.02), scale=0.01, misalignment=np.full(3, 0.01)),
        Datasheet("compass", "gyrocompass", 1.0, np.full(1, 0.005), bias=np.full(1, 0.01)),
    )
    runs = [run_over(DeadReckoning(), recording_of(s, 120.0, aids=aids)) for s in range(20)]
    errors, covariances = (np.array(x) for x in zip(*runs, strict=True))
    e, P = errors[:, -1, :2], covariances[:, -1, :2, :2]
    nees = np.einsum("si,si->s", e, np.linalg.solve(P, e[..., None])[..., 0]) / 2
    assert 0.4 < nees.mean() < 1.8


def test_dead_reckoning_falls_back_on_the_log(recording_of, run_over):
    """The DVL stops; the log takes over, and comes back to the DVL when it speaks again."""
    aids = (
        Datasheet("log", "speed_log", 1.0, np.full(1, 0.01)),
        Datasheet("dvl", "dvl", 1.0, np.full(3, 0.01)),
        Datasheet("compass", "gyrocompass", 1.0, np.full(1, 0.005)),
    )
    recording = recording_of(0, 200.0, aids=aids)
    dvl = recording.data.aids["dvl"]
    keep = (dvl.time < 50.0) | (dvl.time > 150.0)
    for column in ("time", "value", "faults", "fault_error", "sigma"):
        object.__setattr__(dvl, column, getattr(dvl, column)[keep])
    recording.data.aids["log"].value[:] += 1.0  # who is in use shows in the speed
    estimator = DeadReckoning()
    estimator.reset(recording.start, recording.instruments)
    velocity = np.array([estimator.update(packet).velocity for packet in recording.steps()])
    faster = np.hypot(*velocity[:, :2].T) - np.hypot(*recording.data.truth.velocity[:, :2].T)
    assert abs(faster[40]) < 0.2
    assert abs(faster[100] - 1.0) < 0.2
    assert abs(faster[190]) < 0.2


@pytest.mark.parametrize(
    ("kinds", "message"),
    [(("gyrocompass",), "needs a DVL or a speed log"), (("dvl",), "needs a compass or the gyroscopes")],
)
def test_what_dead_reckoning_needs(recording_of, kinds: tuple[str, ...], message: str):
    recording = recording_of(0, 2.0)
    sheets = [Datasheet(k, k, 1.0, np.ones(1)) for k in kinds]
    with pytest.raises(UnsuitableScenario, match=message):
        make("dead-reckoning").reset(recording.start, Instruments(sheets))


def test_the_oracle_knows_noise_and_flags(recording_of, run_over):
    """Gross errors are left out, noise is weighed as it is, a disturbed IMU is restored; the EKF is worse by far."""
    recording = recording_of(4, 100.0)
    rng = np.random.default_rng(0)
    gnss = recording.data.aids["gnss"]
    wild = rng.random(len(gnss)) < 0.3
    added = np.where(wild[:, None], rng.uniform(20, 60, gnss.value.shape), 0.0)
    from simnav.geometry import earth

    faulty = replace(gnss, value=earth.displace(gnss.value, added), fault_error=added, faults=wild.astype(np.uint32))
    aids = {**recording.data.aids, "gnss": faulty}
    del aids["gnss_velocity"]
    bad = replace(
        recording,
        faults=(FaultLabel("gross_error", ("gnss",), 0.0, 100.0),),
        data=replace(recording.data, aids=aids),
    )
    oracle = make("oracle")
    assert oracle.reference
    oracle.reveal(bad)
    best, _ = run_over(oracle, bad)
    ours, _ = run_over(make("ekf"), bad)
    assert np.sqrt(np.mean(best[:, :2] ** 2)) < 0.2 * np.sqrt(np.mean(ours[:, :2] ** 2))
    oracle.reset(bad.start, bad.instruments)
    flagged = [f for p in bad.steps() for f in oracle.update(p).flagged]
    assert flagged == [("gnss", t) for t in gnss.time[wild]]


def test_the_oracle_weighs_a_noise_step():
    scenario = load("gnss-noise-step")
    recording = record(scenario, 0)
    oracle = make("oracle")
    oracle.reveal(recording)
    oracle.reset(recording.start, recording.instruments)
    name, stream = next((n, s) for n, s in recording.data.aids.items() if s.faults.any())
    k = int(np.flatnonzero(stream.faults)[0])
    from simnav.estimators.adaptations.base import Innovation
    from simnav.types import Measurement

    d = stream.value.shape[1]
    nominal = np.diag(recording.instruments[name].sigma ** 2)
    m = Measurement(float(stream.time[k]), name, stream.kind, stream.value[k])
    noise = oracle.adaptation.adapt(Innovation(m, np.zeros(d), np.eye(d), nominal))
    np.testing.assert_allclose(noise, np.diag(stream.sigma[k] ** 2), rtol=1e-9)
    assert noise[0, 0] > nominal[0, 0]


def test_the_oracle_asks_for_the_truth(recording_of):
    recording = recording_of(0, 2.0)
    with pytest.raises(UnsuitableScenario, match="reveal"):
        make("oracle").reset(recording.start, recording.instruments)


class Linear(FilterpyEstimator):
    """filterpy's KalmanFilter on GNSS positions."""

    name = "linear"
    components = ("north", "east", "velocity_north", "velocity_east")
    needs = ("gnss_position",)

    def build(self, start, instruments):
        kf = KalmanFilter(dim_x=4, dim_z=2)
        kf.x = np.array([0.0, 0.0, *start.velocity[:2]])
        kf.P = start.covariance[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])].copy()
        kf.H = np.eye(2, 4)
        return kf

    def predict(self, kf, dt):
        kf.F = np.eye(4) + dt * np.eye(4, k=2)
        kf.Q = Q_discrete_white_noise(2, dt, 0.04, block_size=2, order_by_dim=False)
        kf.predict()

    def correct(self, kf, z, sheet):
        kf.update(z[:2], R=np.diag(sheet.sigma[:2] ** 2))


class Unscented(Linear):
    """filterpy's UnscentedKalmanFilter on the same linear problem."""

    name = "unscented"

    def build(self, start, instruments):
        points = MerweScaledSigmaPoints(4, alpha=0.5, beta=2.0, kappa=0.0)
        move = lambda x, dt: np.concatenate([x[:2] + dt * x[2:], x[2:]])  # noqa: E731
        kf = UnscentedKalmanFilter(4, 2, 1.0, hx=lambda x: x[:2], fx=move, points=points)
        kf.x = np.array([0.0, 0.0, *start.velocity[:2]])
        kf.P = start.covariance[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])].copy()
        return kf

    def predict(self, kf, dt):
        kf.Q = Q_discrete_white_noise(2, dt, 0.04, block_size=2, order_by_dim=False)
        kf.predict(dt)


def test_filterpy_filters_plug_in_and_agree(recording_of, run_over):
    """On a linear problem the unscented filter is the Kalman filter."""
    recording = recording_of(1, 60.0, turning=0.0, sea=0.0)
    ours, P = run_over(Linear(), recording)
    other, Q = run_over(Unscented(), recording)
    np.testing.assert_allclose(ours, other, atol=1e-6)
    np.testing.assert_allclose(P, Q, atol=1e-6)
    seen = np.isfinite(ours).all(axis=0)
    assert seen.tolist() == [True, True, False, True, True, False, False, False, False]
    assert np.sqrt(np.mean(ours[20:, :2] ** 2)) < 12.0  # the lever arm of 8 m is not corrected for


def test_filterpy_filters_pass_the_contract_test():
    for cls in (Linear, Unscented):
        report = check(cls)
        assert report.passed, str(report)
    assert "needs gnss_position; there is none" in _reason(Linear())


def _reason(estimator: FilterpyEstimator) -> str:
    from simnav.types import InitialState

    start = InitialState(0.0, np.zeros(3), np.zeros(3), np.zeros(3), np.eye(9))
    with pytest.raises(UnsuitableScenario) as caught:
        estimator.reset(start, Instruments(()))
    return str(caught.value)
