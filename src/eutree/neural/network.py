"""Small networks as one vector of weights, and the scaling of what they look at."""

from dataclasses import dataclass

import numpy as np

from eutree.arrays import Float32s, Floats, frozen
from eutree.errors import InvalidArgumentError
from eutree.neural import _kernels
from eutree.neural._kernels import Network

FAR = 10.0  # in spreads: what is farther from the mean looks alike
FLOOR = 0.05  # of the range: least spread of a feature


def n_weights(p: int, h: int, q: int) -> int:
    """Return the number of weights of a network p -> h -> h -> q."""
    return (p + 1) * h + (h + 1) * h + (h + 1) * q


def network_of(weights: Float32s, p: int, h: int, q: int) -> Network:
    """Return the network p -> h -> h -> q whose matrices are views of a vector of weights.

    Raises:
        InvalidArgumentError: The vector has another size than such a network has weights.
    """
    if weights.shape != (n_weights(p, h, q),):
        raise InvalidArgumentError(
            f"weights must have shape ({n_weights(p, h, q)},) for a network "
            f"{p} -> {h} -> {h} -> {q}, got {weights.shape}"
        )
    parts, begin = [], 0
    for shape in ((p, h), (h,), (h, h), (h,), (h, q), (q,)):
        end = begin + int(np.prod(shape))
        parts.append(weights[begin:end].reshape(shape))
        begin = end
    return Network._make([*parts, weights])


def random_network(p: int, h: int, q: int, generator: np.random.Generator) -> Network:
    """Return a network of random weights, uniform with variance 2 / inputs (He et al. 2015).

    The last layer's are a hundred times smaller, so that everything is 0 at first.
    """
    network = network_of(np.zeros(n_weights(p, h, q), dtype=np.float32), p, h, q)
    for matrix, factor in ((network.w1, 1.0), (network.w2, 1.0), (network.w3, 0.01)):
        reach = factor * np.sqrt(6.0 / matrix.shape[0])
        matrix[:] = generator.uniform(-reach, reach, matrix.shape)
    return network


def copied(network: Network) -> Network:
    """Return a network of the same weights in memory of its own."""
    p, h = network.w1.shape
    return network_of(network.weights.copy(), p, h, network.b3.size)


def outputs(network: Network, x: Float32s) -> Floats:
    """Return what the network puts out for each row of x [N, p], shape [N, q]."""
    return _kernels.outputs(network, np.ascontiguousarray(x)).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Scaling:
    """Where the features of observations lie, and how far they spread.

    Attributes:
        mean: Mean of each feature.
        spread: What counts as a distance of 1.
    """

    mean: Floats  # [d]
    spread: Floats  # [d]

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", frozen(self.mean))
        object.__setattr__(self, "spread", frozen(self.spread))

    @classmethod
    def of(cls, observations: Floats) -> "Scaling":
        """Return that of observations [N, d]: standard deviations and a twentieth of the range.

        The range keeps a feature that hardly ever changes, like a contact, from being blown up.
        """
        spread = observations.std(axis=0) + FLOOR * np.ptp(observations, axis=0)
        return cls(observations.mean(axis=0), np.where(spread > 0.0, spread, 1.0))

    def __call__(self, observations: Floats) -> Float32s:
        """Return observations [..., d] in spreads from the mean, cut at ten."""
        scaled = np.clip((observations - self.mean) / self.spread, -FAR, FAR)
        return scaled.astype(np.float32)
