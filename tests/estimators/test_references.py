"""The oracles: what each is told, that none uses more, and their order."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from simnav.estimator import find, make
from simnav.estimators.adaptations.base import Innovation
from simnav.estimators.adaptations.truth import FaultTimes, FisherNoise, MixtureNoise, TrueNoise, fisher_information
from simnav.labels import FaultLabel
from simnav.recording import AidStream
from simnav.scenario import Scenario, load
from simnav.scoring import errors
from simnav.scoring.consistency import nees, nees_band
from simnav.scoring.navigation_error import smoothed_errors
from simnav.sensors.faults import BiasStep, Frozen, GrossError, Multipath, NoiseStep, Outage, Ramp
from simnav.simulation.simulator import simulate
from simnav.trial import run_trial
from simnav.types import Datasheet, Instruments, Measurement

ROWS = ("oracle", "oracle-clairvoyant", "oracle-mixture", "oracle-rts", "oracle-times")


def shortened(name: str, duration: float, *faults) -> Scenario:
    return load(name).model_copy(update={"duration": duration, "faults": tuple(faults)})


def run(row: str, recording):
    trial = run_trial(make(row), recording)
    assert trial.status == "ok", trial.reason
    return trial


@pytest.mark.parametrize("row", ROWS)
def test_oracles_are_marked_and_are_the_ekf_where_nothing_is_wrong(row):
    assert find(row).reference
    recording = simulate(shortened("open-sea", 60.0), 1)
    ours, ekf = run(row, recording), run("ekf", recording)
    # Centimetres, for the oracles are linearised elsewhere: 1 cm is 1.6e-9 rad.
    np.testing.assert_allclose(ours.position[:, :2], ekf.position[:, :2], rtol=0, atol=2e-9)
    np.testing.assert_allclose(ours.covariance[:, :6, :6], ekf.covariance[:, :6, :6], rtol=0.02, atol=1e-5)


def test_the_clairvoyant_works_on_the_run_without_faults():
    faults = (
        NoiseStep(instruments=("gnss",), factor=3.0, start=20.0),
        Multipath(instruments=("gnss",), sigma_position=8.0, correlation_time=30.0, start=10.0),
        GrossError(instruments=("gnss", "dvl"), probability=0.3, size_position=(10.0, 40.0), size_velocity=(0.5, 1.0)),
    )
    wrong, right = simulate(shortened("open-sea", 80.0, *faults), 5), simulate(shortened("open-sea", 80.0), 5)
    assert np.abs(wrong.data.aids["gnss"].value - right.data.aids["gnss"].value).max() > 1e-6
    # Displacements one after the other, or their sum: tens of metres over the radius of the Earth, squared.
    ours, theirs = run("oracle-clairvoyant", wrong), run("oracle", right)
    np.testing.assert_allclose(errors(ours, wrong)[:, :6], errors(theirs, right)[:, :6], rtol=0, atol=5e-4)
    np.testing.assert_allclose(ours.covariance, theirs.covariance, rtol=1e-6, atol=1e-12)


LASTING = {
    "multipath": Multipath(
        instruments=("gnss",), sigma_position=(8.0, 8.0, 12.0), correlation_time=40.0, start=20.0, end=140.0
    ),
    "bias": BiasStep(instruments=("gnss",), offset_position=(17.0, -17.0, 5.0), start=20.0, end=140.0),
    "ramp": Ramp(instruments=("gnss",), slope_position=(0.5, -0.3, 0.0), start=20.0, end=140.0),
}


@pytest.mark.parametrize("kind", LASTING)
def test_errors_that_last_are_states_and_leave_the_oracle_consistent(kind):
    """As noise they would be believed more with every epoch: a NEES of many times the band."""
    found = []
    for seed in range(20):
        recording = simulate(shortened("open-sea", 150.0, LASTING[kind]), seed)
        trial = run("oracle", recording)
        found.append(nees(errors(trial, recording), trial.covariance, (0, 1, 2))[0][20:140])
    mean = np.mean(found) / 3.0
    low, high = nees_band(3, 20, 0.99)
    assert low < mean < high


def test_the_oracle_is_not_told_what_a_fault_added():
    """Other sizes of the same faults, with the same flags, are weighed the same."""
    faults = (GrossError(instruments=("gnss",), probability=0.3, size_position=(5.0, 15.0)), LASTING["multipath"])
    recording = simulate(shortened("open-sea", 100.0, *faults), 2)
    gnss = recording.data.aids["gnss"]
    other = replace(recording, data=replace(
        recording.data, aids={**recording.data.aids, "gnss": replace(gnss, fault_error=7.0 * gnss.fault_error)}
    ))  # fmt: skip
    for row in ("oracle", "oracle-mixture"):
        np.testing.assert_array_equal(run(row, recording).position, run(row, other).position)


def test_the_order_of_the_oracles():
    """Less is known, more is lost: clairvoyant, flags, density, nothing; and the smoother is better than its filter."""
    faults = (GrossError(instruments=("gnss",), probability=0.35, size_position=(3.0, 12.0)),)
    scenario = shortened("gnss-noise-step", 120.0, *faults)
    rows = ("oracle-clairvoyant", "oracle", "oracle-mixture", "ekf")
    square: dict[str, list[float]] = {row: [] for row in (*rows, "smoothed")}
    for seed in range(12):
        recording = simulate(scenario, seed)
        for row in rows:
            square[row].append(np.mean(errors(run(row, recording), recording)[:, :2] ** 2))
        square["smoothed"].append(np.mean(smoothed_errors(run("oracle-rts", recording), recording)[:, :2] ** 2))
    rms = {row: np.sqrt(np.mean(x)) for row, x in square.items()}
    assert rms["smoothed"] < 0.9 * rms["oracle"]
    assert rms["oracle-clairvoyant"] < rms["oracle"] < rms["oracle-mixture"] < rms["ekf"]
    assert rms["oracle-mixture"] < 1.15 * rms["oracle"]
    assert rms["ekf"] > 1.5 * rms["oracle"]


def revealed(adaptation: TrueNoise, fault: FaultLabel, hit: bool, residual: float) -> tuple[TrueNoise, Innovation]:
    """An adaptation that was told of one measurement of one component, sigma 1, and its innovation."""
    stream = AidStream(
        "depth", "depth", np.ones(1), np.zeros((1, 1)), np.array([int(hit)], np.uint32), np.zeros((1, 1)),
        np.ones((1, 1)), np.empty(0),
    )  # fmt: skip
    adaptation.reveal(SimpleNamespace(data=SimpleNamespace(aids={"depth": stream}), faults=(fault,)))
    adaptation.reset(Instruments([Datasheet("depth", "depth", 1.0, np.ones(1))]))
    m = Measurement(1.0, "depth", "depth", np.zeros(1))
    return adaptation, Innovation(m, np.array([residual]), np.array([[0.5]]), np.eye(1))


def gross(size: float) -> FaultLabel:
    parameters = {"probability": 0.1, "distribution": "normal", "size_position": size}
    return FaultLabel("gross_error", ("depth",), 0.0, 10.0, parameters)


def test_a_flagged_gross_error_counts_with_its_variance_or_not_at_all():
    for size, expected in ((2.0, 5.0), (100.0, None)):
        adaptation, innovation = revealed(TrueNoise(), gross(size), True, 0.0)
        noise = adaptation.adapt(innovation)
        assert (None if noise is None else noise[0, 0]) == expected
    adaptation, innovation = revealed(TrueNoise(), gross(100.0), False, 50.0)
    assert adaptation.adapt(innovation)[0, 0] == 1.0


def test_who_knows_only_the_times_uses_no_measurement_with_a_fault_whatever_its_size():
    for size in (0.1, 100.0):
        adaptation, innovation = revealed(FaultTimes(), gross(size), True, 0.0)
        assert adaptation.adapt(innovation) is None
        assert adaptation.states() == []
    adaptation, innovation = revealed(FaultTimes(), gross(100.0), False, 50.0)
    assert adaptation.adapt(innovation)[0, 0] == 1.0


@pytest.mark.parametrize("hit", [False, True])
def test_the_mixture_weighs_by_bayes_rule_and_ignores_the_flag(hit):
    adaptation, innovation = revealed(MixtureNoise(), gross(2.0), hit, 3.0)
    likelihood = [
        p * np.exp(-0.5 * 9.0 / s) / np.sqrt(2 * np.pi * s) for p, s in ((0.9, 0.5 + 1.0), (0.1, 0.5 + 1.0 + 4.0))
    ]
    w = np.array(likelihood) / sum(likelihood)
    assert adaptation.adapt(innovation)[0, 0] == pytest.approx(1.0 / (w[0] / 1.0 + w[1] / 5.0), rel=1e-12)
    adaptation, innovation = revealed(MixtureNoise(), gross(100.0), hit, 60.0)
    assert adaptation.adapt(innovation) is None


@pytest.mark.parametrize(("p", "ratio"), [(0.1, 100.0), (0.5, 30.0), (0.05, 1e4)])
def test_fisher_information_against_the_integral(p: float, ratio: float):
    x = np.linspace(-10 * np.sqrt(ratio), 10 * np.sqrt(ratio), 400001)
    terms = [w * np.exp(-(x**2) / 2 / v) / np.sqrt(2 * np.pi * v) for w, v in ((1 - p, 1.0), (p, ratio))]
    density = terms[0] + terms[1]
    slope = -x * (terms[0] + terms[1] / ratio)
    exact = np.trapezoid(slope**2 / density, x)
    found = fisher_information(np.array([1 - p, p]), np.array([[1.0], [ratio]]))
    assert found == pytest.approx(exact, rel=2e-3)
    # Sharing the hit, three components know more of it than one.
    joint = fisher_information(np.array([1 - p, p]), np.array([[1.0] * 3, [ratio] * 3]))
    assert np.all(joint > exact)
    assert np.all(joint < 1 - p + p / ratio + 2e-3)
    label = FaultLabel("gross_error", ("depth",), 0.0, 10.0, {
        "probability": p, "distribution": "normal", "size_position": np.sqrt(ratio - 1.0)
    })  # fmt: skip
    adaptation, innovation = revealed(FisherNoise(), label, True, 3.0)
    assert adaptation.adapt(innovation)[0, 0] == pytest.approx(1.0 / exact, rel=1e-2)


@pytest.mark.parametrize(
    "fault",
    [
        *LASTING.values(),
        Frozen(instruments=("gnss",), start=50.0, end=90.0),
        NoiseStep(instruments=("gnss",), factor=5.0, start=50.0, end=140.0),
        Outage(instruments=("gnss",), start=50.0, end=90.0),
    ],
    ids=lambda fault: fault.kind,
)
@pytest.mark.parametrize("row", ROWS)
def test_without_an_imu_the_oracles_still_beat_those_who_are_not_told(row, fault):
    recording = simulate(shortened("ship-dead-reckoning", 150.0, fault), 3)
    ours, theirs = (np.sqrt(np.mean(errors(run(name, recording), recording)[:, :2] ** 2)) for name in (row, "ship-ekf"))
    assert ours < 1.001 * theirs


def test_the_smoothed_oracle_has_fault_states_too():
    """Consistent and better than its filter while multipath lasts."""
    filtered, smoothed, normalised = [], [], []
    for seed in range(10):
        recording = simulate(shortened("open-sea", 150.0, LASTING["multipath"]), seed)
        oracle = make("oracle-rts")
        trial = run_trial(oracle, recording)
        assert trial.status == "ok", trial.reason
        filtered.append(errors(trial, recording)[:, :3])
        error = smoothed_errors(trial, recording)
        smoothed.append(error[:, :3])
        normalised.append(nees(error, oracle.smoothed_covariance, (0, 1, 2))[0])
    assert np.sqrt(np.mean(np.square(smoothed))) < 0.8 * np.sqrt(np.mean(np.square(filtered)))
    low, high = nees_band(3, 10, 0.99)
    assert low < np.mean(normalised) / 3.0 < high
