"""Double DQN with demonstrations in its replay: a small network that learns to control first.

Q(o, a) is a network of two hidden layers. Every step is kept and learned from again and again: Q of
the action taken moves towards the rewards of the next n steps and the value of where they led, as
the target network sees it (van Hasselt, Guez and Silver 2016; n-step returns as in Hessel et al.
2018). An action may have several outputs, the quantiles of its return (Dabney et al. 2018), and its
value is their mean. The target follows softly (Lillicrap et al. 2016). The network handed on is a
slow average of the weights (Polyak and Juditsky 1992), which acts more evenly than the last ones.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eutree.arrays import Booleans, Float32s, Floats, Integers, freeze, grown
from eutree.errors import InvalidArgumentError
from eutree.features import GreedyPolicy
from eutree.neural import _kernels
from eutree.neural._kernels import Learning, Network, Rates, StretchRows
from eutree.validation import check_amounts, check_integer, check_measures, check_number

FAR = 10.0  # in spreads: numbers farther from the mean look alike
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


@dataclass(frozen=True, eq=False)
class Scaling:
    """Where the features of observations lie, and how far they spread."""

    mean: Floats  # [d] mean of each feature
    spread: Floats  # [d] distance that counts 1, of each feature

    def __post_init__(self) -> None:
        freeze(self, "mean", "spread")

    @classmethod
    def of(cls, observations: Floats) -> "Scaling":
        """Return that of observations [N, d]: standard deviations and a twentieth of the range.

        The range keeps a feature that hardly ever changes, like a contact, from being blown up.
        """
        spread = observations.std(axis=0) + FLOOR * np.ptp(observations, axis=0)
        return cls(observations.mean(axis=0), np.where(spread > 0.0, spread, 1.0))

    def __call__(self, observations: Floats) -> Float32s:
        """Return observations [..., d] in spreads from the mean, cut at ten."""
        return np.clip((observations - self.mean) / self.spread, -FAR, FAR).astype(np.float32)


LARGEST_RETURN = 10.0  # scaled size of the largest discounted return of the demonstrations
CHUNK = 256  # updates between two chances to interrupt, about a third of a second
SLOWEST = 0.1  # share of the rate that is left at the end


@dataclass(frozen=True, kw_only=True)
class DoubleDQNSettings:
    """How the network learns.

    Attributes:
        hidden: Units of each of the two hidden layers.
        quantiles: Outputs of an action: quantiles of its return, whose mean is its value.
        discount: gamma, per step.
        n_steps: Steps of a stretch n.
        rate: Adam's step size at first; it falls linearly to a tenth.
        batch: Stretches of one update.
        updates_per_step: Updates for each step taken.
        target: Share of the way that the target's weights move to the present ones, per update.
        average: The same of the averaged weights.
        error: Largest temporal difference that counts, in scaled rewards.
        norm: Largest norm of a gradient.
    """

    hidden: int = 128
    quantiles: int = 1
    discount: float = 0.99
    n_steps: int = 3
    rate: float = 5e-4
    batch: int = 128
    updates_per_step: float = 0.5
    target: float = 0.005
    average: float = 0.0005
    error: float = 2.0
    norm: float = 10.0

    def __post_init__(self) -> None:
        check_amounts(self, hidden=1, quantiles=1, n_steps=1, batch=1)
        check_number("discount", self.discount, low=0.0, high=1.0)
        check_measures(self, "rate updates_per_step error norm", low=0.0, low_open=True)
        check_measures(self, "target average", low=0.0, high=1.0, low_open=True)


class DoubleDQN(GreedyPolicy):
    """A network that learns the values of actions from stored episodes.

    As a policy it acts by the averaged weights.

    Args:
        settings: How it learns.
        scaling: Of the observations.
        n_actions: Number of actions A.
        reward_scale: Factor of rewards, so that returns are of the size of ten.
        updates: Updates that are planned; the rate falls over them.
        generator: Source of the first weights.

    Attributes:
        updates: Updates so far.
        n_rows: Stretches stored so far: one for each step.
    """

    def __init__(
        self,
        settings: DoubleDQNSettings,
        scaling: Scaling,
        n_actions: int,
        *,
        reward_scale: float,
        updates: int,
        generator: np.random.Generator,
    ) -> None:
        self.updates = 0
        self._settings = settings
        self._scaling = scaling
        self._n_actions = n_actions
        self._reward_scale = check_number("reward_scale", reward_scale, low=0.0, low_open=True)
        self._planned = check_integer("updates", updates, low=1)
        self._size = scaling.mean.size, settings.hidden, n_actions * settings.quantiles
        online = random_network(*self._size, generator)
        none = np.zeros_like(online.weights)
        self._learning = Learning(
            online, copied(online), copied(online), copied(online), none, none.copy()
        )
        self._rates = Rates(settings.target, settings.average, settings.error, settings.norm)
        self.n_rows = 0
        self._all = np.ones(n_actions, dtype=np.bool_)
        places, numbers = np.zeros((0, scaling.mean.size), np.float32), np.zeros(0, np.float32)
        actions, masks = np.zeros(0, np.int64), np.zeros((0, n_actions), np.bool_)
        self._experience = StretchRows(places, actions, numbers, places, numbers, masks)

    def add(
        self,
        observations: Floats,  # [T + 1, d] from the first to the last
        actions: Integers,  # [T]
        rewards: Floats,  # [T]
        *,
        terminated: bool,  # whether the task ended it; else its last observation has a value
        allowed: Booleans | None = None,  # [T, A] at each step; at the last observation all are
    ) -> None:
        """Store the steps of an episode."""
        if not actions.size:
            return
        settings, scale = self._settings, self._reward_scale
        new = stretches(rewards, settings.discount, settings.n_steps, terminated=terminated)
        scaled = self._scaling(observations)
        masks = np.tile(self._all, (len(observations), 1))
        if allowed is not None:
            masks[:-1] = allowed
        rows = StretchRows(
            scaled[:-1],
            actions,
            (scale * new.earned).astype(np.float32),
            scaled[new.end],
            new.discounts.astype(np.float32),
            masks[new.end],
        )
        end = self.n_rows + actions.size
        if end > self._experience.actions.size:
            room = max(end, 2 * self.n_rows)
            self._experience = StretchRows._make(grown(column, room) for column in self._experience)
        for name in StretchRows._fields:
            getattr(self._experience, name)[self.n_rows : end] = getattr(rows, name)
        self.n_rows = end

    def update(self, n: int, generator: np.random.Generator) -> None:
        """Make n updates, on batches of all steps stored."""
        for begin in range(0, n if self.n_rows else 0, CHUNK):
            size = min(CHUNK, n - begin)
            number = np.arange(self.updates, self.updates + size)
            left = 1.0 - np.minimum(number / self._planned, 1.0) * (1.0 - SLOWEST)
            rows = generator.integers(self.n_rows, size=(size, self._settings.batch))
            rates, made = self._settings.rate * left, self.updates
            _kernels.update(self._learning, self._experience, rows, rates, made, self._rates)
            self.updates += size

    def act(self, observation: Floats, allowed: Booleans | None = None) -> int:
        """Return the best action at an observation [d] by the present weights, of those allowed."""
        x = self._scaling(observation)[np.newaxis]
        mask = self._all if allowed is None else allowed
        return int(_kernels.greedy_action(self._learning.online, x, mask))

    def action_values(self, observations: Floats) -> Floats:
        """Return Q of each action at observations [N, d], by the averaged weights, shape [N, A]."""
        x = np.ascontiguousarray(self._scaling(observations))
        found = _kernels.outputs(self._learning.average, x).astype(np.float64)
        quantiles = found.reshape(len(found), self._n_actions, self._settings.quantiles)
        values: Floats = quantiles.mean(axis=2) / self._reward_scale
        return values

    def state(self) -> dict[str, Float32s | Integers]:
        """Return all weights; with the episodes added again, a learner goes on from there."""
        of = self._learning
        weights = {
            name: getattr(of, name).weights.copy() for name in ("online", "target", "average")
        }
        updates = np.array([self.updates], dtype=np.int64)
        return weights | {"mean": of.mean.copy(), "square": of.square.copy(), "updates": updates}

    def restore(self, state: Mapping[str, Float32s | Integers]) -> None:
        """Take over the arrays of ``state``."""
        of = self._learning
        for name in ("online", "target", "average"):
            weights = np.asarray(state[name], dtype=np.float32)
            getattr(of, name).weights[:] = network_of(weights, *self._size).weights
        of.mean[:], of.square[:] = state["mean"], state["square"]
        self.updates = int(state["updates"][0])


class Stretches(NamedTuple):
    """The next n steps from each step of an episode."""

    earned: Floats  # [T] discounted sum of their rewards
    end: Integers  # [T] observation they end at; the last one where the episode is shorter
    discounts: Floats  # [T] weight of the value there; 0 where the task ended


def stretches(rewards: Floats, discount: float, n_steps: int, *, terminated: bool) -> Stretches:
    """Return the stretches of an episode with these rewards [T]; see ``DoubleDQN.add``."""
    length = rewards.size
    padded = np.concatenate([rewards, np.zeros(n_steps)])
    earned = np.zeros(length)
    for k in range(n_steps):
        earned += discount**k * padded[k : k + length]
    begin = np.arange(length)
    end = np.minimum(begin + n_steps, length)
    ended = (end == length) & terminated
    return Stretches(earned, end, np.where(ended, 0.0, discount ** (end - begin).astype(float)))


def reward_scale_of(rewards: Sequence[Floats], discount: float) -> float:
    """Return the factor that makes the largest discounted return of some episodes ten."""
    largest = 0.0
    for of_episode in rewards:
        value = 0.0
        for reward in of_episode[::-1].tolist():
            value = reward + discount * value
            largest = max(largest, abs(value))
    return LARGEST_RETURN / largest if largest > 0.0 else 1.0
