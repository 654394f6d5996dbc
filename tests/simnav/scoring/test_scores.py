"""Scores against closed forms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from simnav.labels import FaultLabel
from simnav.recording import Recording
from simnav.scoring import SCORES, score, series
from simnav.scoring.accuracy import distance_travelled
from simnav.scoring.outages import outages
from simnav.types import NavigationStates


def test_constant_errors(recording: Recording, make_trial: Any) -> None:
    s = score(make_trial(recording, [3.0, -4.0, 2.0, 0.3, 0.4, -0.1, 0.003, 0.004, -0.02]), recording)
    expected = {
        "horizontal_rmse": 5.0, "horizontal_mae": 5.0, "horizontal_max": 5.0, "cep50": 5.0, "r95": 5.0,
        "north_rmse": 3.0, "north_mae": 3.0, "north_max": 3.0, "east_rmse": 4.0, "east_mae": 4.0, "east_max": 4.0,
        "vertical_rmse": 2.0, "vertical_mae": 2.0, "vertical_max": 2.0,
        "velocity_horizontal_rmse": 0.5, "velocity_horizontal_mae": 0.5, "velocity_north_rmse": 0.3,
        "velocity_east_rmse": 0.4, "velocity_vertical_rmse": 0.1, "level_rmse": 0.005, "tilt_north_rmse": 0.003,
        "tilt_east_rmse": 0.004, "heading_rmse": 0.02, "heading_mae": 0.02,
        "final_error": 5.0, "drift": 100.0 * 5.0 / 500.0, "availability": 1.0,
    }  # fmt: skip
    for name, value in expected.items():
        assert s[name] == pytest.approx(value, rel=1e-6), name


def test_every_documented_score_is_there_and_no_other(recording: Recording, make_trial: Any) -> None:
    assert list(score(make_trial(recording, np.zeros(9)), recording)) == list(SCORES)
    assert {i.better for i in SCORES.values()} == {"lower", "higher", "one", "nominal"}


def test_radii_of_a_gaussian_error_are_those_of_the_rayleigh_distribution(make_recording: Any, make_trial: Any) -> None:
    recording = make_recording(steps=20_000)
    error = np.zeros((20_000, 9))
    error[:, :2] = np.random.default_rng(3).normal(0.0, 2.0, (20_000, 2))
    s = score(make_trial(recording, error), recording)
    assert s["cep50"] == pytest.approx(2.0 * np.sqrt(2.0 * np.log(2.0)), rel=0.02)
    assert s["r95"] == pytest.approx(2.0 * np.sqrt(2.0 * np.log(20.0)), rel=0.02)
    assert s["horizontal_rmse"] == pytest.approx(2.0 * np.sqrt(2.0), rel=0.02)
    assert s["horizontal_mae"] == pytest.approx(2.0 * np.sqrt(np.pi / 2.0), rel=0.02)


def test_drift_is_the_final_error_over_the_distance(recording: Recording, make_trial: Any) -> None:
    error = np.zeros((100, 9))
    error[:, 0] = 0.02 * 5.0 * recording.data.truth.time  # 2 % of the distance
    s = score(make_trial(recording, error), recording)
    assert distance_travelled(recording) == pytest.approx(500.0, rel=1e-6)
    assert s["drift"] == pytest.approx(2.0, rel=1e-5)
    assert s["final_error"] == pytest.approx(10.0, rel=1e-6)


def test_a_run_that_broke_off_is_scored_as_far_as_it_went(recording: Recording, make_trial: Any) -> None:
    s = score(make_trial(recording, np.tile([0.0, 3.0, 0, 0, 0, 0, 0, 0, 0], (40, 1))), recording)
    assert s["horizontal_rmse"] == pytest.approx(3.0, rel=1e-6)
    assert s["drift"] == pytest.approx(100.0 * 3.0 / 200.0, rel=1e-5)
    assert s["availability"] == pytest.approx(0.4)


def test_a_trial_without_epochs_has_no_scores(recording: Recording, make_trial: Any) -> None:
    s = score(make_trial(recording, np.zeros((0, 9))), recording)
    assert s.pop("availability") == 0.0
    assert np.isnan(list(s.values())).all()


def test_gaps_in_the_reference_count_neither_as_error_nor_as_missing(recording: Recording, make_trial: Any) -> None:
    trial = make_trial(recording, [3.0, 4.0, 0, 0, 0, 0, 0, 0, 0])
    truth = recording.data.truth
    position = truth.position.copy()
    position[20:30] = np.nan
    holed = NavigationStates(truth.time, position, truth.velocity, truth.attitude)
    s = score(trial, replace(recording, data=replace(recording.data, truth=holed)))
    assert s["horizontal_rmse"] == pytest.approx(5.0, rel=1e-6)
    assert s["availability"] == 1.0
    assert s["drift"] == pytest.approx(1.0, rel=1e-5)  # the gap is bridged


def test_time_per_epoch_leaves_out_the_first(recording: Recording, make_trial: Any) -> None:
    seconds = np.linspace(0.01, 0.99, 100)
    seconds[0] = 60.0
    s = score(make_trial(recording, np.zeros(9), update_seconds=seconds), recording)
    assert s["update_median"] == pytest.approx(np.median(seconds[1:]))
    assert s["update_mean"] == pytest.approx(seconds[1:].mean())
    assert s["update_p95"] == pytest.approx(np.quantile(seconds[1:], 0.95))


def test_smoothed_scores(recording: Recording, make_trial: Any) -> None:
    trial, better = make_trial(recording, np.full(9, 1.0)), make_trial(recording, [0.3, 0.4, 0.1, 0, 0, 0, 0, 0, 0.01])
    trial = replace(trial, smoothed=NavigationStates(better.time, better.position, better.velocity, better.attitude))
    s = score(trial, recording)
    assert s["smoothed_horizontal_rmse"] == pytest.approx(0.5, rel=1e-5)
    assert s["smoothed_horizontal_max"] == pytest.approx(0.5, rel=1e-5)
    assert s["smoothed_north_rmse"] == pytest.approx(0.3, rel=1e-5)
    assert s["smoothed_east_rmse"] == pytest.approx(0.4, rel=1e-5)
    assert s["smoothed_vertical_rmse"] == pytest.approx(0.1, rel=1e-5)
    assert s["smoothed_heading_rmse"] == pytest.approx(0.01, rel=1e-5)
    assert s["horizontal_rmse"] == pytest.approx(np.sqrt(2.0), rel=1e-5)


# --- outages ----------------------------------------------------------------------------------------


def ramp(recording: Recording, start: float, end: float, rate: float, back: float) -> np.ndarray:
    """A north error that grows at a rate in an outage and then goes back linearly at another."""
    time = recording.data.truth.time
    top = rate * (end - 1.0 - start)
    north = np.where(time < start, 0.0, np.where(time < end, rate * (time - start), top - back * (time - end + 1.0)))
    error = np.zeros((len(time), 9))
    error[:, 0] = np.maximum(north, 0.0)
    return error


def test_the_error_at_the_end_of_an_outage_and_the_recovery(make_recording: Any, make_trial: Any) -> None:
    recording = make_recording(outages=[(20.0, 50.0)])
    error = ramp(recording, 20.0, 50.0, 1.0, 2.0)  # 29 m at 49 s, then down by 2 m/s: 9 m at 59 s
    (outage,) = outages(error, recording)
    assert (outage.start, outage.end, outage.instruments) == (20.0, 50.0, ("gnss",))
    assert outage.end_error == pytest.approx(29.0)
    assert (outage.threshold, outage.recovery_time, outage.recovered) == (10.0, 9.0, True)
    assert outages(error, recording, threshold=20.0)[0].recovery_time == 4.0
    s = score(make_trial(recording, error), recording)
    assert s["outage_end_error"] == s["outage_end_error_max"] == pytest.approx(29.0, rel=1e-6)
    assert (s["recovery_time"], s["recovered"]) == (9.0, 1.0)


def test_an_error_that_stays_small_needs_no_recovery(make_recording: Any) -> None:
    recording = make_recording(outages=[(20.0, 50.0)])
    (outage,) = outages(ramp(recording, 20.0, 50.0, 0.1, 1.0), recording)
    assert (outage.recovery_time, outage.recovered) == (0.0, True)


def test_an_estimator_that_was_worse_before_has_to_come_back_to_that(make_recording: Any) -> None:
    recording = make_recording(outages=[(20.0, 50.0)])
    error = ramp(recording, 20.0, 50.0, 1.0, 1.0)
    error[:, 0] += 15.0
    (outage,) = outages(error, recording)
    assert outage.threshold == 15.0
    assert outage.recovery_time == pytest.approx(28.0)


def test_no_recovery_before_the_next_outage(make_recording: Any) -> None:
    recording = make_recording(outages=[(20.0, 50.0), (60.0, 70.0)])
    error = ramp(recording, 20.0, 50.0, 1.0, 0.1)
    first, second = outages(error, recording)
    assert (first.recovered, first.recovery_time) == (False, 10.0)
    assert second.threshold == pytest.approx(29.0 - 1.0)  # the error at 59 s


def test_several_outages_are_scored_by_their_means_and_the_largest(make_recording: Any, make_trial: Any) -> None:
    recording = make_recording(outages=[(20.0, 30.0), (60.0, 80.0)])
    error = ramp(recording, 20.0, 30.0, 1.0, 1.0) + ramp(recording, 60.0, 80.0, 2.0, 0.5)
    s = score(make_trial(recording, error), recording)
    assert [o.end_error for o in outages(error, recording)] == pytest.approx([9.0, 38.0])
    assert [(o.recovery_time, o.recovered) for o in outages(error, recording)] == [(0.0, True), (20.0, False)]
    assert (s["outage_end_error"], s["outage_end_error_max"]) == pytest.approx((23.5, 38.0))
    assert (s["recovery_time"], s["recovered"]) == pytest.approx((10.0, 0.5))


def test_an_outage_to_the_end_has_an_error_and_no_recovery(make_recording: Any, make_trial: Any) -> None:
    recording = make_recording(outages=[(80.0, 200.0)])
    error = ramp(recording, 80.0, 200.0, 1.0, 1.0)
    (outage,) = outages(error, recording)
    assert outage.end == np.inf
    assert outage.end_error == pytest.approx(20.0)
    assert np.isnan(outage.recovery_time)
    s = score(make_trial(recording, error), recording)
    assert s["outage_end_error"] == pytest.approx(20.0, rel=1e-6)
    assert np.isnan(s["recovered"])


def test_a_random_outage_is_cut_into_its_gaps(make_recording: Any) -> None:
    recording = make_recording(outages=[(20.0, 30.0), (40.0, 50.0)])
    recording = replace(recording, faults=(FaultLabel("outage", ("gnss",), 0.0, 100.0),))
    assert [(o.start, o.end) for o in outages(np.zeros((100, 9)), recording)] == [(20.0, 30.0), (40.0, 50.0)]


def test_without_outages_there_is_nothing_to_score(make_recording: Any, make_trial: Any) -> None:
    recording = make_recording(outages=[(20.0, 50.0)])
    recording = replace(recording, faults=(FaultLabel("ramp", ("gnss",), 20.0, 50.0),))
    s = score(make_trial(recording, np.ones(9)), recording)
    assert np.isnan([s["outage_end_error"], s["recovery_time"], s["recovered"]]).all()


# --- detection --------------------------------------------------------------------------------------


def test_detection_and_false_alarms_are_counted_against_the_labels(make_recording: Any, make_trial: Any) -> None:
    # Datasheet sigma 2 m: 7 m and -30 m are to be detected, 5 m is not, and is no false alarm either.
    recording = make_recording(faulty=[(10, 7.0, 0), (20, -30.0, 3), (30, 5.0, 1), (40, 50.0, 1)])
    times = recording.data.truth.time
    flagged = [("gnss", times[k] + 1e-9) for k in (10, 20, 30, 50, 51, 51)] + [("gnss", 3.5), ("dvl", times[60])]
    s = score(make_trial(recording, np.zeros(9), flagged=flagged), recording)
    assert s["detection_rate"] == pytest.approx(2 / 3)
    assert s["false_alarm_rate"] == pytest.approx(2 / 96)


def test_who_flags_nothing_is_not_judged(make_recording: Any, make_trial: Any) -> None:
    recording = make_recording(faulty=[(10, 70.0, 0)])
    s = score(make_trial(recording, np.zeros(9)), recording)
    assert np.isnan([s["detection_rate"], s["false_alarm_rate"]]).all()


def test_measurements_after_a_failure_do_not_count(make_recording: Any, make_trial: Any) -> None:
    recording = make_recording(faulty=[(10, 70.0, 0), (60, 70.0, 0)])
    s = score(make_trial(recording, np.zeros((40, 9)), flagged=[("gnss", 11.0)]), recording)
    assert s["detection_rate"] == 1.0
    assert s["false_alarm_rate"] == 0.0


# --- series -----------------------------------------------------------------------------------------


def test_series_are_thinned_and_hold_the_tracks(make_recording: Any, make_trial: Any) -> None:
    recording = make_recording(steps=3001)
    covariance = np.tile(np.eye(9), (3001, 1, 1))
    covariance[:, :2, :2] = [[2.5, 1.5], [1.5, 2.5]]  # semi-axes 2 and 1
    trial = make_trial(recording, [3.0, -4.0, 1.0, 0.3, 0.4, 0, 0, 0, 0.1], covariance=covariance)
    s = series(trial, recording)
    assert len(s["time"]) == 500
    assert (s["time"][0], s["time"][-1]) == (1.0, 3001.0)
    for name, value in (
        ("horizontal", 5.0), ("vertical", 1.0), ("north", 3.0), ("east", -4.0), ("velocity", 0.5), ("heading", 0.1),
        ("three_sigma", 6.0), ("quantiles", 5.0),
    ):  # fmt: skip
        np.testing.assert_allclose(s[name], value, rtol=1e-6, err_msg=name)
    np.testing.assert_allclose(s["truth_east"], 5.0 * s["time"], rtol=1e-6)
    np.testing.assert_allclose(s["estimate_east"], 5.0 * s["time"] - 4.0, rtol=1e-6)
    np.testing.assert_allclose(s["estimate_down"] - s["truth_down"], 1.0, rtol=1e-6)
    assert {len(v) for n, v in s.items() if n != "quantiles"} == {500}


def test_series_hold_the_means_of_the_diagnostics_of_each_instrument(make_recording: Any, make_trial: Any) -> None:
    """An instrument that delivers at one epoch in seven is in every part of the run."""
    from dataclasses import replace

    recording = make_recording(steps=1000)
    seldom = np.where(np.arange(1000) % 7 == 0, np.arange(1000.0), np.nan)
    given = {"weight.gnss": seldom, "nis.gnss": np.full(1000, np.nan), "iterations": np.ones(1000)}
    given["protection_level"] = np.linspace(10.0, 20.0, 1000)
    s = series(replace(make_trial(recording, np.zeros(9)), diagnostics=given), recording)
    assert s["weight.gnss"].shape == s["diagnostics_time"].shape == (100,)
    assert "iterations" not in s
    assert np.isnan(s["nis.gnss"]).all()
    assert s["weight.gnss"][0] == 3.5  # of 0 and 7
    np.testing.assert_allclose(s["weight.gnss"], s["diagnostics_time"] - 1.0, atol=4.0)
    assert (s["protection_level"][0], s["protection_level"][-1]) == (10.0, 20.0)
    assert s["protection_level"].shape == s["time"].shape


def test_series_of_a_trial_that_gave_nothing(recording: Recording, make_trial: Any) -> None:
    s = series(make_trial(recording, np.zeros((0, 9))), recording)
    assert len(s["time"]) == len(s["truth_north"]) == 0
    assert np.isnan(s["quantiles"]).all()
