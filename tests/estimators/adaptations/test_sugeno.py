"""The Sugeno network by hand, its gradients by differences, and hybrid learning on systems that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav.estimators.adaptations.sugeno import Sugeno
from simnav.estimators.training.hybrid_learning import StepSize, fit_consequents, learn, premise_gradient, rmse


def random_network(seed: int, inputs: int = 2, memberships: int = 3) -> Sugeno:
    """Memberships in their order, consequents of order one."""
    rng = np.random.default_rng(seed)
    grid = Sugeno.grid(inputs, memberships)
    return Sugeno(
        grid.centres + rng.uniform(-0.05, 0.05, grid.centres.shape),
        grid.widths * rng.uniform(0.8, 1.2, grid.widths.shape),
        rng.standard_normal(grid.consequents.shape),
    )


def test_output_by_hand():
    """Two inputs with two memberships, one layer after the other, with the numbers written out."""
    network = Sugeno(
        np.array([[0.0, 1.0], [0.0, 2.0]]),
        np.array([[1.0, 0.5], [2.0, 1.0]]),
        np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [2.0, -1.0, 0.5]]),
    )
    x = np.array([[0.5, 1.0]])
    # Layer 1: exp(-0.125), exp(-0.5) of the first input, exp(-0.125), exp(-0.5) of the second.
    np.testing.assert_allclose(network.grades(x)[0], [[0.8824969, 0.6065307], [0.8824969, 0.6065307]], rtol=1e-6)
    # Layers 2, 3: products 0.7788008, 0.5352614, 0.5352614, 0.3678794, of the sum 2.2172031.
    np.testing.assert_allclose(network.weights(x)[0], [0.3512537, 0.2414128, 0.2414128, 0.1659205], rtol=1e-5)
    # Layers 4, 5: consequents 0.5, 1.0, 1.0, 0.5.
    np.testing.assert_allclose(network.rules(x)[0], [0.5, 1.0, 1.0, 0.5])
    assert network(x)[0] == pytest.approx(0.5 + 0.5 * (0.2414128 + 0.2414128), rel=1e-6)


def test_one_input_gives_what_many_give():
    network = random_network(8, inputs=3)
    x = np.random.default_rng(8).uniform(-1.0, 2.0, (20, 3))
    np.testing.assert_allclose([network.single(row) for row in x.tolist()], network(x), rtol=1e-12, atol=1e-14)


def test_a_rule_is_a_membership_of_each_input():
    network = Sugeno.grid(3)
    assert network.antecedents.shape == (27, 3, 3)
    assert (network.antecedents.sum(axis=2) == 1.0).all()
    assert len(np.unique(network.antecedents.reshape(27, 9), axis=0)) == 27
    # At the centres of one rule's antecedents that rule is the strongest.
    for rule in (0, 5, 26):
        x = np.sum(network.antecedents[rule] * network.centres, axis=1)[None]
        assert np.argmax(network.weights(x)) == rule


def test_neighbours_on_the_grid_cross_at_one_half_and_the_strengths_sum_to_one():
    network = Sugeno.grid(2, 5)
    between = np.full((1, 2), 0.125)
    np.testing.assert_allclose(network.grades(between)[0, :, :2], 0.5)
    far = np.array([[1e6, -1e6]])
    np.testing.assert_allclose(network.weights(far)[0], np.eye(25)[20])  # last of the first, first of the last


@pytest.mark.parametrize("inputs", [2, 3])
def test_gradients_are_those_of_the_error(inputs: int):
    """Against central differences of the mean squared error."""
    network = random_network(inputs, inputs)
    rng = np.random.default_rng(9)
    x, y = rng.random((40, inputs)), rng.standard_normal(40)
    gradients = premise_gradient(network, x, y)
    h = 1e-6
    for name, gradient in zip(("centres", "widths"), gradients, strict=True):
        at = getattr(network, name)
        for index in np.ndindex(at.shape):
            ends = []
            for sign in (1.0, -1.0):
                moved = at.copy()
                moved[index] += sign * h
                ends.append(rmse(replace(network, **{name: moved}), x, y) ** 2)
            assert gradient[index] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-5, abs=1e-8), (name, index)


def test_least_squares_finds_the_consequents():
    """Exactly, where the data are those of the network, in more rows than one block has."""
    network = random_network(3)
    x = np.random.default_rng(3).random((1500, 2))
    found = fit_consequents(replace(network, consequents=np.zeros((9, 3))), x, network(x), ridge=1e-14)
    np.testing.assert_allclose(found.consequents, network.consequents, atol=1e-8)


def test_rules_without_data_stay_small():
    """Data in one corner: the normal equations are singular, and what they do not determine is drawn to zero."""
    x = 0.1 * np.random.default_rng(4).random((500, 3))
    found = fit_consequents(Sugeno.grid(3), x, 1.0 + x[:, 0])
    assert rmse(found, x, 1.0 + x[:, 0]) < 1e-3
    assert np.abs(found.consequents).max() < 2.0


def test_learning_recovers_a_known_system():
    """From the grid, whose premises are off: least squares alone leaves 0.03, learning less than 0.001."""
    truth = Sugeno(
        np.array([[0.1, 0.5, 0.95], [0.0, 0.4, 0.9]]),
        np.array([[0.2, 0.15, 0.25], [0.25, 0.2, 0.2]]),
        np.random.default_rng(0).standard_normal((9, 3)),
    )
    rng = np.random.default_rng(1)
    x, check = rng.random((2000, 2)), rng.random((500, 2))
    learned = learn(Sugeno.grid(2), (x, truth(x)), (check, truth(check)), passes=300)
    assert learned.training[0] > 0.02
    assert learned.validation[learned.best] < 1e-3
    assert rmse(learned.network, check, truth(check)) == learned.validation[learned.best]


def test_two_input_sinc():
    """Jang 1993, section V, example 1: sin(x)/x sin(y)/y on 121 points, 16 rules, 250 passes."""
    axis = np.arange(-10.0, 11.0, 2.0)
    points = np.array([(a, b) for a in axis for b in axis])
    y = np.sinc(points / np.pi).prod(axis=1)
    x = (points + 10.0) / 20.0
    learned = learn(Sugeno.grid(2, 4), (x, y), (x, y), passes=250, step=0.02, patience=250)
    assert learned.training[0] > 0.09
    assert learned.training[learned.best] < 0.032


def test_learning_is_the_same_every_time_and_stops_early():
    rng = np.random.default_rng(5)
    x, y = rng.random((300, 2)), rng.standard_normal(300)  # nothing but noise
    other = rng.random((300, 2)), rng.standard_normal(300)
    first, again = (learn(Sugeno.grid(2), (x, y), other, passes=200, patience=5) for _ in range(2))
    assert first.training == again.training
    assert np.array_equal(first.network.centres, again.network.centres)
    assert np.array_equal(first.network.consequents, again.network.consequents)
    assert len(first.training) < 100
    assert len(first.training) == first.best + 6


def test_step_size_grows_on_four_falls_and_shrinks_on_two_oscillations():
    size = StepSize(1.0)
    for error in (5.0, 4.0, 3.0, 2.0):
        assert size.see(error) == 1.0
    assert size.see(1.0) == pytest.approx(1.1)
    size = StepSize(1.0)
    for error in (1.0, 2.0, 1.5, 2.5):
        assert size.see(error) == 1.0
    assert size.see(2.0) == pytest.approx(0.9)
    size = StepSize(1.0)
    assert [size.see(e) for e in (1.0, 2.0, 3.0, 2.0, 3.0)] == [1.0] * 5


def test_data_that_are_none():
    x, y = np.zeros((2, 2)), np.array([0.0, np.nan])
    with pytest.raises(ValueError, match="the training data should be finite"):
        learn(Sugeno.grid(2), (x, y), (x, np.zeros(2)))
    with pytest.raises(ValueError, match="the validation data should be finite"):
        learn(Sugeno.grid(2), (x, np.zeros(2)), (x[:0], np.zeros(0)))
