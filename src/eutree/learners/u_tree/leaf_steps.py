"""The episode under way in the leaves of a tree: each step is one compiled call."""

from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.compiled import machine_code
from eutree.learners.episode_buffer import EpisodeBuffer, FinishedEpisode
from eutree.learners.learner import Step
from eutree.learners.u_tree import _kernels_step
from eutree.learners.u_tree._kernels_step import REFUSED, UNKNOWN
from eutree.mdp import TERMINAL, TabularMDP
from eutree.trees import DecisionTree


class LeafEpisode(NamedTuple):
    """An episode with its leaves."""

    steps: FinishedEpisode
    leaves: Int32s  # [T + 1] L(o) of each observation
    entered: Int32s  # [T] where each step led: a leaf, or TERMINAL


class LeafSteps:
    """Takes steps into the MDP over the leaves, and knows the present leaf and what to do there.

    Attributes:
        leaf: L(o) of the present observation.
        generator: Source of all chance of the episode.
    """

    def __init__(self) -> None:
        self._buffer = EpisodeBuffer()
        self._leaves: list[int] = []
        self._arrive, self._step = _kernels_step.arrive, _kernels_step.step
        self._bound = False
        self.leaf = 0
        self._choice = UNKNOWN

    def __len__(self) -> int:
        """Return the number of steps so far."""
        return len(self._buffer)

    def start(
        self,
        tree: DecisionTree,
        mdp: TabularMDP,
        observation: Floats,
        generator: np.random.Generator,
    ) -> None:
        """Begin an episode at its first observation, shape [d]; ``mdp`` is over the tree's leaves.

        Neither may be another one before the episode has ended.
        """
        observation = np.ascontiguousarray(observation, dtype=np.float64)
        self._buffer.start(observation, generator)
        self.generator = generator
        self._nodes, self._mdp, self._arrays = tree.nodes, mdp, mdp.arrays
        place = (self._nodes, self._arrays, observation)
        if not self._bound:
            self._arrive = machine_code(_kernels_step.arrive, *place)
            self._step = machine_code(_kernels_step.step, *place, 0, 0, 0.0, False, 0)
            self._bound = True
        self.leaf, self._choice = self._arrive(*place)
        self._leaves = [self.leaf]

    def greedy(self, prior: Integers) -> int:
        """Return the greedy action of the present leaf (Eq. 1); where nothing was tried, its prior.

        Args:
            prior: Action of each leaf, shape [L].
        """
        return self._choice if self._choice != UNKNOWN else int(prior[self.leaf])

    def add(self, step: Step, backups: int) -> None:
        """Take a step: count it (Eqs. 3, 4), back up so many states, find the leaf it led to."""
        observation = np.ascontiguousarray(step.observation, dtype=np.float64)
        leaf, choice = self._step(
            self._nodes, self._arrays, observation, self.leaf,
            step.action, step.reward, step.terminated, backups,
        )  # fmt: skip
        if choice == REFUSED:
            entered = TERMINAL if step.terminated else leaf
            self._mdp.observe(self.leaf, step.action, step.reward, entered, backups)
            self._arrays = self._mdp.arrays
            choice = _kernels_step.greedy(self._arrays, leaf)
        self._buffer.add(step)
        self._leaves.append(leaf)
        self.leaf, self._choice = leaf, choice

    def finish(self) -> LeafEpisode:
        """Return the episode, and forget it."""
        leaves = np.array(self._leaves, dtype=np.int32)
        entered = leaves[1:].copy()
        episode = self._buffer.finish()
        if episode.terminated:
            entered[-1] = TERMINAL
        return LeafEpisode(episode, leaves, entered)
