"""VQQL: vector quantization for the states, Q-learning for the policy.

Fernandez and Borrajo (2000) gather observations, design a codebook of N codewords by the
generalized Lloyd algorithm, and learn Q over its regions by Q-learning:

    Q(s, a) <- (1 - alpha) Q(s, a) + alpha [r + gamma max_a' Q(s', a')]

Resolution follows where the agent has been, not where a decision changes. With an expert tree there
is a codebook *inside each of its leaves*: no region reaches across a place where the expert changes
his mind, and with one codeword in each leaf the regions are the expert tree itself.

The published quantizer is designed once, from random interaction, which never sees the interesting
part of many tasks. Here every update designs it again from all that is stored; a new codeword takes
over the values of the region that it lies in, and the stored transitions are replayed. The change
in one step is the unit of each feature, so that units of measurement do not matter.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers
from eutree.data import Episode
from eutree.learners import Decisions, History, Needs, Part, Problem, Start, Step, Stored, Update
from eutree.learners.declared import LOCKED_PART, MOST, Found, arrays_of, history_parts, tree_part
from eutree.learners.episode_buffer import EpisodeBuffer, store, store_demonstrations
from eutree.learners.history import TERMINAL
from eutree.learners.learner import Arrays, MethodOfParts
from eutree.mdp import TabularMDP, TransitionCounts
from eutree.trees import DecisionTree
from eutree.validation import check_choice, check_integer, check_number
from eutree_lab.relabelling import relabelled
from eutree_lab.step_scale import step_scale
from eutree_lab.vqql import _kernels as kernels
from eutree_lab.vqql.codebook import Codebook, codebook_in_leaves

Solver = Literal["q-learning", "model"]


def _is_book(found: Found) -> None:
    first, n_regions = found.state["first"], found.sizes["R"]
    if len(first) != found.sizes["L"] + 1:
        raise found.refuse("first", "must have one entry more than the tree has leaves")
    if first[0] != 0 or first[-1] != n_regions or (np.diff(first) < 1).any():
        raise found.refuse("first", f"must ascend from 0 to {n_regions}, the regions")
    if (found.state["scale"] <= 0.0).any():
        raise found.refuse("scale", "must be positive")
    if (np.isnan(found.state["values"]) != (found.state["tried"] == 0)).any():
        raise found.refuse("values", "must be known exactly where an action was tried")


_BOOK = {
    "prior": Stored("i8", "L", low=0, below="A", at="_prior"),
    "codewords": Stored("f8", "Rd", at="book.codewords"),
    "first": Stored("i8", "F", low=0, most="R", at="book.first"),
    "scale": Stored("f8", "d", at="book.scale"),
    "values": Stored("f8", "RA", nan=True, at="values"),
    "tried": Stored("i8", "RA", low=0, most=MOST, at="_tried"),
}


@dataclass(frozen=True, kw_only=True)
class VectorQuantizationMethod(MethodOfParts):
    """The choices of VQQL.

    Attributes:
        n_regions: Regions N of the codebook, in all leaves together; never fewer than leaves.
        solver: ``"q-learning"`` (published), or ``"model"``: Pr and R of the same regions, solved.
        discount: gamma.
        exploration: epsilon, the probability of a random action while gathering.
        gathering_episodes: Episodes between two designs of the codebook.
        rate: The n-th update of a region and action has the rate alpha = n ** -rate.
        replays: How often the stored transitions are replayed in an update, the last one first.
    """

    name: ClassVar[str] = "vqql"
    needs: ClassVar[Needs] = Needs()
    deleted: ClassVar[Mapping[str, Any]] = {"trial": False}
    parts = (tree_part("book.tree"), *history_parts(), LOCKED_PART, Part(_BOOK, _is_book))

    n_regions: int = 64
    solver: Solver = "q-learning"
    discount: float = 0.99
    exploration: float = 0.1
    gathering_episodes: int = 20
    rate: float = 0.8
    replays: int = 10

    def __post_init__(self) -> None:
        check_integer("n_regions", self.n_regions, low=1)
        check_choice("solver", self.solver, ("q-learning", "model"))
        check_number("discount", self.discount, low=0.0, high=1.0)
        check_number("exploration", self.exploration, low=0.0, high=1.0)
        check_integer("gathering_episodes", self.gathering_episodes, low=1)
        check_number("rate", self.rate, low=0.5, high=1.0)
        check_integer("replays", self.replays, low=1)

    def start(self, problem: Problem, start: Start) -> "VectorQuantization":
        """Return the learner at its start: an expert tree is the outer partition."""
        tree, actions, locked = start.first_leaves(problem)
        learner = VectorQuantization(tree, problem.n_actions, self, prior=actions, locked=locked)
        if start.episodes:
            learner.add_demonstrations(start.episodes)
        return learner


class VectorQuantization:
    """The learner of VQQL.

    Args:
        tree: The outer partition: a single leaf, or the expert tree's structure.
        n_actions: Number of actions A.
        method: How to learn.
        prior: Action of each leaf where nothing was tried: the expert's, shape [L].
        locked: Leaves whose prior action stays, without exploration.

    Attributes:
        book: The present codebook.
        values: Q of each region and action, NaN where it was never tried, shape [R, A].
        history: All transitions stored so far.
    """

    def __init__(
        self,
        tree: DecisionTree,
        n_actions: int,
        method: VectorQuantizationMethod,
        *,
        prior: Integers | None = None,
        locked: Iterable[int] = (),
    ) -> None:
        self.n_actions = n_actions
        self.method = method
        self.history = History(tree.n_features, 1)
        none = np.zeros(tree.n_leaves, dtype=np.int64)
        self._prior = np.array(none if prior is None else prior)  # [L]
        self._locked = frozenset(locked)
        nothing = np.empty((0, tree.n_features))
        self.book = codebook_in_leaves(tree, nothing, tree.n_leaves, scale=np.ones(tree.n_features))
        self.values = np.full((self.book.n_regions, n_actions), np.nan)
        self._tried = np.zeros(self.values.shape, dtype=np.int64)
        self._buffer = EpisodeBuffer()

    def add_demonstrations(self, episodes: Iterable[Episode]) -> None:
        """Store the expert's transitions, and learn a first codebook and Q from them."""
        store_demonstrations(self.history, episodes)
        self._learn()

    def start_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation, shape [d]; all its chance is ``generator``."""
        self._buffer.start(observation, generator)
        self._before = self.values.copy(), self._tried.copy()
        self._region = self._region_of(observation)

    def act(self) -> int:
        """Return the greedy action of the present region; a random one with epsilon."""
        leaf = int(self.book.leaf[self._region])
        if leaf in self._locked:
            return int(self._prior[leaf])
        generator = self._buffer.generator
        if generator.random() < self.method.exploration:
            return int(generator.integers(self.n_actions))
        return int(self.greedy_actions()[self._region])

    def observe(self, step: Step) -> None:
        """Take what came of an action, and update Q of its region."""
        self._buffer.add(step)
        entered = self._region_of(step.observation)
        kernels.q_learning(
            np.array([self._region]),
            np.array([step.action]),
            np.array([step.reward]),
            np.array([TERMINAL if step.terminated else entered]),
            self.method.discount,
            self.method.rate,
            self.values,
            self._tried,
        )
        self._region = entered

    def end_episode(self) -> None:
        """Store the episode, whose last step was terminated or truncated."""
        store(self.history, self._buffer.finish())

    def discard_episode(self) -> None:
        """Be as before ``start_episode``, to the bit; do nothing between two episodes."""
        if len(self._buffer):
            self.values, self._tried = self._before
            self._buffer.clear()

    def update(self, generator: np.random.Generator) -> Update:
        """Design the codebook again from all that is stored, and learn Q over its regions."""
        before = self.book.n_regions
        self._learn()
        distances = self.book.distances(self.history.observations)
        distortion = float((distances**2).mean()) if distances.size else 0.0
        figures = {"n_regions": self.book.n_regions, "distortion": distortion}
        figures |= {"n_regions_before": before}
        return Update(figures=figures)

    def greedy_actions(self) -> Integers:
        """Return the action of each region, shape [R]; the leaf's prior one where none is known."""
        known = ~np.isnan(self.values)
        best = np.where(known, self.values, -np.inf).argmax(axis=1)
        leaves = self.book.leaf
        learned = known.any(axis=1) & ~np.isin(leaves, list(self._locked))
        return np.where(learned, best, self._prior[leaves])

    def decisions(self) -> Decisions:
        """Return the outer tree where each leaf is one region, else C4.5's tree of the regions."""
        tree, actions, locked = self.book.tree, self.greedy_actions(), tuple(sorted(self._locked))
        observations = self.history.observations
        if self.book.n_regions == tree.n_leaves or not len(observations):
            return Decisions(tree=tree, actions=actions[self.book.first[:-1]], locked=locked)
        return relabelled(observations, actions[self.book.regions(observations)], self.n_actions)

    def own_policy(self) -> "RegionPolicy":
        """Return the policy over regions, frozen."""
        return RegionPolicy(self.book, self.greedy_actions())

    def state(self) -> Arrays:
        """Return all that is known between two episodes."""
        return arrays_of(self, self.method.parts)

    def _region_of(self, observation: Floats) -> int:
        return int(self.book.regions(observation[np.newaxis])[0])

    def _learn(self) -> None:
        """Design the codebook and learn Q over it, from all that is stored."""
        history, old = self.history, self.book
        if not history.size:
            return
        scale = step_scale(history.observations, history.next_observations)
        n_regions = max(self.method.n_regions, old.tree.n_leaves)
        self.book = codebook_in_leaves(old.tree, history.observations, n_regions, scale=scale)
        # A leaf without observations has a codeword at 0, wherever the leaf lies: look inside it.
        heirs = old.first[self.book.leaf]
        inside = old.regions(self.book.codewords * scale)
        heirs = np.where(old.leaf[inside] == self.book.leaf, inside, heirs)
        self.values = self.values[heirs]
        self._tried = np.zeros(self.values.shape, dtype=np.int64)
        left = self.book.regions(history.observations)
        entered = self.book.regions(history.next_observations)
        entered[history.entered == TERMINAL] = TERMINAL
        actions = history.actions.astype(np.int64)
        if self.method.solver == "model":
            self._solve(left, actions, entered)
        else:
            for _ in range(self.method.replays):
                kernels.q_learning(
                    left[::-1].copy(),
                    actions[::-1].copy(),
                    history.rewards[::-1].copy(),
                    entered[::-1].copy(),
                    self.method.discount,
                    self.method.rate,
                    self.values,
                    self._tried,
                )
        self.values[self._tried == 0] = np.nan

    def _solve(self, left: Integers, actions: Integers, entered: Integers) -> None:
        """Let Q be that of the MDP of the regions (Eqs. 3 to 6)."""
        rows = left, actions, self.history.rewards, entered
        counts = TransitionCounts.of(*rows, n_states=self.book.n_regions, n_actions=self.n_actions)
        mdp = TabularMDP(counts, self.method.discount)
        mdp.solve()
        self.values, self._tried = np.array(mdp.action_values), np.array(counts.visits)


@dataclass(frozen=True, eq=False)
class RegionPolicy:
    """Decides by the region of a codebook.

    Attributes:
        book: The codebook.
        actions: Action of each region.
    """

    book: Codebook
    actions: Integers  # [R]

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action for one observation [d] or a batch [E, d], as Stable-Baselines3."""
        rows = np.asarray(observation, dtype=np.float64)
        if rows.ndim == 1:
            return int(self.actions[self.book.regions(rows[np.newaxis])[0]]), state
        return self.actions[self.book.regions(rows)], state
