"""A world model of small networks: an ensemble that predicts where a step leads, how surely.

As in PETS (Chua, Calandra, McAllister and Levine 2018) each member predicts mean and variance of
the displacement o' - o, given o and the action (and if asked the displacement before); members
differ by their first weights and batches. Features with two values only are found and predicted as
such; two that are on a circle, as an angle's cosine and sine are, stay on it, and derived ones are
computed in place of predicted. The reward of a step, and whether it ends the task, badly or well,
are heads of the network.

All scales are fixed when the members are new; fitting on costs a fraction of fitting from scratch.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Float32s, Floats, Integers
from eutree.features import Derivation, threshold_between
from eutree.neural import Network, Scaling
from eutree.neural.double_dqn import CHUNK, SLOWEST, copied, network_of, random_network
from eutree.validation import check_amounts, check_measures
from eutree.world_model import _kernels_ensemble as kernels
from eutree.world_model._kernels_ensemble import BAD, GOES_ON, GOOD, Fitting, Scales, Steps
from eutree.world_model._kernels_ensemble_lanes import ROWS, TILE, EnsembleWorld
from eutree.world_model._kernels_formulas import formulas_of
from eutree.world_model.transitions import Transitions

N_KINDS = 3
EXTRA_ENDS = 32  # rows of a batch that are last steps
ROUND = 1e-5  # deviation of the squared distances from a circle's middle, in parts of their mean
TAIL = 0.02  # percent of rewards and displacements cut off from predictions, on either side


@dataclass(frozen=True, kw_only=True)
class EnsembleSettings:
    """How an ensemble is fitted.

    Attributes:
        members: Networks M.
        hidden: Units of each of the two hidden layers.
        batch: Transitions of one update; 32 last steps are added to them.
        updates: Updates of each member when it is new.
        more_updates: Updates of each member when it is fitted on.
        rate: Adam's step size at first, of a new member; it falls linearly to a tenth.
        more_rate: The same of a member that is fitted on.
        recent: Transitions that half of a batch is drawn from when fitting on: the last ones.
        memory: Whether the displacement before a step is an input.
    """

    members: int = 3
    hidden: int = 64
    batch: int = 512
    updates: int = 12_000
    more_updates: int = 2_000
    rate: float = 1e-3
    more_rate: float = 3e-4
    recent: int = 60_000
    memory: bool = False

    def __post_init__(self) -> None:
        check_amounts(self, members=1, hidden=1, batch=1, updates=1, more_updates=1, recent=1)
        check_measures(self, "rate more_rate", low=0.0, low_open=True)


def scales_of(data: Transitions) -> Scales:
    """Return the scales of some transitions."""
    places = _inputs(data, data.observations, data.previous_displacements)
    scaling, size = Scaling.of(places), np.abs(data.displacements)
    seen = np.concatenate([data.observations, data.next_observations])
    moves = np.percentile(data.displacements, [TAIL, 100.0 - TAIL], axis=0)
    binary = np.array([np.unique(column).size == 2 for column in seen.T])
    quantities = np.flatnonzero(~binary & (seen.min(axis=0) < seen.max(axis=0))).tolist()
    return Scales(
        centre=np.array(scaling.mean),
        spread=np.array(scaling.spread),
        move=0.3 * data.displacements.std(axis=0) + 0.3 * np.percentile(size, 90, axis=0),
        # in C order, as after a restore: kernels are compiled for each order
        moves=np.ascontiguousarray(moves.T),
        binary=binary,
        circles=circles_of(seen, quantities),
        low=seen.min(axis=0),
        high=seen.max(axis=0),
        earned=np.array([_rewards(data.rewards[kinds(data) == kind]) for kind in range(N_KINDS)]),
    )


def circles_of(observations: Floats, features: Sequence[int]) -> Integers:
    """Return the pairs of some features that are on a circle around 0, shape [C, 2].

    An angle is observed as its cosine and sine. Errors that are predicted apart lead away from the
    circle, to where no step was ever seen. A feature is on one circle at most.
    """
    if len(features) < 2:
        return np.empty((0, 2), dtype=np.int64)
    squares, pairs = observations[:, features] ** 2, list[tuple[int, int]]()
    mean, with_other = squares.mean(axis=0), np.cov(squares, rowvar=False)
    variance = np.add.outer(np.diag(with_other), np.diag(with_other)) + 2.0 * with_other
    is_round = np.sqrt(np.maximum(variance, 0.0)) < ROUND * np.add.outer(mean, mean)
    for i, j in np.argwhere(np.triu(is_round, 1)).tolist():
        if not {i, j} & set(itertools.chain(*pairs)):
            pairs.append((i, j))
    return np.array(features, dtype=np.int64)[np.array(pairs, dtype=np.int64).reshape(-1, 2)]


def steps_of(data: Transitions, scales: Scales) -> Steps:
    """Return the rows to fit members to, from the first members' or later transitions.

    After the N transitions come the observations in which the task ended: there it ends again.
    A rollout that overlooks an end would else go on where no step was ever seen.
    """
    kind, ended = kinds(data), data.terminated
    kind = np.concatenate([kind, kind[ended]])
    chosen = np.eye(data.n_actions)[np.concatenate([data.actions, data.actions[ended]])]
    before = _inputs(data, data.observations, data.previous_displacements)
    after = _inputs(data, data.next_observations, data.displacements)
    seen = np.concatenate([before, after[ended]])
    inputs = np.concatenate([(seen - scales.centre) / scales.spread, chosen], axis=1)
    units = np.where(scales.move > 0.0, scales.move, 1.0)
    upper = data.next_observations > 0.5 * (scales.low + scales.high)
    targets = np.where(scales.binary, upper, data.displacements / units)
    unit = scales.earned[kind, 1]
    rewards = np.concatenate([data.rewards, data.rewards[ended]]) - scales.earned[kind, 0]
    rewards = rewards / np.where(unit > 0.0, unit, 1.0)
    x, y, earned = (column.astype(np.float32) for column in (inputs, targets, rewards))
    return Steps(x, y, earned, kind, scales.binary)


@dataclass(frozen=True, eq=False)
class Ensemble:
    """A fitted ensemble."""

    settings: EnsembleSettings  # how it was fitted
    scales: Scales  # of inputs and outputs
    weights: Float32s  # [M, P]; of each member
    n_actions: int
    starts: Floats  # [E, d]; first observations of the stored episodes
    horizon: int  # steps after which a rollout is cut
    returns: tuple[float, float]  # the 1st and 98th percentile of the stored episodes' returns
    derivation: Derivation  # how derived features are computed

    @property
    def n_features(self) -> int:
        """Number of features d of an observation."""
        return int(self.starts.shape[1])

    @property
    def world(self) -> EnsembleWorld:
        """The members as the compiled loops take them, no step taken yet."""
        networks = [_filled_up(network_of(row, *self.size)) for row in self.weights]
        members = Network._make(np.stack(arrays) for arrays in zip(*networks, strict=True))
        w1, w2, w3 = map(_tiled, (members.w1, members.w2, members.w3))
        tiles = members._replace(w1=w1, w2=w2, w3=w3)
        formulas = formulas_of(self.derivation)
        return EnsembleWorld(members, tiles, self.scales, formulas, np.zeros(1, dtype=np.int64))

    @property
    def size(self) -> tuple[int, int, int]:
        """Inputs, hidden units and outputs of a member."""
        d = self.scales.move.size
        return self.scales.centre.size + self.n_actions, self.settings.hidden, 2 * d + 5

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the ensemble as arrays, its derivation apart; ``from_state`` takes them back."""
        return self.scales._asdict() | {
            "weights": self.weights,
            "starts": self.starts,
            "horizon": np.array([self.horizon], dtype=np.int64),
            "returns": np.array(self.returns),
        }

    @classmethod
    def from_state(
        cls,
        state: Mapping[str, NDArray[Any]],
        settings: EnsembleSettings,
        n_actions: int,
        derivation: Derivation,
    ) -> "Ensemble":
        """Return the ensemble whose ``state()`` this was, also of a run before version 0.3."""
        state = {"circles": np.empty((0, 2), dtype=np.int64)} | dict(state)
        low, high = state["returns"].tolist()
        return cls(
            settings,
            Scales(**{name: np.array(state[name]) for name in Scales._fields}),
            np.array(state["weights"], dtype=np.float32),
            n_actions,
            np.ascontiguousarray(state["starts"]),
            int(state["horizon"][0]),
            (low, high),
            derivation,
        )

    def fitted_on(self, data: Transitions, generator: np.random.Generator) -> "Ensemble":
        """Return the ensemble after more updates on all transitions, those it knows included."""
        settings = self.settings
        batches = settings.more_updates, settings.more_rate, min(settings.recent, data.rewards.size)
        return self._fitted(self.weights.copy(), data, generator, *batches)

    def _fitted(
        self,
        members: Iterable[Float32s],
        data: Transitions,
        generator: np.random.Generator,
        updates: int,
        first_rate: float,
        recent: int,
    ) -> "Ensemble":
        """Return the ensemble of these members, fitted in place, one when the last one is done."""
        steps = steps_of(replace(data, memory=self.settings.memory), self.scales)
        batches = _Batches(steps, self.settings.batch, recent)
        weights = []
        for row in members:
            weights.append(row)
            network, none = network_of(row, *self.size), np.zeros_like(row)
            fitting = Fitting(network, copied(network), none, none.copy())
            for begin in range(0, updates, CHUNK):
                n = min(CHUNK, updates - begin)
                left = 1.0 - (1.0 - SLOWEST) * np.arange(begin, begin + n) / updates
                rows = batches.draw(n, generator)
                kernels.fit(fitting, steps, rows, first_rate * left, begin, batches.weight)
        low, high = np.percentile(data.episode_returns, [1.0, 98.0])
        return replace(
            self,
            weights=np.stack(weights),
            starts=np.ascontiguousarray(data.observations[data.first]),
            returns=(float(low), float(high)),
        )


def fit_ensemble(
    data: Transitions, settings: EnsembleSettings, generator: np.random.Generator
) -> Ensemble:
    """Fit a new ensemble to transitions, at least one."""
    empty = Ensemble(
        settings=settings, scales=scales_of(replace(data, memory=settings.memory)),
        weights=np.zeros((0, 0), dtype=np.float32), n_actions=data.n_actions,
        starts=np.zeros((0, 0)), horizon=data.horizon(), returns=(0.0, 0.0),
        derivation=data.derivation,
    )  # fmt: skip
    fresh = (random_network(*empty.size, generator).weights for _ in range(settings.members))
    return empty._fitted(fresh, data, generator, settings.updates, settings.rate, recent=0)


def kinds(data: Transitions) -> Integers:
    """Return the kind of each step: it goes on, ends badly or ends well, shape [N]."""
    kind = np.full(data.rewards.size, GOES_ON, dtype=np.int64)
    last = data.rewards[data.terminated]
    kind[data.terminated] = np.where(last > between_ends(last), GOOD, BAD)
    return kind


def between_ends(rewards: Floats) -> float:
    """Return the reward that best parts those of last steps in two kinds; infinity for no ends.

    It lies where the variance between the two parts is largest (Otsu 1979), midway between the
    rewards on either side of it.
    """
    values = np.sort(rewards)
    if not values.size or values[0] == values[-1]:
        return float("inf")
    n = np.arange(1, values.size)
    below = np.cumsum(values)[:-1]
    above = values.sum() - below
    between = n * (values.size - n) * (below / n - above / (values.size - n)) ** 2
    between[values[1:] == values[:-1]] = -1.0
    place = int(between.argmax())
    return threshold_between(*values[place : place + 2].tolist())


class _Batches:
    """Rows of batches: some of all transitions, some of the last ones, some last steps."""

    def __init__(self, steps: Steps, size: int, recent: int) -> None:
        n, ends = len(steps.targets), np.flatnonzero(steps.kind != GOES_ON)
        n_recent = size // 2 if recent else 0
        expected = (size - n_recent) * (ends.size / 2) / n  # each is there twice
        if recent:
            expected += n_recent * np.count_nonzero(steps.kind[n - recent : n]) / recent
        extra = EXTRA_ENDS if ends.size else 0
        # So weighted, last steps count in the log-odds of ends as often as they occur.
        self.weight = expected / (expected + extra / 2) if expected else 1.0
        every = np.arange(n)
        self._parts = (every, size - n_recent), (every[n - recent :], n_recent), (ends, extra)

    def draw(self, n: int, generator: np.random.Generator) -> Integers:
        """Return the rows of n batches, shape [n, B]."""
        parts = [
            rows[generator.integers(rows.size, size=(n, many))]
            for rows, many in self._parts
            if many
        ]
        return np.concatenate(parts, axis=1)


def _filled_up(network: Network) -> Network:
    """Return a network of as many inputs, hidden units, outputs as compiled loops take at once."""
    p, h, q = (-size % ROWS for size in (*network.w1.shape, network.b3.size))
    return network._replace(
        w1=np.pad(network.w1, ((0, p), (0, h))), b1=np.pad(network.b1, (0, h)),
        w2=np.pad(network.w2, (0, h)), b2=np.pad(network.b2, (0, h)),
        w3=np.pad(network.w3, ((0, h), (0, q))), b3=np.pad(network.b3, (0, q)),
    )  # fmt: skip


def _tiled(matrices: Float32s) -> Float32s:
    """Return matrices [M, p, q] flat, of each ``TILE`` columns all rows, shape [M, T p TILE].

    They begin at a line of the cache: else many a vector of the loops would lie in two.
    """
    n, p, q = matrices.shape
    wide = np.pad(matrices, ((0, 0), (0, 0), (0, -q % TILE)))
    room = np.empty(wide.size + TILE, dtype=np.float32)
    tiles = room[-room.ctypes.data // 4 % TILE :][: wide.size].reshape(n, -1, p, TILE)
    tiles[:] = wide.reshape(n, p, -1, TILE).swapaxes(1, 2)
    return tiles.reshape(n, -1)


def _inputs(data: Transitions, places: Floats, moves: Floats) -> Floats:
    """Return o or o' and, with memory, the displacement that led to it, shape [N, p - A]."""
    return np.concatenate([places, moves], axis=1) if data.memory else places


def _rewards(rewards: Floats) -> list[float]:
    """Return mean, unit, least and largest reward of one kind of step."""
    if not rewards.size:
        return [0.0, 0.0, 0.0, 0.0]
    mean = float(rewards.mean())
    unit = 0.3 * rewards.std() + 0.3 * float(np.percentile(np.abs(rewards - mean), 90))
    low, high = np.percentile(rewards, [TAIL, 100.0 - TAIL])
    return [mean, float(unit), float(low), float(high)]
