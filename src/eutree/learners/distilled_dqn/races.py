"""Rivals of the policy: trees of CART, pruned by imagined returns, and their real races.

The trees of all rounds that wanted the place of the policy are kept. A race is made of ordinary
episodes, from starts that the learner numbers: all entrants run from the same ones. The episodes
of another tree that decides alike throughout are known and not run again.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eutree.contests import Ahead, Table, new_table, next_episode
from eutree.contests.rules import Lead
from eutree.contests.table import pairs
from eutree.learners.declared import State
from eutree.learners.distilled_dqn.teaching import Experience, Students
from eutree.learners.learner import Arrays, Figures
from eutree.policy_search.model_trust import ModelTrust
from eutree.world_model import ActionTree
from eutree.world_model.action_trees import n_leaves
from eutree.world_model.ensemble import Ensemble, EnsembleSettings, fit_ensemble
from eutree.world_model.ensemble_rollouts import EnsembleRollouts, pruned_by_rollouts

ORIGINS = ("start", "cart", "pruned", "pruned-weighted")
UNKNOWN = float("nan")


@dataclass
class Contender:
    """A tree that is, was or may become the policy.

    Attributes:
        tree: The tree.
        origin: How it was made: the start, CART as it is, or pruned by imagined returns from a
            plain or from a weighted CART.
        imagined: Its score in the latest world model; NaN before the first.
        returns: Its returns in all races so far.
    """

    tree: ActionTree
    origin: str
    imagined: float = UNKNOWN
    returns: list[float] = field(default_factory=list)

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


def packed_contenders(contenders: Sequence[Contender]) -> dict[str, NDArray[Any]]:
    """Return contenders as arrays."""
    trees = packed_trees([one.tree for one in contenders])
    return trees | {
        "origin": np.array([ORIGINS.index(one.origin) for one in contenders], dtype=np.int64),
        "imagined": np.array([one.imagined for one in contenders]),
        "n_returns": np.array([len(one.returns) for one in contenders], dtype=np.int64),
        "returns": np.array([r for one in contenders for r in one.returns], dtype=np.float64),
    }


def unpacked_contenders(state: Mapping[str, NDArray[Any]]) -> list[Contender]:
    """Return the contenders that ``packed_contenders`` made arrays of."""
    ends = np.cumsum(state["n_returns"])[:-1]
    returns = np.split(state["returns"], ends)
    return [
        Contender(tree, ORIGINS[origin], imagined, earned.tolist())
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
# Several times the leaves allowed, and whether CART was weighted; the first are made first.
PRUNED = ((3, True), (3, False), (2, False), (3, True), (3, False), (2, True))
PARTS = (1, 2, 4)  # of the leaves allowed: what CART's own trees have that race
FEW_RETURNS = 4  # below which a contender's mean says nothing


class ImaginedRivals:
    """A world model, and the trees that it speaks for.

    Args:
        settings: How the model is fitted.
        students: The teacher's labels, and trees that copy them.
        experience: What the model is fitted to.
        n_actions: Number of actions.
        max_leaves: Most leaves of a rival.

    Attributes:
        ensemble: The model; None before it is first fitted.
    """

    def __init__(
        self,
        settings: EnsembleSettings,
        students: Students,
        experience: Experience,
        n_actions: int,
        max_leaves: int,
    ) -> None:
        self._settings = settings
        self._students = students
        self._experience = experience
        self._n_actions = n_actions
        self._max_leaves = max_leaves
        self.ensemble: Ensemble | None = None

    def make(self, n: int, generator: np.random.Generator) -> list[Contender]:
        """Fit the model to all that is known; return CART's trees and ``n`` pruned ones."""
        data = self._experience.transitions(self._n_actions)
        if self.ensemble is None:
            self.ensemble = fit_ensemble(data, self._settings, generator)
        else:
            self.ensemble = self.ensemble.fitted_on(data, generator)
        observations = self._experience.history.observations
        sizes = sorted({max(self._max_leaves // part, 2) for part in PARTS}, reverse=True)
        rivals = [Contender(self._students.fit(observations, n), "cart") for n in sizes]
        for times, weighted in PRUNED[:n]:
            leaves = times * self._max_leaves
            large = self._students.fit(observations, leaves, weighted=weighted)
            rollouts = EnsembleRollouts(self.ensemble, N_STARTS, generator)
            tree, score = pruned_by_rollouts(large, rollouts, self._max_leaves, generator)
            rivals.append(Contender(tree, "pruned-weighted" if weighted else "pruned", score))
        return rivals

    def imagine(
        self, contenders: Sequence[Contender], policy: ActionTree, generator: np.random.Generator
    ) -> None:
        """Score all contenders in the same imagined episodes, which chose none of them."""
        if self.ensemble is None:
            return
        rollouts = EnsembleRollouts(self.ensemble, N_STARTS, generator)
        rollouts.run(policy)
        for one in contenders:
            one.imagined = rollouts.score(rollouts.returns_of(one.tree))

    def trust(self, contenders: Sequence[Contender]) -> ModelTrust | None:
        """Return how the model orders the trees that were really run; None without a model."""
        if self.ensemble is None:
            return None
        met = [one for one in contenders if len(one.returns) >= FEW_RETURNS]
        return ModelTrust(
            np.array([one.imagined for one in met]),
            np.array([one.mean_return for one in met]),
            np.array([len(one.returns) for one in met], dtype=np.int64),
        )

    def ensemble_of(self, state: Arrays) -> Ensemble:
        """Return the model whose ``state()`` this was."""
        return Ensemble.from_state(state, self._settings, self._n_actions)


SURE = 2.0  # standard errors that end a race, and that win where its rivals cannot be trusted
MANY_RETURNS = 12  # below which a contender's mean says little
ROW_OF_RACE = 10_000  # starts of one race are numbered from this times the race's number on


class ContenderRaces:
    """All contenders of one learner, and their races.

    Args:
        first: What the learner starts with: the policy.
        experience: Where the episodes of the races are stored.
        students: Says what a tree does.
        price: Return that a leaf must earn.

    Attributes:
        contenders: The start and all trees that raced or are to race.
        incumbent: Number of the contender that is the policy.
        entrants: Numbers of those in the present race, the incumbent first.
        rule: What decides the race under way; None between two.
        table: The returns of its entrants so far, shape [entrants, starts].
        number: Races so far.
    """

    def __init__(
        self, first: Contender, experience: Experience, students: Students, price: float
    ) -> None:
        self._experience = experience
        self._price = price
        self._students = students
        self.contenders = [first]
        self.incumbent = 0
        self.entrants: list[int] = []
        self.rule: Ahead | None = None
        self.table = new_table(0, 0)
        self.number = 0
        self._run: list[tuple[int, int, int]] = []  # entrant, number, first row of each heat
        self._heat: tuple[int, int] | None = None

    @property
    def policy(self) -> ActionTree:
        """The incumbent's tree."""
        return self.contenders[self.incumbent].tree

    @property
    def running(self) -> ActionTree:
        """The tree that decides in the present episode."""
        if self._heat is None:
            return self.policy
        return self.contenders[self.entrants[self._heat[0]]].tree

    @property
    def is_run(self) -> bool:
        """Whether no heat of the race is left to run."""
        return self._heat is None

    def next_start(self) -> int | None:
        """Return the number of the start of the next episode; None if any will do."""
        return None if self._heat is None else ROW_OF_RACE * self.number + self._heat[1]

    def best(self, n: int) -> list[int]:
        """Return the rivals that earned most, leaves paid for, among those that ran often enough.

        The incumbent may be one of the ``n``, and is left out.
        """
        known = [i for i, c in enumerate(self.contenders) if len(c.returns) >= MANY_RETURNS]
        most = sorted(known, key=lambda i: -self.contenders[i].worth(self._price))[:n]
        return [one for one in most if one != self.incumbent]

    def begin(self, rivals: Sequence[int], looks: Sequence[int]) -> None:
        """Begin a race of the policy with these rivals."""
        self.entrants = [self.incumbent, *rivals]
        self.take_up(looks, new_table(len(self.entrants), looks[-1]))
        self.number += 1
        self._run = []
        self._call()

    def last_episode_was_heat(self) -> Figures:
        """Take the last episode as a heat of the race, and find the next one.

        Returns:
            What was run, and the result if it was the last heat; nothing between two races.
        """
        heat = self._heat
        if heat is None:
            return {}
        rows = self._experience.last()
        value = self._experience.return_of(rows)
        entrant = self.entrants[heat[0]]
        facts: Figures = {
            "race": self.number,
            "entrant": entrant,
            "origin": self.contenders[entrant].origin,
            "start": heat[1],
            "return": value,
        }
        self._run.append((*heat, rows.start))
        self._tell(heat, value)
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
        Of rivals that a model proposed whose order may be chance, one has to be clearly ahead.

        Args:
            trust: How the model that proposed the rivals orders trees.
        """
        if self.rule is None:
            return {}
        trusted = trust is not None and trust.better_than_chance
        rule = self.rule if trusted else replace(self.rule, final=self.rule.errors)
        rival = self.entrants[rule.stopped(self.table).winner]
        mine, other = (
            self.contenders[one].sure_worth(self._price) for one in (self.incumbent, rival)
        )
        if other > mine:
            self.incumbent = rival
        self.rule, self._heat = None, None
        facts: Figures = {"policy": self.incumbent}
        if trust is not None:
            facts.update(trust.figures())
        return facts

    def take_up(self, looks: Sequence[int], table: Table) -> None:
        """Let a race be under way."""
        leaves = (n_leaves(self.contenders[one].tree) for one in self.entrants)
        prices = tuple(self._price * n for n in leaves)
        self.rule = Ahead(looks=tuple(looks), errors=SURE, final=0.0, patient=True, prices=prices)
        self.table = table

    def _call(self) -> None:
        """Find the next heat that has to be run."""
        if self.rule is None:
            return
        self._heat = next_episode(self.rule, self.table)
        while self._heat is not None and (known := self._known(*self._heat)) is not None:
            self._tell(self._heat, known)
            self._heat = next_episode(self.rule, self.table)

    def _known(self, entrant: int, number: int) -> float | None:
        tree, history = self.contenders[self.entrants[entrant]].tree, self._experience.history
        for _, _, first in (heat for heat in self._run if heat[1] == number):
            rows = self._experience.episode_from(first)
            if self._students.agree(tree, history.observations[rows], history.actions[rows]):
                return self._experience.return_of(rows)
        return None

    def _tell(self, heat: tuple[int, int], value: float) -> None:
        self.table[heat] = value
        self.contenders[self.entrants[heat[0]]].returns.append(value)

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
