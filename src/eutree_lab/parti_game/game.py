"""Parti-game: to a goal region by cells, an adversary and a greedy local controller.

In cell i one aims at a neighbour until i is left, or one is stuck; the triple (i, aim, arrived) is
remembered. Aims are chosen by minimax (``outcomes``); where the adversary can keep one from the
goal for ever, cells at the border of the losing ones are split (``losing_cells``). A. W. Moore and
C. G. Atkeson, *The Parti-game Algorithm* (Machine Learning 21, 1995), algorithms 3 and 4; variants
of M. A. Al-Ansari and R. J. Williams (NIPS 11, 1998).

The expert, if there is one, is one more aim of every cell: act as it does until the cell is left
(Moore 1993 proposes such "behaviours"). Its outcomes are counted in its demonstrations.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from eutree.arrays import Floats
from eutree.validation import check_choice, check_integer, check_number
from eutree_lab.parti_game import outcomes as found
from eutree_lab.parti_game.cells import GOAL, Cells
from eutree_lab.parti_game.displacements import LearnedController
from eutree_lab.parti_game.losing_cells import (
    VARIANTS,
    cells_to_improve,
    cells_to_split,
    explained_cuts,
)
from eutree_lab.parti_game.outcomes import EXPERT, LOST, AimCosts, Outcomes

GOES_ON, CUT_SHORT, TAKEN_BACK = 0, 1, 2
"""How a step ended besides GOAL and LOST; who is taken back goes on at another place."""

OFFSET = 0.1  # how far beyond a shared face to aim, as a share of the smallest side


@dataclass(frozen=True)
class GameRules:
    """The choices of the algorithm.

    Attributes:
        variant: Rule of splitting: "pg", "lppg" or "llppg"; "pg" aims at centres, the others at
            faces.
        patience: Steps without coming nearer to the target after which one is stuck.
        max_cells: Number of cells from which on nothing is split.
        floor: Share above which an outcome is reckoned with, for certain; 0 takes all (no noise).
    """

    variant: str = "llppg"
    patience: int = 10
    max_cells: int = 2000
    floor: float = 0.0

    def __post_init__(self) -> None:
        check_choice("variant", self.variant, VARIANTS)
        check_integer("patience", self.patience, low=1)
        check_integer("max_cells", self.max_cells, low=1)
        check_number("floor", self.floor, low=0.0, high=1.0, high_open=True)


@dataclass(frozen=True)
class WayToAim:
    """The way to an aim: its cell and place, the aim, how near, and steps left without progress."""

    cell: int
    aim: int
    start: Floats  # [d]
    target: Floats  # [d]
    nearest: float
    left: int


@dataclass
class PartiGame:
    """One learner: cells, outcomes of aims in them, and the present aim.

    Attributes:
        cells: The present partition.
        controller: Chooses actions that lead to the aim.
        rules: The choices of the algorithm.
        expert: The expert's action at an observation; None if there is none.
        demonstrated: Observations of each demonstration and how it ended (GOAL, LOST, CUT_SHORT).
        own: Outcomes of aims in the learner's own steps.
        n_news: Triples never seen before, and splits, since the episode began.
        exhausted: Whether a losing cell could not be split for the limit of cells.
    """

    cells: Cells
    controller: LearnedController
    rules: GameRules = field(default_factory=GameRules)
    expert: Callable[[Floats], int] | None = None
    demonstrated: Sequence[tuple[Floats, int]] = ()
    own: Outcomes = field(default_factory=Outcomes)
    n_news: int = 0
    exhausted: bool = False

    def __post_init__(self) -> None:
        self.own.floor = self.rules.floor
        self._way: WayToAim | None = None
        self._refresh()

    def begin(self) -> None:
        """Begin an episode: no aim is left of the one before."""
        self._way, self.n_news = None, 0

    def act(self, observation: Floats, generator: np.random.Generator) -> int:
        """Return the action on the way to the present aim, after choosing one if need be."""
        if self._way is None:
            self._way = self._chosen(observation, generator)
        if self._way.aim == EXPERT and self.expert is not None:
            return self.expert(observation)
        return self.controller.act(observation, self._way.target, generator)

    def observe(self, observation: Floats, action: int, after: Floats, ending: int) -> None:
        """Take note of a step.

        Args:
            observation: Where it began, shape [d].
            action: The action taken.
            after: Where it led, shape [d].
            ending: GOES_ON, CUT_SHORT, TAKEN_BACK, GOAL or LOST.
        """
        if ending not in (LOST, TAKEN_BACK):  # the observation is no displacement then
            self.controller.learn(observation, action, after)
        way = self._way
        if way is None:
            return
        if ending == CUT_SHORT:
            self._way = None
            return
        arrived = ending if ending in (GOAL, LOST) else self.cells.tree.leaf_of(after.tolist())
        if arrived == way.cell and ending != TAKEN_BACK:
            distance = self._distance(after, way.target)
            if distance < way.nearest * (1.0 - 1e-6):
                self._way = replace(way, nearest=distance, left=self.rules.patience)
                return
            if way.left > 1 or way.aim == EXPERT:
                self._way = replace(way, left=way.left - 1)
                return
        self._way = None
        is_new = self.own.add((way.cell, way.aim, arrived), way.start)
        self.n_news += is_new
        if is_new or self.rules.floor > 0.0:
            self._recost()

    def plan(self) -> AimCosts:
        """Return J of every cell and the aims there are."""
        return self._costs

    def best(self, observation: Floats) -> int:
        """Return the action at an observation without exploring, splitting or learning."""
        cell = self.cells.tree.leaf_of(observation.tolist())
        aim = self._costs.best_aim(cell)
        if aim == EXPERT and self.expert is not None:
            return self.expert(observation)
        return self.controller.best(observation, self._point(cell, aim, observation))

    def improve(self) -> bool:
        """Halve cells where a shorter way may be hidden; return whether there was any.

        To be asked between two episodes, after one that brought nothing new (Al-Ansari and
        Williams 1998, "global improvement").
        """
        room = self.rules.max_cells - len(self.cells)
        gone = cells_to_improve(self.cells, self._costs)[:room].tolist()
        if gone:
            self._replace(self.cells.halve(gone), gone)
        return bool(gone)

    def resume(self, cells: Cells, own: Outcomes, *, exhausted: bool) -> None:
        """Go on between two episodes with cells and outcomes known from before."""
        self.cells, self.own, self.exhausted = cells, own, exhausted
        self._way = None
        self._refresh()

    def _chosen(self, observation: Floats, generator: np.random.Generator) -> WayToAim:
        """Return the way to the best aim, after splitting until there is one (algorithm 4)."""
        cell = self.cells.tree.leaf_of(observation.tolist())
        while np.isinf(self._costs.cost[cell]) and self._split():
            cell = self.cells.tree.leaf_of(observation.tolist())
        aim = self._costs.best_aim(cell)
        if np.isinf(self._costs.cost[cell]):  # nothing is certain: try anything
            first, last = np.searchsorted(self._costs.cell, [cell, cell + 1])
            aim = int(generator.choice(self._costs.aim[first:last]))
        target = self._point(cell, aim, observation)
        nearest = self._distance(observation, target)
        return WayToAim(cell, aim, observation.copy(), target, nearest, self.rules.patience)

    def _split(self) -> bool:
        """Split cells at the border of the losing ones; return whether there were any to split."""
        cuts = []
        if self.rules.floor > 0.0:
            cuts = explained_cuts(self.cells, self._costs, self._all)
        chosen = cells_to_split(self.cells, self._costs, self.rules.variant)
        if len(self.cells) + max(len(cuts), 1) > self.rules.max_cells or not chosen.size:
            self.exhausted = True
            return False
        room = self.rules.max_cells - len(self.cells)
        gone = [cell for cell, _, _ in cuts] if cuts else chosen[:room].tolist()
        self._replace(self.cells.split(cuts) if cuts else self.cells.halve(gone), gone)
        self.n_news += 1
        return True

    def _replace(self, cells: Cells, gone: Sequence[int]) -> None:
        """Take other cells; forget the outcomes of those that are gone."""
        self.cells = cells
        self.own = self.own.without(gone)
        self._refresh()

    def _refresh(self) -> None:
        """Find the aims and the expert's outcomes in new cells."""
        self._aims = found.aims(self.cells, expert=self.expert is not None)
        shown = found.expert_outcomes(self.cells, self.demonstrated) if self.expert else []
        self._shown = found.counted(shown, self.rules.floor)
        self._recost()

    def _recost(self) -> None:
        self._all = found.merged(self.own, self._shown) if self._shown.arrivals else self.own
        self._costs = found.costs(len(self.cells), *self._aims, self._all)

    def _point(self, cell: int, aim: int, observation: Floats) -> Floats:
        if aim == EXPERT:
            return observation.copy()
        if aim == GOAL:
            return self.cells.goal_point(cell)
        if self.rules.variant == "pg":
            return self.cells.centre(aim)
        return self.cells.face_point(cell, aim, OFFSET)

    def _distance(self, observation: Floats, target: Floats) -> float:
        return float(np.linalg.norm((target - observation) / self.cells.span))
