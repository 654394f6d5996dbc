"""The flat-line test of the samples of an IMU."""

import dataclasses
import itertools

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.models.flat_lines import FIRST_SAMPLES, REPETITIONS, FlatLineTest
from simnav.estimators.models.propagation import HELD_ATTITUDE, HELD_VELOCITY
from simnav.scenario import load
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial
from simnav.types import ImuDatasheet, ImuSamples, TriadDatasheet
from tests.cases.samples_as_given import as_given

SHEET = ImuDatasheet(100.0, TriadDatasheet(random_walk=1e-4), TriadDatasheet(random_walk=1e-3))
STUCK = slice(FIRST_SAMPLES + 200, FIRST_SAMPLES + 500)


def samples(count=2000, seed=0):
    """Samples of a vehicle in waves, with noise."""
    rng = np.random.default_rng(seed)
    time = 0.01 * np.arange(1, count + 1)
    wave = np.sin(5.0 * time)[:, None]
    rate = 0.05 * wave + 1e-3 * rng.standard_normal((count, 3))
    force = np.array([0.0, 0.0, -9.8]) + 0.5 * wave + 1e-2 * rng.standard_normal((count, 3))
    return ImuSamples(time, np.full(count, 0.01), rate, force)


def together(found):
    return np.hstack([found.angular_rate, found.specific_force])


def given(imu):
    return np.hstack([imu.angular_rate, imu.specific_force])


def stuck(imu, axes, rows=STUCK, value=None):
    """The samples with some axes at their value before the rows, or at another one."""
    values = given(imu)
    values[rows, axes] = values[rows.start - 1, axes] if value is None else value
    return dataclasses.replace(imu, angular_rate=values[:, :3].copy(), specific_force=values[:, 3:].copy())


def test_samples_with_noise_stay_as_they_are():
    imu = samples()
    found = FlatLineTest(SHEET).samples(imu)
    np.testing.assert_array_equal(together(found), given(imu))
    assert not found.unmeasured.any()


@pytest.mark.parametrize("axis", range(6))
def test_a_stuck_axis_goes_back_to_its_mean_and_gets_noise(axis: int):
    imu = stuck(samples(), [axis])
    found = FlatLineTest(SHEET).samples(imu)
    expected = np.zeros((len(imu), 6), bool)
    expected[STUCK.start + REPETITIONS - 1 : STUCK.stop, axis] = True
    np.testing.assert_array_equal(found.unmeasured > 0.0, expected)
    mean = [0.0, 0.0, 0.0, 0.0, 0.0, -9.8][axis]
    last = together(found)[STUCK.stop - 1, axis]
    assert abs(last - mean) < (0.01 if axis < 3 else 0.1)
    held = HELD_ATTITUDE if axis < 3 else HELD_VELOCITY
    np.testing.assert_array_equal(found.unmeasured[expected], held**2)
    np.testing.assert_array_equal(together(found)[~expected], given(imu)[~expected])
    np.testing.assert_array_equal(
        imu.angular_rate, stuck(samples(), [axis]).angular_rate
    )  # the samples are not changed


def test_an_imu_that_gives_zeros_is_known_at_once():
    imu = stuck(samples(), range(6), value=0.0)
    found = FlatLineTest(SHEET).samples(imu)
    assert (found.unmeasured[STUCK] > 0.0).all()
    assert not np.delete(found.unmeasured, np.r_[STUCK], axis=0).any()
    assert found.specific_force[STUCK, 2].max() < -9.0


def test_blocks_of_samples_do_as_one():
    imu = stuck(samples(), [1, 4])
    whole, test, ends = FlatLineTest(SHEET).samples(imu), FlatLineTest(SHEET), [0, 7, 1199, 1203, 1204, 1450, 2000]
    parts = [test.samples(imu[slice(*pair)]) for pair in itertools.pairwise(ends)]
    for name in ("angular_rate", "specific_force", "unmeasured"):
        np.testing.assert_array_equal(np.vstack([getattr(p, name) for p in parts]), getattr(whole, name))
    assert FlatLineTest(SHEET).samples(None).time.size == 0


def test_saturation_in_every_wave_is_found_every_time():
    imu = samples(20_000)
    rate = np.where(imu.time[:, None] > 15.0, np.clip(imu.angular_rate, -0.03, 0.03), imu.angular_rate)
    clipped = np.abs(rate) == 0.03
    found = FlatLineTest(SHEET).samples(dataclasses.replace(imu, angular_rate=rate)).unmeasured[:, :3] > 0.0
    assert found.sum() > 0.8 * clipped.sum()
    assert not found[~clipped].any()


def test_the_end_of_the_range_is_no_measurement_from_the_first_sample_on():
    imu = samples()
    rate = np.clip(imu.angular_rate, -0.03, 0.03)
    sheet = dataclasses.replace(SHEET, gyroscope=dataclasses.replace(SHEET.gyroscope, range=0.03))
    found = FlatLineTest(sheet).samples(dataclasses.replace(imu, angular_rate=rate))
    np.testing.assert_array_equal(found.unmeasured[:, :3] > 0.0, np.abs(rate) == 0.03)


@pytest.mark.parametrize("kind", ["coarse", "repeated by the logger", "without noise", "no noise by the datasheet"])
def test_an_axis_that_repeats_itself_is_not_tested(kind: str):
    imu, sheet = samples(5000), SHEET
    if kind == "coarse":
        imu = dataclasses.replace(imu, angular_rate=np.round(imu.angular_rate, 2))
    elif kind == "repeated by the logger":
        imu = dataclasses.replace(imu, angular_rate=np.repeat(imu.angular_rate[::10], 10, axis=0))
    elif kind == "without noise":
        still = np.tile([1e-5, 0.0, 2e-5], (len(imu), 1))
        imu = dataclasses.replace(imu, angular_rate=still)
    else:
        imu = stuck(imu, [0])
        sheet = dataclasses.replace(SHEET, gyroscope=TriadDatasheet())
    assert not FlatLineTest(sheet).samples(imu).unmeasured.any()


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e9])
def test_an_absurd_sample_does_not_change_the_mean(bad: float):
    imu = stuck(samples(), [0, 5])
    imu.angular_rate[500, 0] = imu.specific_force[500, 2] = bad
    found = FlatLineTest(SHEET).samples(imu)
    assert abs(together(found)[STUCK.stop - 1, 0]) < 0.01
    assert abs(together(found)[STUCK.stop - 1, 5] + 9.8) < 0.1


@pytest.mark.parametrize("name", ["ekf", "sw-fgo", "inekf", "gtsam-fixed-lag"])
def test_zeros_of_the_imu_hardly_matter(name: str, monkeypatch):
    recording = record(load("imu-dropouts").with_values({"draw.output": "zero", "draw.length": 2.0}), 9100)
    with_test = score(run_trial(make(name), recording), recording, ["horizontal_rmse"])
    monkeypatch.setattr(FlatLineTest, "samples", staticmethod(as_given))
    without = score(run_trial(make(name), recording), recording, ["horizontal_rmse"])
    assert with_test["horizontal_rmse"] < 0.5 * without["horizontal_rmse"]
    assert with_test["horizontal_rmse"] < 2.5
