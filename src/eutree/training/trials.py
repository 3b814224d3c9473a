"""Real episodes in which trees are compared, under a budget of steps that is never exceeded.

In one heat episode k is reset with the same seed for every tree. Where a tree decides like another
at every step of an episode, it is the same episode, and is not run again.
"""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Floats
from eutree.data import Episode
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.policies import TreePolicy

STREAM = 31
FIRST_BLOCK = 4  # episodes
MOST_RACED = 32  # episodes of one block of a race
FEWEST = 8  # episodes without which nothing is known
ENOUGH = 32  # episodes that show which of two trees earns more
SURE = 2.0  # standard errors
MANY = 64  # episodes that show that a smaller tree does as well


class Trials:
    """Episodes of trees, heat after heat.

    Args:
        env: Where they run.
        history: Number of previous observations in the trees' features.
        seed: Seed of all episodes.
        worth: Return that a leaf must earn.
        longest: Steps of the longest episode seen; what one may take where the environment sets no
            limit itself.

    Attributes:
        limit: Environment steps that may be taken in all.
        steps: Environment steps of all episodes so far.
        episodes: These episodes.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], history: int, *, seed: int, worth: float, longest: int
    ) -> None:
        self.limit = 0
        self.steps = 0
        self.episodes: list[Episode] = []
        self._env = GuardedEnv(env, history=history)
        self._seed = seed
        self._worth = worth
        set_limit = None if env.spec is None else env.spec.max_episode_steps
        self._longest = longest if set_limit is None else set_limit
        self._known_limit = set_limit is not None
        self._heat = 0
        self._run: dict[bytes, list[Episode]] = {}

    def new_heat(self) -> None:
        """Begin a heat with other episodes."""
        self._heat += 1
        self._run.clear()

    def episodes_of(self, tree: TreePolicy, n: int) -> list[Episode] | None:
        """Return the first n episodes of the heat as a tree runs them; None if steps are short."""
        mine = self._run.setdefault(key(tree), [])
        while len(mine) < n:
            known = self._known(tree, len(mine))
            if known is None:
                if self.steps + self._longest > self.limit:
                    return None
                known = self._new(tree, len(mine))
            mine.append(known)
        return mine[:n]

    def change(self, tree: TreePolicy, rival: TreePolicy, n: int) -> Floats | None:
        """Return what the rival earns more in each of n episodes, leaves apart, shape [n]."""
        returns = [self._returns(one, n) for one in (rival, tree)]
        return None if returns[0] is None or returns[1] is None else returns[0] - returns[1]

    def better(self, tree: TreePolicy, rival: TreePolicy, *, of_many: bool = False) -> bool | None:
        """Return whether the rival earns clearly more, or is smaller and as good.

        The number of episodes doubles as long as the rival is ahead, leaves paid for.

        Args:
            tree: What stays if nothing is better.
            rival: What may take its place.
            of_many: Whether the rival is one of many that are tried one after another. Then two
                standard errors are clear, not one, and ties are not looked into.

        Returns:
            None if the rival is ahead and steps are too few to be sure.
        """
        better = self._ahead(tree, rival, of_many=of_many)
        if not better:
            self._run.pop(key(rival), None)
        return better

    def _ahead(self, tree: TreePolicy, rival: TreePolicy, *, of_many: bool) -> bool | None:
        saved = self._worth * (tree.n_leaves - rival.n_leaves)
        errors = SURE if of_many else 1.0
        n = FIRST_BLOCK
        while (change := self.change(tree, rival, n)) is not None:
            ahead = change.mean() + saved
            if ahead < 0.0 or (of_many and ahead == 0.0):
                return False
            error = errors * float(change.std(ddof=1)) / np.sqrt(n)
            if n >= ENOUGH and change.mean() + min(saved, 0.0) > error:
                return True
            if n >= MANY:
                return bool(ahead > error)
            n *= 2
        return None if n > FEWEST else False

    def race(self, runners: Sequence[TreePolicy]) -> TreePolicy:
        """Return the winner: run all, drop the worse half, run twice as many, while steps last."""
        alive = list(runners)
        affordable = (self.limit - self.steps) // (2 * self._longest * max(len(alive), 1))
        size = n = int(np.clip(affordable, 1, FIRST_BLOCK))
        while len(alive) > 1:
            scores: dict[int, float] = {}
            for runner in alive:
                returns = self._returns(runner, n)
                if returns is None:
                    return max(alive, key=lambda one: scores.get(id(one), -np.inf))
                scores[id(runner)] = float(returns.mean()) - self._worth * runner.n_leaves
            alive.sort(key=lambda one: -scores[id(one)])
            alive = alive[: (len(alive) + 1) // 2]
            size = min(2 * size, MOST_RACED)
            n += size
        return alive[0]

    def _returns(self, tree: TreePolicy, n: int) -> Floats | None:
        run = self.episodes_of(tree, n)
        return None if run is None else np.array([e.undiscounted_return for e in run])

    def _known(self, tree: TreePolicy, number: int) -> Episode | None:
        """Return the episode as another tree ran it, if this one decides the same throughout."""
        for run in self._run.values():
            if len(run) > number:
                episode = run[number]
                rows = episode.observations[:-1]
                if np.array_equal(tree.actions[tree.tree.leaf_index(rows)], episode.actions):
                    return episode
        return None

    def _new(self, tree: TreePolicy, number: int) -> Episode:
        seed = episode_seed(episode_seed(self._seed, self._heat, STREAM), number)
        alone = TreePolicy(tree.tree, tree.actions, tree.schema)  # the environment has the history
        episode = run_episode(self._env, alone, seed)
        self.steps += len(episode)
        if not self._known_limit:
            self._longest = max(self._longest, len(episode))
        self.episodes.append(episode)
        return episode


def key(tree: TreePolicy) -> bytes:
    """Return what trees that decide alike by the same tests have in common."""
    return tree.tree.feature.tobytes() + tree.tree.threshold.tobytes() + tree.actions.tobytes()
