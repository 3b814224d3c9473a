"""Parti-game with a learned local controller, and the expert as one more high-level action.

A. W. Moore and C. G. Atkeson (Machine Learning 21, 1995), in the variants of M. A. Al-Ansari and R.
J. Williams (NIPS 11, 1998); :mod:`eutree_lab.parti_game.game` has the algorithm. It learns at
every step: a losing cell is split in the middle of an episode. Rewards do not matter to it.

The leaves of the expert tree, clipped to a finite box, are the first cells. A success says nothing
to an optimist, so demonstrations matter in three other ways: they show where the goal is, they are
data for the local controller, and they count the outcomes of the aim "act as the expert does until
the cell is left". The tree shown is C4.5's of the controller's actions.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats
from eutree.errors import InvalidArgumentError
from eutree.learners import Decisions, History, Needs, Part, Problem, Start, Step, Stored, Update
from eutree.learners.declared import (
    MOST,
    Declared,
    Found,
    arrays_of,
    give_back,
    history_parts,
    tree_of,
    tree_part,
)
from eutree.learners.episode_buffer import EpisodeBuffer, store, store_demonstrations
from eutree.learners.learner import Arrays, reached
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.validation import check_integer, check_vector
from eutree_lab.parti_game._kernels_tiles import Tiles
from eutree_lab.parti_game.cells import GOAL, Cells, goal_boxes
from eutree_lab.parti_game.displacements import LearnedController
from eutree_lab.parti_game.game import CUT_SHORT, GOES_ON, GameRules, PartiGame
from eutree_lab.parti_game.outcomes import EXPERT, LOST, Outcomes, counted
from eutree_lab.relabelling import relabelled
from eutree_lab.root_box import root_box


@dataclass(frozen=True, kw_only=True)
class PartiGameMethod:
    """The choices of parti-game.

    Attributes:
        variant: Cells that are split: "llppg" (the largest losing cells at the border), "lppg" (all
            of them) or "pg" (both sides of the border).
        patience: Steps without coming nearer to the target after which one is stuck.
        max_cells: Cells from which on nothing is split.
        floor: Share above which an outcome is reckoned with, for certain; 0 takes all, more is for
            noisy tasks.
        improve: Whether cells are halved for shorter ways too, after an episode that reached the
            goal and brought nothing new ("global improvement").
        follow_expert: Whether the expert is an aim.
        use_cells: Whether the expert's leaves are the first cells.
        goal: Lower and upper corner of the goal; None learns it from the demonstrations.
        gathering_episodes: Episodes between two entries in the log; it learns at every step.
    """

    name: ClassVar[str] = "parti-game"
    needs: ClassVar[Needs] = Needs(goal=True, gathering=True)

    variant: str = "llppg"
    patience: int = 10
    max_cells: int = 1000
    floor: float = 0.0
    improve: bool = False
    follow_expert: bool = True
    use_cells: bool = True
    goal: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    gathering_episodes: int = 20

    def __post_init__(self) -> None:
        self.rules()  # checks its choices
        check_integer("gathering_episodes", self.gathering_episodes, low=1)
        if self.goal is not None:  # then no demonstration has to show it
            corners = [check_vector("goal", corner) for corner in self.goal]
            if len(corners) != 2 or corners[0].shape != corners[1].shape:
                raise InvalidArgumentError(f"goal must be two corners of one box, got {self.goal}")
            object.__setattr__(self, "needs", replace(self.needs, goal=False))

    def rules(self) -> GameRules:
        """Return the choices of the algorithm itself."""
        return GameRules(self.variant, self.patience, self.max_cells, self.floor)

    def start(self, problem: Problem, start: Start) -> "PartiGameLearner":
        """Return the learner at its start."""
        return PartiGameLearner(problem, start, self)

    def restore(self, problem: Problem, start: Start, state: Arrays) -> "PartiGameLearner":
        """Return the learner whose ``state()`` this was; it goes on to the same bytes."""
        return give_back(PartiGameLearner(problem, start, self), _PARTS, state)

    def declared(self, problem: Problem, start: Start) -> Declared:
        """Return the declaration of a ``state()``."""
        d = problem.n_features
        _, n_tiles, _ = _controller(np.zeros(d), np.ones(d), problem).tiles.means.shape
        return problem.declare(*_PARTS, tiles=n_tiles)


def _are_triples(found: Found) -> None:
    """Raise FormatError unless rows are cell, aim and cell arrived in."""
    for column, least in enumerate((0, EXPERT, LOST)):
        if (found.state["triples"][:, column] < least).any():
            raise found.refuse("triples", f"column {column} must be in {least}..cells")


def _arrays_of(game: PartiGame) -> Arrays:
    triples, starts = [], []
    for (cell, aim), came in game.own.starts.items():
        triples += [(cell, aim, arrived) for _, arrived in came]
        starts += [start for start, _ in came]
    d = game.cells.tree.n_features
    return {
        "triples": np.array(triples, dtype=np.int64).reshape(-1, 3),
        "starts": np.array(starts, dtype=np.float64).reshape(-1, d),
    }


def _resume(learner: "PartiGameLearner", state: Arrays) -> None:
    """Let the game of a learner go on with the tree of its cells, and what came of its aims."""
    game = learner.game
    tree = tree_of(state, game.cells.tree.n_features)
    rows = zip(map(tuple, state["triples"].tolist()), np.array(state["starts"]), strict=True)
    cells = Cells.of(tree, *game.cells.box, game.cells.goals)
    game.resume(cells, counted(rows, game.rules.floor), exhausted=game.exhausted)


_GAME = Part(
    {
        "exhausted": Stored("b1", "1", at="game.exhausted"),
        "triples": Stored("i8", "K3", low=min(EXPERT, LOST), below="L"),
        "starts": Stored("f8", "Kd"),
        "means": Stored("f8", ("A", "tiles", "d"), at="_learned.tiles.means"),
        "errors": Stored("f8", ("A", "tiles"), low=0, at="_learned.tiles.errors"),
        "visits": Stored("i8", ("A", "tiles"), low=0, most=MOST, at="_learned.tiles.visits"),
        "size": Stored("f8", "2", low=0, at="_learned.tiles.size"),  # a sum and a number
    },
    _are_triples,
    at="game",
    save=_arrays_of,
    make=_resume,
)
_PARTS = (tree_part("game.cells.tree")._replace(make=None), *history_parts(), _GAME)


class PartiGameLearner:
    """The learner of parti-game.

    Args:
        problem: Its names and bounds.
        start: Where it begins.
        method: How to learn.

    Attributes:
        game: Cells, outcomes of aims, and the controller.
        history: All transitions stored so far.
    """

    def __init__(self, problem: Problem, start: Start, method: PartiGameMethod) -> None:
        self.method, self.n_actions = method, problem.n_actions
        d = problem.n_features
        self.history = History(d, 1)
        store_demonstrations(self.history, start.episodes)
        tree = DecisionTree.single_leaf(d)
        if start.expert is not None and method.use_cells:
            tree = start.expert.tree
        seen = [np.empty((0, d)), *(episode.observations for episode in start.episodes)]
        low, high = root_box(problem, tree, np.concatenate(seen))
        if method.goal is None:
            goals = goal_boxes(start.episodes, low, high)
        else:
            goals = np.array([[check_vector("goal", c, size=d) for c in method.goal]])
        self._learned = controller = _controller(low, high - low, problem)
        good = reached(start.episodes)
        demonstrated = []
        for episode, is_good in zip(start.episodes, good, strict=True):
            rows = episode.observations
            for o, action, after in zip(rows, episode.actions.tolist(), rows[1:], strict=False):
                controller.learn(o, action, after)
            ending = GOAL if is_good else LOST if episode.terminated else CUT_SHORT
            demonstrated.append((rows, 0 if ending == CUT_SHORT else ending))
        follows = start.expert is not None and not start.random and method.follow_expert
        self._expert = _action_of(start.expert) if follows and start.expert else None
        self._good_level = _good_level(start)
        self.game = PartiGame(
            Cells.of(tree, low, high, goals), controller, method.rules(),
            expert=self._expert, demonstrated=demonstrated,
        )  # fmt: skip
        self._buffer = EpisodeBuffer()
        self._ending = GOES_ON

    def start_episode(self, observation: Floats, generator: np.random.Generator) -> None:
        """Begin an episode at its first observation, shape [d]; all its chance is ``generator``."""
        self._before = self._snapshot()
        self._buffer.start(observation, generator)
        self.game.begin()

    def act(self) -> int:
        """Return the action on the way to the present aim."""
        return self.game.act(self._buffer.present, self._buffer.generator)

    def observe(self, step: Step) -> None:
        """Take what came of an action; learn from it at once."""
        before = self._buffer.present
        self._buffer.add(step)
        ending = CUT_SHORT if step.truncated else GOES_ON
        if step.terminated:
            said = step.info.get("is_success")
            good = bool(said) if said is not None else step.reward >= self._good_level
            ending = GOAL if good else LOST
        self._ending = ending
        self.game.observe(before, step.action, step.observation, ending)

    def end_episode(self) -> None:
        """Store the episode, whose last step was terminated or truncated."""
        episode = self._buffer.finish()
        store(self.history, episode)
        if self.method.improve and self._ending == GOAL and self.game.n_news == 0:
            self.game.improve()

    def discard_episode(self) -> None:
        """Be as before ``start_episode``, to the bit; do nothing between two episodes."""
        if len(self._buffer):
            self._buffer.clear()
            self._go_back(*self._before)

    def update(self, generator: np.random.Generator) -> Update:
        """Say how far it is; everything was learned at its step."""
        losing = self.game.plan().losing
        return Update(
            figures={
                "n_cells": len(self.game.cells),
                "losing_cells": int(losing.sum()),
                "exhausted": int(self.game.exhausted),
            }
        )

    def decisions(self) -> Decisions:
        """Return C4.5's tree of what is done at the stored observations."""
        observations = self.history.observations
        if not len(observations):
            tree = DecisionTree.single_leaf(observations.shape[1])
            return Decisions(tree=tree, actions=np.zeros(1, dtype=np.int64))
        actions, _ = self.own_policy().predict(observations)
        return relabelled(observations, actions, self.n_actions)

    def own_policy(self) -> "CellPolicy":
        """Return the present aims and the controller, frozen."""
        return CellPolicy(self._copy())

    def state(self) -> Arrays:
        """Return all that is known between two episodes."""
        return arrays_of(self, _PARTS)

    def _snapshot(self) -> tuple[Cells, Outcomes, bool, Tiles]:
        game, tiles = self.game, Tiles._make(array.copy() for array in self._learned.tiles)
        return game.cells, game.own.copy(), game.exhausted, tiles

    def _go_back(self, cells: Cells, own: Outcomes, exhausted: bool, tiles: Tiles) -> None:
        self._learned.tiles = tiles
        self.game.resume(cells, own, exhausted=exhausted)

    def _copy(self) -> PartiGame:
        """Return a game of its own that does as this one does now."""
        cells, own, _, tiles = self._snapshot()
        controller = LearnedController(cells.box[0], cells.span, self.n_actions)
        controller.tiles = tiles
        return PartiGame(
            cells, controller, self.method.rules(), expert=self._expert,
            demonstrated=self.game.demonstrated, own=own,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class CellPolicy:
    """Aims by the cell one is in, and goes there by the controller, without exploring.

    Attributes:
        game: Cells, aims and controller; nobody else's.
    """

    game: PartiGame

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action for one observation [d] or a batch [E, d], as Stable-Baselines3."""
        given = np.asarray(observation, dtype=np.float64)
        actions = np.array([self.game.best(row) for row in np.atleast_2d(given)], dtype=np.int64)
        return (int(actions[0]) if given.ndim == 1 else actions), state


def _controller(low: Floats, span: Floats, problem: Problem) -> LearnedController:
    return LearnedController(low, span, problem.n_actions)


def _action_of(expert: TreePolicy) -> Callable[[Floats], int]:
    """Return the expert's action at an observation."""
    tree, actions = expert.tree, expert.actions.tolist()

    def action(observation: Floats) -> int:
        chosen: int = actions[tree.leaf_of(observation.tolist())]
        return chosen

    return action


def _good_level(start: Start) -> float:
    """Return the reward from which on a last one is good, if the environment does not say."""
    ends = [
        float(episode.rewards[-1])
        for episode, good in zip(start.episodes, reached(start.episodes), strict=True)
        if good
    ]
    return min(ends, default=-np.inf)
