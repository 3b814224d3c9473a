"""The memory of the learner of Table 1 on its leaves: their targets, and an episode.

The Continuous U-Tree cuts leaves by a test of returns, a kd-tree by density; both are the same
learner. In an episode under way each step is one compiled call.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np

from eutree.arrays import Floats, Int32s, Integers
from eutree.compiled import machine_code
from eutree.learners import _kernels
from eutree.learners.episode_buffer import EpisodeBuffer, FinishedEpisode
from eutree.learners.history import History
from eutree.learners.learner import Step
from eutree.learners.u_tree import _kernels_step
from eutree.learners.u_tree._kernels_step import REFUSED, UNKNOWN
from eutree.mdp import TERMINAL, TabularMDP
from eutree.trees import DecisionTree
from eutree.validation import check_number

# A rule takes the leaves' values [L], and their greedy actions [L] if it asks for them.


class OneStep(msgspec.Struct, frozen=True, tag=True):
    """q = r + discount * V(L(o')), the paper's Eq. 2 with o' in place of its misprinted o."""

    def of(
        self, history: History, rows: Integers, *, values: Floats, greedy: object, discount: float
    ) -> Floats:
        """Return q of each of the rows, shape [n]; V of a terminal state is 0."""
        q, entered = history.rewards[rows], history.entered[rows]
        goes_on = entered >= 0
        q[goes_on] += discount * values[entered[goes_on]]
        return q


class LambdaReturn(msgspec.Struct, frozen=True, tag=True):
    """The lambda-return, cut at the first action that is not greedy (Watkins's Q(lambda)).

    Through leaves that lump unlike observations together, a one-step target loses the outcome of an
    action two or three steps later; a return keeps it.

    Attributes:
        decay: lambda, from 0 (one step) to 1 (the whole return up to the cut).
    """

    decay: float = 1.0

    def __post_init__(self) -> None:
        check_number("decay", self.decay, low=0.0, high=1.0)

    def of(
        self,
        history: History,
        rows: Integers,
        *,
        values: Floats,
        greedy: Callable[[], Int32s],
        discount: float,
    ) -> Floats:
        """Return q of each of the rows, shape [n]."""
        out = np.empty(rows.size)
        _kernels.lambda_targets(rows, history.rows, values, greedy(), discount, self.decay, out)
        return out


Target: TypeAlias = OneStep | LambdaReturn


class LeafEpisode(NamedTuple):
    """An episode with its leaves."""

    steps: FinishedEpisode
    leaves: Int32s  # [T + 1] L(o) of each observation
    entered: Int32s  # [T] where each step led: a leaf, or TERMINAL


class LeafSteps:
    """Takes steps into the MDP over the leaves, and knows the present leaf and its greedy action.

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

        ``prior`` has an action of each leaf, shape [L].
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
