"""Challengers of a policy in a race: plans, prunings, random changes.

Several world models, none of which need be right, each propose improved or smaller trees; C4.5
proposes prunings; and of several random changes the one is proposed that recorded steps speak for.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.compiled import compiled
from eutree.compression.smaller_trees import Costs, Ladder, with_locks, with_tree
from eutree.contests.rules import OBVIOUS, Lead, lead_apart
from eutree.data import Episode
from eutree.policies import TreePolicy
from eutree.policy_search.climbing import annealed, annealed_together, climbed, restarts
from eutree.policy_search.improvement import MOST_LEAVES, Improvement
from eutree.policy_search.planner import FEWEST_ROLLOUTS
from eutree.policy_search.variation import Variation
from eutree.validation import check_amounts, check_integer, check_number
from eutree.world_model import ActionTree, PairedRollouts, Transitions, WorldModel, fit_world_models
from eutree.world_model.action_trees import from_decision_tree, to_decision_tree
from eutree.world_model.dynamics import MAX_LEAVES, fit_model_tree

MOST_ROWS = 30_000
VALUE_ROWS_PER_LEAF = 30
VALUE_LEAVES = 64
LAMBDA = 0.9
FEW = 5  # rows that say nothing


@dataclass(frozen=True, eq=False)
class Advantages:
    """Gains of recorded steps over the usual ones from where they were taken.

    Attributes:
        observations: o of each step.
        actions: a.
        gains: Sum of lambda^k delta_k from here to the end of the episode, where
            delta = r + V(o') - V(o), and V is fitted to the returns to go.
    """

    observations: Floats  # [N, d]
    actions: Integers  # [N]
    gains: Floats  # [N]

    @classmethod
    def of(cls, data: Transitions, generator: np.random.Generator) -> "Advantages":
        """Return those of some of the transitions."""
        n = data.rewards.size
        rows = np.sort(generator.choice(n, min(n, MOST_ROWS), replace=False))
        value = fit_model_tree(
            data.observations[rows],
            data.returns_to_go[rows],
            max_leaves=VALUE_LEAVES,
            min_leaf=VALUE_ROWS_PER_LEAF,
        )
        beyond = np.where(data.terminated, 0.0, value.predict(data.next_observations))
        gains = data.rewards + beyond - value.predict(data.observations)
        _add_what_follows(gains, data.last)
        return cls(data.observations[rows], data.actions[rows], gains[rows])

    def speak_for(self, policy: Integers, challenger: Integers) -> float:
        """Return how many standard errors a challenger's way gained more; 0 where nothing is known.

        The policy and the challenger are given by their actions at each observation, shape [N].
        """
        differs = policy != challenger
        likes = self.gains[differs & (challenger == self.actions)]
        own = self.gains[differs & (policy == self.actions)]
        if min(likes.size, own.size) < FEW:
            return 0.0
        lead = lead_apart(own, likes)
        return lead.mean / max(lead.error, 1e-9)


@compiled
def _add_what_follows(gains: Floats, last: Booleans) -> None:
    """Add LAMBDA times the next sum to each of them, up to the end of its episode, in place."""
    ahead = 0.0
    for i in range(gains.size - 1, -1, -1):
        ahead = gains[i] + (0.0 if last[i] else LAMBDA * ahead)
        gains[i] = ahead


ROWS_PER_LEAF = 100  # of a detailed model
DEARER = (1.0, 6.0)  # prices of a leaf at which each model proposes
LARGER = 2  # times the leaves allowed that a tree of good episodes has at most, before it is cut
ROUGH = 5  # times fewer rollouts are enough to anneal
TOGETHER, KEPT = 20, 4  # trees annealed together, and how many of them are proposed
SPARE = 10  # leaves above those allowed with which they begin
HERDED, HELD_STEPS = 300, 2_000_000  # rollouts that judge a change, and room for all, at most
CHANGES, CHANGED_STEPS = 6000, 500_000_000  # of each, and their steps in the world model, at most
MOST_RUNGS = 12  # prunings that race
MOST_KNOWN = 50_000  # transitions that models are fitted to
RECENT = 300  # episodes whose advantages are known
VARIANTS = 10  # of which one is tried
PROMISING = 4  # challengers that race, where models can be trusted
# Standard errors, and share of a typical return, by which a model may miss the incumbent's returns;
# the next episode may have the worst return seen, too.
SURE, NEAR = 2.0, 0.1
TELLING = 8  # episodes of the incumbent below which models are not told apart
FORETELLING = 30  # imagined episodes from the start of a real one


@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """The length of a search, and its aim.

    Attributes:
        steps: Most environment steps to run. An episode begins only if the longest possible one
            still fits: the environment's own limit, or else the longest seen so far.
        leaf_price: Return that a leaf must earn, as a share of a typical return's size.
        max_leaves: Most leaves of the result; a policy that has more is replaced by the winner of
            a race of smaller ones, whatever it earns. None allows as many as there are, or
            ``MOST_LEAVES``.
        model_steps: Steps in a world model that judge each change, about; at least 100 episodes.
        keep_success: Whether a challenger must also succeed as often, in the same episodes.
    """

    steps: int
    leaf_price: float = 0.001
    max_leaves: int | None = None
    model_steps: int = 100_000
    keep_success: bool = False

    def __post_init__(self) -> None:
        check_integer("race_steps", self.steps, low=0)
        check_number("leaf_price", self.leaf_price, low=0.0)
        check_amounts(self, max_leaves=2, model_steps=1)


@dataclass(frozen=True)
class _Proposing:
    """How to fit one of the world models that propose."""

    gap: float = 0.5
    memory: bool = True
    noise: bool = True
    detailed: bool = False


_MODELS = (
    _Proposing(gap=0.9),
    _Proposing(noise=False, detailed=True),
    _Proposing(memory=False, detailed=True),
    _Proposing(memory=False, noise=False, detailed=True),
)


class Proposals:
    """Makes challengers.

    Args:
        start: The policy that the search starts from; its locked leaves are in every challenger.
        data: The transitions stored in learning.
        settings: The price of a leaf, and how long to plan.
        generator: Source of all chance.

    Attributes:
        max_leaves: Most leaves of a challenger.
        leaf_price: Return that a leaf must earn.
    """

    def __init__(
        self,
        start: TreePolicy,
        data: Transitions,
        settings: SearchSettings,
        generator: np.random.Generator,
    ) -> None:
        self.max_leaves = settings.max_leaves or max(start.n_leaves, MOST_LEAVES)
        self._scale = data.typical_return
        self.leaf_price = settings.leaf_price * self._scale
        self._improvement = Improvement(price=settings.leaf_price, max_leaves=self.max_leaves)
        self._settings = settings
        self._start = start
        self._data = data
        self._generator = generator

    def promising(
        self, policy: TreePolicy, own: Sequence[Episode], known: Advantages
    ) -> TreePolicy | None:
        """Return the variant of a policy that recorded steps speak for most, by its episodes."""
        visited = np.concatenate([episode.observations[:-1] for episode in own])
        variation = Variation(policy.schema.n_actions, self.max_leaves, self._generator)
        tree = from_decision_tree(policy.tree, policy.actions)
        decided = _decisions(policy, known)
        best, most = None, -math.inf
        for _ in range(VARIANTS):
            variant = variation.of(tree, visited)
            if variant is None:
                continue
            challenger = self._policy_of(variant)
            if key(challenger) == key(policy) or challenger.n_leaves > self.max_leaves:
                continue
            score = known.speak_for(decided, _decisions(challenger, known))
            if score > most:
                best, most = challenger, score
        return best

    def advantages(self, episodes: Sequence[Episode], generator: np.random.Generator) -> Advantages:
        """Return the gains of the steps of the last of some episodes."""
        data = self._data.followed_by(episodes[-RECENT:])
        return Advantages.of(data.since(int(np.unique(data.episodes)[-RECENT:][0])), generator)

    def pruned(self, policy: TreePolicy) -> list[TreePolicy]:
        """Return prunings of the policy by C4.5, of all sizes."""
        ladder = Ladder(policy, Costs.of(policy, self._data.observations, "visits")).rungs()
        kept = [with_locks(rung, self._start) for rung in ladder]
        rungs = [rung for rung in kept if 2 <= rung.n_leaves <= self.max_leaves]
        if not rungs:
            return []
        chosen = np.unique(np.linspace(0, len(rungs) - 1, MOST_RUNGS).round().astype(int))
        return [rungs[number] for number in chosen]

    def planned(self, policy: TreePolicy, episodes: Sequence[Episode]) -> Iterator[TreePolicy]:
        """Yield each world model's changes of the policy, at several prices of a leaf."""
        start = from_decision_tree(policy.tree, policy.actions)
        for model in self._models(episodes):
            rollouts = self._rollouts(model)
            if policy.n_leaves > self.max_leaves:
                for tree in self._improvement.shrunk(rollouts, start, self._scale):
                    yield self._policy_of(tree)
                continue
            tree = start
            for factor in DEARER:
                dearer = replace(self._improvement, price=self._improvement.price * factor)
                tree = dearer.improve(rollouts, tree, self._scale)
                yield self._policy_of(tree)

    def climbed(
        self, policy: TreePolicy, own: Sequence[Episode], episodes: Sequence[Episode]
    ) -> Iterator[TreePolicy]:
        """Yield the incumbent and trees of good episodes after many small changes.

        They are tried in the model that is closest to the incumbent's returns. Where it is wrong
        they may lead astray, so each tree is proposed as it is cut to size, annealed and climbed.
        The ``own`` episodes are the incumbent's, the others all that were run so far.
        """
        missed = [(self._missed(one, policy, own).mean(), one) for one in self._models(episodes)]
        rollouts = self._rollouts(min(missed, key=lambda item: item[0])[1])
        yield from self._changed(rollouts, from_decision_tree(policy.tree, policy.actions))
        known = self._data.followed_by(episodes)
        for start in restarts(known, max_leaves=LARGER * self.max_leaves):
            cut = next(self._improvement.shrunk(rollouts, start, self._scale))
            yield self._policy_of(cut)
            yield from self._changed(rollouts, cut)

    def cut_together(
        self, policy: TreePolicy, own: Sequence[Episode], episodes: Sequence[Episode]
    ) -> Iterator[TreePolicy]:
        """Yield the best of what a larger policy and trees of good episodes become together.

        Nothing where no model foretells the policy's return. Arguments are those of ``climbed``.
        """
        believed = self._foretold(policy, own, (), episodes)
        if believed is None:
            return
        rollouts = self._rollouts(believed[0])
        larger = replace(self._improvement, max_leaves=self.max_leaves + SPARE)
        known = self._data.followed_by(episodes)
        grown = restarts(known, max_leaves=LARGER * self.max_leaves)
        starts = [from_decision_tree(policy.tree, policy.actions), *grown]
        trees = [next(larger.shrunk(rollouts, one, self._scale)) for one in starts]
        few = min(HERDED, _few(rollouts))
        n = max(2, min(TOGETHER, HELD_STEPS // (few * rollouts.model.horizon)))
        herd = [PairedRollouts(rollouts.model, few, 1.0, self._generator) for _ in range(n)]
        for one, tree in zip(herd, cycle(trees), strict=False):
            one.run(tree)
        steps = sum(one.n_steps for one in herd)
        changes = min(CHANGES, self._settings.steps // 4, CHANGED_STEPS // steps)
        found = annealed_together(herd, self._improvement, scale=self._scale, changes=changes)
        rollouts.redraw()
        rollouts.run(trees[0])
        gains = [rollouts.gain(tree).mean for tree in found]
        yield from (self._policy_of(found[k]) for k in np.argsort(gains)[-KEPT:])

    def _changed(self, rollouts: PairedRollouts, tree: ActionTree) -> Iterator[TreePolicy]:
        """Yield a tree once it is annealed, and once that has climbed."""
        variation = Variation(rollouts.n_actions, self.max_leaves, self._generator)
        rough = PairedRollouts(rollouts.model, _few(rollouts), 1.0, self._generator)
        price = self.leaf_price
        tree = annealed(rough, tree, variation, price=price, scale=self._scale)
        yield self._policy_of(tree)
        yield self._policy_of(climbed(rollouts, tree, variation, price=price))

    def guessed(
        self,
        policy: TreePolicy,
        own: Sequence[Episode],
        challengers: Sequence[TreePolicy],
        episodes: Sequence[Episode],
    ) -> tuple[tuple[TreePolicy, ...], tuple[float, ...]]:
        """Return the challengers that promise most, and the guessed return of each.

        Where no model foretells the policy's return all are returned, without a guess. Other
        arguments are those of ``climbed``.
        """
        found = self._foretold(policy, own, challengers, episodes)
        if found is None:
            return tuple(challengers), ()
        _, foretold = found
        sizes = np.array([one.n_leaves for one in challengers])
        worth = np.array(foretold) - self.leaf_price * sizes
        best = np.argsort(-worth, kind="stable")[:PROMISING].tolist()
        return tuple(challengers[k] for k in best), tuple(foretold[k] for k in best)

    def _foretold(
        self,
        policy: TreePolicy,
        own: Sequence[Episode],
        trees: Sequence[TreePolicy],
        episodes: Sequence[Episode],
    ) -> tuple[WorldModel, list[float]] | None:
        """Return the model to believe and the returns of trees in it; None if there is none.

        It is the first that foretells the policy's mean return, or a later one that does and is
        obviously closer to its returns from the same starts.
        """
        lead = Lead.of(np.array([episode.undiscounted_return for episode in own]))
        low, high = self.range_seen([episode.undiscounted_return for episode in episodes])
        reach = SURE * lead.error + NEAR * self._scale + (high - low) / len(own)
        found: tuple[WorldModel, list[float]] | None = None
        missed: Floats | None = None  # by the model that is closest so far
        for model in self._models(episodes):
            expected, *guesses = self._returns(model, [policy, *trees]).tolist()
            if abs(expected - lead.mean) > reach:
                continue
            if len(own) < TELLING:
                return model, guesses
            now = self._missed(model, policy, own)
            closer = None if missed is None else Lead.of(missed - now)
            if closer is None or closer.mean > OBVIOUS[TELLING] * closer.error:
                found, missed = (model, guesses), now
        return found

    def prices(self, trees: Sequence[TreePolicy]) -> tuple[float, ...]:
        """Return the return that each tree has to earn for its leaves."""
        return tuple(self.leaf_price * tree.n_leaves for tree in trees)

    def range_seen(self, raced: Sequence[float]) -> tuple[float, float]:
        """Return the lowest and highest return of all that was stored, and of those raced."""
        seen = np.concatenate([self._data.episode_returns, raced])
        return float(seen.min()), float(seen.max())

    def _returns(self, model: WorldModel, trees: Sequence[TreePolicy]) -> Floats:
        """Return the returns of trees in common episodes of a world model, shape [trees]."""
        first, *others = (from_decision_tree(tree.tree, tree.actions) for tree in trees)
        rollouts = self._rollouts(model)
        rollouts.redraw()
        rollouts.run(first)
        gains = [0.0, *(rollouts.gain(tree).mean for tree in others)]
        return rollouts.mean_return + np.array(gains)

    def _missed(self, model: WorldModel, policy: TreePolicy, episodes: Sequence[Episode]) -> Floats:
        """Return how far a model's mean return from the start of each episode is from the real."""
        tree, missed = from_decision_tree(policy.tree, policy.actions), []
        for episode in episodes:
            here = model.begun_at(episode.observations[:1])
            there = PairedRollouts(here, FORETELLING, 1.0, self._generator)
            there.run(tree)
            missed.append(abs(episode.undiscounted_return - there.mean_return))
        return np.array(missed)

    def _models(self, episodes: Sequence[Episode]) -> Iterator[WorldModel]:
        # The last of a long run are those of a good policy, which seldom show how it fails.
        stored = self._data.followed_by(episodes).spread(MOST_KNOWN)
        detail = max(MAX_LEAVES, stored.rewards.size // ROWS_PER_LEAF)
        for kind in _MODELS:
            known = replace(stored, memory=kind.memory)
            size = detail if kind.detailed else MAX_LEAVES
            (model,) = fit_world_models(known, [kind.gap], max_leaves=size)
            yield model if kind.noise else model.without_noise()

    def _rollouts(self, model: WorldModel) -> PairedRollouts:
        n_episodes = max(int(self._settings.model_steps / self._data.mean_length), FEWEST_ROLLOUTS)
        return PairedRollouts(model, n_episodes, 1.0, self._generator)

    def prefer(self, policy: TreePolicy, challenger: TreePolicy, known: Sequence[Episode]) -> bool:
        """Return whether the challenger earns more in every world model, by a standard error."""
        return all(self._prefers(model, policy, challenger) for model in self._models(known))

    def _prefers(self, model: WorldModel, policy: TreePolicy, challenger: TreePolicy) -> bool:
        """Return whether the challenger earns more in a world model, by a standard error."""
        rollouts = self._rollouts(model)
        rollouts.run(from_decision_tree(policy.tree, policy.actions))
        gain = rollouts.gain(from_decision_tree(challenger.tree, challenger.actions))
        return gain.mean > gain.error

    def _policy_of(self, tree: ActionTree) -> TreePolicy:
        """Return a tree as a policy, with the locked leaves of the start in it."""
        free = with_tree(self._start, *to_decision_tree(tree, self._start.tree.n_features))
        return with_locks(free, self._start)


def key(tree: TreePolicy) -> bytes:
    """Return the key that trees share which decide alike by the same tests."""
    return tree.tree.feature.tobytes() + tree.tree.threshold.tobytes() + tree.actions.tobytes()


def identity(policy: TreePolicy) -> bytes:
    """Return the key of a policy as it plays: under masks what its leaves know decides, too."""
    bare = with_tree(policy, policy.tree, policy.actions)
    known = policy.masked and (policy.orders != bare.orders).any()
    return key(policy) + (policy.orders.tobytes() if known else b"")


def _decisions(policy: TreePolicy, known: Advantages) -> Integers:
    """Return a policy's actions at each recorded step, shape [N]."""
    return policy.actions[policy.tree.leaf_index(known.observations)]


def _few(rollouts: PairedRollouts) -> int:
    """Return how many rollouts are enough to anneal."""
    return max(rollouts.n_episodes // ROUGH, FEWEST_ROLLOUTS)
