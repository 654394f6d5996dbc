"""The test of persistence: a state error is told from noise, a witness decides, and a poor IMU ruins no row."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.adaptations.base import Innovation
from simnav.estimators.adaptations.innovation_based import FixedWindow, InnovationBased
from simnav.estimators.adaptations.sage_husa import SageHusa
from simnav.estimators.adaptations.variational_bayes import VariationalBayes
from simnav.estimators.algebra.chi_square import normal_quantile
from simnav.estimators.models.roles import witnesses
from simnav.estimators.persistence import add_innovation, is_correlated, is_directed, is_large, no_innovations
from simnav.scenario import load
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import KINDS as ERRORS
from simnav.types import Datasheet, ImuDatasheet, Instruments, Measurement, TriadDatasheet
from tests.cases.judged_predictions import JudgedPredictions

SHEETS = (
    Datasheet("gnss", "gnss_position", 1.0, np.ones(3)),
    Datasheet("dvl", "dvl", 1.0, np.ones(3)),
)
IMU = ImuDatasheet(100.0, TriadDatasheet(), TriadDatasheet())
KINDS = {"gnss": "gnss_position", "dvl": "dvl"}
S99 = normal_quantile(0.99)


def given(residual, time: float, name: str = "gnss", predicted: float = 0.5) -> Innovation:
    """An innovation of three components with R = I."""
    m = Measurement(time, name, KINDS[name], np.zeros(3))
    return Innovation(m, np.asarray(residual, dtype=float), predicted * np.eye(3), np.eye(3))


def course_of(innovations: np.ndarray) -> list[bool]:
    """Whether innovations of three components, already standardised, are found correlated, one after the other."""
    course, found = no_innovations(1), []
    for k, u in enumerate(innovations):
        add_innovation(course, 0, *u, 3, float(k), False)
        found.append(is_correlated(course, 0, S99))
    return found


def filtered(process: float, noise: float, rng: np.random.Generator, n: int = 4000) -> np.ndarray:
    """Innovations of a filter of three random walks that takes both sigmas for 1."""
    gain = (np.sqrt(5.0) - 1.0) / 2.0  # steady state: P = Q + P - P^2/(P + R), K = P/(P + R)
    x, estimate, found = np.zeros(3), np.zeros(3), []
    for _ in range(n):
        x = x + process * rng.standard_normal(3)
        v = x + noise * rng.standard_normal(3) - estimate
        estimate = estimate + gain * v
        found.append(v)
    return np.array(found)


def test_a_wrong_motion_correlates_innovations_and_a_wrong_noise_does_not():
    """Mehra (1970): the lag-one correlation is above zero where Q is too small, and below where R is."""
    rng = np.random.default_rng(0)
    assert np.mean(course_of(filtered(10.0, 1.0, rng))) > 0.5
    assert np.mean(course_of(filtered(1.0, 1.0, rng))) < 0.02
    assert np.mean(course_of(filtered(1.0, 10.0, rng))) < 0.001


def test_a_white_noise_of_any_size_and_tails_is_not_found_correlated():
    rng = np.random.default_rng(1)
    for u in (rng.standard_normal((4000, 3)), 30.0 * rng.standard_normal((4000, 3)), rng.standard_t(2.0, (4000, 3))):
        assert np.mean(course_of(u)) < 0.02


def test_large_is_chi_square():
    """Unit normals are found too large at the level of the test at most; the fading lowers the share."""
    rng = np.random.default_rng(2)
    course, found = no_innovations(1), []
    for k in range(20_000):
        add_innovation(course, 0, *rng.standard_normal(3), 3, float(k), False)
        found.append(is_large(course, 0, normal_quantile(0.95)))
    assert 0.003 < np.mean(found) < 0.05


NEVER = 10**6  # so many failures in a row there are not: the test of joint failures says nothing


def judged(imu: bool, dvl, gnss, dvl_until: float = 100.0, predicted: float = 0.5, together: int = 3) -> list[bool]:
    """The verdicts on 30 fixes of ``gnss(k)``, each after a velocity of ``dvl(k)`` that is heard until a time."""
    test = JudgedPredictions(Instruments(SHEETS, IMU if imu else None), together)
    found = []
    for k in range(30):
        if k <= dvl_until:
            test.fails(given(dvl(k), k, "dvl", predicted))
        found.append(test.fails(given(gnss(k), k + 0.5, "gnss", predicted)))
    return found


def test_a_lasting_error_is_that_of_the_fixes_if_the_log_is_a_witness():
    rng = np.random.default_rng(3)
    good = rng.standard_normal((30, 3))
    off = 5.0 + good
    assert not any(judged(True, lambda k: good[k], lambda k: off[k])[10:])


def test_a_lasting_error_is_that_of_the_prediction_if_no_witness_is_heard_or_both_persist():
    rng = np.random.default_rng(3)
    good = rng.standard_normal((30, 3))
    off = 3.0 + good
    assert all(judged(True, lambda k: good[k], lambda k: off[k], dvl_until=3.0)[15:])
    assert all(judged(True, lambda k: off[k], lambda k: off[k])[15:])


def test_what_the_witness_said_at_first_stands():
    """A filter that follows wrong fixes soon disagrees with the log, too."""
    rng = np.random.default_rng(3)
    good = rng.standard_normal((30, 3))
    off = 3.0 + good
    assert not any(judged(True, lambda k: good[k] if k < 18 else off[k], lambda k: off[k], together=NEVER))
    assert all(judged(True, lambda k: off[k], lambda k: off[k], together=NEVER)[15:])  # nothing was said at first


def test_a_white_noise_without_a_witness_is_that_of_the_fixes():
    noise = 6.0 * np.random.default_rng(4).standard_normal((30, 3))
    assert np.mean(judged(True, lambda k: noise[k], lambda k: noise[k], dvl_until=3.0)[15:]) < 0.2


def test_without_a_witness_an_error_of_any_size_is_that_of_the_prediction():
    """A disturbed gyroscope makes errors of any size. Without an IMU the test is not made."""
    off = 30.0 * np.ones(3)
    assert all(judged(True, lambda k: off, lambda k: off, dvl_until=-1.0, predicted=1e-3)[15:])
    assert not any(judged(False, lambda k: off, lambda k: off, dvl_until=-1.0))


def lone_log(says, fixes: bool = False) -> list[bool]:
    """The verdicts on 20 velocities, six seconds after the last fix or with a sound fix after each."""
    test, rng, found = JudgedPredictions(Instruments(SHEETS, IMU)), np.random.default_rng(8), []
    for k in range(20):
        found.append(test.fails(given(says(k), float(k), "dvl")))
        if fixes:
            test.fails(given(rng.standard_normal(3), k + 0.5, "gnss"))
    return found


def test_a_lone_log_is_believed_from_its_second_failure_in_one_direction_on():
    """What a log says is said once, so it is not waited until six innovations are found correlated."""
    rng = np.random.default_rng(7)
    good = rng.standard_normal((20, 3))
    drift = np.outer(np.arange(20) - 9.0, (9.0, -14.0, -17.0))
    off = [good[k] if k < 10 else drift[k] for k in range(20)]
    assert lone_log(lambda k: off[k])[9:] == [False, False, *9 * [True]]
    assert not any(lone_log(lambda k: off[k], fixes=True))


def test_a_gross_error_or_a_larger_noise_of_a_lone_log_has_no_direction():
    rng = np.random.default_rng(9)
    single = [40.0 * rng.standard_normal(3) if k % 4 == 0 else rng.standard_normal(3) for k in range(20)]
    assert not any(lone_log(lambda k: single[k]))
    noise = 30.0 * np.random.default_rng(10).standard_normal((4000, 3))
    test = JudgedPredictions(Instruments(SHEETS, IMU))
    found = [test.fails(given(u if k % 8 else 0.0 * u, float(k), "dvl")) for k, u in enumerate(noise)]
    assert 0.05 < np.mean(found) < 0.15  # 1 - PredictionTest.ALONE


@pytest.mark.parametrize("count", [2, 3])
def test_the_cosine_of_isotropic_innovations_has_unit_variance_over_their_number(count: int):
    """The statistic of runs is exceeded as often as a standard normal, for any law of the sizes."""
    rng, course, found = np.random.default_rng(11), no_innovations(1), []
    for k in range(20_000):
        u = np.zeros(3)
        u[:count] = rng.standard_normal(count) * np.exp(2.0 * rng.standard_normal())
        add_innovation(course, 0, *u, count, float(k), k % 6 != 0)
        if k % 6 == 5:
            found.append(is_directed(course, 0, normal_quantile(0.9)))
    assert 0.08 < np.mean(found) < 0.12


def test_a_compass_is_believed_only_while_another_instrument_finds_the_prediction_wrong():
    sheet = Datasheet("compass", "gyrocompass", 1.0, np.ones(1))
    test, found, others = JudgedPredictions(Instruments((*SHEETS, sheet), IMU)), [], [False]
    for k in range(60):
        m = Measurement(float(k), "compass", "gyrocompass", np.zeros(1))
        found.append(test.fails(Innovation(m, np.array([9.0]), 0.5 * np.eye(1), np.eye(1))))
        wrong = 10 <= k < 20
        others.append(test.fails(given((9.0, -14.0, -17.0) if wrong else np.zeros(3), k + 0.5, "dvl")))
    assert found == others[:-1]
    assert all(found[12:21])
    assert not any(found[:12])
    assert not found[-1]


def depth_judged(with_dvl: bool) -> list[bool]:
    """The verdicts on 30 depths that are wrong by five sigma, with or without a sound DVL beside them."""
    sheet = Datasheet("depth", "depth", 1.0, np.ones(1))
    test = JudgedPredictions(Instruments((*SHEETS, sheet), IMU))
    rng, found = np.random.default_rng(6), []
    for k in range(30):
        if with_dvl:
            test.fails(given(rng.standard_normal(3), k, "dvl"))
        m = Measurement(k + 0.5, "depth", "depth", np.zeros(1))
        found.append(test.fails(Innovation(m, np.array([5.0]), 0.5 * np.eye(1), np.eye(1))))
    return found


def test_a_depth_sensor_is_believed_unless_a_dvl_is_a_witness():
    """Before, a depth sensor beside a wrong accelerometer lost its weight, and the height was left to the IMU."""
    assert all(depth_judged(with_dvl=False)[15:])
    assert not any(depth_judged(with_dvl=True))


def test_who_notices_whom():
    kinds = {
        "gnss": "gnss_position", "usbl": "terrain_fix", "dvl": "dvl", "log": "speed_log", "depth": "depth",
        "compass": "gyrocompass",
    }  # fmt: skip
    found = witnesses(
        Instruments(tuple(Datasheet(n, k, 1.0, np.ones(len(ERRORS[k].errors))) for n, k in kinds.items()))
    )
    assert found["gnss"] == found["usbl"] == ("dvl", "log")
    assert found["dvl"] == found["log"] == ("gnss", "usbl")
    assert found["depth"] == ("gnss", "dvl")
    assert "compass" not in found


@pytest.mark.parametrize("adaptation", [InnovationBased(), FixedWindow(), VariationalBayes(), SageHusa()])
def test_a_memory_is_as_long_in_seconds_at_a_higher_rate(adaptation):
    """After a noise step to 4 sigma, the time to half of the new sigma at 10 Hz is that at 1 Hz, to a third."""
    times = []
    for rate in (1.0, 10.0):
        rng, found = np.random.default_rng(5), np.zeros(int(60 * rate))
        for _ in range(20):
            adaptation.reset(Instruments((Datasheet("gnss", "gnss_position", rate, np.ones(3)),)))
            for _ in range(int(40 * rate)):
                adaptation.adapt(given(1.05 * rng.standard_normal(3), 0.0, predicted=0.1))
            for k in range(len(found)):
                noise = adaptation.adapt(given(4.0 * rng.standard_normal(3), 0.0, predicted=0.1))
                found[k] += noise[0, 0] / 20.0
        times.append((1 + np.argmax(found > 8.0)) / rate)
    assert times[1] == pytest.approx(times[0], rel=0.34)


@pytest.fixture(scope="module")
def voyages():
    """A lone DVL and one second of a disturbed gyroscope; GNSS as the only aid, with an IMU eight times too noisy."""
    found = {}
    for name, seed in (("lone-dvl", 4), ("sole-gnss", 4)):
        recording = record(load(name), seed)
        found[name] = recording, error(recording, "ekf")
    return found


def error(recording, row: str) -> float:
    """Horizontal RMSE of a row [m]."""
    trial = run_trial(make(row), recording)
    assert trial.status == "ok", trial.reason
    return score(trial, recording, ["horizontal_rmse"])["horizontal_rmse"]


@pytest.mark.parametrize(
    "row", ["iae", "rae", "sage-husa", "vb-akf", "adkf", "igg3", "huber-kf", "gated-ekf", "mckf", "student-t", "imm"]
)
@pytest.mark.parametrize("case", ["lone-dvl", "sole-gnss"])
def test_a_poor_imu_does_not_ruin_an_adaptive_row(voyages, case: str, row: str):
    """Before the test of persistence most of these rows had 3 to 130 times the error of the plain filter."""
    recording, plain = voyages[case]
    assert error(recording, row) < 2.5 * plain


@pytest.mark.parametrize("case", ["lone-dvl", "sole-gnss"])
def test_a_poor_imu_does_not_ruin_solution_separation(voyages, case: str):
    recording, plain = voyages[case]
    assert error(recording, "solution-separation") < 4.0 * plain
