"""The Kalman solver: closed forms, consistency over seeds, and bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from simnav.estimator import UnsuitableScenario, find, make, names
from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.algebra.joseph import joseph_update
from simnav.estimators.models.base import ErrorModel, Linearised
from simnav.estimators.rows.kalman import Ekf
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.types import Datasheet, Estimate, Instruments, Measurement, Measurements


@pytest.mark.parametrize("m", [1, 2, 3])
def test_joseph_against_the_information_form(m: int):
    rng = np.random.default_rng(m)
    root = rng.standard_normal((8, 8))
    P, H = root @ root.T, rng.standard_normal((m, 8))
    R = np.diag(rng.random(m) + 0.1)
    expected = np.linalg.inv(np.linalg.inv(P) + H.T @ np.linalg.inv(R) @ H)
    residual, dx = rng.standard_normal(m), np.empty(8)
    S = H @ P @ H.T + R
    gain = P @ H.T @ np.linalg.inv(S)
    mine = P.copy()
    nis = joseph_update(mine, np.ascontiguousarray(P @ H.T), S, residual, dx)
    np.testing.assert_allclose(mine, expected, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(dx, gain @ residual, rtol=1e-10)
    assert nis == pytest.approx(residual @ np.linalg.solve(S, residual))
    assert np.array_equal(mine, mine.T)


def test_joseph_keeps_a_stiff_covariance_positive():
    """Twelve orders of magnitude between prior and measurement, a thousand times over."""
    P = np.diag([1e8, 1e-4, 1.0])
    H = np.array([[1.0, 1e3, 0.0]])
    dx = np.empty(3)
    for _ in range(1000):
        joseph_update(P, P @ H.T, H @ P @ H.T + 1e-4, np.zeros(1), dx)
    assert np.linalg.eigvalsh(P).min() >= 0.0


def test_a_singular_innovation_covariance_changes_nothing():
    P = np.eye(2)
    before = P.copy()
    H = np.array([[1.0, 0.0], [1.0, 0.0]])
    assert joseph_update(P, P @ H.T, H @ P @ H.T, np.ones(2), np.empty(2)) == -1.0
    assert np.array_equal(P, before)


class Position(ErrorModel):
    """One state, a random walk, measured by a depth sensor: small enough to do by hand."""

    size = 1

    def begin(self, start, instruments):
        self.time, self.x, self.trace = start.time, 0.0, []
        return np.ones((1, 1))

    def observes(self, instrument):
        return instrument.kind == "depth"

    def propagate(self, covariance, until):
        covariance += until - self.time
        self.time = until

    def measure(self, measurement):
        self.trace.append(self.time)
        return Linearised(measurement.value - self.x, np.ones((1, 1)), np.ones((1, 1)))

    def correct(self, dx):
        self.x += dx[0]

    def estimate(self, covariance):
        full = np.zeros((9, 9))
        full[0, 0] = covariance[0, 0]
        return Estimate(self.time, np.array([self.x, 0.0, 0.0]), covariance=full)


class Nothing(Adaptation):
    def adapt(self, innovation: Innovation):
        return None


DEPTH = Instruments((Datasheet("depth", "depth", 1.0, np.ones(1)),))


def depth(time: float, value: float = 1.0) -> Measurement:
    return Measurement(time, "depth", "depth", np.array([value]))


def test_each_measurement_at_its_own_time(recording_of):
    """By hand: P = 1 + 0.25 = 1.25, K = 1.25/2.25 = 5/9, P = 5/9; then 0.25 + 0.5."""
    start = recording_of(0, 2.0, imu=None).start
    e = KalmanEstimator(Position())
    e.reset(start, DEPTH)
    out = e.update(Measurements(0.0, 1.0, None, [depth(0.25)]))
    assert e.model.trace == [0.25]
    assert out.position[0] == pytest.approx(5 / 9)
    assert out.covariance[0, 0] == pytest.approx(5 / 9 + 0.75)
    assert out.diagnostics["nis.depth"] == pytest.approx(1 / 2.25)
    assert out.diagnostics["innovation.depth"] == pytest.approx(1.0)
    out = e.update(Measurements(1.0, 2.0, None, []))
    assert np.isnan(out.diagnostics["nis.depth"])


def test_what_is_skipped_is_counted(recording_of):
    start = recording_of(0, 2.0, imu=None).start
    e = KalmanEstimator(Position())
    e.reset(start, DEPTH)
    bad = [depth(1.9), depth(1.2), depth(1.2), depth(0.5), depth(1.5, np.nan), depth(1.6, np.inf), depth(1.7, 1e9)]
    e.update(Measurements(0.0, 1.0, None, []))
    out = e.update(Measurements(1.0, 2.0, None, bad))
    assert e.model.trace == [1.2, 1.9]  # sorted; the repetition, the late one and the absurd ones are not there
    assert out.diagnostics["skipped"] == 5
    out = e.update(Measurements(2.0, 3.0, None, [depth(1.9)]))
    assert out.diagnostics["skipped"] == 6


def test_an_adaptation_that_refuses_is_flagged(recording_of):
    e = KalmanEstimator(Position(), Nothing())
    e.reset(recording_of(0, 2.0, imu=None).start, DEPTH)
    out = e.update(Measurements(0.0, 1.0, None, [depth(0.5)]))
    assert out.flagged == [("depth", 0.5)]
    assert out.position[0] == 0.0


def normalised(errors: np.ndarray, covariances: np.ndarray, part: list[int]) -> np.ndarray:
    """NEES (...,) of some of the nine components."""
    e, P = errors[..., part], covariances[..., part, :][..., :, part]
    return np.einsum("...i,...i->...", e, np.linalg.solve(P, e[..., None])[..., 0])


def assert_consistent(errors: np.ndarray, covariances: np.ndarray, part: list[int], epochs: list[int]) -> None:
    """Average NEES over the runs (axis 0) within the chi-square band, at each of a few epochs.

    The runs are independent, epochs of one run are not; the band of each epoch is therefore exact, and as wide
    (Bonferroni) as makes all epochs together hold with 95 % if the filter is consistent.
    """
    runs, d = len(errors), len(part)
    tail = 0.025 / len(epochs)
    low, high = chi2.ppf([tail, 1.0 - tail], runs * d) / runs
    average = normalised(errors, covariances, part)[:, epochs].mean(axis=0)
    assert np.all((average > low) & (average < high)), (part, average, (low, high))


POSITION, VELOCITY, ATTITUDE = [0, 1, 2], [3, 4, 5], [6, 7, 8]
RUNS = 40


@pytest.fixture(scope="module")
def open_sea(run_over):
    """Errors and covariances of the EKF and of the oracle over 40 seeds of the matched clean scenario."""
    scenario = load("open-sea").model_copy(update={"duration": 300.0})
    found: dict[str, list] = {"ekf": [], "oracle": []}
    for seed in range(RUNS):
        recording = record(scenario, seed)
        for name, runs in found.items():
            estimator = make(name)
            if estimator.reference:
                estimator.reveal(recording)
            runs.append(run_over(estimator, recording))
    return {n: (np.array([e for e, _ in r]), np.array([c for _, c in r])) for n, r in found.items()}


@pytest.mark.slow
def test_ekf_is_consistent_on_the_matched_scenario_and_within_5_percent_of_the_oracle(open_sea):
    """NEES of position, velocity and attitude at five epochs; their RMSE over all runs and epochs."""
    errors, covariances = open_sea["ekf"]
    for part in (POSITION, VELOCITY, ATTITUDE):
        assert_consistent(errors, covariances, part, [9, 59, 149, 224, 299])
    (ekf, _), (oracle, _) = open_sea["ekf"], open_sea["oracle"]
    for part in (POSITION, VELOCITY, ATTITUDE):
        ours, best = (np.sqrt(np.mean(e[..., part] ** 2)) for e in (ekf, oracle))
        assert abs(ours / best - 1.0) < 0.05


@pytest.mark.slow
def test_ekf_is_consistent_with_calibrated_instruments(recording_of, run_over):
    """A DVL with scale factor and misalignment, a compass and a GNSS receiver with biases."""
    sheets = (
        Datasheet(
            "gnss", "gnss_position", 1.0, np.full(3, 1.0), bias_instability=np.full(3, 0.5), correlation_time=60.0
        ),
        Datasheet("dvl", "dvl", 1.0, np.full(3, 0.02), phase=0.4, scale=0.01, misalignment=np.full(3, 0.01)),
        Datasheet("compass", "magnetic_compass", 1.0, np.full(1, 0.01), bias=np.full(1, 0.02)),
        Datasheet("depth", "depth", 1.0, np.full(1, 0.2), bias=np.full(1, 0.2)),
    )
    runs = [run_over(Ekf(), recording_of(seed, 120.0, aids=sheets)) for seed in range(RUNS)]
    errors, covariances = (np.array(x) for x in zip(*runs, strict=True))
    for part in (POSITION, VELOCITY, ATTITUDE):
        assert_consistent(errors, covariances, part, [19, 59, 119])


def test_calibration_can_be_switched_off(recording_of):
    recording = recording_of(0, 5.0)
    sheets = (replace(recording.instruments["dvl"], scale=0.01, bias=np.full(3, 0.01)),)
    instruments = Instruments(sheets, recording.instruments.imu)
    sizes = []
    for calibrate in (True, False):
        e = Ekf(calibrate=calibrate)
        e.reset(recording.start, instruments)
        sizes.append(e.model.size)
    assert sizes == [22, 15]


def with_streams(recording: Recording, change) -> Recording:
    data = recording.data
    return replace(recording, data=replace(data, aids={n: change(s) for n, s in data.aids.items()}))


@pytest.fixture(scope="module")
def long_recordings(recording_of) -> dict[bool, Recording]:
    """Three minutes; for slow estimators one."""
    return {slow: recording_of(7, 60.0 if slow else 180.0) for slow in (False, True)}


@pytest.mark.parametrize("name", names())
@settings(max_examples=1, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_every_estimator_stays_finite_on_bad_input(long_recordings, run_over, name: str, data: st.DataObject):
    """Gaps of minutes, absurd values, repetitions, disorder, late measurements: finite, or a sentence."""
    recording = long_recordings[find(name).slow]
    length = float(recording.data.truth.time[-1])
    gap = data.draw(st.tuples(st.floats(0.0, 0.6 * length), st.floats(1.0, 0.9 * length)), label="gap")
    absurd = data.draw(st.sampled_from([np.nan, np.inf, -np.inf, 1e9, -1e9, 1e300]), label="value")
    every = data.draw(st.integers(2, 20), label="every")
    seed = data.draw(st.integers(0, 2**16), label="seed")
    rng = np.random.default_rng(seed)
    imu = recording.data.imu
    keep = (imu.time < gap[0]) | (imu.time > sum(gap)) if data.draw(st.booleans(), label="imu gap") else imu.time > 0
    force = imu.specific_force.copy()
    force[:: 50 * every, 0] = absurd
    samples = replace(imu, time=imu.time[keep], interval=imu.interval[keep],
                      angular_rate=imu.angular_rate[keep], specific_force=force[keep])  # fmt: skip

    def spoil(stream):
        left = (stream.time < gap[0]) | (stream.time > sum(gap))
        value = stream.value.copy()
        value[::every] = absurd
        order = np.flatnonzero(left)
        order = np.repeat(order, rng.integers(0, 3, len(order)))
        time = stream.time + np.where(rng.random(len(stream.time)) < 0.1, -3.0, 0.0)
        columns = {n: getattr(stream, n)[order] for n in ("faults", "fault_error", "sigma")}
        return replace(stream, time=time[order], value=value[order], **columns)

    bad = with_streams(replace(recording, data=replace(recording.data, imu=samples)), spoil)
    estimator = make(name)
    if estimator.reference:
        estimator.reveal(bad)
    try:
        errors, covariances = run_over(estimator, bad)
    except UnsuitableScenario:  # what it says is tested below
        return
    seen = np.isfinite(errors)
    assert seen.any(axis=0).sum() == seen.all(axis=0).sum() > 0
    for e, P in zip(errors, covariances, strict=True):
        part = np.flatnonzero(np.isfinite(e))
        P = P[np.ix_(part, part)]
        assert np.isfinite(P).all()
        sigma = np.sqrt(np.diag(P))
        assert np.linalg.eigvalsh(P / np.outer(sigma, sigma)).min() > -1e-9


@pytest.mark.parametrize("name", names())
def test_unsuitable_scenarios_say_what_is_needed(recording_of, name: str):
    recording = recording_of(0, 2.0)
    estimator = make(name)
    if estimator.reference:
        estimator.reveal(recording)
    with pytest.raises(UnsuitableScenario, match="needs"):
        estimator.reset(recording.start, Instruments(()))
