"""The federated filter: where it must equal the centralized one, and that it is never surer than it is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimator import Estimator, EstimatorError, UnsuitableScenario, make
from simnav.geometry import earth
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.types import Datasheet

DEG = np.pi / 180.0
GNSS = Datasheet("gnss", "gnss_position", 1.0, np.array([1.5, 1.5, 3.0]), lever_arm=np.array([2.0, -1.0, -8.0]))
DVL = Datasheet("dvl", "dvl", 1.0, np.full(3, 0.02), phase=0.333, lever_arm=np.array([1.0, 0.5, 3.0]))
BIASED_DVL = replace(DVL, bias=np.full(3, 0.02), scale=0.01, misalignment=np.full(3, 0.005))
DEPTH = Datasheet("depth", "depth", 0.5, np.array([0.3]), bias=np.array([0.2]))


def locals_of(estimator: Estimator) -> dict:
    """The local filters by name: share, error and covariance. Only the fusion reads them, so they are not public."""
    return estimator._locals


def assert_same(run_over, recording: Recording, reference: str, name: str, **parameters) -> None:
    expected, P = run_over(make(reference, **{k: v for k, v in parameters.items() if k == "calibrate"}), recording)
    errors, covariances = run_over(make(name, **parameters), recording)
    sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    assert np.abs((errors - expected) / sigma).max() < 1e-6
    assert np.abs((covariances - P) / (sigma[:, :, None] * sigma[:, None, :])).max() < 1e-6


@pytest.mark.parametrize("name", ["federated", "federated-no-reset"])
@pytest.mark.parametrize("sheet", [GNSS, DVL, BIASED_DVL], ids=["gnss", "dvl", "dvl with calibration states"])
def test_with_one_local_filter_it_is_the_ekf(recording_of, run_over, name: str, sheet: Datasheet):
    assert_same(run_over, recording_of(3, 40.0, aids=(sheet,)), "ekf", name, fusion_period=0.0)


@pytest.mark.parametrize(
    "parameters",
    [{}, {"master_share": 0.4}, {"shares": (0.1, 0.3, 0.2, 0.35, 0.05)}],
    ids=["equal", "master", "unequal"],
)
def test_fused_and_reset_after_every_measurement_it_is_the_centralized_filter(recording_of, run_over, parameters):
    """Carlson's theorem: beta of each prediction's information adds up to the whole, whatever the shares."""
    recording = recording_of(3, 40.0)
    assert_same(run_over, recording, "ekf", "federated", fusion_period=0.0, calibrate=False, **parameters)


def test_the_master_adds_up_the_information(recording_of, run_over):
    """Without reset, after the last fusion: P_f^-1 = sum of P_i^-1, and it is never below the centralized P."""
    recording = recording_of(5, 40.0)
    estimator = make("federated-no-reset", fusion_period=4.0)
    _, covariances = run_over(estimator, recording)
    total = sum(np.linalg.inv(local.covariance[:15, :15]) for local in locals_of(estimator).values())
    scale = np.sqrt(np.diag(total))
    ours = np.linalg.inv(estimator.covariance[:15, :15])
    np.testing.assert_allclose(ours / np.outer(scale, scale), total / np.outer(scale, scale), atol=1e-5)
    assert sum(local.share for local in locals_of(estimator).values()) == pytest.approx(1.0)
    central = run_over(make("ekf"), recording)[1][-1]
    scale = np.sqrt(np.diag(central))
    assert np.linalg.eigvalsh((covariances[-1] - central) / np.outer(scale, scale))[0] > -1e-3


@pytest.fixture(scope="module")
def survey() -> list[Recording]:
    """The AUV survey without outages, shortened."""
    scenario = load("auv-survey").model_copy(update={"duration": 150.0, "faults": ()})
    return [record(scenario, seed) for seed in range(12)]


@pytest.mark.parametrize(
    ("name", "parameters"),
    [("federated", {}), ("federated", {"fusion_period": 10.0}), ("federated-no-reset", {})],
    ids=["reset", "reset after 10 s", "no reset"],
)
def test_it_is_never_surer_than_it_is_right(survey, run_over, name: str, parameters: dict):
    """ANEES over independent runs below the upper end of the chi-square band (0.1%)."""
    from scipy import stats

    for k in (75, 149):
        nees = []
        for recording in survey:
            errors, covariances = run_over(make(name, **parameters), recording)
            nees.append(errors[k] @ np.linalg.solve(covariances[k], errors[k]))
        assert np.sum(nees) < stats.chi2.ppf(0.999, 9 * len(survey))


def test_waiting_costs(recording_of, run_over):
    """The federated filter's loss: a measurement counts only at the next fusion."""
    aids = (GNSS, DVL, DEPTH)
    squares = {0.0: [], 20.0: []}
    for seed in range(4):
        recording = recording_of(seed, 120.0, aids=aids)
        for period, each in squares.items():
            errors, _ = run_over(make("federated", fusion_period=period), recording)
            each.append(np.mean(errors[40:, 3:6] ** 2))
    assert np.mean(squares[20.0]) > 1.1 * np.mean(squares[0.0])


def test_a_default_fusion_waits_for_the_slowest_sensor(recording_of, run_over):
    """Between fusions the estimate is the prediction: its covariance grows until the depth sensor has delivered."""
    recording = recording_of(0, 21.0, aids=(GNSS, replace(DEPTH, rate=0.2)))
    _, covariances = run_over(make("federated"), recording)
    sigma = np.sqrt(covariances[:, 0, 0])
    falls = np.flatnonzero(np.diff(sigma) < 0) + 2.0  # the step's end, in seconds
    np.testing.assert_array_equal(falls, [5.0, 10.0, 15.0, 20.0])


def test_without_reset_a_fault_stays_with_its_sensor(recording_of, run_over):
    """GNSS leaps by 5 m: without reset the DVL's filter does not follow (but for the shared linearisation)."""
    recording = recording_of(2, 60.0, aids=(GNSS, DVL))
    stream = recording.data.aids["gnss"]
    value = stream.value.copy()
    late = stream.time > 30.0
    value[late] = earth.displace(value[late], np.array([5.0, 0.0, 0.0]))
    spoilt = replace(
        recording, data=replace(recording.data, aids={**recording.data.aids, "gnss": replace(stream, value=value)})
    )
    moved = {}
    for name in ("federated", "federated-no-reset"):
        ends = []
        for r in (recording, spoilt):
            estimator = make(name)
            run_over(estimator, r)
            local = locals_of(estimator)["dvl"]
            offset = earth.relative_position(estimator.model.position, recording.data.truth.position[-1])
            ends.append(offset + local.error[:3])
        moved[name] = np.abs(ends[1] - ends[0]).max()
    assert moved["federated-no-reset"] < 0.6
    assert moved["federated"] > 4.0


@pytest.mark.parametrize("name", ["federated", "federated-no-reset"])
def test_it_survives_the_outages_of_the_survey(name: str, run_over):
    scenario = load("auv-survey").model_copy(update={"duration": 450.0})
    errors, covariances = run_over(make(name), record(scenario, 1))
    assert np.isfinite(errors).all()
    sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    assert np.abs(errors / sigma).max() < 6.0
    assert np.hypot(*errors[-1, :2]) < 20.0


@pytest.mark.parametrize(
    ("bad", "sentence"),
    [
        ({"shares": (0.5, 0.6)}, "sum to 1"),
        ({"shares": (1.5, -0.5)}, "above 0"),
        ({"master_share": 1.0}, "master_share"),
        ({"fusion_period": -1.0}, "fusion_period"),
        ({"fusion_period": float("nan")}, "fusion_period"),
    ],
)
def test_shares_that_are_none(bad: dict, sentence: str):
    with pytest.raises(EstimatorError, match=sentence):
        make("federated", **bad)


def test_shares_that_do_not_fit_the_sensors(recording_of):
    recording = recording_of(1, 10.0, aids=(GNSS,))
    with pytest.raises(UnsuitableScenario, match="2 shares"):
        make("federated", shares=(0.5, 0.5)).reset(recording.start, recording.instruments)
