"""The policy, the trees of all rounds that wanted its place, and the race under way.

A race is made of ordinary episodes, from starts that the learner numbers: all entrants run from
the same ones. What another tree ran, deciding alike throughout, is known and not run again.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eutree.contests import Ahead, Table, new_table, next_episode
from eutree.contests.ahead import Lead
from eutree.contests.table import pairs
from eutree.learners.declared import part, prefixed
from eutree.learners.distilled_dqn.contenders import (
    Contender,
    packed_contenders,
    unpacked_contenders,
)
from eutree.learners.distilled_dqn.experience import Experience
from eutree.learners.distilled_dqn.students import Students
from eutree.learners.learner import Arrays, Figures
from eutree.learners.model_trust import ModelTrust
from eutree.world_model import ActionTree
from eutree.world_model.action_trees import n_leaves

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

    def contenders_state(self) -> Arrays:
        """Return the contenders as arrays."""
        return prefixed("contender_", packed_contenders(self.contenders))

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

    def take_back(self, state: Arrays, *, incumbent: int, number: int) -> None:
        """Go on from both states."""
        self.incumbent, self.number = incumbent, number
        self.contenders = unpacked_contenders(part(state, "contender_"))
        if "race_returns" in state:
            self.entrants = state["race_entrants"].tolist()
            self._run = [tuple(row) for row in state["race_run"].tolist()]
            self.take_up(state["race_looks"].tolist(), state["race_returns"].copy())
            self._call()
