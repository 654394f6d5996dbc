"""Many steps by one call have the numbers of single steps, whoever wrote the functions and however the runs end."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from simnav import Estimator
from simnav.estimator import make
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.adaptations.noise import NoiseAdaptation
from simnav.estimators.adaptations.sage_husa import SageHusa
from simnav.estimators.composition import Row
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.kinematic import KinematicModel
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.trial import TOGETHER, Trial, run_trial

#: Clean at sea, with jumps of fixes, under water, without an IMU.
SCENARIOS = ("open-sea", "harbour-multipath", "auv-soft-mud", "ship-dead-reckoning")
ROWS = ("ekf", "gated-ekf", "iae", "vb-akf", "adkf", "mckf", "imm", "ukf", "ship-ekf", "ship-ukf", "gnss-only")


def runs(scenario: str, seeds: tuple[int, ...] = (1, 2), duration: float = 100.0) -> list[Recording]:
    """Some runs of one scenario; the number of steps is no multiple of those that are taken together."""
    return [record(load(scenario).model_copy(update={"duration": duration}), seed) for seed in seeds]


def counted(estimator: Estimator, together: bool) -> tuple[Estimator, list[int]]:
    """An estimator, and how many steps it has taken by each call of `update_all`; none if it may not."""
    taken: list[int] = []
    inner = estimator.update_all

    def update_all(steps: Any) -> Any:
        found = inner(steps) if together else None
        taken.extend([] if found is None else [len(found)])
        return found

    vars(estimator)["update_all"] = update_all
    return estimator, taken


def assert_same(a: Trial, b: Trial) -> None:
    assert (a.status, a.reason, a.flagged) == (b.status, b.reason, b.flagged)
    for name in ("time", "position", "velocity", "attitude", "estimated", "covariance"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    assert a.diagnostics.keys() == b.diagnostics.keys()
    for name, values in a.diagnostics.items():
        np.testing.assert_array_equal(values, b.diagnostics[name], err_msg=name)


@pytest.fixture(scope="module", params=SCENARIOS)
def bank(request: pytest.FixtureRequest) -> list[Recording]:
    return runs(request.param)


@pytest.mark.parametrize("row", ROWS)
def test_a_bank_of_runs_has_the_numbers_of_single_steps(bank: list[Recording], row: str) -> None:
    whole, taken = counted(make(row), together=True)
    single, none = counted(make(row), together=False)
    for recording in bank:
        trial = run_trial(whole, recording)
        assert_same(trial, run_trial(single, recording))
    assert none == []
    assert taken == ([] if trial.status == "unsuitable" else [TOGETHER, 100 - TOGETHER] * len(bank))


def moved(recording: Recording, step: int) -> Recording:
    """The same run with a truth that is elsewhere from a step on."""
    truth = recording.data.truth
    position = truth.position.copy()
    position[step:, 0] -= 0.1
    return replace(recording, data=replace(recording.data, truth=replace(truth, position=position)))


def test_a_run_that_diverges_ends_alone() -> None:
    first, second = runs("harbour-multipath")
    whole, taken = counted(make("iae"), together=True)
    single, _ = counted(make("iae"), together=False)
    for recording, status, count in ((moved(first, 30), "diverged", 30), (second, "ok", 100)):
        trial = run_trial(whole, recording)
        assert (trial.status, len(trial)) == (status, count)
        assert_same(trial, run_trial(single, recording))
    assert taken == [TOGETHER, TOGETHER, 100 - TOGETHER]  # the first run ended within its first steps


class PlainRule(NoiseAdaptation):
    """Twice the noise of the datasheet, in Python."""

    def choose(self, innovation: Any) -> Any:
        return 2.0 * innovation.noise


class Own(KalmanEstimator):
    """A filter with a step of its own."""

    def update(self, measurements: Any) -> Any:
        estimate = super().update(measurements)
        estimate.diagnostics = {**estimate.diagnostics, "own": 1.0}
        return estimate


class OwnRow(Row, solver=KalmanEstimator, model=InertialModel, adaptation=ChiSquareGate):
    """A row with a step of its own."""

    def update(self, measurements: Any) -> Any:
        return replace(super().update(measurements), flagged=[])


class Wider(KinematicModel):
    """A model of somebody else: functions over a flat state, and an estimate in Python."""

    def estimate(self, covariance: Any) -> Any:
        estimate = super().estimate(covariance)
        return replace(
            estimate, covariance=estimate.covariance * 2.0, states={"turned": (self.numbers[:2], np.ones(2))}
        )


class WiderRow(Row, solver=KalmanEstimator, model=Wider, adaptation=SageHusa):
    """A row of somebody else."""


@pytest.mark.parametrize(
    ("made", "together"),
    [
        (lambda: KalmanEstimator(InertialModel(), PlainRule()), False),
        (lambda: Own(InertialModel()), False),
        (OwnRow, False),
        (WiderRow, True),
        (lambda: KalmanEstimator(InertialModel(calibrate=False), SageHusa()), True),
        (lambda: KalmanEstimator(InertialModel(calibrate=False), SageHusa(full=True)), False),
    ],
)
def test_what_is_in_python_is_taken_step_by_step(made: Any, together: bool) -> None:
    """And what others wrote as functions is taken together, without a word of it."""
    (recording,) = runs("open-sea", seeds=(3,))
    whole, taken = counted(made(), together=True)
    trial = run_trial(whole, recording)
    assert trial.status == "ok", trial.reason
    assert_same(trial, run_trial(counted(made(), together=False)[0], recording))
    assert bool(taken) == together


def test_steps_taken_together_and_one_by_one_follow_each_other() -> None:
    """A reading that is late for the first time makes the row take the rest one by one."""
    (recording,) = runs("open-sea", seeds=(4,), duration=200.0)
    stream = recording.data.aids["gnss"]
    stamp = stream.time.copy()
    stamp[120] -= 2.0
    late = replace(
        recording.data, aids={**recording.data.aids, "gnss": replace(stream, stamp=stamp, arrival=stream.time)}
    )
    recording = replace(recording, data=late)
    whole, taken = counted(make("vb-akf"), together=True)
    assert_same(run_trial(whole, recording), run_trial(counted(make("vb-akf"), together=False)[0], recording))
    assert taken == [TOGETHER]
