"""The chi-square test of a window's cost: quiet where the model is right, loud and honest where it is not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import simnav
from simnav.estimator import make
from simnav.estimators.solvers.cost_consistency import LASTING, LONG, PATIENCE, CostTest, chi_square_deviate
from simnav.scenario import load


@pytest.mark.parametrize("freedom", [6.0, 20.0, 300.0])
@pytest.mark.parametrize("probability", [0.05, 0.5, 0.99, 1.0 - 3e-5])
def test_the_deviate_is_the_normal_one(freedom: float, probability: float):
    value = float(stats.chi2.ppf(probability, freedom))
    assert chi_square_deviate(value, freedom) == pytest.approx(stats.norm.ppf(probability), abs=0.1)


def test_it_speaks_after_a_few_improbable_epochs_and_falls_silent_again():
    test = CostTest()
    assert not test.inconsistent
    assert np.isnan(test.variance_factor)
    for _ in range(PATIENCE - 1):
        test.add(300.0, 100.0)
    assert not test.inconsistent
    assert test.inflation == 1.0
    test.add(0.0, 0.0)  # an epoch without aids says nothing
    test.add(400.0, 100.0)
    assert test.inconsistent
    assert test.inflation == pytest.approx(8.0)
    test.add(50.0, 100.0)
    assert not test.inconsistent
    assert test.inflation == 1.0


def test_it_remembers_for_a_while_but_only_inflates_in_time():
    """A window that was drawn away agrees with what did it; a few improbable epochs are soon forgotten."""

    def after(improbable: int) -> list[bool]:
        test, found = CostTest(), []
        for k in range(3 * LONG):
            test.add(200.0 if LONG <= k < LONG + improbable else 50.0, 100.0)
            assert test.lasting or not test.inconsistent
            assert (test.inflation > 1.0) == test.inconsistent
            found.append(test.lasting)
        return found

    long, short = after(LASTING), after(LASTING - 1)
    assert all(long[LONG + LASTING : 2 * LONG])
    assert not any(long[: LONG + PATIENCE - 1])
    assert not any(long[2 * LONG + 1 :])
    assert sum(short) == LASTING - PATIENCE


@pytest.mark.parametrize(
    ("name", "scenario"), [("sw-fgo", "open-sea"), ("gnc-fgo", "open-sea"), ("ship-fgo", "ship-straight")]
)
def test_it_is_quiet_on_clean_data(name: str, scenario: str):
    """The cost of a clean window is what chi-square says."""
    trial = simnav.run_trial(make(name), simnav.record(load(scenario).model_copy(update={"duration": 200.0}), 2))
    factor = np.asarray(trial.diagnostics["variance_factor"], dtype=float)
    assert 0.7 < np.nanmean(factor) < 1.15
    assert not np.any(trial.diagnostics["inconsistent"])


def test_a_window_that_cannot_explain_its_measurements_says_so():
    """GNSS is off by 25 m for 100 s: the error is many of the sigmas that the window would report without the test."""
    recording = simnav.record(load("window-bias"), 1)
    trial = simnav.run_trial(make("sw-fgo"), recording)
    inconsistent = np.asarray(trial.diagnostics["inconsistent"], dtype=bool)
    factor = np.asarray(trial.diagnostics["variance_factor"], dtype=float)
    ((begin, end),) = [(f.start, f.end) for f in load("window-bias").faults]
    time = trial.time
    assert inconsistent[(time > begin + 10.0) & (time < begin + 25.0)].all()
    assert not inconsistent[time < begin].any()
    assert np.nanmax(factor[(time > begin) & (time < end)]) > 10.0


def test_the_reported_covariance_is_multiplied_by_the_variance_factor():
    recording = simnav.record(load("window-bias").model_copy(update={"duration": 400.0}), 1)
    estimator, seen = make("sw-fgo"), 0
    estimator.reset(recording.start, recording.instruments)
    for packet in recording.steps():
        estimate = estimator.update(packet)
        believed = estimator.chain.predicted_covariance(estimator.covariance)[:9, :9]
        if estimator._cost_test.inconsistent:
            seen += 1
            assert estimate.diagnostics["variance_factor"] > 1.0
            np.testing.assert_allclose(estimate.covariance, estimate.diagnostics["variance_factor"] * believed)
        else:
            np.testing.assert_array_equal(estimate.covariance, believed)
    assert seen > 5
