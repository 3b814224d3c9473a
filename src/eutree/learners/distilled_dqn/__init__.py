"""Learn with a network, hand over a tree: a counted teacher, DAgger, imagined pruning, real races.

1. *Teacher.* A Double DQN learns the task, demonstrations in its replay. Its steps are counted.
   With ``learning_share`` it goes on learning from what trees do in the stages that follow.
2. *DAgger* (Ross, Gordon and Bagnell 2011). Large trees act, the teacher says what it would do.
3. *Rounds*, as long as steps are left. An ensemble of networks is fitted to all transitions so far.
   CART makes trees of two and three times the leaves allowed from all labelled observations, plain
   and weighted by what a wrong action costs (VIPER; Bastani et al. 2018), and each is pruned by
   imagined returns. They race against the policy in real episodes; the teacher labels what the
   challengers came to see, so the trees of the next round know more.
4. *Last races.* With what is left of the steps the best trees of all rounds meet again.

A race is made of ordinary episodes, in which the tree that runs decides, from starts that the
learner numbers: all entrants run from the same ones.

The policy changes only by winning a race. The network is never handed over.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from eutree.learners.declared import (
    HISTORY_PART,
    MASKS_PART,
    MOST,
    SHOWN_PART,
    Declared,
    Found,
    Part,
    Stored,
    packed_trees_part,
)
from eutree.learners.distilled_dqn.learner import NUMBERS, DistilledDQNLearner, Stage
from eutree.learners.distilled_dqn.races import ORIGINS, RACED_TREE
from eutree.learners.distilled_dqn.teaching import DistilledDQNChoices
from eutree.learners.learner import Arrays, Needs, Problem, Start
from eutree.neural.double_dqn import n_weights
from eutree.world_model.ensemble import N_KINDS


@dataclass(frozen=True, kw_only=True)
class DistilledDQN(DistilledDQNChoices):
    """The method; see ``DistilledDQNChoices`` for its choices."""

    name: ClassVar[str] = "distilled-dqn"
    needs: ClassVar[Needs] = Needs(
        gathering=True, starts=("demos", "tree+demos"), asks_teacher=True
    )
    gathering_episodes: ClassVar[int] = 1

    def start(self, problem: Problem, start: Start) -> "DistilledDQNLearner":
        """Return a learner at its start."""
        return DistilledDQNLearner(self, problem, start)

    def restore(self, problem: Problem, start: Start, state: Arrays) -> "DistilledDQNLearner":
        """Return the learner whose ``state()`` this was; it goes on to the same bytes."""
        learner = DistilledDQNLearner(self, problem, start)
        learner.take_back(state)
        return learner

    def declared(self, problem: Problem, start: Start) -> Declared:
        """Return what the arrays of a ``state()`` are."""
        history = (HISTORY_PART, SHOWN_PART, MASKS_PART)
        teacher = () if start.teacher is not None else (self._teacher_part(problem),)
        trees = (packed_trees_part(RACED_TREE, "T"), packed_trees_part("student_", 1))
        model = self._model_part(problem)
        parts = (*history, *teacher, *trees, _RACED_TREES, _numbers_part(start), model, _RACE)
        return problem.declare(*parts)

    def _teacher_part(self, problem: Problem) -> Part:
        """Return what is stored of a network that teaches."""
        outputs = problem.n_actions * self.teacher.quantiles
        size = n_weights(problem.n_features, self.teacher.hidden, outputs)
        weights = ("online", "target", "average", "mean", "square")
        arrays = {f"teacher_{name}": Stored("f4", (size,)) for name in weights}
        arrays["teacher_square"] = Stored("f4", (size,), low=0)
        arrays["teacher_known"] = Stored("i8", "1", low=0, most="history_n_episodes")
        arrays["teacher_updates"] = Stored("i8", "1", low=0, most=MOST)
        return Part(arrays)

    def _model_part(self, problem: Problem) -> Part:
        """Return what is stored of the world model, once it is fitted."""
        settings = self.world_model
        seen = problem.n_features * (1 + settings.memory)
        size = n_weights(seen + problem.n_actions, settings.hidden, 2 * problem.n_features + 5)
        return Part({
            "model_centre": Stored("f8", (seen,)),
            "model_spread": Stored("f8", (seen,), low=0),
            "model_move": Stored("f8", "d", low=0),
            "model_moves": Stored("f8", "d2"),
            "model_binary": Stored("b1", "d"),
            "model_low": Stored("f8", "d"),
            "model_high": Stored("f8", "d"),
            "model_earned": Stored("f8", (N_KINDS, 4)),
            "model_weights": Stored("f4", (settings.members, size)),
            "model_starts": Stored("f8", "Bd"),
            "model_horizon": Stored("i8", "1", low=1, most=MOST),
            "model_returns": Stored("f8", "2"),
        }, _is_model, optional=True)  # fmt: skip


def _is_model(found: Found) -> None:
    if not found.sizes["B"]:
        raise found.refuse("model_starts", "must be at least one")
    if (found.state["model_spread"] == 0.0).any():
        raise found.refuse("model_spread", "must be positive")


def _numbers_part(start: Start) -> Part:
    """Return where the learner stands; demonstrations are a part of all that it has lived."""
    n_shown = sum(map(len, start.episodes))

    def are_numbers(found: Found) -> None:
        numbers = dict(zip(NUMBERS, found.state["numbers"].tolist(), strict=True))
        most = {"stage": len(Stage) - 1, "labelled_from": found.sizes["N"],
                "incumbent": found.sizes["T"] - 1, "n_races": 2**31}  # fmt: skip
        for name, value in numbers.items():
            if not 0 <= value <= most.get(name, MOST):
                raise found.refuse("numbers", f"{name} must be in 0..{most.get(name, MOST)}")
        if found.sizes["N"] < n_shown or found.value("history_n_episodes") < len(start.episodes):
            raise found.refuse("history_rewards", f"must begin with the {n_shown} demonstrated")

    return Part({"numbers": Stored("i8", (len(NUMBERS),))}, are_numbers)


def _are_raced(found: Found) -> None:
    if sum(found.state[f"{RACED_TREE}n_returns"].tolist()) != found.sizes["earned"]:
        raise found.refuse(f"{RACED_TREE}n_returns", "must be as many as there are returns")


_RACED_TREES = Part(
    {
        f"{RACED_TREE}returns": Stored("f8", ("earned",)),
        f"{RACED_TREE}n_returns": Stored("i8", "T", low=0, most="earned"),
        f"{RACED_TREE}origin": Stored("i8", "T", low=0, below=len(ORIGINS)),
        f"{RACED_TREE}imagined": Stored("f8", "T", nan=True),
    },
    _are_raced,
)


def _is_race(found: Found) -> None:
    looks, run = found.state["race_looks"], found.state["race_run"]
    if not len(looks) or (np.diff(looks, prepend=0) < 1).any() or looks[-1] != found.sizes["X"]:
        raise found.refuse("race_looks", f"must ascend from 1 to {found.sizes['X']}, the episodes")
    if found.sizes["R"] < 2:
        raise found.refuse("race_entrants", "must be at least two")
    for column, below in enumerate((found.sizes["R"], found.sizes["X"], found.sizes["N"])):
        if (run[:, column] >= below).any():
            raise found.refuse("race_run", f"column {column} must be in 0..{below - 1}")


_RACE = Part(
    {
        "race_returns": Stored("f8", "RX", nan=True),
        "race_entrants": Stored("i8", "R", low=0, below="T"),
        "race_looks": Stored("i8", "K", low=1, most="X"),
        "race_run": Stored("i8", "Q3", low=0, most=MOST),
    },
    _is_race,
    optional=True,
)


__all__ = ["DistilledDQN"]
