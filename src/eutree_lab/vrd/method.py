"""Variable resolution discretization in a learned world model.

R. Munos and A. Moore, *Variable Resolution Discretization in Optimal Control* (Machine Learning 49,
2002), take the world as given; here a world model is fitted to the stored transitions, in every
update: the model, the process over the corners of the boxes, its exact solution, and boxes halved
where a criterion says so (:mod:`eutree_lab.vrd.influence`). The expert tree is the first partition,
and its actions at the corners are the first policy, kept on ties.

The method's own policy is a look-ahead in the model. The tree shown is C4.5's of its actions.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.learners import Decisions, History, Needs, Part, Problem, Start, Step, Stored, Update
from eutree.learners.declared import TREE_PART, Found, arrays_of, give_back, history_parts, tree_of
from eutree.learners.episode_buffer import (
    EpisodeBuffer,
    store,
    store_demonstrations,
    transitions_of,
)
from eutree.learners.learner import Arrays, MethodOfParts, TrueModel
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.validation import check_choice, check_integer, check_number
from eutree.world_model import fit_world_models
from eutree_lab.relabelling import relabelled
from eutree_lab.root_box import root_box
from eutree_lab.vrd.corner_process import (
    CornerWorld,
    Dynamics,
    KnownWorld,
    ModelledWorld,
    Solved,
    solved,
)
from eutree_lab.vrd.influence import CRITERIA, refined
from eutree_lab.vrd.kuhn import MOST_FEATURES, Grid

FEWEST = 8  # transitions that a model is fitted to


@dataclass(frozen=True, kw_only=True)
class VariableResolutionMethod(MethodOfParts):
    """The choices of variable resolution discretization.

    Attributes:
        first_boxes: Boxes at the first solution; all are halved until there are so many. Where
            they are too coarse V is so wrong that criteria refine the wrong places.
        criterion: Where boxes are halved: "average", "nonlinearity", "disagreement", "combined",
            "stdev_inf" or "starts" (the influence on the starts of demonstrations; "average" where
            there are none).
        share: Share of the boxes that one refinement halves.
        refinements: Refinements in an update.
        max_corners: Corners (states) from which on nothing is halved.
        discount: gamma.
        longest: Steps that an action is held at most.
        exploration: epsilon, the probability of a random action while gathering.
        gathering_episodes: Episodes between two updates.
        pessimism: Share of the gap between safe and fatal that the model takes for fatal.
        true_model: Whether the environment's own model takes the place of the learned one.
    """

    name: ClassVar[str] = "vrd"
    needs: ClassVar[Needs] = Needs(max_features=MOST_FEATURES)

    first_boxes: int = 256
    criterion: str = "starts"
    share: float = 0.2
    refinements: int = 3
    max_corners: int = 1000
    discount: float = 0.99
    longest: int = 50
    exploration: float = 0.1
    gathering_episodes: int = 20
    pessimism: float = 0.5
    true_model: bool = False

    def __post_init__(self) -> None:
        check_integer("first_boxes", self.first_boxes, low=1)
        check_choice("criterion", self.criterion, CRITERIA)
        check_number("share", self.share, low=0.0, high=1.0, low_open=True)
        check_integer("refinements", self.refinements, low=1)
        check_integer("max_corners", self.max_corners, low=2)
        check_number("discount", self.discount, low=0.0, high=1.0, low_open=True)
        check_integer("longest", self.longest, low=1)
        check_number("exploration", self.exploration, low=0.0, high=1.0)
        check_integer("gathering_episodes", self.gathering_episodes, low=1)
        check_number("pessimism", self.pessimism, low=0.0, high=1.0, low_open=True, high_open=True)

    def start(self, problem: Problem, start: Start) -> "VariableResolution":
        """Return the learner at its start."""
        learner = VariableResolution(problem, start, self)
        if self.true_model and problem.model is None:
            raise InvalidArgumentError(
                "method 'vrd' does not fit this task: true_model needs an environment that offers "
                "its model, and observations that are its whole state"
            )
        if start.episodes or self.true_model:
            learner.learn()
        return learner

    def restore(self, problem: Problem, start: Start, state: Arrays) -> "VariableResolution":
        """Return the learner whose ``state()`` this was; it goes on to the same bytes."""
        return give_back(VariableResolution(problem, start, self), self.parts, state)

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts of a learner's state."""
        values = {
            "box": Stored("f8", "2d"),
            "values": Stored("f8", "C"),
            "policy": Stored("i8", "C", low=0, below="A"),
        }
        make = VariableResolution.solved_again
        solved = Part(values, self._is_solved, True, "solved", save=_solved_arrays, make=make)
        return (TREE_PART, *history_parts(), _SOLVED_FROM, solved)

    def _is_solved(self, found: Found) -> None:
        """Raise FormatError unless there is a value for each corner of the tree's boxes."""
        try:
            grid = Grid.of(tree_of(found.state, found.sizes["d"]), *found.state["box"])
        except InvalidArgumentError as error:
            raise found.refuse("box", str(error)) from None
        if found.sizes["C"] != grid.n_corners:
            raise found.refuse(
                "values", f"must have {grid.n_corners} entries, the corners of the tree's boxes"
            )
        if found.value("solved_from") < FEWEST and not self.true_model:
            raise found.refuse("solved_from", f"must be at least {FEWEST} where there are values")


_SOLVED_FROM = Part({"solved_from": Stored("i8", "1", low=0, most="N", at="_solved_from")})


def _solved_arrays(one: Solved) -> Arrays:
    return {"values": one.values, "policy": one.policy, "box": np.stack(one.grid.box)}


class VariableResolution:
    """The learner of variable resolution discretization.

    Args:
        problem: Its names and bounds.
        start: Where it begins.
        method: How to learn.

    Attributes:
        tree: The present boxes.
        solved: The present boxes with their values; None before the first update.
        history: All transitions stored so far.
    """

    def __init__(self, problem: Problem, start: Start, method: VariableResolutionMethod) -> None:
        self.method, self.n_actions = method, problem.n_actions
        self.tree = DecisionTree.single_leaf(problem.n_features)
        self._expert: TreePolicy | None = start.expert
        if start.expert is not None:
            self.tree = start.expert.tree
        self._informed = None if start.random else start.expert
        self._problem = problem
        self.solved: Solved | None = None
        self._world: CornerWorld | None = None
        self._model_steps = 0
        self._solved_from = 0
        self._starts = np.array([e.observations[0] for e in start.episodes if len(e)])
        self.history = History(problem.n_features, 1)
        store_demonstrations(self.history, start.episodes)
        self._buffer = EpisodeBuffer()

    def start_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation, shape [d]; all its chance is ``generator``."""
        self._buffer.start(observation, generator)

    def act(self) -> int:
        """Return the best action by one look ahead; a random one with epsilon."""
        generator = self._buffer.generator
        if generator.random() < self.method.exploration:
            return int(generator.integers(self.n_actions))
        if self.solved is None and self._informed is None:
            return int(generator.integers(self.n_actions))
        return int(self.own_policy().predict(self._buffer.present)[0])

    def observe(self, step: Step) -> None:
        """Take what came of an action."""
        self._buffer.add(step)

    def end_episode(self) -> None:
        """Store the episode, whose last step was terminated or truncated."""
        episode = self._buffer.finish()
        store(self.history, episode)

    def discard_episode(self) -> None:
        """Be as before ``start_episode``, to the bit; do nothing between two episodes."""
        self._buffer.clear()

    def update(self, generator: np.random.Generator) -> Update:
        """Fit the model to all that is stored, refine, and solve."""
        self.learn()
        if self.solved is None:
            return Update()
        return Update(
            figures={
                "n_corners": self.solved.grid.n_corners,
                "n_boxes": self.tree.n_leaves,
                "model_steps": self._model_steps,
            }
        )

    def learn(self) -> None:
        """Fit the model and refine the boxes as often as the method says."""
        if self.history.size < FEWEST and not self.method.true_model:
            return
        self._solved_from = self.history.size
        world = self._world = self._fitted()
        before = self.solved
        grid = self._new_grid()
        while grid.tree.n_leaves < self.method.first_boxes:
            longest = ((grid.high - grid.low) / grid.span).argmax(axis=1)
            grid = grid.halve([(i, int(axis)) for i, axis in enumerate(longest)])
        self.tree = grid.tree
        self.solved = solved(grid, world, before=before, initial_policy=self._prior(grid))
        for _ in range(self.method.refinements):
            if self.solved.grid.n_corners >= self.method.max_corners:
                break
            finer = refined(self.solved, self._criterion(), self.method.share, self._starts)
            if finer.tree.n_leaves == self.tree.n_leaves:
                break
            self.tree = finer.tree
            prior = self._prior(finer)
            self.solved = solved(finer, world, before=self.solved, initial_policy=prior)
        self._model_steps = world.n_steps_taken  # without those of acting, which come later

    def decisions(self) -> Decisions:
        """Return C4.5's tree of the look-ahead; before there is one, the expert's tree."""
        observations = self.history.observations
        if self.solved is None or not len(observations):
            if self._expert is not None:
                return Decisions(tree=self._expert.tree, actions=self._expert.actions)
            return Decisions(
                tree=DecisionTree.single_leaf(self._problem.n_features),
                actions=np.zeros(1, dtype=np.int64),
            )
        actions, _ = self.own_policy().predict(observations)
        return relabelled(observations, actions, self.n_actions)

    def own_policy(self) -> "CornerPolicy":
        """Return the look-ahead, frozen; before there is one, the expert, or the first action."""
        return CornerPolicy(self.solved, self._world, self._informed)

    def state(self) -> Arrays:
        """Return all that is known between two episodes."""
        return arrays_of(self, self.method.parts)

    def solved_again(self, state: Arrays) -> Solved:
        """Return the boxes with their values; the model is fitted again."""
        self._world = self._fitted()
        values, policy = np.array(state["values"]), np.array(state["policy"])
        return Solved.of(Grid.of(self.tree, *state["box"]), self._world, values, policy)

    def _fitted(self) -> CornerWorld:
        """Return the world model of the transitions that were stored at the last update."""
        true, method = self._problem.model, self.method
        if method.true_model and true is not None:
            return KnownWorld(_dynamics(true), self.n_actions, method.discount, method.longest)
        data = replace(transitions_of(self.history, self.n_actions), memory=False)
        (model,) = fit_world_models(data.until(self._solved_from), [self.method.pessimism])
        return ModelledWorld(
            model.without_noise(), self.n_actions, self.method.discount, self.method.longest
        )

    def _new_grid(self) -> Grid:
        return Grid.of(self.tree, *root_box(self._problem, self.tree, self.history.observations))

    def _prior(self, grid: Grid) -> Any:
        """Return the expert's action at each corner, or None."""
        expert = self._informed
        return None if expert is None else expert.actions[expert.tree.leaf_index(grid.corners)]

    def _criterion(self) -> str:
        """Return the criterion; without demonstrations there are no starts that could matter."""
        wanted = self.method.criterion
        return "average" if wanted == "starts" and not len(self._starts) else wanted


@dataclass(frozen=True, eq=False)
class CornerPolicy:
    """Decides by one look ahead in a world.

    Attributes:
        solved: Boxes and values; None before there are any.
        world: Where actions lead; None with them.
        expert: The policy in that case; None: the first action.
    """

    solved: Solved | None
    world: CornerWorld | None
    expert: TreePolicy | None

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action for one observation [d] or a batch [E, d], as Stable-Baselines3."""
        given = np.asarray(observation, dtype=np.float64)
        rows = np.atleast_2d(given)
        if self.solved is not None and self.world is not None:
            actions = self.solved.actions(self.world, rows)
        elif self.expert is not None:
            actions = self.expert.actions[self.expert.tree.leaf_index(rows)].astype(np.int64)
        else:
            actions = np.zeros(len(rows), dtype=np.int64)
        return (int(actions[0]) if given.ndim == 1 else actions), state


def _dynamics(model: TrueModel) -> Dynamics:
    """Return the model with the chance to go on in place of whether the task ends."""

    def dynamics(states: Floats, actions: Integers) -> tuple[Floats, Floats, Floats]:
        after, rewards, ends = model(states, actions)
        return after, rewards, np.where(ends, 0.0, 1.0)

    return dynamics
