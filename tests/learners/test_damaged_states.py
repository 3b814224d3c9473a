"""Whatever is done to one array of a stored state, it is refused or makes a learner that works.

Every array of every method is damaged in every way that its declaration speaks of: missing, shorter
and longer along each axis, empty, with an axis more, of other elements, and with elements out of
range. A declaration that says less than compiled loops trust shows here.
"""

import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from eutree.errors import FormatError
from eutree.learners import UTreeMethod
from eutree.learners.declared import Stored
from eutree.learners.planning import PlanningMethod
from eutree.learners.registry import METHODS, restored
from eutree.world_model.ensemble import EnsembleSettings
from eutree_lab.history_u_tree.method import HistoryUTreeMethod
from tests.damages import damages
from tests.learners.battery import FILE, SMALL, Case
from tests.worlds import Corridor, play

OTHERS = {
    "u-tree, bounded": UTreeMethod(gathering_episodes=4, max_transitions=60, solve_growth=1.2),
    "planning, bounded": PlanningMethod(gathering_episodes=4, max_transitions=90),
    "history-u-tree, with evidence": HistoryUTreeMethod(gathering_episodes=4, evidence=2.0),
    "distilled-dqn, in a race": replace(
        SMALL["distilled-dqn"],
        steps=900,
        teacher_share=0.1,
        dagger_share=0.1,
        world_model=EnsembleSettings(members=2, hidden=8, batch=16, updates=20, more_updates=5),
    ),
    "distilled-dqn, with sums": replace(
        SMALL["distilled-dqn"], sums=2, steps=900, teacher_share=0.1, dagger_share=0.1
    ),
}
NAMES = (*METHODS, *OTHERS)


@cache
def stored(name):
    """Return a case of a method, and a state of a learner of it that has lived."""
    method = OTHERS.get(name) or SMALL.get(name) or METHODS[name]()
    case = Case.of(method, "tree+demos" if "tree+demos" in method.needs.starts else "demos")
    learner = case.begun()
    for number in range(40 if name.endswith("race") else 8):
        play(learner, Corridor(), seed=100 + number)
        if number % 4 == 3 or name.endswith("race"):
            learner.update(np.random.default_rng(number))
        if "race_returns" in learner.state() and number > 20:
            break
    return case, {name: np.array(array) for name, array in learner.state().items()}


def outcome(case, state):
    """Return whether a state is refused; raise whatever comes of a learner that does not work."""
    try:
        learner = restored(FILE, state, case.method, case.problem, case.start)
    except FormatError as error:
        clear = str(error).startswith(str(FILE)) and error.place and error.reason
        if not clear:
            raise AssertionError(f"unclear: {error}") from error
        return "refused"
    learner.decisions()
    learner.state()
    play(learner, Corridor(), seed=3)
    return "works"


def damaged(case, state, names):
    """Return how often damage to the arrays of these names was refused, and how often not."""
    found = {"refused": 0, "works": 0}
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # sums of the largest numbers overflow
        for name in names:
            for damage, changed in damages(state[name]):
                other = {k: a for k, a in state.items() if k != name}
                if changed is not None:
                    other[name] = changed
                try:
                    found[outcome(case, other)] += 1
                except Exception as error:
                    raise AssertionError(f"{name}: {damage}: {error!r}") from error
    return found


@pytest.mark.promise(2)
@pytest.mark.parametrize("name", NAMES)
def test_every_damage_to_every_array_is_refused_or_makes_a_learner_that_works(name):
    case, state = stored(name)
    assert outcome(case, state) == "works"
    assert ("race_returns" in state and "model_weights" in state) == name.endswith("race")
    assert damaged(case, state, sorted(state))["refused"] > 10 * len(state)


class Trusting(UTreeMethod):
    """A method that says of one of its arrays only of which type it is."""

    def declared(self, problem, start):
        own = super().declared(problem, start)
        *parts, last = own.parts
        lax = last._replace(arrays={**last.arrays, "prior": Stored("i8", "Z")})
        return replace(own, parts=(*parts, lax))


def test_a_declaration_that_says_too_little_is_caught():
    case, state = stored("u-tree, bounded")
    lax = Trusting(gathering_episodes=4, max_transitions=60, solve_growth=1.2)
    with pytest.raises(AssertionError, match="prior"):
        damaged(replace(case, method=lax), state, ["prior"])


def test_a_run_that_asked_cannot_go_on():
    """What demonstrations it had asked for stands in the checkpoints of earlier releases."""
    case, state = stored("planning")
    none, some = (np.arange(n) for n in (0, 2))
    assert outcome(case, state | {"plan_assisted_episodes": none}) == "works"
    assert outcome(case, state | {"plan_assisted_episodes": some}) == "refused"
