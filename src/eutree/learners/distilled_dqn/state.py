"""The state of a learner of ``distilled-dqn``, as its checkpoints keep it."""

from enum import IntEnum

import numpy as np

from eutree.learners.declared import MOST, Found, Part, Stored, history_parts, packed_trees_part
from eutree.learners.distilled_dqn.races import (
    ORIGINS,
    RACED_TREE,
    Races,
    packed_raced,
    packed_trees,
    unpacked_raced,
    unpacked_trees,
)
from eutree.learners.distilled_dqn.sums import Sums
from eutree.learners.learner import Start
from eutree.neural import DoubleDQN
from eutree.neural.double_dqn import n_weights
from eutree.world_model.ensemble import N_KINDS, Ensemble, EnsembleSettings


class Stage(IntEnum):
    """Where a learner is."""

    TEACHER = 0
    DAGGER = 1
    RACE = 2
    LAST_RACE = 3


NUMBERS = (
    "steps", "stage", "dagger.labelled_from", "dagger.round_from", "races.incumbent", "races.number"
)  # fmt: skip


def _are_numbers(found: Found) -> None:
    """Demonstrations are a part of all that a learner has lived."""
    most = (MOST, len(Stage) - 1, found.sizes["N"], MOST, found.sizes["T"] - 1, 2**31)
    for name, number, bound in zip(NUMBERS, found.state["numbers"].tolist(), most, strict=True):
        if not 0 <= number <= bound:
            raise found.refuse("numbers", f"{name} must be in 0..{bound}")
    n_shown = found.sizes["shown"]
    if found.sizes["N"] < n_shown or found.value("history_n_episodes") < found.sizes["n_shown"]:
        raise found.refuse("history_rewards", f"must begin with the {n_shown} demonstrated")


def sizes_with(sums: int, d: int, n_actions: int, model: EnsembleSettings) -> dict[str, int]:
    """Return the sizes of a state that depend on how many sums stand behind the features."""
    f = d + sums
    seen = f * (1 + model.memory)
    return {"f": f, "seen": seen, "member": n_weights(seen + n_actions, model.hidden, 2 * f + 5)}


def _are_raced(found: Found) -> None:
    if sum(found.state[f"{RACED_TREE}n_returns"].tolist()) != found.sizes["earned"]:
        raise found.refuse(f"{RACED_TREE}n_returns", "must be as many as there are returns")


def _is_model(found: Found) -> None:
    if not found.sizes["B"]:
        raise found.refuse("model_starts", "must be at least one")
    if (found.state["model_spread"] == 0.0).any():
        raise found.refuse("model_spread", "must be positive")


def _is_race(found: Found) -> None:
    looks, run = found.state["race_looks"], found.state["race_run"]
    if not len(looks) or (np.diff(looks, prepend=0) < 1).any() or looks[-1] != found.sizes["X"]:
        raise found.refuse("race_looks", f"must ascend from 1 to {found.sizes['X']}, the episodes")
    if found.sizes["R"] < 2:
        raise found.refuse("race_entrants", "must be at least two")
    for column, below in enumerate((found.sizes["R"], found.sizes["X"], found.sizes["N"])):
        if (run[:, column] >= below).any():
            raise found.refuse("race_run", f"column {column} must be in 0..{below - 1}")


_WEIGHTS = Stored("f4", ("weights",))
_TEACHER = Part(
    {
        "teacher_known": Stored("i8", "1", low=0, most="history_n_episodes", at="network.known"),
        "teacher_updates": Stored("i8", "1", low=0, most=MOST),
        **{f"teacher_{name}": _WEIGHTS for name in ("online", "target", "average", "mean")},
        "teacher_square": _WEIGHTS._replace(low=0),
    },
    at="network.policy",
    prefix="teacher_",
    save=DoubleDQN.state,
    make=lambda learner, state: learner.network.take_back(state, learner.history),
)
_RACED_TREES = Part(
    {
        f"{RACED_TREE}returns": Stored("f8", ("earned",)),
        f"{RACED_TREE}n_returns": Stored("i8", "T", low=0, most="earned"),
        f"{RACED_TREE}origin": Stored("i8", "T", low=0, below=len(ORIGINS)),
        f"{RACED_TREE}imagined": Stored("f8", "T", nan=True),
    },
    _are_raced,
    at="races.trees",
    prefix=RACED_TREE,
    save=packed_raced,
    make=lambda _, state: unpacked_raced(state),
)
_STUDENT = packed_trees_part("student_", 1)._replace(
    at="dagger.tree",
    prefix="student_",
    save=lambda tree: packed_trees([tree]),
    make=lambda learner, state: learner.dagger.take_back(*unpacked_trees(state)),
)
_MODEL = Part(
    {
        "model_centre": Stored("f8", ("seen",)),
        "model_spread": Stored("f8", ("seen",), low=0),
        "model_move": Stored("f8", "f", low=0),
        "model_moves": Stored("f8", "f2"),
        "model_binary": Stored("b1", "f"),
        "model_low": Stored("f8", "f"),
        "model_high": Stored("f8", "f"),
        "model_earned": Stored("f8", (N_KINDS, 4)),
        "model_weights": Stored("f4", ("members", "member")),
        "model_starts": Stored("f8", "Bf"),
        "model_horizon": Stored("i8", "1", low=1, most=MOST),
        "model_returns": Stored("f8", "2"),
    },
    _is_model,
    optional=True,  # before it is fitted
    at="challengers.ensemble",
    prefix="model_",
    save=Ensemble.state,
    make=lambda learner, state: learner.challengers.ensemble_of(state),
)
_CIRCLES = Part(
    {"model_circles": Stored("i8", ("circles", 2), low=0, below="f")},
    optional=True,  # in runs before version 0.3
)
_RACE = Part(
    {
        "race_returns": Stored("f8", "RX", nan=True),
        "race_entrants": Stored("i8", "R", low=0, below="T"),
        "race_looks": Stored("i8", "K", low=1, most="X"),
        "race_run": Stored("i8", "Q3", low=0, most=MOST),
    },
    _is_race,
    optional=True,
    at="races",
    save=Races.race_state,
    make=lambda learner, state: learner.races.take_back(state),
)
_NUMBERS_PART = Part({"numbers": Stored("i8", (len(NUMBERS),), at=" ".join(NUMBERS))}, _are_numbers)


def sums_part(most: int, model: EnsembleSettings) -> Part:
    """Return the weights of the sums; what comes after them has features of its own for these."""

    def are_sums(found: Found) -> None:
        n = found.sizes["sums"]
        if n > most:
            raise found.refuse("sums", f"must be at most {most}, got {n}")
        d, n_actions = found.sizes["d"], found.sizes["A"]
        found.sizes.update(sizes_with(n, d, n_actions, model))

    return Part(
        {"sums": Stored("f8", ("sums", "d"))},
        are_sums,
        optional=True,  # before they are looked for
        at="_students.sums",
        save=lambda sums: {"sums": sums.weights},
        make=lambda _, state: Sums(state["sums"]),
    )


def parts_of(start: Start, most_sums: int, model: EnsembleSettings) -> tuple[Part, ...]:
    """Return the parts of a learner's state; a teacher that was given is given again."""
    teacher = () if start.teacher is not None else (_TEACHER,)
    raced = packed_trees_part(RACED_TREE, "T"), _RACED_TREES
    history = history_parts("_experience.history")
    return (
        *history,
        sums_part(most_sums, model),
        *teacher,
        *raced,
        _NUMBERS_PART,
        _STUDENT,
        _MODEL,
        _CIRCLES,
        _RACE,
    )
