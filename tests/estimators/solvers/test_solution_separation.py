"""Solution separation: its sub-filters, the covariance of their separation, exclusion and protection level."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.hypotheses import Hypothesis
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.solution_separation import SolutionSeparation
from simnav.estimators.solvers.state_difference import difference
from simnav.geometry import earth
from simnav.scenario import load
from simnav.source import record
from simnav.types import Datasheet, Estimate, Measurements

GNSS = Datasheet("gnss", "gnss_position", 1.0, np.array([1.5, 1.5, 3.0]), lever_arm=np.array([2.0, -1.0, -8.0]))
DVL = Datasheet("dvl", "dvl", 1.0, np.full(3, 0.02), phase=0.333, lever_arm=np.array([1.0, 0.5, 3.0]))
COMPASS = Datasheet("compass", "gyrocompass", 2.0, np.full(1, 0.01))
AIDS = (GNSS, DVL, COMPASS)


def off(recording, size: float, first: float, last: float = np.inf, rate: float = 0.0):
    """The recording with fixes that are off to the north-east: a step, or a ramp [m/s]."""
    gnss = recording.data.aids["gnss"]
    since = gnss.time - first
    error = np.where((since >= 0.0) & (gnss.time < last), size + rate * since, 0.0)[:, None] * np.array([0.7, 0.7, 0.0])
    moved = replace(gnss, value=earth.displace(gnss.value, error))
    return replace(recording, data=replace(recording.data, aids={**recording.data.aids, "gnss": moved}))


def run(recording, **parameters):
    """Horizontal error, protection level and excluded instruments by step."""
    estimator = make("solution-separation", **parameters)
    estimator.reset(recording.start, recording.instruments)
    error, level, excluded = [], [], []
    for k, packet in enumerate(recording.steps()):
        out = estimator.update(packet)
        error.append(np.hypot(*earth.relative_position(out.position, recording.data.truth.position[k])[:2]))
        level.append(out.diagnostics["protection_level"])
        excluded.append(estimator.excluded)
    return np.array(error), np.array(level), excluded


def without(estimator: SolutionSeparation, name: str) -> Estimate:
    """What the older sub-filter without an instrument says; it is never given out, so it is not public."""
    return estimator._older_filter(name).estimate


@pytest.mark.parametrize("name", ["gnss", "dvl", "compass"])
def test_a_sub_filter_is_the_filter_that_never_had_the_instrument(recording_of, name: str):
    recording = recording_of(3, 60.0, aids=AIDS)
    estimator = SolutionSeparation(InertialModel())
    estimator.reset(recording.start, recording.instruments)
    alone = KalmanEstimator(InertialModel())
    alone.reset(recording.start, recording.instruments)
    for p in recording.steps():
        estimator.update(p)
        expected = alone.update(Measurements(p.start, p.time, p.imu, [m for m in p.aids if m.instrument != name]))
    sub = without(estimator, name)
    np.testing.assert_allclose(difference(sub, expected), 0.0, atol=1e-9)
    np.testing.assert_allclose(sub.covariance, expected.covariance, rtol=1e-6, atol=1e-12)


def test_the_covariance_of_the_separation_is_the_difference_of_the_covariances(recording_of):
    """Over 40 runs: the squared separation over P_i - P_0 has mean 1, for position and velocity."""
    squares = {"gnss": [], "dvl": []}
    for seed in range(40):
        recording = recording_of(seed, 40.0, aids=AIDS)
        estimator = SolutionSeparation(InertialModel(), horizon=1e4)
        estimator.reset(recording.start, recording.instruments)
        for packet in recording.steps():
            main = estimator.update(packet)
        for name, found in squares.items():
            sub = without(estimator, name)
            d, spread = difference(sub, main), sub.covariance - main.covariance
            found.append(d[[0, 1, 3, 4]] ** 2 / np.diag(spread)[[0, 1, 3, 4]])
    for name, found in squares.items():
        mean = np.mean(found, axis=0)
        assert np.all((mean > 0.42) & (mean < 1.9)), (name, mean)  # 0.1 % of chi-square with 40 degrees


def test_where_nothing_is_wrong_it_is_the_ekf(recording_of, run_over):
    for seed in range(3):
        recording = recording_of(seed, 150.0, aids=AIDS)
        expected, P = run_over(make("ekf"), recording)
        errors, Q = run_over(make("solution-separation", horizon=60.0), recording)
        np.testing.assert_allclose(errors, expected, atol=1e-7)
        np.testing.assert_allclose(Q, P, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("size", "rate"), [(40.0, 0.0), (0.0, 1.0)], ids=["step", "ramp"])
def test_a_wrong_gnss_is_excluded_and_used_again(recording_of, size: float, rate: float):
    recording = off(recording_of(4, 260.0, aids=AIDS), size, 80.0, 160.0, rate)
    error, level, excluded = run(recording)
    assert {"gnss"} in [set(e) for e in excluded[80:130]]
    assert all("dvl" not in e and "compass" not in e for e in excluded)
    assert not excluded[78]
    assert not excluded[-1]
    plain = make("ekf")
    plain.reset(recording.start, recording.instruments)
    worst = 0.0
    for k, packet in enumerate(recording.steps()):
        at = plain.update(packet).position
        worst = max(worst, float(np.hypot(*earth.relative_position(at, recording.data.truth.position[k])[:2])))
    assert error.max() < 0.3 * worst
    assert np.all(error <= level)


def test_a_dvl_that_says_zero_is_excluded(recording_of):
    recording = recording_of(4, 150.0, aids=AIDS)
    dvl = recording.data.aids["dvl"]
    dvl.value[(dvl.time > 60.0) & (dvl.time < 110.0)] = 0.0
    error, level, excluded = run(recording)
    assert {"dvl"} in [set(e) for e in excluded[62:90]]
    assert all("gnss" not in e for e in excluded)
    assert error.max() < 8.0
    assert np.all(error <= level)


def begun(recording, error, sigma):
    """The recording with a start that is off by nine errors [m, m/s, rad], and told nine sigmas."""
    truth = recording.data.truth
    error, sigma = np.asarray(error), np.asarray(sigma)
    start = replace(
        recording.start,
        position=earth.displace(truth.position[0], error[:3]),
        velocity=truth.velocity[0] + error[3:6],
        attitude=truth.attitude[0] + error[6:],
        covariance=np.diag(sigma**2),
    )
    return replace(recording, start=start)


@pytest.mark.parametrize("factor", [5.0, 20.0])
def test_a_wrong_start_is_not_blamed_on_the_instruments(recording_of, factor: float):
    sigma = np.array([3.0, 3.0, 2.0, 0.05, 0.05, 0.05, *np.radians([0.05, 0.05, 1.0])])
    error = factor * sigma * np.array([1.0, -1.0, 0.5, 0.0, 0.0, 0.0, 0.5, -0.5, 1.0])
    error_of, _, excluded = run(begun(recording_of(4, 200.0, aids=(GNSS, DVL)), error, sigma))
    assert not any(excluded)
    assert error_of[100:].max() < 6.0


@pytest.mark.parametrize("degrees", [40.0, 130.0])
def test_an_unknown_heading_is_not_blamed_on_the_instruments(recording_of, degrees: float):
    sigma = np.array([3.0, 3.0, 2.0, 0.05, 0.05, 0.05, *np.radians([0.05, 0.05, degrees])])
    error = np.zeros(9)
    error[8] = 0.7 * np.radians(degrees)
    recording = begun(recording_of(4, 200.0, aids=(GNSS, DVL)), error, sigma)
    error_of, _, excluded = run(recording)
    assert not any(excluded)
    plain = make("ekf")
    plain.reset(recording.start, recording.instruments)
    for packet in recording.steps():
        last = plain.update(packet)
    end = np.hypot(*earth.relative_position(last.position, recording.data.truth.position[-1])[:2])
    assert error_of[-1] == pytest.approx(end, abs=0.1)


def test_a_filter_that_has_lost_its_heading_excludes_nothing():
    """Without fixes the heading of this MEMS unit is lost in a minute, and the filter without them with it."""
    recording = record(load("clean-voyages"), 404)
    _, _, excluded = run(recording)
    assert not any(excluded)


@pytest.mark.parametrize("seed", [305, 602, 606])
def test_a_filter_that_may_have_lost_its_heading_is_not_compared(seed: int):
    """Clean voyages. The filter without fixes is wrong by 6 to 30 degrees; its covariance says 1 to 2.5."""
    _, _, excluded = run(record(load("training-mems"), seed))
    assert not any(excluded)


def hypothesis(variance: float, drift: float, time: float) -> Hypothesis:
    """Of a vessel that has gone 300 m north and 400 m east since 100 s, with the variance of the heading then."""
    here = np.array([0.9, 0.1, 0.0])
    first = Estimate(100.0, here, np.zeros(3), np.zeros(3), np.diag([*[1.0] * 8, variance]))
    last = replace(
        first,
        time=time,
        position=earth.displace(here, np.array([300.0, 400.0, 0.0])),
        velocity=np.array([3.0, 4.0, 0.0]),
    )
    last.covariance = np.diag([*[4.0] * 8, 1e-6])
    return Hypothesis("gnss", None, 100.0, last, first, drift)


def test_a_heading_that_nothing_measures_is_known_by_dead_reckoning():
    sub = hypothesis(1e-4, 1e-10, 160.0)
    sub.turn(1e-7)
    expected = 1e-4 + 1e-10 * 60.0**2 + 1e-7 * 60.0
    assert sub.estimate.covariance[8, 8] == pytest.approx(expected)
    # The added error turns the track of 500 m and the velocity of 5 m/s.
    added = sub.estimate.covariance - np.diag([*[4.0] * 8, 1e-6])
    across = np.array([-0.8, 0.6])
    assert across @ added[:2, :2] @ across == pytest.approx(500.0**2 * (expected - 1e-6), rel=1e-3)
    assert across @ added[3:5, 3:5] @ across == pytest.approx(5.0**2 * (expected - 1e-6), rel=1e-3)
    assert np.linalg.matrix_rank(added, tol=1e-9) == 1
    assert across @ added[:2, 8] > 0.0  # a turn to starboard puts a vessel that went north-east to the south-east


def test_a_heading_that_is_known_worse_than_by_dead_reckoning_stays_as_it_is():
    sub = hypothesis(1e-8, 0.0, 160.0)
    before = sub.estimate.covariance.copy()
    sub.turn(1e-12)
    np.testing.assert_array_equal(sub.estimate.covariance, before)


def test_the_start_is_doubted_in_the_first_minute_only(recording_of):
    recording = recording_of(4, 70.0, aids=AIDS)
    estimator = make("solution-separation")
    estimator.reset(recording.start, recording.instruments)
    doubt = {p.time: estimator.update(p).diagnostics["separation.initial state"] for p in recording.steps()}
    assert np.all(np.isfinite([value for time, value in doubt.items() if 20.0 < time < 60.0]))
    assert np.all(np.isnan([value for time, value in doubt.items() if time > 60.0]))


def disturbed(recording, first: float, last: float, force: float = 0.0, rate: float = 0.0):
    """The recording with accelerometers and gyroscopes that are off by a constant [m/s^2], [rad/s] on all axes."""
    imu = recording.data.imu
    during = ((imu.time >= first) & (imu.time < last))[:, None]
    moved = replace(
        imu, specific_force=imu.specific_force + force * during, angular_rate=imu.angular_rate + rate * during
    )
    return replace(recording, data=replace(recording.data, imu=moved))


@pytest.mark.parametrize(("force", "rate"), [(0.4, 0.0), (0.0, 0.01)], ids=["accelerometers", "gyroscopes"])
@pytest.mark.parametrize("aids", [AIDS, (GNSS, DVL)], ids=["with a compass", "without"])
def test_a_disturbed_imu_is_excluded_and_believed_again(recording_of, aids, force: float, rate: float):
    recording = disturbed(recording_of(4, 260.0, aids=aids), 80.0, 120.0, force, rate)
    error, level, excluded = run(recording)
    assert not any(excluded[:80])
    assert {"imu"} in [set(e) for e in excluded[80:120]]
    assert not excluded[-1]
    assert error.max() < 12.0
    assert np.all(error <= level)


def test_a_poor_imu_does_without_a_noisy_receiver_for_no_minute():
    """A MEMS unit and a receiver alone: fixes that are five times noisier are better than none."""
    recording = record(load("training-gnss-faults"), 304)
    error, _, _ = run(recording)
    assert error.max() < 30.0


@pytest.mark.parametrize("seed", [319, 331])
def test_bad_fixes_after_an_outage_are_not_blamed_on_another_instrument(seed: int):
    """The position has grown uncertain, so that the filter without the log or the compass follows the bad fixes."""
    recording = record(load("training-outages"), seed)
    error, _, excluded = run(recording)
    assert set().union(*excluded) <= {"gnss"}
    assert error[-50:].max() < 3.0


def test_what_is_used_again_for_want_of_others_is_not_excluded_at_once():
    """IMU and fixes are wrong at once. If fixes were excluded in the step after, nobody would ever find back."""
    error, _, _ = run(record(load("training-motion"), 330))
    assert np.sqrt(np.mean(error**2)) < 700.0  # else 1550 m


def test_single_gross_errors_are_left_out_and_flagged(recording_of):
    recording = recording_of(4, 60.0, aids=AIDS)
    gnss = recording.data.aids["gnss"]
    gnss.value[[20, 33], 0] += 60.0 / 6.37e6
    estimator = make("solution-separation")
    estimator.reset(recording.start, recording.instruments)
    flagged = [f for packet in recording.steps() for f in estimator.update(packet).flagged]
    assert flagged == [("gnss", float(gnss.time[k])) for k in (20, 33)]


def test_lone_fixes_are_gross_errors_only_if_they_are_single(recording_of):
    """Beside an IMU alone: one that jumps is left out; not the first after a gap, nor those of a course."""
    recording = recording_of(4, 100.0, aids=(GNSS, COMPASS))
    gnss = recording.data.aids["gnss"]
    gnss.value[20, 0] += 60.0 / 6.37e6  # jumps
    gnss.value[50:, 0] += 60.0 / 6.37e6  # is off for good
    estimator = make("solution-separation")
    estimator.reset(recording.start, recording.instruments)
    flagged = [f for packet in recording.steps() for f in estimator.update(packet).flagged]
    first = [time for name, time in flagged if time < gnss.time[60]]
    assert first == [float(gnss.time[k]) for k in (20, 50)]


def test_the_only_aid_of_a_poor_imu_is_not_given_up():
    """After each outage the fixes are far from the prediction of an IMU that is eight times noisier than it says."""
    recording = record(load("sole-gnss"), 701)
    error, _, excluded = run(recording)
    assert not any(excluded)
    plain = make("ekf")
    plain.reset(recording.start, recording.instruments)
    position = [plain.update(packet).position for packet in recording.steps()]
    own = np.hypot(*earth.relative_position(np.array(position), recording.data.truth.position)[:, :2].T)
    assert np.sqrt(np.mean(error**2)) < 1.2 * np.sqrt(np.mean(own**2))


def test_a_larger_risk_is_a_lower_level(recording_of):
    recording = recording_of(4, 30.0, aids=AIDS)
    strict, loose = (run(recording, risk=r)[1] for r in (1e-9, 1e-3))
    assert np.all(strict > loose)
    assert np.all(np.isfinite(strict))


@pytest.mark.parametrize(
    ("name", "value"),
    [("false_alarm", 0.0), ("risk", 1.0), ("fault_probability", 2.0), ("horizon", 0.0), ("recovery", -1.0)],
)
def test_a_senseless_parameter_is_refused(name: str, value: float):
    with pytest.raises(ValueError, match=name):
        SolutionSeparation(InertialModel(), **{name: value})


# --- a ship without an IMU ----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [50, 51, 53])
def test_a_steady_turn_excludes_nothing_on_a_ship_without_an_imu(seed: int):
    recording = record(load("ship-turn").model_copy(update={"duration": 300.0}), seed)
    error, _, excluded = run(recording)
    assert not any(excluded)
    assert np.sqrt(np.mean(error**2)) < 3.0


@pytest.mark.parametrize("seed", [100, 131, 134])
def test_a_ship_without_an_imu_keeps_a_fix_or_log_and_compass(seed: int):
    recording = record(load("training-ships"), seed)
    error, _, excluded = run(recording)
    assert any(excluded)
    for out in map(set, excluded):
        assert "gnss" not in out or not out & {"gyrocompass", "speed_log"}
    longest = run_length = 0
    for out in excluded:
        run_length = run_length + 1 if "gnss" in out else 0
        longest = max(longest, run_length)
    assert longest <= 181  # steps of one second
    assert error.max() < 1000.0
