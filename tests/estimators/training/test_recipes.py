"""The recipes of learned rows: their targets, their voyages, and a training in a small form."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest

from simnav.estimators.training import factor_network, noise_network
from simnav.estimators.training.information import LASTING, information
from simnav.estimators.training.voyages import FIRST_SEEDS, streams_of, voyages
from simnav.leaderboard.dataset import splits
from simnav.scenario import load, parse
from simnav.source import record

FAULTY = """
name = "faulty"
version = 1
title = "Two faults"
duration_s = 60.0
[start]
latitude_deg = 50.0
longitude_deg = 10.0
speed_m_s = 5.0
[vessel]
kind = "ship"
[instruments.gnss]
kind = "gnss_position"
rate_hz = 2.0
sigma_m = 1.5
[instruments.gyrocompass]
rate_hz = 1.0
sigma_deg = 0.5
[[fault]]
kind = "noise_step"
instruments = ["gnss"]
start_s = 10.0
end_s = 20.0
factor = 3.0
[[fault]]
kind = "bias_step"
instruments = ["gnss"]
start_s = 40.0
end_s = 50.0
offset_m = [3.0, 0.0, 0.0]
"""


def test_the_information_of_readings_follows_from_their_labels():
    recording = record(parse(FAULTY), 0)
    stream = recording.data.aids["gnss"]
    found = information(recording, stream)
    expected, noisy = np.ones(len(stream)), (stream.time > 10.1) & (stream.time < 19.9)
    expected[noisy] = 1.0 / 9.0  # by the variance; not, once more, by what it added
    k = 2.0 * LASTING
    expected[(stream.time > 40.1) & (stream.time < 49.9)] = 1.0 / (1.0 + k * (3.0 / 1.5) ** 2 / 3.0)
    sure = np.min(np.abs(stream.time[:, None] - [10.0, 20.0, 40.0, 50.0]), axis=1) > 0.1
    np.testing.assert_allclose(found[sure], expected[sure], rtol=1e-6)
    np.testing.assert_array_equal(information(recording, recording.data.aids["gyrocompass"]), 1.0)


def test_noise_counts_once_where_another_fault_has_the_same_readings():
    """The mean over many runs of the inverse information: of a bias that lasts, of a small one, and of gross errors."""
    both = FAULTY.replace("start_s = 40.0", "start_s = 5.0").replace("end_s = 50.0", "end_s = 55.0")
    gross = """kind = "gross_error"
instruments = ["gnss"]
start_s = 10.0
end_s = 20.0
probability = 1.0
distribution = "fixed"
size_m = 30.0"""
    begin = both.index('kind = "bias_step"')
    for text, square, k in (
        (both, (3.0 / 1.5) ** 2 / 3.0, 2.0 * LASTING),
        (both.replace("offset_m = [3.0,", "offset_m = [0.001,"), 0.0, 2.0 * LASTING),
        (both[:begin] + gross, (30.0 / 1.5) ** 2, 1.0),
    ):
        found = []
        for seed in range(12):
            stream = (recording := record(parse(text), seed)).data.aids["gnss"]
            noisy = (stream.time > 10.1) & (stream.time < 19.9)
            found.append(np.mean(1.0 / information(recording, stream)[noisy]))
        # The noise of the mean over 20 readings, by what is subtracted: 0 in the mean, but not negative.
        allowed = k * 8.0 / 20.0 if square == 0.0 else 0.25 * k * square
        assert abs(np.mean(found) - (9.0 + k * square)) < allowed


def test_the_voyages_are_those_of_a_data_set():
    assert {s: splits.FIRST_SEEDS[s] for s in FIRST_SEEDS} == FIRST_SEEDS
    families = ("training-ships", "training-gnss-faults")
    seeds = [r.seed - FIRST_SEEDS["train"] for r in voyages(families, "train", [0, 1, 4])]
    assert seeds == [0, 0, 2]
    first = [load(name).root(FIRST_SEEDS["train"]) for name in families]
    assert streams_of(families, "train", 5) == sorted([(first[0], first[0] + 2), (first[1], first[1] + 1)])
    assert streams_of(families, "train", 1) == [(first[0], first[0])]
    with pytest.raises(ValueError, match="random-voyages is ranked: a recipe learns from training families only"):
        next(voyages(("random-voyages",), "train", [0]))


@cache
def recordings():
    """Short voyages with a noisy receiver."""
    family = load("training-gnss-faults").model_copy(update={"duration": 100.0})
    return [record(family, FIRST_SEEDS["train"] + k) for k in range(4)]


def test_what_the_noise_network_learns_from():
    datasheet, target = (noise_network.gather([r] * 7)[k][0] for r, k in ((recordings()[0], 0), (recordings()[0], 6)))
    assert datasheet.kind == target.kind == "gnss_position"
    stream = recordings()[0].data.aids["gnss"]
    np.testing.assert_array_equal(datasheet.target, np.float32(information(recordings()[0], stream)))
    assert not np.array_equal(datasheet.inputs, target.inputs)  # the noise was another one
    assert len(datasheet.inputs) == len(stream)


@pytest.mark.parametrize("recipe", [noise_network, factor_network])
def test_a_recipe_learns(recipe, tmp_path, monkeypatch):
    """In some seconds, on what it is validated on, too: the error falls below that of a constant."""
    pytest.importorskip("torch", reason="the extra learn is not installed")
    data = recipe.gather(recordings())
    monkeypatch.setattr(recipe, "BATCH", 2 if recipe is noise_network else 128)
    fitted = recipe.train(data, data, 25 if recipe is noise_network else 10, seed=1)
    network, validation = fitted.network, fitted.validation
    noted = [part for voyage in data for part in voyage] if recipe is noise_network else data
    targets = [part.target for part in noted]
    loaded = noise_network.LearnedNoise if recipe is noise_network else factor_network.LearnedWeights
    logs = [np.log(np.maximum(t, 1e-3)) for t in targets]
    mean = np.mean([np.mean(x) for x in logs])
    constant = np.mean([np.mean((x - mean) ** 2) for x in logs])
    assert min(validation) < 0.9 * constant
    assert network.trained_on["voyages"] == 4
    network.save(tmp_path / "n.npz")
    assert loaded(str(tmp_path / "n.npz")).trained_on == json.loads(json.dumps(network.record))
