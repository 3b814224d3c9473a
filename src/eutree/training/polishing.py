"""Polish a learned tree: rivals from several imaginations race on real episodes.

Planning inside a learning run trusts one world model. Where that model is poor, what it prefers
is not what earns more. Here several models, none of which need be right, each propose improved or
smaller trees, and real episodes decide. A race: all rivals run the same episodes, the worse half
leaves, those that are left run twice as many, until one is left. It then meets the policy on fresh
episodes that took no part in choosing it, and replaces it only if it earns more by one standard
error. What a leaf must earn is counted throughout, so a smaller tree that does as well wins. All
steps are counted; when the next episodes would exceed the budget, it is over.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.compression.candidates import merged
from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.imagination import ActionTree, Transitions, fit_world_models
from eutree.imagination.action_trees import from_decision_tree, n_leaves, to_decision_tree
from eutree.imagination.improvement import Improvement
from eutree.imagination.rehearsal import Rehearsal
from eutree.imagination.world_model import MAX_LEAVES
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.learning.foresight import transitions_of
from eutree.learning.history import History
from eutree.policies import TreePolicy
from eutree.validation import check_integer, check_number, check_seed

RACE_STREAM, DUEL_STREAM = 31, 32
FIRST_BLOCK = 4  # episodes
FEWEST_DUELS, MOST_DUELS = 16, 200  # episodes
MOST_LEAVES = 40
ROWS_PER_LEAF = 100  # of a detailed model
RACE_SHARE = 0.7  # of a round's steps; the rest is the duel's
DEARER = (1.0, 6.0)  # prices of a leaf at which each imagination proposes


@dataclass(frozen=True)
class PolishReport:
    """What polishing did.

    Attributes:
        n_leaves_before: Leaves of the input.
        n_leaves_after: Leaves of the result.
        rivals: Trees that raced, in all rounds.
        rounds: Rounds of proposing, racing and meeting.
        won: Rounds in which a rival replaced the policy.
        environment_steps: Steps of all episodes run.
    """

    n_leaves_before: int
    n_leaves_after: int
    rivals: int
    rounds: int
    won: int
    environment_steps: int


@dataclass(frozen=True)
class _Way:
    """One way of imagining."""

    gap: float = 0.5
    memory: bool = True
    noise: bool = True
    detailed: bool = False


_WAYS = (
    _Way(gap=0.9),
    _Way(noise=False, detailed=True),
    _Way(memory=False, detailed=True),
    _Way(memory=False, noise=False, detailed=True),
)


def polish(
    policy: TreePolicy,
    history: History,
    env: gymnasium.Env[Any, Any],
    *,
    steps: int,
    rounds: int = 3,
    price: float = 0.001,
    max_leaves: int | None = None,
    n_episodes: int = 500,
    seed: int = 0,
) -> tuple[TreePolicy, PolishReport]:
    """Return a tree that earns more in real episodes, or does as well with fewer leaves.

    Args:
        policy: The policy to polish.
        history: All transitions stored in learning it (``LearningResult.history``).
        env: Where episodes are run.
        steps: Most environment steps to run, give or take an episode.
        rounds: Rounds; each begins with the winner of the last.
        price: Return that a leaf must earn, as a share of a typical return's size.
        max_leaves: Most leaves of the result; a policy that has more is replaced by the winner of
            the first race, whatever it earns. None allows as many as there are, or ``MOST_LEAVES``.
        n_episodes: Imagined episodes that judge each change.
        seed: The same seed gives the same tree.

    Raises:
        InvalidArgumentError: An argument is not as described, or leaves are locked.
    """
    check_integer("steps", steps, low=1)
    check_integer("rounds", rounds, low=1)
    limit = max(policy.n_leaves, MOST_LEAVES)
    if max_leaves is not None:
        limit = check_integer("max_leaves", max_leaves, low=2)
    check_integer("n_episodes", n_episodes, low=8)
    check_number("price", price, low=0.0)
    check_seed(seed)
    if policy.locked:
        raise InvalidArgumentError(f"policy must have no locked leaves, got {policy.locked}")
    data = transitions_of(history, policy.schema.n_actions)
    worth = price * max(float(np.abs(data.episode_returns).mean()), 1e-9)
    length = data.rewards.size / max(history.n_episodes, 1)
    race = _Race(GuardedEnv(env, history=policy.history), seed, worth, length)
    generator = np.random.default_rng(np.random.SeedSequence((seed, RACE_STREAM)))
    best, n_rivals, won = merged(policy), 0, 0
    improvement = Improvement(price=price, max_leaves=limit)
    for number in range(rounds):
        data = data.followed_by(race.episodes)
        race.episodes.clear()
        begin = race.steps
        share = (steps - begin) // (rounds - number)
        rivals = _distinct(best, _proposed(best, data, improvement, n_episodes, generator))
        rivals = [rival for rival in rivals if rival.n_leaves <= limit]
        n_rivals += len(rivals)
        if best.n_leaves > limit:
            best, won = race.run(rivals, begin + share), won + 1
            continue
        winner = race.run([best, *rivals], begin + int(RACE_SHARE * share))
        if winner is not best and race.meets(best, winner, begin + share):
            best, won = winner, won + 1
    return best, PolishReport(policy.n_leaves, best.n_leaves, n_rivals, rounds, won, race.steps)


def _proposed(
    policy: TreePolicy,
    data: Transitions,
    improvement: Improvement,
    n_episodes: int,
    generator: np.random.Generator,
) -> Iterator[TreePolicy]:
    """Yield what each way of imagining makes of the policy, at several prices of a leaf."""
    scale = max(float(np.abs(data.episode_returns).mean()), 1e-9)
    recent = data.recent(50_000)
    detail = max(MAX_LEAVES, recent.rewards.size // ROWS_PER_LEAF)
    start = from_decision_tree(policy.tree, policy.actions)
    for way in _WAYS:
        known = replace(recent, memory=way.memory)
        size = detail if way.detailed else MAX_LEAVES
        (model,) = fit_world_models(known, [way.gap], max_leaves=size)
        model = model if way.noise else model.without_noise()
        rehearsal = Rehearsal(model, n_episodes, 1.0, generator)
        tree = start
        for factor in DEARER:
            tree = replace(improvement, price=improvement.price * factor).improve(
                rehearsal, tree, scale
            )
            yield _policy_of(policy, tree)
        while n_leaves(tree) > improvement.max_leaves:
            factor *= 3
            tree = replace(improvement, price=improvement.price * factor).improve(
                rehearsal, tree, scale
            )
            yield _policy_of(policy, tree)


def _policy_of(policy: TreePolicy, tree: ActionTree) -> TreePolicy:
    state_tree, actions = to_decision_tree(tree, policy.tree.n_features)
    return replace(policy, tree=state_tree, actions=actions, leaves=None, locked=())


def _distinct(policy: TreePolicy, rivals: Iterator[TreePolicy]) -> list[TreePolicy]:
    """Return the rivals that are neither the policy nor one another."""
    seen, kept = {_key(policy)}, []
    for rival in rivals:
        if _key(rival) not in seen:
            seen.add(_key(rival))
            kept.append(rival)
    return kept


def _key(policy: TreePolicy) -> bytes:
    tree = policy.tree
    return tree.feature.tobytes() + tree.threshold.tobytes() + policy.actions.tobytes()


class _Race:
    """Episodes in which trees are compared, each on the same luck as the others.

    Args:
        env: Where they run.
        seed: Seed of all episodes.
        worth: Return that a leaf must earn.
        length: Expected steps of an episode.

    Attributes:
        steps: Environment steps of all episodes so far.
        episodes: The last ones, for the next world models.
    """

    def __init__(self, env: GuardedEnv, seed: int, worth: float, length: float) -> None:
        self.steps = 0
        self.episodes: list[Episode] = []
        self._env = env
        self._seed = seed
        self._worth = worth
        self._length = length
        self._block = 0

    def run(self, runners: Sequence[TreePolicy], limit: int) -> TreePolicy:
        """Return the winner: halve the field and double the episodes while steps last."""
        alive = list(runners)
        scores = {id(runner): np.empty(0) for runner in alive}
        size = FIRST_BLOCK
        while len(alive) > 1 and self._affordable(size * len(alive), limit):
            for runner in alive:
                new = self._scores(runner, size, RACE_STREAM)
                scores[id(runner)] = np.concatenate([scores[id(runner)], new])
            self._block += 1
            alive.sort(key=lambda runner: -float(scores[id(runner)].mean()))
            alive = alive[: (len(alive) + 1) // 2]
            size = 2 * size
        return alive[0]

    def meets(self, policy: TreePolicy, rival: TreePolicy, limit: int) -> bool:
        """Return whether the rival earns more by a standard error on fresh episodes.

        Where steps are left for a few only, the policy stays.
        """
        size = int(min(MOST_DUELS, (limit - self.steps) / (2 * self._length)))
        if size < FEWEST_DUELS:
            return False
        change = self._scores(rival, size, DUEL_STREAM) - self._scores(policy, size, DUEL_STREAM)
        self._block += 1
        error = float(change.std(ddof=1) / np.sqrt(change.size))
        return bool(change.mean() > error)

    def _scores(self, runner: TreePolicy, size: int, stream: int) -> Floats:
        """Return what a tree earns in each episode of the present block, its leaves paid."""
        block = episode_seed(self._seed, self._block, stream)
        tree = replace(runner, history=0)  # the environment gives it its history
        run = [run_episode(self._env, tree, episode_seed(block, k)) for k in range(size)]
        self.episodes += run
        steps = sum(map(len, run))
        self.steps += steps
        self._length = 0.5 * (self._length + steps / size)
        returns = np.array([episode.undiscounted_return for episode in run])
        return returns - self._worth * runner.n_leaves

    def _affordable(self, episodes: int, limit: int) -> bool:
        return self.steps + episodes * self._length <= limit
