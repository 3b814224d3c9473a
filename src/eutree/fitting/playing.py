"""Play trees: every episode is counted and kept, with the leaves that decided in it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.contests import Halving, hold, new_table
from eutree.data import Episode
from eutree.evaluation import Evaluation
from eutree.interaction import GuardedEnv, episode_seed, run_episode
from eutree.interaction.seeding import Stream
from eutree.policies import TreePolicy

TIE = 1e-9  # of a success: what a unit of return is worth beside it
Progress = Callable[[str, int, int], None]  # what for, episodes played for it, at most so many


@dataclass(frozen=True, eq=False)
class Played:
    """Episodes that a tree has played.

    Attributes:
        policy: The tree.
        episodes: What came of it, at least one episode.
    """

    policy: TreePolicy
    episodes: tuple[Episode, ...]

    @property
    def evaluation(self) -> Evaluation:
        """The same as figures."""
        successes = [episode.is_success for episode in self.episodes]
        return Evaluation(
            returns=np.array([episode.undiscounted_return for episode in self.episodes]),
            lengths=np.array([len(episode) for episode in self.episodes]),
            endings=np.array([episode.ending for episode in self.episodes]),
            successes=None if None in successes else np.array(successes),
            n_leaves=self.policy.n_leaves,
        )

    @property
    def worths(self) -> Floats:
        """What trees are compared by, [E]: success where there is any, among equals the return."""
        return np.array([
            bool(episode.is_success) + TIE * episode.undiscounted_return
            for episode in self.episodes
        ])  # fmt: skip

    def failed(self, enough: float) -> Booleans:
        """Return which episodes failed, [E]; without successes, which earned too little."""
        figures = self.evaluation
        return figures.returns < enough if figures.successes is None else ~figures.successes

    def leaves(self) -> list[Integers]:
        """Return the leaf that decided at each step of each episode."""
        tree, features = self.policy.tree, self.policy.features
        seen = [episode.with_features(features).observations[:-1] for episode in self.episodes]
        return [tree.leaf_index(rows).astype(np.int64) for rows in seen]

    def followed_by(self, more: "Played") -> "Played":
        """Return both plays of one tree together."""
        return replace(self, episodes=self.episodes + more.episodes)


class Player:
    """Plays trees in one environment and counts every episode.

    Args:
        env: The environment.
        seed: Seed of all that is played; the episodes of a block are the same for every tree.
        on_progress: Told after each episode.

    Attributes:
        episodes: How many were played.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], seed: int, on_progress: Progress | None = None
    ) -> None:
        self._env = GuardedEnv(env)
        self._seed = seed
        self._on_progress = on_progress
        self.episodes = 0
        self.begin("playing", 1)

    def begin(self, stage: str, most: int) -> None:
        """Say what the next episodes are played for, and how many there may be of them."""
        self._stage, self._most, self._before = stage, most, self.episodes

    def play(self, policy: TreePolicy, episodes: int, block: int, *, first: int = 0) -> Played:
        """Return what came of so many episodes of a block, from the ``first`` one on.

        Raises:
            EnvironmentFault: The environment broke its contract.
        """
        seed = episode_seed(self._seed, block, Stream.FITTING)
        played = []
        for number in range(first, first + episodes):
            played.append(run_episode(self._env, policy, episode_seed(seed, number)))
            self.episodes += 1
            if self._on_progress is not None:
                count = self.episodes - self._before
                self._on_progress(self._stage, count, max(count, self._most))
        return Played(policy, tuple(played))

    def contest(
        self, rule: Halving, rivals: Sequence[TreePolicy], block: int
    ) -> tuple[int, Played]:
        """Return which tree has won, the first of equals, and what it has played.

        Args:
            rule: Decides.
            rivals: The trees, at least one.
            block: Where their episodes come from.
        """
        plays: dict[int, Played] = {}

        def run(tree: int, starts: Sequence[int]) -> Floats:
            more = self.play(rivals[tree], len(starts), block, first=starts[0])
            plays[tree] = plays[tree].followed_by(more) if tree in plays else more
            return more.worths

        winner = hold(rule, new_table(len(rivals), rule.most), run).winner
        return winner, plays[winner]
