"""Estimators with raw observations of satellites: tightly coupled by the blocks of states, consistent, and alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from simnav.estimator import make
from simnav.estimators.adaptations.truth import TrueNoise
from simnav.geometry.earth import relative_position
from simnav.recording import Recording
from simnav.satellites.orbit import SPEED_OF_LIGHT
from simnav.scenario import Scenario
from simnav.sensors.gnss_raw import GnssRaw
from simnav.simulation.simulator import Simulator, ideal
from simnav.source import record
from simnav.spec import SpecError
from simnav.trial import Trial, run_trial
from simnav.types import Instruments
from tests.cases.raw_gnss import raw_gnss


def run(name: str, scenario: Scenario, seed: int) -> tuple[Trial, Recording]:
    recording = record(scenario, seed)
    trial = run_trial(make(name), recording)
    assert trial.status == "ok", trial.reason
    return trial, recording


def error(trial: Trial, recording: Recording) -> np.ndarray:
    """(T, 6) errors of position [m] and velocity [m/s]."""
    truth = recording.data.truth
    away = relative_position(trial.position, truth.position)
    return np.concatenate([away, trial.velocity - truth.velocity], axis=1)


def test_the_filter_is_consistent_on_clean_runs():
    """NEES of position and velocity at the end of independent runs, within the 99.9 % interval of chi-square."""
    total, runs = 0.0, 8
    for seed in range(runs):
        trial, recording = run("ekf", raw_gnss(40.0), seed)
        last = error(trial, recording)[-1]
        total += last @ np.linalg.solve(trial.covariance[-1][:6, :6], last)
    low, high = chi2.ppf([0.0005, 0.9995], 6 * runs)
    assert low < total < high


def test_filter_window_and_oracle_agree():
    scenario = raw_gnss(30.0)
    trials = {name: run(name, scenario, 3) for name in ("ekf", "sw-fgo", "oracle")}
    errors = {name: error(*found) for name, found in trials.items()}
    sigma = np.sqrt(np.diagonal(trials["oracle"][0].covariance, axis1=1, axis2=2)[:, :6])
    for name in ("sw-fgo", "oracle"):
        assert (abs(errors[name] - errors["ekf"])[5:] < sigma[5:]).all()
    clock, truth = trials["ekf"][0].diagnostics, record(scenario, 3)
    spec = scenario.aids["gnss"].build("gnss", 3)
    true = spec.block("clock", truth.data.truth.time)
    off = (clock["state.gnss.clock"] - true)[5:] / clock["sigma.gnss.clock"][5:]
    assert abs(off).max() < 5.0


STEP = """
[[fault]]
kind = "bias_step"
instruments = "gnss"
channels = ["E30"]
start_s = 14.0
end_s = 38.0
offset_m = 40.0
offset_m_s = 0.0
"""


def test_a_satellite_with_an_error_is_flagged_alone():
    """As long as it lasts: that all its readings fail does not discredit the filter while other satellites pass."""
    trial, recording = run("gated-ekf", raw_gnss(40.0, STEP), 2)
    faulty = [(source, time) for source, time in trial.flagged if source == "gnss:E30"]
    assert faulty == [("gnss:E30", float(time)) for time in range(14, 38)]
    assert len(trial.flagged) - len(faulty) < 0.02 * 7 * 40
    assert np.linalg.norm(error(trial, recording)[-1, :2]) < 3.0


RECEIVER = """
[instruments.fix]
kind = "gnss_receiver"
observations = "gnss"
sigma_m = [0.5, 0.5, 1.0]
bias_instability_m = [1.0, 1.0, 3.0]
correlation_time_s = 600.0
lever_arm_m = [-3.0, 0.0, -12.0]
[instruments.doppler]
kind = "gnss_receiver_velocity"
observations = "gnss"
sigma_m_s = [0.04, 0.04, 0.08]
lever_arm_m = [-3.0, 0.0, -12.0]
[[fault]]
kind = "outage"
instruments = "gnss"
channels = {0}
start_s = 120.0
end_s = 181.0
"""


def of_instruments(recording: Recording, *names: str) -> Recording:
    """The recording with some of its instruments only."""
    given = recording.instruments
    sheets = [sheet for sheet in given.values() if sheet.name in names]
    data = replace(recording.data, aids={name: recording.data.aids[name] for name in names})
    return replace(recording, instruments=Instruments(sheets, given.imu, given.step), data=data)


@pytest.mark.parametrize(("left", "share"), [(("G11", "G12", "E27"), 0.5), (("G12", "E27"), 1.0)])
def test_tight_coupling_uses_what_is_left(left, share):
    """With three satellites for a minute the error is at most half of that with the receiver, which is silent then."""
    gone = [s for s in raw_gnss().aids["gnss"].channels() if s not in left]
    errors = {"raw": [], "receiver": []}
    for seed in range(3):
        recording = record(raw_gnss(180.0, RECEIVER.format(gone)), seed)
        for form, names in (("raw", ("gnss",)), ("receiver", ("fix", "doppler"))):
            part = of_instruments(recording, *names)
            errors[form].append(np.linalg.norm(error(run_trial(make("ekf"), part), part)[-1, :2]))
    raw, receiver = (np.sqrt(np.mean(np.square(errors[form]))) for form in ("raw", "receiver"))
    assert raw <= share * receiver


WALL = """
[surroundings.obstacles]
kind = "obstacles"
latitude_deg = 54.0
longitude_deg = 7.9
[[surroundings.obstacles.obstacle]]
centre_m = [40.0, 65.0]
size_m = [400.0, 10.0]
top_m = 50.0
"""


def test_an_oracle_knows_the_map():
    """It takes off what reflections add, and its bound has none of it."""
    scenario = raw_gnss(12.0, WALL)
    recording = record(scenario, 1)
    stream, knowledge = recording.data.aids["gnss"], TrueNoise()
    knowledge.reveal(recording)
    assert [label.kind for label in recording.faults] == ["reflection"]
    late = np.flatnonzero(stream.faults)
    assert len(late) > 5
    for k, given in enumerate(stream.measurements()):
        wanted = stream.value[k] - stream.fault_error[k]
        np.testing.assert_allclose(knowledge.corrected(given).value, wanted, rtol=0, atol=1e-9)
    perfect, free = ideal(scenario, 1).data.aids["gnss"], ideal(raw_gnss(12.0), 1).data.aids["gnss"]
    same = free.places(perfect.time, perfect.channel)
    assert abs(perfect.value - free.value[same])[:, 0].max() < 0.11  # what has no label


def stepping(duration: float) -> Scenario:
    scenario = raw_gnss(duration)
    gnss = scenario.aids["gnss"].model_copy(update={"clock_step": 1e-5})
    return scenario.model_copy(update={"instruments": {**scenario.instruments, "gnss": gnss}})


@pytest.mark.parametrize("name", ["ekf", "gated-ekf", "gnc-fgo", "ukf", "oracle"])
def test_estimates_survive_steps_of_the_receivers_clock(name):
    """Beside the same run with a clock that runs freely: nothing but rounding, on ranges of 20 000 km."""
    free, stepped = record(raw_gnss(25.0), 2), record(stepping(25.0), 2)
    away = stepped.data.aids["gnss"].value - free.data.aids["gnss"].value
    steps = away[:, 0] / (SPEED_OF_LIGHT * 1e-5)
    np.testing.assert_allclose(steps, np.round(steps), rtol=0, atol=1e-9)
    assert len(np.unique(np.round(steps))) > 1
    assert not away[:, 1].any()
    ours, theirs = (run_trial(make(name), recording) for recording in (stepped, free))
    assert abs(error(ours, stepped) - error(theirs, free)).max() < 1e-5
    assert ours.flagged == theirs.flagged


def test_steps_of_the_receivers_clock_have_a_label():
    """On all first readings after a step, whether the run is made at one time or in blocks."""
    recording = record(stepping(60.0), 2)
    stream = recording.data.aids["gnss"]
    assert [(label.kind, label.instruments) for label in recording.faults] == [("clock_jump", ("gnss",))]
    rows = stream.channel == stream.channel[0]
    time, value = stream.time[rows], stream.value[rows]
    # What its rate does not explain of the change of a range from one epoch to the next.
    change = np.diff(value[:, 0]) - 0.5 * (value[1:, 1] + value[:-1, 1]) * np.diff(time)
    jumped = np.append(False, abs(change) > 0.5 * SPEED_OF_LIGHT * 1e-5)
    assert jumped.sum() >= 2
    np.testing.assert_array_equal(stream.faults[rows] != 0, jumped)
    assert not stream.fault_error.any()
    simulator = Simulator(stepping(60.0), 2)
    blocks = [simulator.advance(until) for until in (7.0, 21.0, 40.0, 60.0)]
    again = np.concatenate([block.aids["gnss"].faults for block in blocks])
    np.testing.assert_array_equal(again, stream.faults)


def test_a_step_that_no_receiver_makes_is_refused():
    with pytest.raises(SpecError, match=r"clock_step_s = 1e-06 should be 0, or at least 1e-05; receivers have 0\.001"):
        GnssRaw.from_toml(
            {"satellites": ["G11"], "sigma_pseudorange_m": 0.3, "sigma_range_rate_m_s": 0.05, "clock_step_s": 1e-6}
        )
