"""Challengers of the policy: trees of CART, pruned by imagined returns, and their real races.

The challengers of all rounds are kept. A race is made of ordinary episodes, from starts that the
learner numbers: all entrants, incumbent and challengers, run from the same ones. The episodes
of another tree that decides alike throughout are known and not run again.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import cycle, islice
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from eutree.arrays import Floats
from eutree.contests import Ahead, Table, new_table, next_episode
from eutree.contests.rules import Lead
from eutree.contests.table import pairs
from eutree.features import Derivation
from eutree.learners.declared import State
from eutree.learners.distilled_dqn.teaching import Experience, Students
from eutree.learners.episode_buffer import transitions_of
from eutree.learners.learner import Arrays, Figures
from eutree.policy_search.model_trust import ModelTrust
from eutree.policy_search.variation import Variation
from eutree.world_model import ActionTree
from eutree.world_model.action_trees import n_leaves
from eutree.world_model.ensemble import Ensemble, EnsembleSettings, fit_ensemble
from eutree.world_model.ensemble_rollouts import (
    EnsembleRollouts,
    climbed_by_rollouts,
    pruned_by_rollouts,
)
from eutree.world_model.transitions import seen_as

RACED_TREE = "contender_"  # a raced tree's arrays: checkpoints keep the word of the first release
# The start, CART as it is, pruned by imagined returns from a plain or from a weighted CART, or such
# a tree after changes that are imagined to pay.
ORIGINS = ("start", "cart", "pruned", "pruned-weighted", "climbed")
UNKNOWN = float("nan")


@dataclass
class RacedTree:
    """A tree that is, was or may become the policy."""

    tree: ActionTree
    origin: str  # how it was made, one of ``ORIGINS``
    imagined: float = UNKNOWN  # its score in the latest world model; NaN before the first
    returns: list[float] = field(default_factory=list)  # its returns in all races so far

    @property
    def mean_return(self) -> float:
        """Mean of its returns; NaN where there is none."""
        return float(np.mean(self.returns)) if self.returns else UNKNOWN

    def worth(self, price: float) -> float:
        """Return its mean return less what its leaves have to earn; NaN where there is none."""
        return self.mean_return - price * n_leaves(self.tree)

    def sure_worth(self, price: float) -> float:
        """Return its worth less a standard error; -inf for fewer than two returns."""
        n = len(self.returns)
        if n < 2:
            return -math.inf
        return self.worth(price) - float(np.std(self.returns, ddof=1)) / math.sqrt(n)


def packed_raced(raced: Sequence[RacedTree]) -> dict[str, NDArray[Any]]:
    """Return raced trees as arrays."""
    trees = packed_trees([one.tree for one in raced])
    return trees | {
        "origin": np.array([ORIGINS.index(one.origin) for one in raced], dtype=np.int64),
        "imagined": np.array([one.imagined for one in raced]),
        "n_returns": np.array([len(one.returns) for one in raced], dtype=np.int64),
        "returns": np.array([r for one in raced for r in one.returns], dtype=np.float64),
    }


def unpacked_raced(state: Mapping[str, NDArray[Any]]) -> list[RacedTree]:
    """Return the raced trees that ``packed_raced`` made arrays of."""
    ends = np.cumsum(state["n_returns"])[:-1]
    returns = np.split(state["returns"], ends)
    return [
        RacedTree(tree, ORIGINS[origin], imagined, earned.tolist())
        for tree, origin, imagined, earned in zip(
            unpacked_trees(state),
            state["origin"].tolist(),
            state["imagined"].tolist(),
            returns,
            strict=True,
        )
    ]


def packed_trees(trees: Sequence[ActionTree]) -> dict[str, NDArray[Any]]:
    """Return trees as arrays, one after the other."""
    columns = {
        name: np.concatenate([getattr(tree, name) for tree in trees]) for name in ActionTree._fields
    }
    return columns | {"n_nodes": np.array([tree.feature.size for tree in trees], dtype=np.int64)}


def unpacked_trees(state: Mapping[str, NDArray[Any]]) -> list[ActionTree]:
    """Return the trees that ``packed_trees`` made arrays of."""
    ends = np.cumsum(state["n_nodes"])[:-1]
    columns = [np.split(np.array(state[name]), ends) for name in ActionTree._fields]
    return [
        ActionTree._make(np.ascontiguousarray(column) for column in columns_of_tree)
        for columns_of_tree in zip(*columns, strict=True)
    ]


N_STARTS = 50  # first observations of imagined episodes
LARGE = 32  # leaves that a tree to prune has a multiple of, however few are allowed
# Recipes of a tree to prune: its leaves, in those allowed, and whether CART is weighted.
Recipe: TypeAlias = tuple[int, bool]
RECIPES: tuple[Recipe, ...] = ((3, True), (3, False), (2, False), (2, True))
MOST_PRUNED = 6  # trees that race
PARTS = (1, 2, 4)  # of the leaves allowed: what CART's own trees have that race
FEW_RETURNS = 4  # below which a tree's mean says nothing


class ImaginedChallengers:
    """A world model, fitted to the experience, and the trees that it speaks for."""

    def __init__(
        self,
        settings: EnsembleSettings,
        students: Students,
        experience: Experience,
        n_actions: int,
        max_leaves: int,
        derivation: Callable[[], Derivation],
    ) -> None:
        self._settings = settings
        self._students = students
        self._experience = experience
        self._n_actions = n_actions
        self._max_leaves = max_leaves
        self._derivation = derivation
        self.ensemble: Ensemble | None = None  # before it is first fitted

    def make(self, n: int, generator: np.random.Generator) -> list[RacedTree]:
        """Fit the model to all that is known; return CART's trees and ``n`` others.

        Half of these are prunings, or fewer where they are the same tree; the others climb on.
        """
        data = transitions_of(self._experience.history, self._n_actions)
        data = seen_as(self._derivation(), data)
        if self.ensemble is None:
            ensemble = fit_ensemble(data, self._settings, generator)
        else:
            ensemble = self.ensemble.fitted_on(data, generator)
        self.ensemble = ensemble
        observations = self._experience.history.observations
        sizes = sorted({max(self._max_leaves // part, 2) for part in PARTS}, reverse=True)
        made = [RacedTree(self._students.fit(observations, size), "cart") for size in sizes]
        judge = EnsembleRollouts(ensemble, N_STARTS, generator)
        judge.run(made[0].tree)
        pruned = self._pruned(n, ensemble, judge, generator)[: n - n // 2]
        made += pruned
        for one in islice(cycle(pruned), n - len(pruned)):
            made.append(self._climbed(one.tree, ensemble, judge, generator))
        return made

    def _pruned(
        self, n: int, ensemble: Ensemble, judge: EnsembleRollouts, generator: np.random.Generator
    ) -> list[RacedTree]:
        """Return the ``n`` pruned trees that the judge scores best, of four more; each one once.

        Recipes differ from run to run by more than the trees of one recipe do, and the model tells
        recipes apart where it cannot tell such trees apart. So each has a tree, and the others are
        of the recipe whose trees score best in imagined episodes that have chosen none of them.
        """
        rows, made = self._experience.history.observations, list[RacedTree]()
        large: dict[Recipe, ActionTree] = {}
        scores: dict[Recipe, list[float]] = {recipe: [] for recipe in RECIPES}
        while len(made) < len(RECIPES) + n:
            recipe = max(RECIPES, key=lambda one: np.mean(scores[one]) if scores[one] else np.inf)
            if recipe not in large:
                large[recipe] = self.to_prune(recipe, rows)
            rollouts = EnsembleRollouts(ensemble, N_STARTS, generator)
            tree, _ = pruned_by_rollouts(large[recipe], rollouts, self._max_leaves, generator)
            score = judge.score_of(tree)
            scores[recipe].append(score)
            made.append(RacedTree(tree, "pruned-weighted" if recipe[1] else "pruned", score))
        different: dict[bytes, RacedTree] = {}
        for one in sorted(made, key=lambda one: -one.imagined):
            different.setdefault(b"".join(part.tobytes() for part in one.tree), one)
        return list(different.values())[:n]

    def _climbed(
        self,
        tree: ActionTree,
        ensemble: Ensemble,
        judge: EnsembleRollouts,
        generator: np.random.Generator,
    ) -> RacedTree:
        """Return a tree after random changes that pay in imagined episodes."""
        rollouts = EnsembleRollouts(ensemble, N_STARTS, generator)
        variation = Variation(self._n_actions, self._max_leaves, generator)
        changed = climbed_by_rollouts(tree, rollouts, variation.of)
        return RacedTree(changed, "climbed", judge.score_of(changed))

    def to_prune(self, recipe: Recipe, observations: Floats) -> ActionTree:
        """Return the large tree of a recipe, a copy of the teacher at observations [N, d]."""
        times, weighted = recipe
        leaves = times * max(self._max_leaves, LARGE)
        return self._students.fit(observations, leaves, weighted=weighted)

    def imagine(
        self, raced: Sequence[RacedTree], policy: ActionTree, generator: np.random.Generator
    ) -> None:
        """Score all raced trees in the same imagined episodes, which chose none of them."""
        if self.ensemble is None:
            return
        rollouts = EnsembleRollouts(self.ensemble, N_STARTS, generator)
        rollouts.run(policy)
        returns = rollouts.returns_of_each([one.tree for one in raced])
        for one, row in zip(raced, returns, strict=True):
            one.imagined = rollouts.score(row)

    def trust(self, raced: Sequence[RacedTree]) -> ModelTrust | None:
        """Return how the model orders the trees that were really run; None without a model."""
        if self.ensemble is None:
            return None
        met = [one for one in raced if len(one.returns) >= FEW_RETURNS]
        return ModelTrust(
            np.array([one.imagined for one in met]),
            np.array([one.mean_return for one in met]),
            np.array([len(one.returns) for one in met], dtype=np.int64),
        )

    def ensemble_of(self, state: Arrays) -> Ensemble:
        """Return the model whose ``state()`` this was."""
        settings = self._settings, self._n_actions, self._derivation()
        return Ensemble.from_state(state, *settings)


SURE = 2.0  # standard errors that end a race, and that win where its proposals are not trusted
MANY_RETURNS = 12  # below which a tree's mean says little
ROW_OF_RACE = 10_000  # starts of one race are numbered from this times the race's number on


class Races:
    """All raced trees of one learner, ``first`` the policy, and their races.

    The price is the return that a leaf must earn.
    """

    def __init__(
        self, first: RacedTree, experience: Experience, students: Students, price: float
    ) -> None:
        self._experience = experience
        self._price = price
        self._students = students
        self.trees = [first]  # and then all challengers that raced or are to race
        self.incumbent = 0  # number of the tree that is the policy
        self.entrants: list[int] = []  # of the present race, the incumbent first
        self.rule: Ahead | None = None  # what decides the race under way; None between two
        self.table = new_table(0, 0)  # [entrants, starts] their returns so far
        self.number = 0  # races so far
        self._run: list[tuple[int, int, int]] = []  # entrant, start, first row of each episode
        self._next: tuple[int, int] | None = None

    @property
    def policy(self) -> ActionTree:
        """The incumbent's tree."""
        return self.trees[self.incumbent].tree

    @property
    def running(self) -> ActionTree:
        """The tree that decides in the present episode."""
        if self._next is None:
            return self.policy
        return self.trees[self.entrants[self._next[0]]].tree

    @property
    def is_run(self) -> bool:
        """Whether no episode of the race is left to run."""
        return self._next is None

    def next_start(self) -> int | None:
        """Return the number of the start of the next episode; None if any will do."""
        return None if self._next is None else ROW_OF_RACE * self.number + self._next[1]

    def best(self, n: int) -> list[int]:
        """Return the trees that earned most, leaves paid for, among those that ran often enough.

        The incumbent may be one of the ``n``, and is left out.
        """
        known = [i for i, c in enumerate(self.trees) if len(c.returns) >= MANY_RETURNS]
        most = sorted(known, key=lambda i: -self.trees[i].worth(self._price))[:n]
        return [one for one in most if one != self.incumbent]

    def begin(self, challengers: Sequence[int], looks: Sequence[int]) -> Figures:
        """Begin a race of the policy with these challengers; return how many they are."""
        self.entrants = [self.incumbent, *challengers]
        self.take_up(looks, new_table(len(self.entrants), looks[-1]))
        self.number += 1
        self._run = []
        self._call()
        return {"rivals": len(challengers)}  # logs keep that word too

    def take_last_episode(self) -> Figures:
        """Take the last episode as one of the race, and find the next.

        Return the tree, start and return, the result after the last; nothing between two races.
        """
        place = self._next
        if place is None:
            return {}
        rows = self._experience.last()
        value = self._experience.return_of(rows)
        entrant = self.entrants[place[0]]
        facts: Figures = {
            "race": self.number,
            "entrant": entrant,
            "origin": self.trees[entrant].origin,
            "start": place[1],
            "return": value,
        }
        self._run.append((*place, rows.start))
        self._tell(place, value)
        self._call()
        if self.is_run and self.rule is not None:
            won = self.rule.stopped(self.table).winner
            lead = Lead.of(pairs(self.table[[0, won]]))
            facts |= {"winner": self.entrants[won], "ahead": lead.mean, "error": lead.error,
                      "pairs": lead.pairs}  # fmt: skip
        return facts

    def end(self, trust: ModelTrust | None) -> Figures:
        """Let the winner be the policy, if what all races showed of both speaks for it too.

        The winner of a race is flattered by being the winner. The policy has run in more of them.
        Where the model's order of the challengers that it proposed may be chance (``trust``), the
        winner has to be clearly ahead.
        """
        if self.rule is None:
            return {}
        trusted = trust is not None and trust.better_than_chance
        rule = self.rule if trusted else replace(self.rule, final=self.rule.errors)
        winner = self.entrants[rule.stopped(self.table).winner]
        mine, other = (self.trees[one].sure_worth(self._price) for one in (self.incumbent, winner))
        if other > mine:
            self.incumbent = winner
        self.rule, self._next = None, None
        facts: Figures = {"policy": self.incumbent}
        if trust is not None:
            facts.update(trust.figures())
        return facts

    def take_up(self, looks: Sequence[int], table: Table) -> None:
        """Let a race be under way."""
        prices = tuple(self._price * n_leaves(self.trees[one].tree) for one in self.entrants)
        self.rule = Ahead(
            looks=tuple(looks),
            errors=SURE,
            final=0.0,
            patient=True,
            rare_losses=False,
            prices=prices,
        )
        self.table = table

    def _call(self) -> None:
        """Find the next episode that has to be run."""
        if self.rule is None:
            return
        self._next = next_episode(self.rule, self.table)
        while self._next is not None and (known := self._known(*self._next)) is not None:
            self._tell(self._next, known)
            self._next = next_episode(self.rule, self.table)

    def _known(self, entrant: int, number: int) -> float | None:
        tree, history = self.trees[self.entrants[entrant]].tree, self._experience.history
        for _, _, first in (run for run in self._run if run[1] == number):
            rows = self._experience.episode_from(first)
            if self._students.agree(tree, history.observations[rows], history.actions[rows]):
                return self._experience.return_of(rows)
        return None

    def _tell(self, place: tuple[int, int], value: float) -> None:
        self.table[place] = value
        self.trees[self.entrants[place[0]]].returns.append(value)

    def race_state(self) -> Arrays:
        """Return the race under way as arrays; nothing between two."""
        if self.rule is None:
            return {}
        return {
            "race_returns": self.table,
            "race_looks": np.array(self.rule.looks, dtype=np.int64),
            "race_entrants": np.array(self.entrants, dtype=np.int64),
            "race_run": np.array(self._run, dtype=np.int64).reshape(-1, 3),
        }

    def take_back(self, state: State) -> None:
        """Go on with the race that was under way."""
        self.entrants = state["race_entrants"].tolist()
        self._run = [tuple(row) for row in state["race_run"].tolist()]
        self.take_up(state["race_looks"].tolist(), state["race_returns"].copy())
        self._call()
