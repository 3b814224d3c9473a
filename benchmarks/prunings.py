"""Measure what trees pruned by imagined returns earn, and what the trees they are cut from copy.

Run: python benchmarks/prunings.py LunarLander-v3 [--seeds 1001 1002] [--steps 500000]
     [--leaves 32] [--prunings 3] [--episodes 160] [--tried 24] [--best 5]
     [--out docs/results/prunings.csv]

A run of ``distilled-dqn`` with the settings of the task stops where it would propose challengers
for the second time. Its world model learns from all that it has lived; then trees of each recipe
are pruned in it: once of labels of DAgger's observations alone, and once of all, the challengers'
of the first race too. Every tree plays the same real episodes, whose steps no run counts. A row is
a tree; the means are printed.
``--tried`` and ``--best`` are the cuts that a pruning looks at before it makes one, and those that
it compares on all imagined episodes. Seeds from 1000 to 1999 are for tuning.
"""

import argparse
import csv
import time
from itertools import groupby, product
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from benchmarks.table import Cell, Learning, Settings

import eutree
from eutree.interaction.making import make
from eutree.learners.distilled_dqn.learner import DistilledDQNLearner
from eutree.learners.distilled_dqn.races import N_STARTS, RECIPES
from eutree.learners.episode_buffer import transitions_of
from eutree.schema import EnvironmentSpec
from eutree.world_model import ActionTree, ensemble_rollouts
from eutree.world_model.action_trees import to_decision_tree
from eutree.world_model.ensemble_rollouts import EnsembleRollouts, pruned_by_rollouts

COLUMNS = ("task", "steps", "leaves", "seed", "labels", "times", "weighted", "tried", "best",
           "imagined", "return", "error", "cpu_s")  # fmt: skip
FIRST_EPISODE = 555_000  # seed of the real episodes


class ProposedError(Exception):
    """The run is where its challengers are made; it carries the learner and its generator."""

    def __init__(self, learner: DistilledDQNLearner, generator: np.random.Generator) -> None:
        super().__init__()
        self.learner, self.generator = learner, generator


def learner_at(
    cell: Cell, env: Any, settings: Settings
) -> tuple[DistilledDQNLearner, np.random.Generator]:
    """Return the learner of a run, and its generator, before it proposes for the second time."""
    made = []
    propose = DistilledDQNLearner._propose

    def stop(learner: DistilledDQNLearner, generator: np.random.Generator) -> Any:
        made.append(learner)
        if len(made) == 2:
            raise ProposedError(learner, generator)
        return propose(learner, generator)

    try:
        with mock.patch.object(DistilledDQNLearner, "_propose", stop):
            Learning(cell, env, settings).result()
    except ProposedError as error:
        return error.learner, error.generator
    raise SystemExit(f"{cell}: {len(made)} proposals were made, two are needed")


def rows_of_run(cell: Cell, arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Return a row for each tree that is pruned from what one run knows."""
    settings = Settings.of(cell.task)
    env = make(EnvironmentSpec(cell.task, settings.arguments))
    learner, generator = learner_at(cell, env, settings)
    challengers, students = learner.challengers, learner._students
    dagger = learner._experience.n_shown + learner.dagger.round_from
    known = transitions_of(learner.history, learner._problem.n_actions)
    assert challengers.ensemble is not None  # of the first proposal
    model = challengers.ensemble.fitted_on(known, generator)
    whole = learner.history.observations
    found = []
    for labels, rows in (("dagger", whole[:dagger]), ("all", whole)):
        students.begin(learner.dagger.labelled_from)
        judge = EnsembleRollouts(model, N_STARTS, generator)
        judge.run(students.fit(rows, cell.leaves))
        large = {recipe: challengers.to_prune(recipe, rows) for recipe in RECIPES}
        for recipe, _ in product(RECIPES, range(arguments.prunings)):
            begin = time.process_time()
            rollouts = EnsembleRollouts(model, N_STARTS, generator)
            tree, _ = pruned_by_rollouts(large[recipe], rollouts, cell.leaves, generator)
            spent = time.process_time() - begin
            imagined = judge.score_of(tree)
            returns = earned(tree, learner, env, arguments.episodes)
            found.append({
                "task": cell.task, "steps": cell.steps, "leaves": cell.leaves, "seed": cell.seed,
                "labels": labels, "times": recipe[0], "weighted": int(recipe[1]),
                "tried": arguments.tried, "best": arguments.best, "imagined": round(imagined, 1),
                "return": round(float(returns.mean()), 1),
                "error": round(float(returns.std(ddof=1) / np.sqrt(returns.size)), 1),
                "cpu_s": round(spent, 1),
            })  # fmt: skip
            print(*(f"{key}={found[-1][key]}" for key in COLUMNS), flush=True)
    return found


def earned(tree: ActionTree, learner: DistilledDQNLearner, env: Any, episodes: int) -> np.ndarray:
    """Return a tree's returns in real episodes, the same for all trees."""
    d, n_actions = learner._problem.n_features, learner._problem.n_actions
    policy = eutree.TreePolicy(*to_decision_tree(tree, d), eutree.Schema.anonymous(d, n_actions))
    return eutree.evaluate(policy, env, episodes=episodes, seed=FIRST_EPISODE).returns


def means(rows: list[dict[str, Any]]) -> None:
    """Print what trees of each kind earn on average, and how far apart they are."""
    for of in (("labels",), ("seed", "labels"), ("seed", "labels", "times", "weighted")):

        def key(row: dict[str, Any], of: tuple[str, ...] = of) -> tuple[Any, ...]:
            return tuple(row[name] for name in of)

        for group, members in groupby(sorted(rows, key=key), key=key):
            returns = np.array([float(row["return"]) for row in members])
            print(*group, f"{returns.size} trees, {returns.mean():.0f}, best {returns.max():.0f}, "
                  f"standard deviation {returns.std(ddof=1):.0f}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("task")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1001, 1002])
    parser.add_argument("--steps", type=int, default=500_000)
    parser.add_argument("--leaves", type=int, default=32)
    parser.add_argument("--prunings", type=int, default=3)
    parser.add_argument("--episodes", type=int, default=160)
    parser.add_argument("--tried", type=int, default=ensemble_rollouts.TRIED)
    parser.add_argument("--best", type=int, default=ensemble_rollouts.BEST)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    ensemble_rollouts.TRIED, ensemble_rollouts.BEST = arguments.tried, arguments.best
    rows = []
    for seed in arguments.seeds:
        cell = Cell("eutree", arguments.task, arguments.steps, arguments.leaves, seed)
        rows += rows_of_run(cell, arguments)
    if arguments.out is not None:
        with arguments.out.open("w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    means(rows)


if __name__ == "__main__":
    main()
