"""The episode under way in the leaves of a tree: each step is one compiled call."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.compiled import machine_code
from eutree.learners import _kernels_step
from eutree.learners._kernels_step import REFUSED, UNKNOWN, EpisodeArrays, TreeArrays
from eutree.learners.episode_buffer import FinishedEpisode
from eutree.learners.learner import Step
from eutree.mdp import TERMINAL, TabularMDP
from eutree.trees import DecisionTree

_FIRST_ROOM = 64  # steps


class LeafEpisode(NamedTuple):
    """An episode with its leaves."""

    steps: FinishedEpisode
    leaves: Int32s  # [T + 1] L(o) of each observation
    entered: Int32s  # [T] where each step led: a leaf, or TERMINAL


class LeafSteps:
    """Takes steps into the MDP over the leaves, and knows the present leaf and what to do there.

    Args:
        n_features: Number of features d of an observation.

    Attributes:
        leaf: L(o) of the present observation.
    """

    def __init__(self, n_features: int) -> None:
        self._size = 0
        self._terminated = False
        self._shown = np.zeros(_FIRST_ROOM, dtype=np.bool_)  # [C]
        self._episode = EpisodeArrays(
            observations=np.zeros((_FIRST_ROOM + 1, n_features)),
            leaves=np.zeros(_FIRST_ROOM + 1, dtype=np.int32),
            actions=np.zeros(_FIRST_ROOM, dtype=np.int64),
            rewards=np.zeros(_FIRST_ROOM),
        )
        self._arrive, self._step = _kernels_step.arrive, _kernels_step.step
        self._bound = False
        self.leaf = 0
        self._choice = UNKNOWN

    def __len__(self) -> int:
        """Return the number of steps so far."""
        return self._size

    def start(self, tree: DecisionTree, mdp: TabularMDP, observation: Floats) -> None:
        """Begin an episode at its first observation, shape [d]; ``mdp`` is over the tree's leaves.

        Neither may be another one before the episode has ended.
        """
        self._size = 0
        self._shown[:] = False
        self._tree = TreeArrays(tree.feature, tree.threshold, tree.left, tree.right, tree.leaf)
        self._mdp = mdp
        self._episode.observations[0] = observation
        place = (self._tree, mdp.arrays, self._episode, 0)
        if not self._bound:
            self._arrive = machine_code(_kernels_step.arrive, *place)
            self._step = machine_code(_kernels_step.step, *place, 0, 0.0, False, 0)
            self._bound = True
        self.leaf, self._choice = self._arrive(*place)

    def greedy(self, prior: Integers) -> int:
        """Return the greedy action of the present leaf (Eq. 1); where nothing was tried, its prior.

        Args:
            prior: Action of each leaf, shape [L].
        """
        return self._choice if self._choice != UNKNOWN else int(prior[self.leaf])

    def add(self, step: Step, backups: int) -> None:
        """Take a step: count it (Eqs. 3, 4), back up so many states, find the leaf it led to."""
        t = self._size
        if t == len(self._shown):
            self._double()
        if step.shown:
            self._shown[t] = True
        self._episode.observations[t + 1] = step.observation
        leaf, choice = self._step(
            self._tree, self._mdp.arrays, self._episode, t,
            step.action, step.reward, step.terminated, backups,
        )  # fmt: skip
        if choice == REFUSED:
            entered = TERMINAL if step.terminated else leaf
            self._mdp.observe(self.leaf, step.action, step.reward, entered, backups)
            choice = _kernels_step.greedy(self._mdp.arrays, leaf)
        self.leaf, self._choice, self._terminated = leaf, choice, step.terminated
        self._size = t + 1

    def finish(self) -> LeafEpisode:
        """Return the episode, to be read before the next one begins, and forget it."""
        n, self._size = self._size, 0
        episode, leaves = self._episode, self._episode.leaves[: n + 1]
        entered = leaves[1:].copy()
        if self._terminated:
            entered[-1] = TERMINAL
        steps = FinishedEpisode(
            observations=episode.observations[: n + 1],
            actions=episode.actions[:n],
            rewards=episode.rewards[:n],
            shown=self._shown[:n],
            terminated=self._terminated,
        )
        return LeafEpisode(steps, leaves, entered)

    def _double(self) -> None:
        """Make room for as many steps again."""
        self._shown = np.concatenate([self._shown, np.zeros_like(self._shown)])
        episode, room = self._episode, len(self._shown)
        observations = np.zeros((room + 1, episode.observations.shape[1]))
        observations[: len(episode.observations)] = episode.observations
        self._episode = EpisodeArrays(
            observations,
            np.append(episode.leaves, np.zeros(room // 2, dtype=np.int32)),
            np.append(episode.actions, np.zeros(room // 2, dtype=np.int64)),
            np.append(episode.rewards, np.zeros(room // 2)),
        )
