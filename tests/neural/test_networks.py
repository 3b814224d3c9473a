"""Layers, gradients and Adam of eutree.neural, against matrix products and differences."""

import numpy as np
import pytest

from eutree.errors import InvalidArgumentError
from eutree.neural import Scaling, _kernels
from eutree.neural.double_dqn import n_weights, network_of, random_network
from tests import naive_neural


def some_network(seed, *, p=3, h=7, q=5, dtype=np.float64):
    weights = np.random.default_rng(seed).standard_normal(n_weights(p, h, q)) * 0.5
    return network_of(weights.astype(dtype), p, h, q)


@pytest.mark.parametrize("seed", range(5))
def test_layers_are_matrix_products(seed):
    network = some_network(seed)
    x = np.random.default_rng(seed + 10).standard_normal((11, 3)).round(1)  # with zeros
    at = _kernels.room(network, 11)
    _kernels.forward(network, x, at)
    for mine, naive in zip(at, naive_neural.forward(network, x), strict=True):
        np.testing.assert_allclose(mine, naive, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_gradient_agrees_with_finite_differences(seed):
    """Central differences of a weighted sum of outputs, by every single weight."""
    generator = np.random.default_rng(seed)
    network, gradient = some_network(seed), some_network(0)
    x, error = generator.standard_normal((6, 3)), generator.standard_normal((6, 5))
    at = _kernels.room(network, 6)
    _kernels.forward(network, x, at)
    _kernels.backward(network, x, at, error, gradient)

    def loss():
        return float((naive_neural.forward(network, x)[2] * error).sum())

    step = 1e-6
    for i in range(network.weights.size):
        before = network.weights[i]
        network.weights[i] = before + step
        above = loss()
        network.weights[i] = before - step
        below = loss()
        network.weights[i] = before
        assert gradient.weights[i] == pytest.approx((above - below) / (2 * step), abs=1e-6)


@pytest.mark.parametrize("n", range(18))
def test_rows_are_added_four_to_a_term_to_the_bit(n):
    """However many go in one pass: the order of additions is part of every result."""
    generator = np.random.default_rng(n)
    w = generator.normal(size=(20, 21)).astype(np.float32)
    x = generator.normal(size=20).astype(np.float32)
    active = np.append(np.sort(generator.permutation(20)[:n]), 0)  # the last place counts nothing
    out = generator.normal(size=21).astype(np.float32)
    expected = naive_neural.add_rows(w, x, active[:n], out)
    _kernels.add_rows(w, x, n, active, out)
    assert (out == expected).all()


def test_adam_takes_the_steps_of_the_paper():
    generator = np.random.default_rng(4)
    weights, gradients = generator.standard_normal(30), generator.standard_normal((8, 30))
    mine, mean, square = weights.copy(), np.zeros(30), np.zeros(30)
    for number, gradient in enumerate(gradients, start=1):
        _kernels.adam_step(mine, gradient, mean, square, number, 0.01)
    # Epsilon is added before the second average is unbiased here: a difference of 1e-7.
    np.testing.assert_allclose(mine, naive_neural.adam(weights, gradients, 0.01), atol=1e-6)


def test_long_gradients_are_shortened_and_short_ones_kept():
    gradient = np.array([3.0, 4.0])
    _kernels.limit_norm(gradient, 10.0)
    assert gradient.tolist() == [3.0, 4.0]
    _kernels.limit_norm(gradient, 1.0)
    np.testing.assert_allclose(gradient, [0.6, 0.8])


def test_a_random_network_says_nothing_at_first():
    network = random_network(4, 64, 3, np.random.default_rng(0))
    x = np.random.default_rng(1).standard_normal((50, 4)).astype(np.float32)
    assert np.abs(naive_neural.forward(network, x)[2]).max() < 0.1


def test_weights_of_another_size_are_refused():
    with pytest.raises(InvalidArgumentError, match=r"must have shape \(116,\).*got \(5,\)"):
        network_of(np.zeros(5, np.float32), 3, 7, 4)


def test_scaling_does_not_depend_on_units():
    observations = np.random.default_rng(2).standard_normal((40, 3)) * [1.0, 0.001, 0.0]
    scaled = Scaling.of(observations)(observations)
    np.testing.assert_allclose(
        scaled, Scaling.of(1000 * observations + 7)(1000 * observations + 7), atol=1e-4
    )
    assert scaled[:, 2].tolist() == [0.0] * 40
    assert Scaling.of(observations)(np.array([1e9, 0.0, 0.0]))[0] == 10.0
