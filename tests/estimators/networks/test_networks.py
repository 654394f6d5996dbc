"""Networks as plain arrays: the file, and the compiled recurrent step."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from simnav.estimators.networks.file import Network, NetworkError
from simnav.estimators.networks.recurrent import advance, fitting, flat, shapes, size_of


def drawn(inputs, units, seed=0):
    rng = np.random.default_rng(seed)
    return {name: rng.normal(size=shape) for name, shape in shapes(inputs, units).items()}


def logistic(x):
    return 1.0 / (1.0 + np.exp(-x))


def output_of(weights, x, memory, outputs):
    y = np.empty(outputs)
    advance(weights, x, memory, y)
    return y


def test_the_recurrent_step_is_its_equations():
    own, memory, reference = drawn(4, 3), np.zeros(3), np.zeros(3)
    weights = flat(own)
    assert len(weights) == size_of(4, 3)
    for x in np.random.default_rng(1).normal(size=(5, 4)):
        given = own["input_weight"] @ x + own["input_bias"]
        kept = own["memory_weight"] @ reference + own["memory_bias"]
        r, z = logistic(given[:3] + kept[:3]), logistic(given[3:6] + kept[3:6])
        reference = (1.0 - z) * np.tanh(given[6:] + r * kept[6:]) + z * reference
        y = own["output_weight"] @ reference + own["output_bias"]
        np.testing.assert_allclose(output_of(weights, x, memory, len(y)), y, rtol=1e-12)
        np.testing.assert_allclose(memory, reference, rtol=1e-12)


def test_the_recurrent_step_is_that_of_pytorch():
    torch = pytest.importorskip("torch", reason="the extra learn is not installed")
    layer = torch.nn.GRU(4, 3, batch_first=True).double()
    names = ("input_weight", "memory_weight", "input_bias", "memory_bias")
    own = {name: p.detach().numpy() for name, p in zip(names, layer.parameters(), strict=True)}
    own |= {"output_weight": np.array([1.0, 2.0, 3.0]), "output_bias": np.array([0.5])}
    x = np.random.default_rng(2).normal(size=(6, 4))
    expected = layer(torch.from_numpy(x)[None])[0][0].detach().numpy() @ [1.0, 2.0, 3.0] + 0.5
    memory = np.zeros(3)
    np.testing.assert_allclose([output_of(flat(own), row, memory, 1)[0] for row in x], expected, rtol=1e-10)


def test_a_file_holds_the_network_and_its_record(tmp_path):
    record = {"voyages": 8, "streams": [[5, 12]], "seed": 3}
    network = Network("a-recipe", 2, drawn(4, 3), ("dvl",), record)
    network.save(tmp_path / "n.npz")
    again = Network.load(tmp_path / "n.npz", "a-recipe", 2, partial(fitting, 4))
    assert (again.kinds, again.trained_on) == (("dvl",), record)
    assert again.parameters == size_of(4, 3)
    np.testing.assert_array_equal(again.arrays["input_weight"], np.float32(network.arrays["input_weight"]))


@pytest.mark.parametrize(
    ("recipe", "version", "inputs", "message"),
    [
        ("another", 2, 4, "recipe should be 'another', not 'a-recipe'"),
        ("a-recipe", 3, 4, "version should be 3, not 2"),
        ("a-recipe", 2, 5, r"input_weight is of shape \(9, 4\); it should be of shape \(9, 5\)"),
    ],
)
def test_a_file_of_something_else_is_refused(tmp_path, recipe, version, inputs, message):
    Network("a-recipe", 2, drawn(4, 3)).save(tmp_path / "n.npz")
    with pytest.raises(NetworkError, match=rf"n\.npz: {message}"):
        Network.load(tmp_path / "n.npz", recipe, version, partial(fitting, inputs))


def test_what_is_no_network_is_refused(tmp_path):
    load = partial(Network.load, recipe="a-recipe", version=2, shapes=partial(fitting, 4))
    with pytest.raises(NetworkError, match=r"absent\.npz: No such file"):
        load(tmp_path / "absent.npz")
    (tmp_path / "text.npz").write_text("nothing")
    with pytest.raises(NetworkError, match=r"text\.npz: it is no network file"):
        load(tmp_path / "text.npz")
    np.savez(tmp_path / "other.npz", a=np.ones(3))
    with pytest.raises(NetworkError, match=r"other\.npz: it is no network file"):
        load(tmp_path / "other.npz")
    poor = drawn(4, 3) | {"output_bias": np.array([np.nan])}
    Network("a-recipe", 2, poor).save(tmp_path / "poor.npz")
    with pytest.raises(NetworkError, match=r"poor\.npz: output_bias should hold finite numbers"):
        load(tmp_path / "poor.npz")
