"""A model is functions over one flat state: kernels, their plain sources, and the methods of the model agree."""

from __future__ import annotations

import numpy as np
import pytest

from simnav import run_trial
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.models.filtering import ModelFunctions
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.kinematic import KinematicModel
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.standing_ship import StandingShip
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.smoother import Smoother
from simnav.estimators.solvers.window import WindowEstimator
from simnav.plugins import import_file
from simnav.scenario import load
from simnav.source import record


def plain(model: type) -> type:
    """A model with the plain sources of its functions."""

    class Plain(model):
        def functions(self):
            return ModelFunctions(*(f and f.function for f in super().functions()))

    return Plain


def by_methods(model: type) -> type:
    """A model that gives no functions, so that a filter calls its methods."""

    class ByMethods(model):
        def functions(self):
            return None

    return ByMethods


@pytest.mark.parametrize("adaptation", [None, ChiSquareGate])
@pytest.mark.parametrize(
    ("scenario", "model"),
    [
        ("open-sea", InertialModel),
        ("open-sea", NineStateModel),
        ("open-sea", KinematicModel),
        ("ship-straight", ShipModel),
        ("gnss-outage", StandingShip),
    ],
)
def test_kernels_sources_and_methods_are_one_model(scenario: str, model: type, adaptation: type | None):
    recording = record(load(scenario).model_copy(update={"duration": 40.0}), 1)
    trials = []
    for made in (model, plain(model), by_methods(model)):
        estimator = KalmanEstimator(made(), None if adaptation is None else adaptation())
        trials.append(run_trial(estimator, recording))
        assert trials[-1].status == "ok", trials[-1].reason
        assert estimator._compiled == (made is model)
    for other in trials[1:]:
        np.testing.assert_allclose(other.position, trials[0].position, rtol=1e-13)
        np.testing.assert_allclose(other.covariance, trials[0].covariance, rtol=1e-9, atol=1e-14)


def test_a_model_of_the_guide_once_in_python_and_once_compiled(plugins, tmp_path):
    source = (plugins / "drifting_buoy.py").read_text()
    compiled = tmp_path / "compiled_buoy.py"
    compiled.write_text(
        source.replace("\ndef ", "\n@kernel(passed=True)\ndef ").replace(
            "\nfrom simnav.geometry", "\nfrom simnav.compiled import kernel\nfrom simnav.geometry"
        )
    )
    assert compiled.read_text().count("@kernel") == 4
    recording, trials = record(load("open-sea").model_copy(update={"duration": 60.0}), 1), []
    for path in (plugins / "drifting_buoy.py", compiled):
        estimator = KalmanEstimator(import_file(path).DriftingBuoy(), ChiSquareGate())
        trials.append(run_trial(estimator, recording))
        assert trials[-1].status == "ok", trials[-1].reason
        assert estimator._compiled == (path is compiled)
    np.testing.assert_allclose(trials[0].position, trials[1].position, rtol=1e-14)
    np.testing.assert_allclose(trials[0].covariance, trials[1].covariance, rtol=1e-10)
    smoothed = KalmanEstimator(import_file(plugins / "drifting_buoy.py").DriftingBuoy(), smoother=Smoother())
    assert run_trial(smoothed, recording).status == "ok"


def test_a_window_over_a_model_of_functions_is_the_filter(plugins):
    """The motion and the readings are all but linear, so nothing is gained by linearising anew."""
    recording = record(load("open-sea").model_copy(update={"duration": 40.0}), 1)
    made = import_file(plugins / "drifting_buoy.py").DriftingBuoy
    filtered, windowed = (run_trial(e, recording) for e in (KalmanEstimator(made()), WindowEstimator(made(), window=5)))
    assert windowed.status == "ok", windowed.reason
    np.testing.assert_allclose(windowed.position, filtered.position, rtol=0, atol=1e-9)
    np.testing.assert_allclose(windowed.velocity, filtered.velocity, rtol=0, atol=1e-3)
    np.testing.assert_allclose(windowed.covariance, filtered.covariance, rtol=1e-4, atol=1e-9)
