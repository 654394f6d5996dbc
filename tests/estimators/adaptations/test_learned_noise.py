"""The noise of readings from a network."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from simnav.estimator import EstimatorError, make
from simnav.estimators.adaptations.learned_noise import (
    HIDDEN,
    NUMBER_OF_INPUTS,
    RECIPE,
    VERSION,
    LearnedNoise,
    set_by_network,
)
from simnav.estimators.models.filtering import Prediction, room_for
from simnav.estimators.networks.file import BUDGETS, Network, NetworkError
from simnav.estimators.networks.recurrent import shapes
from simnav.estimators.training.voyages import streams_of
from simnav.estimators.weightings.learned_weights import LearnedWeights
from simnav.scenario import load
from simnav.source import record
from simnav.trial import run_trial


@cache
def recording(scenario="gnss-noise-step"):
    return record(load(scenario).model_copy(update={"duration": 20.0, "faults": ()}), 1)


def constant(path, information, kinds):
    """A network that says the same of every reading."""
    arrays = {name: np.zeros(shape) for name, shape in shapes(NUMBER_OF_INPUTS, 2).items()}
    arrays["output_bias"][0] = np.log(information / (1.0 - information))
    Network(RECIPE, VERSION, arrays, kinds, {"voyages": 3, "streams": [[7, 9]]}).save(path)
    return str(path)


def sigmas(file, **parameters):
    """Sigma of a fix as it was used last, over the datasheet's."""
    run = recording()
    row = make("net-ekf", file=file, **parameters)
    row.reset(run.start, run.instruments)
    estimates = [row.update(packet) for packet in run.steps()]
    return float(estimates[-1].diagnostics["sigma_north.gnss"]) / float(run.instruments["gnss"].sigma[0])


@pytest.mark.parametrize(("information", "factor"), [(0.25, 2.0), (1e-9, 30.0)])
def test_the_noise_is_that_of_the_datasheet_over_the_information(tmp_path, information, factor):
    assert sigmas(constant(tmp_path / "n.npz", information, ("gnss_position",))) == pytest.approx(factor, rel=1e-5)


def test_the_sigma_has_a_bound_and_other_kinds_keep_theirs(tmp_path):
    low = constant(tmp_path / "low.npz", 1e-9, ("gnss_position",))
    assert sigmas(low, highest=5.0) == pytest.approx(5.0)
    assert sigmas(constant(tmp_path / "other.npz", 0.25, ("dvl",))) == pytest.approx(1.0)


def test_an_innovation_that_says_nothing_is_not_asked_about(tmp_path):
    learned = LearnedNoise(constant(tmp_path / "n.npz", 0.25, ("gnss_position",)))
    learned.reset(recording().instruments)
    settings, memory = learned.memory_of("gnss")
    readings = room_for(1)
    readings.time[0] = 1.0
    before, eye = memory.copy(), np.eye(2)

    def asked(innovation, predicted):
        prediction = Prediction(np.array(innovation), np.empty((0, 0)), predicted, eye, np.empty((2, 2)))
        return set_by_network(settings, memory, learned.rule_common, readings, 0, prediction), prediction.noise

    for innovation, predicted in (([np.nan, 0.0], eye), ([1e9, 0.0], eye), ([1.0, 0.0], -0.5 * eye)):
        weight, noise = asked(innovation, predicted)
        assert weight == 0.0
        np.testing.assert_array_equal(noise, eye)
        np.testing.assert_array_equal(memory, before)
    weight, noise = asked([1.0, 2.0], eye)
    assert weight == pytest.approx(0.25)
    np.testing.assert_allclose(noise, 4.0 * eye)
    assert np.isfinite(memory[:HIDDEN]).all()


def test_a_file_that_is_no_network_of_the_recipe_is_refused(tmp_path):
    path = constant(tmp_path / "n.npz", 0.25, ())
    with pytest.raises(NetworkError, match="recipe should be 'factor-network', not 'noise-network'"):
        LearnedWeights(path)
    with pytest.raises(EstimatorError, match=r"estimator 'net-fgo': .*n\.npz: recipe should be"):
        make("net-fgo", file=path)
    with pytest.raises(EstimatorError, match="budget = 5: networks come with the budgets 1000 and 20000"):
        make("net-fgo", budget=5)
    with pytest.raises(ValueError, match=r"highest = 0\.5: it must be at least 1"):
        LearnedNoise(path, highest=0.5)


@pytest.mark.parametrize(
    ("name", "scenario"),
    [("net-ekf", "gnss-noise-step"), ("net-fgo", "gnss-noise-step"), ("beams-ekf", "auv-soft-mud")],
)
@pytest.mark.parametrize("budget", BUDGETS)
def test_the_networks_that_come_with_simnav_say_what_they_learned_from(name, scenario, budget):
    row = make(name if budget == BUDGETS[0] else f"{name}-{budget}")
    trial = run_trial(row, recording(scenario))
    assert trial.status == "ok", trial.reason
    told = row.trained_on
    families, voyages = tuple(told["families"]), told["voyages"]
    assert row.learned_from == streams_of(families, "train", voyages)
    assert budget / 4 <= voyages <= budget
    assert told["parameters"] > 1000
    assert {"families", "seed", "epochs", "seconds_per_epoch", "versions"} <= set(told)
