"""Weightings in an iterated filter: full weight is the iterated filter, an outlier is left out, a good fix is not."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.composition import Row
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.weighted import WeightedKalmanEstimator
from simnav.estimators.weightings.base import Weighting
from simnav.estimators.weightings.graduated_non_convexity import GraduatedNonConvexity
from simnav.estimators.weightings.max_mixture import MaxMixture
from simnav.recording import Recording
from simnav.scenario import load
from simnav.scoring import errors
from simnav.sensors.faults import GrossError
from simnav.source import record
from simnav.trial import Trial, run_trial


class Gnc(Row, solver=WeightedKalmanEstimator, model=Suitable, weighting=GraduatedNonConvexity):
    """Graduated non-convexity in an iterated filter."""


def sea(*faults) -> Recording:
    return record(load("open-sea").model_copy(update={"duration": 60.0, "faults": tuple(faults)}), 4)


def rmse(trial: Trial, recording: Recording) -> float:
    assert trial.status == "ok", trial.reason
    return float(np.sqrt(np.mean(np.sum(errors(trial, recording)[10:, :2] ** 2, axis=1))))


def test_in_full_weight_it_is_the_iterated_filter():
    recording = sea()
    ours = run_trial(WeightedKalmanEstimator(Suitable(), Weighting(), threshold=1e-3), recording)
    theirs = run_trial(make("iekf"), recording)
    sigma = np.sqrt(np.diagonal(theirs.covariance, axis1=1, axis2=2))
    assert np.abs(ours.velocity - theirs.velocity).max() < 1e-2 * sigma[:, 3:6].min()
    np.testing.assert_allclose(np.diagonal(ours.covariance, axis1=1, axis2=2), sigma**2, rtol=1e-3)


@pytest.mark.parametrize(
    ("weighting", "window"),
    [(GraduatedNonConvexity, "gnc-fgo"), (MaxMixture, "max-mixture-fgo")],
    ids=["gnc", "mixture"],
)
def test_gross_errors_are_flagged_and_it_is_as_good_as_the_window(weighting: type[Weighting], window: str):
    clean = sea()
    spoilt = sea(GrossError(instruments=("gnss",), probability=0.1, size_position=(40.0, 80.0), start=5.0))
    row = type(Row)("Any", (Row,), {}, solver=WeightedKalmanEstimator, model=Suitable, weighting=weighting)
    good, bad = run_trial(row(), clean), run_trial(row(), spoilt)
    assert rmse(bad, spoilt) < 0.3 * rmse(run_trial(make("ekf"), spoilt), spoilt)
    assert rmse(good, clean) < 1.1 * rmse(run_trial(make(window), clean), clean)
    weights = bad.diagnostics["weight.gnss"]
    assert len([name for name, _ in bad.flagged if name == "gnss"]) >= 3
    assert np.nanmin(weights) < 0.1 < 0.9 < np.nanmedian(weights)


def test_what_it_takes():
    assert Gnc(growth=1.4, limit=20).weighting.growth == 1.4
    for parameters, message in (({"limit": 1}, "limit is 1"), ({"threshold": 0.0}, "threshold is 0")):
        with pytest.raises(ValueError, match=message):
            Gnc(**parameters)
    with pytest.raises(TypeError, match="takes no adaptation: the weighting decides"):
        type(Row)("Both", (Gnc,), {}, adaptation=GraduatedNonConvexity)
