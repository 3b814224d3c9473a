"""Gains of acting by one tree in place of another, estimated from each recorded episode.

The actor of the log followed some policy mu. Compared are two ways to act: as in the log, but where
two trees decide differently by the one of them, or by the other. An episode's estimate of that gain
is one number, without bias if mu is right, and nothing has to be known of observations and actions
that were never recorded. There are two such numbers:

* *whole episodes*, where few steps of an episode decide: its return, less the expected one where
  the trees first differ, weighted by the inverse chance of all actions from there on that one tree
  would have taken, less the same for the other (importance sampling: Precup, Sutton and Singh,
  *Eligibility traces for off-policy policy evaluation*, ICML 2000). It is the gain itself, and lies
  within the largest weight times the range of returns.
* *single deviations*, elsewhere: at each step at which they differ, the advantage of the action
  taken over its chance, for the tree that would have taken it. Their sum is the first-order term of
  the gain (Kakade and Langford, *Approximately optimal approximate reinforcement learning*, ICML
  2002): the gains of deviating once, added up. Its only bounds are the numbers seen.

Advantages are generalized ones (Schulman et al. 2016, Eq. 16) with V fitted to episodes that do not
judge; mu is the shares of actions in the leaves of a tree of those, grown by C4.5 but pruned by
likelihood: by errors, leaves of 51 % and of 99 % of one action are one (Provost and Domingos, *Tree
induction for probability-based ranking*, Machine Learning 2003). Where actions are masked the trees
decide among those allowed, and so did the actor: its tree sees the masks, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.c45 import C45Settings, grow
from eutree.data import Episode
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.trees.edit import INNER, merge, rebuild
from eutree.world_model.dynamics import ModelTree, fit_model_tree

SWEEPS = 5  # fits of V, each to returns that go on behind a truncated end by the one before
LEAVES = 32
ROWS_PER_LEAF = 20
LAMBDA = 0.9
ROUNDS = 50  # of the shares of actions among those allowed


@dataclass(frozen=True, eq=False)
class Gains:
    """Estimates of the gain of a tree over another, by episodes."""

    values: Floats  # [E] one number for each episode that judges
    fitted: Floats  # [K] one for each episode of the log that V and the chances were fitted to
    worst: float  # no number can be lower, or none is
    whole: bool  # whether they are of whole episodes; else of single deviations
    # Steps at which the trees differ and the one in question was followed, in all episodes
    tried: int


class ToldEpisode(NamedTuple):
    """V and mu at the steps of an episode, and the advantage of each action taken."""

    episode: Episode
    chances: Floats  # [T, A]
    values: Floats  # [T + 1]
    advantages: Floats  # [T]


class FittedLog:
    """V and the chances of actions, fitted to episodes, by which other episodes are judged.

    The episodes have a step at least; the discount is that of V and of the advantages.
    """

    def __init__(self, episodes: Sequence[Episode], n_actions: int, discount: float) -> None:
        self.episodes = [episode for episode in episodes if len(episode)]
        self.n_actions, self._discount = n_actions, discount
        rows = np.concatenate([e.observations[:-1] for e in self.episodes])  # [N, d]
        actions = np.concatenate([e.actions for e in self.episodes])  # [N]
        allowed = np.concatenate([_allowed(e, n_actions) for e in self.episodes])  # [N, A]
        self._masked = not allowed.all()
        seen = np.hstack([rows, allowed]) if self._masked else rows
        chosen = allowed.sum(axis=1) > 1  # what is forced says nothing of preferences
        self._tree = _likely_tree(seen[chosen], actions[chosen], n_actions)
        leaves = self._tree.leaf_index(seen)[chosen]
        counts = np.ones((self._tree.n_leaves, n_actions))  # Laplace's: nothing is impossible
        np.add.at(counts, (leaves, actions[chosen]), 1.0)
        self._shares = _among_allowed(counts, leaves, allowed[chosen])  # [L, A]
        self._cache: dict[int, ToldEpisode] = {}
        self._value = _fitted_value(rows, self.episodes, discount)

    def told(self, episode: Episode) -> ToldEpisode:
        """Return V and mu at an episode's steps; once for all trees that are compared."""
        told = self._cache.get(id(episode))
        if told is None or told.episode is not episode:
            rows, allowed = episode.observations[:-1], _allowed(episode, self.n_actions)
            seen = np.hstack([rows, allowed]) if self._masked else rows
            chances = self._shares[self._tree.leaf_index(seen)] * allowed
            chances /= chances.sum(axis=1, keepdims=True)
            values = self._value.predict(episode.observations)
            ahead = values[1:].copy()
            if episode.terminated:
                ahead[-1:] = 0.0
            surprises = episode.rewards + self._discount * ahead - values[:-1]
            advantages = _sums_ahead(surprises, self._discount * LAMBDA)
            told = self._cache[id(episode)] = ToldEpisode(episode, chances, values, advantages)
        return told

    def gains(
        self,
        one: TreePolicy,
        other: TreePolicy,
        episodes: Sequence[Episode],  # that nothing was fitted to
        limits: tuple[float, float],  # lowest and highest return of an episode
        *,
        most_weight: float,  # of a whole episode; could one be heavier, single deviations speak
    ) -> Gains:
        """Return the estimated gains of acting by ``one`` in place of ``other``."""
        every = (self.told(episode) for episode in (*self.episodes, *episodes))
        told = [_Differing(one, other, each) for each in every]
        whole = max(each.largest_weight for each in told) <= most_weight
        if whole:
            both = np.array([each.whole(limits) for each in told])
            values, worst = both[:, 0], float(both[:, 1].min())
        else:
            values = np.array([each.deviations() for each in told])
            worst = min(float(values.min()), 0.0)
        n = len(self.episodes)
        return Gains(values[n:], values[:n], worst, whole, sum(each.n_followed for each in told))


def rows_of(policy: TreePolicy, episode: Episode) -> Floats:
    """Return the features of a tree at each step; an episode may have more, behind them, [T, d]."""
    rows = episode.observations[:-1]
    if policy.tree.n_features > rows.shape[1]:
        rows = episode.with_features(policy.features).observations[:-1]
    return rows[:, : policy.tree.n_features]


def decisions(policy: TreePolicy, episode: Episode) -> Integers:
    """Return a tree's actions at each step, shape [T]."""
    taken: Integers = policy.decide(rows_of(policy, episode), episode.allowed)
    return taken


def _allowed(episode: Episode, n_actions: int) -> Booleans:
    """Return which actions were allowed at each step, [T, A]."""
    known = episode.allowed
    return np.ones((len(episode), n_actions), np.bool_) if known is None else known


def _likely_tree(rows: Floats, actions: Integers, n_actions: int) -> DecisionTree:
    """Return the tree whose leaves tell best how likely actions [N] are in rows [N, d].

    A test stays where it makes the actions likelier by more than it costs (Schwarz, *Estimating the
    dimension of a model*, Annals of Statistics 1978): log N / 2 for each of A - 1 shares more, and
    log N for its place.
    """
    if not len(rows):
        return DecisionTree.single_leaf(rows.shape[1])
    settings = C45Settings(min_objects=ROWS_PER_LEAF, prune=False, collapse=False)
    grown = grow(rows, actions, n_classes=n_actions, settings=settings)
    tree, _ = grown.to_decision_tree()
    counts = np.zeros((tree.n_leaves, n_actions))
    np.add.at(counts, (tree.leaf_index(rows), actions), 1.0)
    counts = tree.totals(counts)  # [M, A]
    shares = counts / counts.sum(axis=1, keepdims=True)
    found = (counts * np.log(np.where(counts > 0.0, shares, 1.0))).sum(axis=1)  # [M] likelihoods
    cost = (0.5 * (n_actions - 1) + 1.0) * np.log(len(rows))
    label = np.arange(tree.n_nodes)
    for node in range(tree.n_nodes - 1, -1, -1):  # children have larger numbers
        if tree.feature[node] >= 0:
            below = found[tree.left[node]] + found[tree.right[node]] - cost
            if below > found[node]:
                found[node], label[node] = below, INNER
    return rebuild(tree, np.arange(tree.n_nodes), label)[0]


def _among_allowed(counts: Floats, leaves: Integers, allowed: Booleans) -> Floats:
    """Return the shares, [L, A], by which the allowed actions divide the choices in each leaf.

    An action that is seldom allowed has a small part of the ``counts``, [L, A], and yet may be
    preferred. So they are the likeliest for the leaves and masks of all steps, [N] and [N, A]
    (Hunter, *MM algorithms for generalized Bradley-Terry models*, Annals of Statistics 2004).
    """
    shares = counts
    for _ in range(0 if allowed.all() else ROUNDS):
        shares = shares / shares.sum(axis=1, keepdims=True)
        chances = np.full(counts.shape, float(counts.shape[1]))  # Laplace's steps allow everything
        np.add.at(chances, leaves, allowed / (shares[leaves] * allowed).sum(axis=1, keepdims=True))
        shares = counts / chances
    return shares


class _Differing:
    """The steps of an episode at which two trees decide differently, and the actions taken."""

    def __init__(self, one: TreePolicy, other: TreePolicy, told: ToldEpisode) -> None:
        self._told = told
        ours, theirs = decisions(one, told.episode), decisions(other, told.episode)
        self._steps = np.flatnonzero(ours != theirs)  # [D]
        chances = told.chances[self._steps]
        of = np.arange(self._steps.size)
        taken = told.episode.actions[self._steps]
        self._both = [
            (chosen[self._steps] == taken, chances[of, chosen[self._steps]])
            for chosen in (ours, theirs)
        ]

    @property
    def largest_weight(self) -> float:
        """The weight if all actions had been those of one of the trees."""
        with np.errstate(over="ignore"):
            return float(max(np.prod(1.0 / chance) for _, chance in self._both))

    @property
    def n_followed(self) -> int:
        """Steps at which the first tree was followed."""
        return int(self._both[0][0].sum())

    def whole(self, limits: tuple[float, float]) -> tuple[float, float]:
        """Return the episode's estimate of the gain of whole episodes, and the lowest possible one.

        The lowest is that of following the one tree to the lowest return, or the other to the
        highest. That is taken of an episode that was stopped: nobody knows how it would have ended.
        """
        if not self._steps.size:
            return 0.0, 0.0
        first, rewards = self._steps[0], self._told.episode.rewards
        expected = min(
            max(float(rewards[:first].sum() + self._told.values[first]), limits[0]), limits[1]
        )
        ours, theirs = (float(np.prod(1.0 / chance)) for _, chance in self._both)
        worst = -max(ours * (expected - limits[0]), theirs * (limits[1] - expected))
        ends = limits if self._told.episode.was_stopped else (float(rewards.sum()),) * 2
        gain = sum(
            weight * followed.all() * (end - expected)
            for weight, (followed, _), end in zip((ours, -theirs), self._both, ends, strict=True)
        )
        return float(gain), worst

    def deviations(self) -> float:
        """Return the gain of single deviations to one tree over those to the other."""
        (ours, chance), (theirs, other_chance) = self._both
        weights = ours / chance - theirs / other_chance
        return float((weights * self._told.advantages[self._steps]).sum())


def _fitted_value(rows: Floats, episodes: Sequence[Episode], discount: float) -> ModelTree:
    """Return V of the acting policy, a tree with linear leaves."""
    value = None
    for _ in range(1 if all(episode.terminated for episode in episodes) else SWEEPS):
        returns = np.concatenate([_returns(episode, value, discount) for episode in episodes])
        value = fit_model_tree(rows, returns, max_leaves=LEAVES, min_leaf=ROWS_PER_LEAF)
    return cast(ModelTree, value)


def _returns(episode: Episode, value: ModelTree | None, discount: float) -> Floats:
    """Return the discounted sum of rewards from each step on, shape [T]."""
    rewards = episode.rewards.astype(np.float64)
    if value is not None and not episode.terminated:
        rewards[-1] += discount * float(value.predict(episode.observations[-1:])[0])
    return _sums_ahead(rewards, discount)


def _sums_ahead(values: Floats, discount: float) -> Floats:
    """Return the discounted sum of values from each step on, shape [T]."""
    ahead, sums = 0.0, np.empty(len(values))
    for step in range(len(values) - 1, -1, -1):
        ahead = float(values[step]) + discount * ahead
        sums[step] = ahead
    return sums


# The sequence of cuts is that of minimal cost-complexity pruning (Breiman, Friedman, Olshen and
# Stone, *Classification and Regression Trees*, 1984, section 3.3): the node gives way whose leaves
# earn least for each of them, where a leaf earns the gains of single deviations to its action.


SHARES = (1 / 2, 1 / 4, 1 / 8)  # of the leaves


def cuts(policy: TreePolicy, log: FittedLog) -> list[TreePolicy]:
    """Return a tree, and the same cut to a half, a quarter and an eighth of its leaves.

    A tree with locked leaves stays as it is.
    """
    if policy.locked:
        return [policy]
    tree, worth = policy.tree, _worth(policy, log)  # [M, A]
    label = np.full(tree.n_nodes, INNER)
    label[tree.node_of_leaf] = policy.actions
    found = [policy]
    for share in SHARES:
        _cut_to(max(int(share * policy.n_leaves), 1), tree, label, worth)
        small, actions = merge(*rebuild(tree, np.arange(tree.n_nodes), label))
        if small.n_leaves < found[-1].n_leaves:
            found.append(replace(policy, tree=small, actions=actions, leaves=None, ranks=None))
    return found


def _cut_to(most: int, tree: DecisionTree, label: Integers, worth: Floats) -> None:
    """Label nodes as leaves until there are at most so many leaves."""
    while True:
        # Earnings and number of the leaves below each node, both [M].
        value, leaves = np.zeros(tree.n_nodes), np.zeros(tree.n_nodes, dtype=np.int64)
        for node in range(tree.n_nodes - 1, -1, -1):  # children have larger numbers
            if label[node] != INNER:
                value[node], leaves[node] = worth[node, label[node]], 1
            else:
                below = [tree.left[node], tree.right[node]]
                value[node], leaves[node] = value[below].sum(), leaves[below].sum()
        if leaves[0] <= most:
            return
        inner = np.flatnonzero(leaves > 1)
        loss = value[inner] - worth[inner].max(axis=1)
        node = int(inner[(loss / (leaves[inner] - 1)).argmin()])
        label[node] = worth[node].argmax()


def _worth(policy: TreePolicy, log: FittedLog) -> Floats:
    """Return the gains of single deviations to each action in each node, shape [M, A]."""
    tree = policy.tree
    worth = np.zeros((tree.n_leaves, log.n_actions))
    for episode in log.episodes:
        steps, actions, told = np.arange(len(episode)), episode.actions, log.told(episode)
        gained = told.advantages / told.chances[steps, actions]
        np.add.at(worth, (tree.leaf_index(rows_of(policy, episode)), actions), gained)
    return tree.totals(worth)
