"""Learn with a network, hand over a tree: a counted teacher, DAgger, imagined pruning, real races.

1. *Teacher.* A Double DQN learns the task, demonstrations in its replay. Its steps are counted.
2. *DAgger* (Ross, Gordon and Bagnell 2011). Large trees act, the teacher says what it would do.
3. *Rounds*, as long as steps are left. An ensemble of networks is fitted to all transitions so far.
   CART makes trees of two and three times the leaves allowed from all labelled observations, plain
   and weighted by what a wrong action costs (VIPER; Bastani et al. 2018), and each is pruned by
   imagined returns. They race against the policy in real episodes; the teacher labels what the
   rivals came to see, so the trees of the next round know more.
4. *Last races.* With what is left of the steps the best trees of all rounds meet again.

A race is made of ordinary episodes, in which the tree that runs decides, from starts that the
learner numbers: all entrants run from the same ones.

The policy changes only by winning a race. The network is never handed over.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eutree.errors import FormatError
from eutree.learners.contenders import unpacked_trees
from eutree.learners.distilled_dqn_choices import DistilledDQNChoices
from eutree.learners.distilled_dqn_learner import NUMBERS, DistilledDQNLearner, Stage
from eutree.learners.learner import Arrays, Needs, Problem, Start
from eutree.learners.stored_state import HISTORY_ARRAYS, part
from eutree.world_model import ActionTree
from eutree.world_model.action_trees import to_decision_tree


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

    def check_state(self, path: str | Path, state: Arrays, problem: Problem) -> None:
        """Raise FormatError unless ``restore`` can trust the state, which comes from a file."""
        try:
            check_arrays(state, problem)
        except (KeyError, ValueError, IndexError) as error:
            raise FormatError(path, "state", str(error)) from None


def _expected() -> dict[str, tuple[str, int]]:
    """Return the kind of elements and the number of axes of each array."""
    found = {name: (kind, len(axes)) for name, (kind, axes) in HISTORY_ARRAYS.items()}
    found |= {"numbers": ("i", 1), "history_demonstrated": ("b", 1)}
    found |= {f"teacher_{name}": ("i", 1) for name in ("known", "updates")}
    weights = ("online", "target", "average", "mean", "square")
    found |= {f"teacher_{name}": ("f", 1) for name in weights}
    for prefix in ("contender_", "student_"):
        found |= {f"{prefix}{name}": ("i", 1) for name in (*ActionTree._fields, "n_nodes")}
        found |= {f"{prefix}threshold": ("f", 1)}
    found |= {f"contender_{name}": ("i", 1) for name in ("origin", "n_returns")}
    found |= {f"contender_{name}": ("f", 1) for name in ("imagined", "returns")}
    return found


_ARRAYS = _expected()


def check_arrays(state: Arrays, problem: Problem) -> None:
    """Raise ValueError unless all that compiled loops index with lies within what is indexed."""
    for name, (kind, n_axes) in _ARRAYS.items():
        if name in state or not name.startswith(("teacher_", "history_demonstrated")):
            found = state[name]
            right = (found.dtype.kind, found.ndim) == (kind, n_axes)
            _check(right, f"{name} must have {n_axes} axes of kind {kind!r}, got {found.ndim} of "
                   f"{found.dtype.kind!r}")  # fmt: skip
    d, n_actions = problem.n_features, problem.n_actions
    n = len(state["history_rewards"])
    for name in ("observations", "next_observations"):
        _check(state[f"history_{name}"].shape == (n, d), f"history_{name} has another shape")
        _check(bool(np.isfinite(state[f"history_{name}"]).all()), f"history_{name} is not finite")
    for name in ("actions", "episodes", "continues", "terminal"):
        _check(state[f"history_{name}"].shape == (n,), f"history_{name} has another shape")
    _within("history_actions", state["history_actions"], n_actions)
    _check(bool((np.diff(state["history_episodes"]) >= 0).all()), "history_episodes must ascend")
    trees = [*unpacked_trees(part(state, "contender_")), *unpacked_trees(part(state, "student_"))]
    for tree in trees:
        _, actions = to_decision_tree(tree, d)  # which checks features and children
        _within("an action of a tree", actions, n_actions)
    n_contenders = len(state["contender_n_nodes"])
    _check(state["numbers"].shape == (len(NUMBERS),), "numbers has another shape")
    numbers = dict(zip(NUMBERS, state["numbers"].tolist(), strict=True))
    _within("incumbent", np.array([numbers["incumbent"]]), n_contenders)
    _within("stage", np.array([numbers["stage"]]), len(Stage))
    _within("labelled_from", np.array([numbers["labelled_from"]]), n + 1)
    if "teacher_known" in state:
        _within("teacher_known", state["teacher_known"], n + 1)
    _within("origins", state["contender_origin"], 4)
    if "race_returns" in state:
        _within("race_entrants", state["race_entrants"], n_contenders)
        expected = (len(state["race_entrants"]), int(state["race_looks"].max(initial=0)))
        _check(state["race_returns"].shape == expected, "race_returns has another shape")
        _within("race_run", state["race_run"][:, 2], n)


def _check(holds: bool, message: str) -> None:
    if not holds:
        raise ValueError(message)


def _within(name: str, values: NDArray[Any], size: int) -> None:
    inside = bool(((values >= 0) & (values < size)).all())
    _check(inside, f"{name} must lie in 0..{size - 1}")
