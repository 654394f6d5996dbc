"""Weights of the factors of a window from a network."""

from __future__ import annotations

import numpy as np

from simnav.estimators.networks.file import Network
from simnav.estimators.weightings.base import Factors
from simnav.estimators.weightings.learned_weights import (
    INPUTS,
    RECIPE,
    VERSION,
    LearnedWeights,
    inputs_of,
    shapes_of,
)
from simnav.types import Datasheet, Instruments

GROUP = {"gnss": 0, "dvl": 1}


def factors(whitened, instrument, components=3):
    whitened = np.array(whitened, dtype=float)
    k = len(whitened)
    return Factors(
        ("gnss", "dvl"), np.array(instrument, dtype=np.intp), np.full(k, components, dtype=np.intp),
        np.arange(k, dtype=float), whitened, np.tile(np.eye(3), (k, 1, 1)), whitened,
        np.linalg.norm(whitened, axis=1), np.array([1.0]), np.zeros((1, 15)), np.array([np.sqrt(15.0)]),
        np.ones(k), np.ones(1), 1,
    )  # fmt: skip


def test_the_inputs_are_what_they_are_called():
    whitened = [[3.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 2.0, 2.0]]
    found = dict(zip(INPUTS, inputs_of(factors(whitened, [0, 1, 0]), GROUP).T, strict=True))
    size = np.log1p(3.0 / np.sqrt(3.0))
    np.testing.assert_allclose(found["component_0"], np.arcsinh([3.0, 0.0, 1.0]))
    np.testing.assert_allclose(found["size"], [size, 0.0, size])
    np.testing.assert_allclose(found["size_of_mean"], [np.log1p(np.sqrt(6.0)), 0.0, np.log1p(np.sqrt(6.0))])
    np.testing.assert_allclose(found["along_mean"], np.arcsinh([6.0, 0.0, 6.0]))
    np.testing.assert_allclose(found["mean_size"], [size, 0.0, size])
    np.testing.assert_allclose(found["size_before"], [0.0, 0.0, size])
    np.testing.assert_allclose(found["size_after"], [size, 0.0, 0.0])
    np.testing.assert_allclose(found["age"], 0.3 * np.log1p([2.0, 1.0, 0.0]))
    np.testing.assert_allclose(found["number"], 0.3 * np.log1p([2.0, 1.0, 2.0]))
    np.testing.assert_allclose(found["motion"], np.log1p(1.0))
    np.testing.assert_array_equal(found["is_fix"], [1.0, 0.0, 1.0])
    np.testing.assert_array_equal(found["is_velocity"], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(found["mean_of_fixes"], size)
    np.testing.assert_array_equal(found["mean_of_headings"], 0.0)


def test_the_weights_are_the_network_of_the_inputs(tmp_path):
    rng = np.random.default_rng(3)
    arrays = {n: rng.normal(size=s) for n, s in shapes_of({"output_weight": np.empty(5)}).items()}
    Network(RECIPE, VERSION, arrays, ("gnss_position",)).save(tmp_path / "n.npz")
    weighting = LearnedWeights(str(tmp_path / "n.npz"), smallest=0.0)
    sheets = [Datasheet("gnss", "gnss_position", 1.0, np.ones(3)), Datasheet("dvl", "dvl", 1.0, np.ones(3))]
    weighting.reset(Instruments(sheets))
    window = factors(rng.normal(size=(6, 3)), [0, 0, 1, 0, 1, 0])
    assert weighting.weigh(window)
    x = inputs_of(window, GROUP)
    for layer in "01":
        x = np.tanh(x @ np.float32(arrays[f"weight_{layer}"]).T + np.float32(arrays[f"bias_{layer}"]))
    expected = 1.0 / (1.0 + np.exp(-(x @ np.float32(arrays["output_weight"]) + np.float32(arrays["output_bias"]))))
    expected[[2, 4]] = 1.0  # a kind that it has not learned from
    np.testing.assert_allclose(window.weight, expected, rtol=1e-5)
    assert len(set(window.weight)) == 5
