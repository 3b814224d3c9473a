"""Is a tree believed to beat another, by recorded episodes that neither was fitted to?

Whoever acted while the episodes were recorded followed some policy mu. At each held-out step at
which the two trees decide differently the action taken counts for the tree that would have taken
it, by the inverse of its chance mu(a | o), with its advantage: how much more than usual followed.
The sum over an episode estimates without bias what following the one tree instead of the other
would gain, one deviation from mu at a time (the first-order term of the performance difference;
Kakade and Langford, *Approximately optimal approximate reinforcement learning*, ICML 2002). A
policy whose single deviations all gain is better than mu itself (the policy improvement theorem),
and nothing has to be known of observations and actions that were never recorded, as a fitted Q
would have to.

Single deviations say little of a tree that goes where mu never stayed. So the learned tree must
also earn more in a world model of the episodes that it was learned from, in paired rollouts from
their starts. The two fail differently: the first where trees differ in long runs, the second where
the model is poor.

Advantages are generalized ones (Schulman et al. 2016, Eq. 16) with V fitted to the episodes that
the trees were learned from; mu is the shares of actions in the leaves of a C4.5 tree of those.
Differences of whole episodes are compared, by Student's bound: steps of one depend on each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.c45 import C45Settings, grow
from eutree.data import Episode
from eutree.evaluation.intervals import mean_interval
from eutree.policies import TreePolicy
from eutree.world_model import PairedRollouts, Transitions, fit_world_models
from eutree.world_model.action_trees import from_decision_tree
from eutree.world_model.dynamics import ModelTree, fit_model_tree

FEWEST_HELD_OUT = 4  # episodes; below that no difference is believed
HELD_OUT = 1 / 3  # share of the episodes
SWEEPS = 5  # fits of V, each to returns that go on behind a truncated end by the one before
LEAVES = 32
ROWS_PER_LEAF = 20
LAMBDA = 0.9
ROLLOUTS = 200
MIDDLE = 0.5  # between pessimism and optimism
CONFIDENCE = 0.95  # of the one-sided bound


@dataclass(frozen=True)
class OffPolicyComparison:
    """What held-out episodes say of a learned tree against another.

    Attributes:
        gain: Estimated gain of the learned tree over the other in an episode; nan where unknown.
        low: Lower bound of the gain at the confidence of ``CONFIDENCE``.
        predicted: What it earns more in rollouts of a world model, less a standard error.
        n_held_out: Held-out episodes.
    """

    gain: float
    low: float
    predicted: float
    n_held_out: int

    @property
    def believed(self) -> bool:
        """Whether the learned tree is believed to be the better."""
        return bool(self.low > 0.0 and self.predicted > 0.0)

    def facts(self) -> dict[str, float | int | bool | None]:
        """Return the comparison in JSON's types; None where nothing is known."""
        known = self.n_held_out >= FEWEST_HELD_OUT
        return {
            "gain": self.gain if known else None,
            "low": self.low if known else None,
            "predicted": self.predicted if known else None,
            "n_held_out": self.n_held_out,
            "believed": self.believed,
        }

    def describe(self) -> str:
        """Return the comparison in one line."""
        if self.n_held_out < FEWEST_HELD_OUT:
            return (
                f"not believed to beat fit: {self.n_held_out} episodes could be held out, and "
                f"{FEWEST_HELD_OUT} are needed; this is the tree of fit"
            )
        found = (
            f"{self.gain:+.4g}, at least {self.low:+.4g} at {CONFIDENCE:.0%}, "
            f"by {self.n_held_out} held-out episodes; {self.predicted:+.4g} in a world model"
        )
        if self.believed:
            return f"believed to beat fit: return {found}"
        return f"not believed to beat fit ({found}); this is the tree of fit"


def hold_out(
    episodes: Sequence[Episode], generator: np.random.Generator
) -> tuple[tuple[Episode, ...], tuple[Episode, ...]]:
    """Return episodes to learn from and episodes to judge by, each in their order.

    Where too few could be held out, none are.
    """
    n = int(len(episodes) * HELD_OUT)
    if n < FEWEST_HELD_OUT:
        return tuple(episodes), ()
    out = set(generator.permutation(len(episodes))[:n].tolist())
    return (
        tuple(episode for k, episode in enumerate(episodes) if k not in out),
        tuple(episode for k, episode in enumerate(episodes) if k in out),
    )


def compare_off_policy(
    learned: TreePolicy,
    other: TreePolicy,
    known: Sequence[Episode],
    held_out: Sequence[Episode],
    *,
    discount: float,
    generator: np.random.Generator,
) -> OffPolicyComparison:
    """Return what held-out episodes say of a learned tree against another.

    Args:
        learned: The tree that is to be believed or not.
        other: The other one, for example the tree of ``fit``.
        known: Episodes that V and the actions' chances are fitted to.
        held_out: Episodes that nothing was fitted to.
        discount: gamma of the advantages.
        generator: Source of the random numbers of rollouts.
    """
    if len(held_out) < FEWEST_HELD_OUT:
        return OffPolicyComparison(float("nan"), -np.inf, -np.inf, len(held_out))
    log = _Log(known, learned.schema.n_actions)
    value = _fitted_value(log, discount)
    change = np.array(
        [_gain(learned, other, log, value, episode, discount) for episode in held_out]
    )  # [E]
    low = mean_interval(change, confidence=2 * CONFIDENCE - 1).low
    predicted = _predicted(learned, other, known, generator)
    return OffPolicyComparison(float(change.mean()), low, predicted, len(held_out))


def _predicted(
    learned: TreePolicy, other: TreePolicy, known: Sequence[Episode], generator: np.random.Generator
) -> float:
    """Return what a tree earns more than another in rollouts, less a standard error."""
    (model,) = fit_world_models(Transitions.of(known, learned.schema.n_actions), (MIDDLE,))
    rollouts = PairedRollouts(model, ROLLOUTS, 1.0, generator)
    rollouts.run(from_decision_tree(other.tree, other.actions))
    gain = rollouts.gain(from_decision_tree(learned.tree, learned.actions))
    return gain.mean - gain.error


class _Log:
    """The transitions of episodes, and the chances of the actions in them."""

    def __init__(self, episodes: Sequence[Episode], n_actions: int) -> None:
        kept = [episode for episode in episodes if len(episode)]
        self.n_actions = n_actions
        self.episodes = kept
        self.observations = np.concatenate([e.observations[:-1] for e in kept])  # [N, d]
        self.actions = np.concatenate([e.actions for e in kept])  # [N]
        grown = grow(self.observations, self.actions, n_classes=n_actions, settings=C45Settings())
        self._tree, _ = grown.to_decision_tree()
        counts = np.ones((self._tree.n_leaves, n_actions))  # Laplace's: nothing is impossible
        np.add.at(counts, (self._tree.leaf_index(self.observations), self.actions), 1.0)
        self._chances = counts / counts.sum(axis=1, keepdims=True)  # [L, A]

    def chances(self, observations: Floats, actions: Integers) -> Floats:
        """Return mu(a | o) of each step, shape [n]."""
        chances: Floats = self._chances[self._tree.leaf_index(observations), actions]
        return chances


def _fitted_value(log: _Log, discount: float) -> ModelTree:
    """Return V of whoever acted, a tree with linear leaves."""
    value = None
    for _ in range(SWEEPS):
        returns = np.concatenate([_returns(episode, value, discount) for episode in log.episodes])
        value = fit_model_tree(log.observations, returns, max_leaves=LEAVES, min_leaf=ROWS_PER_LEAF)
    return cast(ModelTree, value)


def _returns(episode: Episode, value: ModelTree | None, discount: float) -> Floats:
    """Return the discounted sum of rewards from each step on, shape [T]."""
    ahead, returns = 0.0, np.empty(len(episode))
    if value is not None and not episode.terminated:
        ahead = float(value.predict(episode.observations[-1:])[0])
    for step in range(len(episode) - 1, -1, -1):
        ahead = float(episode.rewards[step]) + discount * ahead
        returns[step] = ahead
    return returns


def _advantages(episode: Episode, value: ModelTree, discount: float) -> Floats:
    """Return how much more than usual followed each step, shape [T]."""
    values = value.predict(episode.observations)  # [T + 1]
    if episode.terminated:
        values[-1] = 0.0
    surprises = episode.rewards + discount * values[1:] - values[:-1]
    ahead, advantages = 0.0, np.empty(len(episode))
    for step in range(len(episode) - 1, -1, -1):
        ahead = float(surprises[step]) + discount * LAMBDA * ahead
        advantages[step] = ahead
    return advantages


def _gain(
    learned: TreePolicy,
    other: TreePolicy,
    log: _Log,
    value: ModelTree,
    episode: Episode,
    discount: float,
) -> float:
    """Return what single deviations to one tree gained over those to the other in an episode."""
    observations, actions = episode.observations[:-1], episode.actions
    one, two = (policy.actions[policy.tree.leaf_index(observations)] for policy in (learned, other))
    differ = one != two
    if not differ.any():
        return 0.0
    sign = (one == actions).astype(np.float64) - (two == actions)  # [T]
    weights = np.where(differ, sign / log.chances(observations, actions), 0.0)
    return float((weights * _advantages(episode, value, discount)).sum())
