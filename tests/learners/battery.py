"""Cases of the battery that every learner passes."""

from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from eutree.learners import Problem, Start
from eutree.learners.declared import taken
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.learners.registry import METHODS
from eutree.learners.starts import start_of
from eutree.neural import DoubleDQNSettings
from eutree.world_model.ensemble import EnsembleSettings
from tests.worlds import Corridor, play, problem_of, recorded

EPISODES = 12


FILE = Path("checkpoint.npz")


SMALL = {  # methods whose default choices are too much for a toy world
    "distilled-dqn": DistilledDQN(
        max_leaves=4,
        demonstration_updates=50,
        teacher=DoubleDQNSettings(hidden=16, batch=16),
        world_model=EnsembleSettings(members=2, hidden=16, batch=32, updates=100, more_updates=50),
    )
}


@dataclass(frozen=True, eq=False)
class Case:
    """A method in the corridor, whose position is multiplied by ``scale``."""

    method: Any
    problem: Problem
    start: Start
    scale: float = 1.0

    @classmethod
    def of(cls, method, start_name, scale=1.0) -> "Case":
        problem = problem_of(Corridor(scale))
        chance = np.random.default_rng(7)
        shown = recorded(scale)
        start = start_of(start_name, problem, demonstrations=shown, generator=chance)
        return cls(method, problem, start, scale)

    def begun(self) -> Any:
        return self.method.start(self.problem, self.start)

    def lived(self, episodes=EPISODES) -> Any:
        """Return a learner after some episodes and the updates between them."""
        learner = self.begun()
        for number in range(episodes):
            play(learner, Corridor(self.scale), seed=100 + number)
            if (number + 1) % 4 == 0:
                learner.update(np.random.default_rng(number))
        return learner

    @cached_property
    def life(self) -> Any:
        """A learner that has lived; only to be looked at."""
        return self.lived()

    @cached_property
    def scaled(self) -> "Case":
        """The same in another unit of the position."""
        return Case.of(self.method, self.start.name, 4.0)


@cache
def case_of(name: str, start_name: str) -> Case:
    return Case.of(SMALL.get(name) or METHODS[name](), start_name)


def checked_state(path, state, method, problem, start):
    """Return a stored state if it is what the method declares."""
    return taken(path, state, method.declared(problem, start))
