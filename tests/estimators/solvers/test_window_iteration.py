"""A window in compiled code and by methods: the same numbers. And what it does where there is no finite step."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.adaptations.innovation_based import InnovationBased
from simnav.estimators.adaptations.noise import NoiseAdaptation
from simnav.estimators.models.chain import Chain
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_chain import InertialChain
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.base import Weighting
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.types import Estimate


@pytest.fixture(scope="module")
def recording() -> Recording:
    """A poorly known heading, so that first steps are large, and more epochs than a window has."""
    scenario = load("open-sea")
    error = scenario.initial_error.model_copy(update={"attitude": (0.01, 0.01, 2.0)})
    return record(scenario.model_copy(update={"duration": 30.0, "initial_error": error}), 3)


def run(estimator: Any, recording: Recording) -> list[Estimate]:
    estimator.reset(recording.start, recording.instruments)
    return [estimator.update(step) for step in recording.steps()]


def assert_same(some: list[Estimate], others: list[Estimate]) -> None:
    for a, b in zip(some, others, strict=True):
        np.testing.assert_array_equal(a.position, b.position)
        np.testing.assert_array_equal(a.covariance, b.covariance)
        np.testing.assert_equal(a.diagnostics, b.diagnostics)
        assert a.flagged == b.flagged


@pytest.mark.parametrize("row", ["sw-fgo", "gnc-fgo"])
def test_the_iteration_is_the_same_by_methods(row: str, recording: Recording, monkeypatch: pytest.MonkeyPatch):
    compiled = run(make(row), recording)
    assert max(e.diagnostics["iterations"] for e in compiled) > 3
    monkeypatch.setattr(InertialChain, "moves", Chain.moves)
    assert_same(compiled, run(make(row), recording))


def test_a_step_is_the_same_by_methods(recording: Recording):
    by_methods = WindowEstimator(InertialModel())
    by_methods.reset(recording.start, recording.instruments)
    assert by_methods._step is not None
    by_methods._step = None
    found = [by_methods.update(step) for step in recording.steps()]
    assert_same(run(WindowEstimator(InertialModel()), recording), found)


@pytest.mark.parametrize("adaptation", [InnovationBased(), ChiSquareGate(0.9)])
def test_an_adaptive_step_is_the_same_by_methods(adaptation: NoiseAdaptation, recording: Recording):
    """Up to the rounding of the covariance, which compiled code carries from reading to reading."""
    compiled, methods = (WindowEstimator(InertialModel(), adaptation=deepcopy(adaptation)) for _ in range(2))
    for estimator in (compiled, methods):
        estimator.reset(recording.start, recording.instruments)
    assert compiled._step is not None
    methods._step = None
    flagged = 0
    for step in recording.steps():
        a, b = compiled.update(step), methods.update(step)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-7, atol=1e-14)
        assert a.diagnostics == pytest.approx(b.diagnostics, rel=1e-6, abs=1e-9, nan_ok=True)
        assert a.flagged == b.flagged
        flagged += len(a.flagged)
    assert (flagged > 0) == isinstance(adaptation, ChiSquareGate)


class Spoiled(WindowEstimator):
    """A window of which a new factor is not a number at one time, with all others of its step."""

    def _converge(self, attached: int) -> Any:
        if self.chain.time == self.at and attached:
            self.chain.aids["value"][-1] = np.nan
        return super()._converge(attached)

    at = 0.0


@pytest.mark.parametrize("weighting", [None, Weighting()])
def test_new_factors_without_a_finite_step_are_left_out(weighting: Weighting | None, recording: Recording):
    estimator = Spoiled(InertialModel(), weighting=weighting)
    estimator.at = 10.0
    estimates = run(estimator, recording)
    skipped = [e.diagnostics["skipped"] for e in estimates]
    assert skipped[-1] > skipped[0] == 0.0
    assert len(set(skipped)) == 2  # in one step
    assert all(np.isfinite(e.covariance).all() for e in estimates)


def test_a_window_without_any_finite_step_says_so(recording: Recording, monkeypatch: pytest.MonkeyPatch):
    estimator = WindowEstimator(InertialModel())
    run(estimator, recording)
    estimator.chain.prior.covariance[:] = np.nan
    with pytest.raises(FloatingPointError, match="no finite solution"):
        estimator._converge(0)
