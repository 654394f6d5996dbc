"""The sliding window as a solver: against filters and the full graph, its plug-ins, and what it does with bad input."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from simnav.estimator import Estimator, find, make, names
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.composition import Row
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.base import Factors, Weighting
from simnav.recording import Recording
from simnav.scenario import load
from simnav.scenario.reading import parse
from simnav.source import record
from simnav.trial import Trial, run_trial
from simnav.types import Estimate, Measurements

RECIPES = {n: find(n).recipe for n in names() if issubclass(find(n), Row) and not find(n).loose}  # no receiver here
ROWS = [n for n, recipe in RECIPES.items() if issubclass(recipe["solver"].make, WindowEstimator)]
#: Few nodes, so that these tests take seconds.
FAST = [n for n in ROWS if n not in ("fgo-unsimplified",) and "ship" not in n and "anfis" not in n]


@pytest.fixture(scope="module")
def clean() -> Recording:
    """Two minutes of the open sea: instruments of white noise."""
    return record(load("open-sea").model_copy(update={"duration": 120.0}), 1)


def run(estimator: Estimator, recording: Recording) -> list[Estimate]:
    estimator.reset(recording.start, recording.instruments)
    return [estimator.update(p) for p in recording.steps()]


def position(estimates: list[Estimate], recording: Recording) -> np.ndarray:
    """Positions, in metres off the first of the truth (north, east, up)."""
    first = recording.data.truth.position[0]
    scale = np.array([6.37e6, 6.37e6 * np.cos(first[0]), 1.0])
    return np.array([(e.position - first) * scale for e in estimates])


def sigma(trial: Trial, axes: slice = slice(0, 2)) -> np.ndarray:
    assert trial.covariance is not None
    return np.sqrt(np.trace(trial.covariance[:, axes, axes], axis1=1, axis2=2))


def horizontal(trial: Trial, recording: Recording) -> np.ndarray:
    truth = recording.data.truth.position[: len(trial)]
    d = (trial.position - truth)[:, :2] * [6.37e6, 6.37e6 * np.cos(truth[0, 0])]
    return np.hypot(d[:, 0], d[:, 1])


def test_one_epoch_is_an_iterated_filter(clean: Recording):
    one = position(run(make("sw-fgo", window=1), clean), clean)
    filtered = position(run(make("iekf"), clean), clean)
    np.testing.assert_allclose(one, filtered, atol=2e-3)


QUIET = """
name = "quiet"
version = 1
title = "accelerometers without white noise, as datasheets of the best ones leave it out"
duration_s = 80.0

[start]
latitude_deg = 45.0
longitude_deg = 10.0
speed_m_s = 5.0

[initial_error]
position_m = [2.0, 2.0, 3.0]
velocity_m_s = [0.05, 0.05, 0.05]
attitude_deg = [0.2, 0.2, 1.5]

[vessel]
kind = "ship"

[[manoeuvre]]
kind = "zigzag"
angle_deg = 25.0
duration_s = 80.0

[instruments.imu]
rate_hz = 50.0
grade = "navigation"

[instruments.gnss]
kind = "gnss_position"
rate_hz = 1.0
sigma_m = [1.5, 1.5, 3.0]

[instruments.dvl]
rate_hz = 1.0
sigma_m_s = 0.02
"""


@pytest.fixture(scope="module")
def quiet() -> Recording:
    return record(parse(QUIET, source="quiet"), 9301)


@pytest.mark.parametrize("name", [n for n in FAST if not n.endswith("-paper")])
def test_accelerometers_without_noise_are_believed(name: str, quiet: Recording):
    """The rounding of their motion is no error that a robust weight should see."""
    assert quiet.instruments.imu is not None
    assert quiet.instruments.imu.accelerometer.random_walk == 0.0
    error, plain = (horizontal(run_trial(make(n), quiet), quiet) for n in (name, "ekf"))
    assert len(error) == len(plain) == 80
    assert np.sqrt(np.mean(error**2)) < 1.3 * np.sqrt(np.mean(plain**2))


def test_what_left_the_window_is_not_forgotten(clean: Recording):
    """Newest states of windows of any length, and of all that was ever measured, are the same on clean data."""
    full = run(make("fgo-full"), clean)
    for window in (3, 20):
        sliding = run(make("sw-fgo", window=window), clean)
        off = position(sliding, clean) - position(full, clean)
        assert np.max(np.abs(off)) < 0.01, window
        for a, b in zip(sliding[20::20], full[20::20]):
            scale = np.sqrt(np.diagonal(b.covariance))
            np.testing.assert_allclose(
                a.covariance / np.outer(scale, scale), b.covariance / np.outer(scale, scale), atol=0.02
            )


def test_converging_further_changes_little(clean: Recording):
    loose = position(run(make("sw-fgo"), clean), clean)
    tight = position(run(make("sw-fgo", tolerance=1e-7, iterations=20), clean), clean)
    assert np.max(np.abs(loose - tight)) < 1e-4


def test_its_memory_does_not_grow_with_the_run(clean: Recording):
    """Not even the work space: a minute more costs nothing."""
    estimator = make("sw-fgo")
    estimator.reset(clean.start, clean.instruments)
    steps = list(clean.steps())
    for p in steps[:60]:
        estimator.update(p)
    tracemalloc.start()
    try:
        for p in steps[60:65]:
            estimator.update(p)
        before = tracemalloc.get_traced_memory()[0]
        for p in steps[65:]:
            estimator.update(p)
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 20_000
    assert isinstance(estimator.solver, WindowEstimator)
    assert len(estimator.chain.nodes) <= 40  # two instants a second


def test_an_adaptation_decides_when_a_measurement_arrives(clean: Recording):
    bad = spoiled(clean, "gnss", 60.0, 61.0, 300.0)
    plain = run_trial(WindowEstimator(InertialModel()), bad)
    gated = run_trial(WindowEstimator(InertialModel(), ChiSquareGate()), bad)
    at = int(np.searchsorted(gated.time, 61.5))
    assert horizontal(plain, bad)[at] > 5.0 * horizontal(gated, bad)[at]
    assert any(name == "gnss" and 60.0 <= t <= 61.0 for name, t in gated.flagged)
    # What it sees is what it sees in a filter: the innovation, normalised by the covariance of its prediction.
    filtered = run_trial(KalmanEstimator(InertialModel(), ChiSquareGate()), clean)
    for quantity in ("innovation.gnss", "nis.gnss"):
        seen, expected = gated.diagnostics[quantity][:10], filtered.diagnostics[quantity][:10]
        assert seen == pytest.approx(expected, rel=0.05, nan_ok=True)
        assert np.isfinite(seen).any()


def test_a_weighting_sees_every_factor_and_is_asked_until_it_has_settled(clean: Recording):
    class Slow(Weighting):
        asked: ClassVar[list[int]] = []

        def weigh(self, factors: Factors) -> bool:
            self.asked.append(factors.iteration)
            assert len(factors.norm) == len(factors.weight) == len(factors.instrument)
            assert len(factors.motion_norm) == len(factors.motion_weight)
            np.testing.assert_allclose(np.linalg.norm(factors.whitened, axis=1), factors.norm, rtol=1e-9)
            r, noise = factors.residual[-1], factors.noise[-1]
            assert factors.norm[-1] ** 2 == pytest.approx(r @ np.linalg.solve(noise, r))
            factors.weight[factors.instrument == factors.names.index("gnss")] = 0.25
            return factors.iteration >= 4

    weighed = WindowEstimator(InertialModel(), weighting=Slow())
    trial = run_trial(weighed, clean)
    assert trial.status == "ok", trial.reason
    asked = np.array(Slow.asked)
    assert np.all(asked[:-1][asked[1:] == 0] >= 4)  # at the end of each epoch
    assert np.nanmax(trial.diagnostics["weight.gnss"]) == 0.25
    assert sorted(trial.flagged) == [("gnss", t) for t in clean.data.aids["gnss"].time]  # a weight of half or less
    # Every GNSS position with twice its sigma: the window is less sure of its own.
    plain = run_trial(make("sw-fgo"), clean)
    assert sigma(trial)[-1] > 1.3 * sigma(plain)[-1]


@pytest.mark.parametrize("name", ["huber-fgo", "ga-fgo", "ship-fgo"])
def test_what_is_kept_of_older_nodes_and_weights_is_within_the_tolerance(clean: Recording, name: str):
    """Against everything linearised, weighed and eliminated anew until nothing moves; in units of the covariance."""
    recording = clean
    if name == "ship-fgo":
        recording = record(load("ship-turn").model_copy(update={"duration": 300.0}), 1)
    fast, exact = run(make(name), recording), run(make(name, tolerance=1e-7, iterations=50), recording)
    for ours, theirs in zip(fast, exact):
        sigmas = np.sqrt(np.diag(theirs.covariance)[:2])
        away = np.abs(ours.position - theirs.position)[:2] * [6.4e6, 6.4e6 * np.cos(theirs.position[0])] / sigmas
        assert np.all(away < 0.1)


def test_diagnostics_name_every_factor(clean: Recording):
    trial = run_trial(make("sw-fgo"), clean)
    for name in (*clean.instruments, "motion"):
        assert np.isfinite(trial.diagnostics[f"residual.{name}"][2:]).all(), name
        assert np.all(trial.diagnostics[f"weight.{name}"][2:] == 1.0), name
    # A normalised residual of the newest position: three components, correlated with an estimate that it has made.
    assert 0.8 < np.mean(trial.diagnostics["residual.gnss"] ** 2) < 3.5
    assert np.all(trial.diagnostics["cost"] > 0.0)


def test_a_wrong_heading_is_found_by_damped_steps(clean: Recording):
    """90 degrees off, and the prior says so: a plain step overshoots, the cost decides."""
    attitude = clean.start.attitude.copy()
    attitude[2] += 1.5
    covariance = clean.start.covariance.copy()
    covariance[8, 8] = 2.0**2
    start = replace(clean.start, attitude=attitude, covariance=covariance)
    turned = replace(clean, start=start)
    trial = run_trial(make("sw-fgo"), turned)
    assert trial.status == "ok", trial.reason
    yaw = trial.attitude[-1, 2] - clean.data.truth.attitude[len(trial) - 1, 2]
    assert abs(np.arctan2(np.sin(yaw), np.cos(yaw))) < 0.05


# Bad input ------------------------------------------------------------------------------------------------------------


def spoiled(recording: Recording, name: str, begin: float, end: float, metres: float, seed: int = 0) -> Recording:
    """Positions of a stretch, thrown off by that much in a random direction."""
    stream = recording.data.aids[name]
    rng = np.random.default_rng(seed)
    inside = (stream.time >= begin) & (stream.time <= end)
    angle = rng.uniform(0.0, 2.0 * np.pi, int(inside.sum()))
    value = stream.value.copy()
    value[inside, 0] += metres * np.cos(angle) / 6.37e6
    value[inside, 1] += metres * np.sin(angle) / 6.37e6
    aids = {**recording.data.aids, name: replace(stream, value=value)}
    return replace(recording, data=replace(recording.data, aids=aids))


def without(recording: Recording, begin: float, end: float, *keep: str) -> Recording:
    """No aids in a stretch but those to be kept."""
    aids = {}
    for name, stream in recording.data.aids.items():
        left = ~((stream.time >= begin) & (stream.time <= end) & (name not in keep))
        rows = {n: getattr(stream, n)[left] for n in ("time", "value", "faults", "fault_error", "sigma")}
        aids[name] = replace(stream, **rows)
    return replace(recording, data=replace(recording.data, aids=aids))


@pytest.mark.parametrize("name", FAST)
def test_a_window_of_nothing_but_outliers(name: str, clean: Recording):
    """Half a minute in which every position is 500 m off, each elsewhere."""
    bad = spoiled(clean, "gnss", 40.0, 70.0, 500.0)
    trial = run_trial(make(name), bad)
    assert trial.status == "ok", trial.reason
    assert np.isfinite(trial.position).all()
    # A minute of good positions later the window has found back.
    assert horizontal(trial, bad)[-1] < 60.0


@pytest.mark.parametrize("name", FAST)
def test_a_window_without_absolute_position(name: str, clean: Recording):
    """Velocity and heading only: the error grows, and the covariance says so."""
    blind = without(clean, 0.0, 1e9, "dvl", "gyrocompass")
    trial = run_trial(make(name), blind)
    assert trial.status == "ok", trial.reason
    s = sigma(trial)
    assert s[-1] >= s[0]
    assert horizontal(trial, blind)[-1] < 5.0 * s[-1]


@pytest.mark.parametrize("variance", [0.0, 1e12])
@pytest.mark.parametrize("name", FAST)
def test_a_rank_deficient_first_epoch(name: str, variance: float, clean: Recording):
    """A start without error, or about which nothing is known, and one scalar measurement in the first epoch."""
    covariance = clean.start.covariance.copy()
    covariance[:6, :6] = variance * np.eye(6)
    first = without(replace(clean, start=replace(clean.start, covariance=covariance)), 0.0, 1.5, "gyrocompass")
    estimator = make(name)
    estimator.reset(first.start, first.instruments)
    last = None
    for _, packet in zip(range(30), first.steps()):
        last = estimator.update(packet)
        assert np.isfinite(last.position).all()
        assert last.covariance is not None
        assert np.linalg.eigvalsh(last.covariance)[0] > -1e-6 * max(1.0, variance)
    assert last is not None
    if variance:  # found, once there were positions
        assert np.sqrt(last.covariance[0, 0]) < 10.0


@pytest.mark.parametrize("name", ["sw-fgo", "iae-fgo", "fgo-full"])
def test_ten_minutes_without_any_aid(name: str):
    """The IMU alone: kilometres, perhaps, but finite, within what the covariance says, and found back at once."""
    recording = without(record(load("harbour-multipath").model_copy(update={"duration": 720.0}), 2), 60.0, 660.0)
    trial = run_trial(make(name), recording)
    assert trial.status == "ok", trial.reason
    error, s = horizontal(trial, recording), sigma(trial)
    at = int(np.searchsorted(trial.time, 655.0))
    assert s[at] > 50.0 * s[int(np.searchsorted(trial.time, 59.0))]
    assert error[at] < 4.0 * s[at]
    assert s[-1] < 0.05 * s[at]
    assert error[-1] < 25.0


@pytest.mark.parametrize("name", FAST)
def test_time_that_goes_backwards(name: str, clean: Recording):
    """A step is delivered again, and one before it: nothing that is older than the state is used, and it is counted."""
    steps = list(clean.steps())[:30]
    estimator = make(name)
    straight = make(name)
    for e in (estimator, straight):
        e.reset(clean.start, clean.instruments)
    for p in steps[:20]:
        estimator.update(p)
        straight.update(p)
    for p in (steps[19], steps[5]):
        again = estimator.update(Measurements(p.start, p.time, p.imu, p.aids))
        assert np.isfinite(again.position).all()
    assert again.diagnostics["skipped"] > 0
    for p in steps[20:]:
        a, b = estimator.update(p), straight.update(p)
    np.testing.assert_allclose(a.position, b.position, atol=1e-6)
    np.testing.assert_allclose(a.velocity, b.velocity, atol=0.05)


def test_bad_parameters_are_named():
    with pytest.raises(ValueError, match="window is 0"):
        make("sw-fgo", window=0)
    with pytest.raises(ValueError, match="tolerance is 0"):
        make("sw-fgo", tolerance=0.0)
    with pytest.raises(ValueError, match="iterations is 0"):
        make("sw-fgo", iterations=0)
