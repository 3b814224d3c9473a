"""Say where the CPU time of a run of distilled-dqn went.

Run: python benchmarks/small_trees_costs.py TASK RUN

RUN is the folder of a run that small_trees.py kept (`--runs`). Each part is timed by itself on that
run's transitions, and multiplied by how often the run did it. What is left of the run's own CPU
time is acting and storing, step by step.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from benchmarks.small_trees import TASKS, Task, events_of, policy_of, raced_trees_of

import eutree
from eutree.learners.distilled_dqn.teaching import Students
from eutree.neural import DoubleDQN, Scaling
from eutree.training import stored_transitions
from eutree.world_model import Transitions
from eutree.world_model.ensemble import fit_ensemble
from eutree.world_model.ensemble_rollouts import EnsembleRollouts, pruned_by_rollouts

UPDATES = 500  # that are timed
LABELLED = 100_000  # transitions that CART is timed on, about what a middle round has
STARTS = 50  # of imagined episodes, as the method has them
TIMES = 3  # leaves before a pruning, in those allowed


@dataclass(frozen=True)
class Part:
    """A part of a run: how often it was done, and the CPU seconds of once."""

    name: str
    times: int
    seconds: float


class Timed:
    """The parts of a run, timed by themselves.

    Args:
        task: The run's task.
        folder: Where it is.
    """

    def __init__(self, task: Task, folder: Path) -> None:
        self._task, self._events = task, events_of(folder)
        self._method = task.method(task.leaves)
        self._policy = policy_of(folder)
        self._known = stored_transitions(folder, self._policy.schema.n_actions)
        met = raced_trees_of(folder)
        self._n_pruned = sum(one.origin.startswith("pruned") for one in met)
        self._generator = np.random.default_rng(0)

    def parts(self) -> list[Part]:
        """Return all parts."""
        teacher = _teacher(self._known, self._method.teacher, self._generator)
        return [self._teaching(teacher), self._modelling(), *self._pruning(teacher), self._acting()]

    def _teaching(self, teacher: DoubleDQN) -> Part:
        updates = max(event.get("updates", 0) for event in self._events)
        teacher.update(1, self._generator)  # compiles
        seconds = _seconds(lambda: teacher.update(UPDATES, self._generator))
        return Part("updates of the teacher", updates, seconds / UPDATES)

    def _modelling(self) -> Part:
        settings = self._method.world_model
        rounds = len({e["race"] for e in self._events if e.get("stage") == "race" and "race" in e})
        few, more = (replace(settings, updates=n) for n in (1, 1 + UPDATES))
        fit_ensemble(self._known, few, self._generator)  # compiles
        once, many = (
            _seconds(lambda of=of: fit_ensemble(self._known, of, self._generator))
            for of in (few, more)
        )
        updates = settings.updates + (rounds - 1) * settings.more_updates
        return Part("updates of the world model's networks", updates, (many - once) / UPDATES)

    def _pruning(self, teacher: DoubleDQN) -> list[Part]:
        rows, limit = self._known.observations[-LABELLED:], self._task.leaves
        students = Students(teacher.action_values, self._known.n_actions)
        large = students.fit(rows, TIMES * limit)  # which asks the teacher, and compiles
        growing = _seconds(lambda: students.fit(rows, TIMES * limit))
        settings = replace(self._method.world_model, updates=UPDATES)
        ensemble = fit_ensemble(self._known, settings, self._generator)
        rollouts = EnsembleRollouts(ensemble, STARTS, self._generator)
        pruned_by_rollouts(large, rollouts, TIMES * limit - 1, self._generator)  # compiles
        seconds = _seconds(lambda: pruned_by_rollouts(large, rollouts, limit, self._generator))
        return [
            Part(f"CART with {TIMES * limit} leaves", self._n_pruned, growing),
            Part("prunings by imagined returns", self._n_pruned, seconds),
        ]

    def _acting(self) -> Part:
        env = gymnasium.make(self._task.env)
        begin = time.process_time()
        found = eutree.evaluate(self._policy, env, episodes=10, seed=1)
        seconds = time.process_time() - begin
        steps = self._events[-1]["steps"]
        return Part("steps of the environment under a tree", steps, seconds / found.lengths.sum())


def _teacher(known: Transitions, settings: Any, generator: np.random.Generator) -> DoubleDQN:
    """Return a teacher to be, with all transitions in its replay."""
    teacher = DoubleDQN(
        settings,
        Scaling.of(known.observations),
        known.n_actions,
        reward_scale=0.1,
        updates=UPDATES,
        generator=generator,
    )
    observations = np.concatenate([known.observations, known.next_observations[-1:]])
    teacher.add(observations, known.actions, known.rewards, terminated=False)
    return teacher


def _seconds(run: Callable[[], Any]) -> float:
    """Return the CPU seconds that a call takes."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def table(parts: list[Part]) -> str:
    """Return the parts as a table."""
    lines = ["| part | how often | CPU ms each | CPU s in all |", "|---|---|---|---|"]
    lines += [
        f"| {of.name} | {of.times:,} | {1000 * of.seconds:.3g} | {of.times * of.seconds:.0f} |"
        for of in parts
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=list(TASKS))
    parser.add_argument("run", type=Path)
    options = parser.parse_args()
    print(table(Timed(TASKS[options.task], options.run).parts()))


if __name__ == "__main__":
    main()
