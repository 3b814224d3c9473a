"""Where a learner begins, by name.

| start       | the paper's name | state tree at the start | history at the start |
|-------------|------------------|-------------------------|----------------------|
| nothing     | C. U-Tree        | a single leaf           | empty                |
| tree        | EU-Tree - DT     | the expert tree         | empty                |
| tree+demos  | EU-Tree          | the expert tree         | the demonstrations   |
| demos       | -                | a single leaf           | the demonstrations   |
| random-tree | -                | a random tree           | empty                |
"""

from dataclasses import replace
from typing import get_args

import numpy as np

from eutree.arrays import Floats
from eutree.data import Demonstrations, Episode
from eutree.errors import InvalidArgumentError
from eutree.learners.expert_tree import fit_expert_tree
from eutree.learners.learner import Problem, Start, StartName
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.validation import check_choice
from eutree.wording import counted

STARTS: tuple[str, ...] = get_args(StartName)
RANDOM_LEAVES = 16


def start_of(
    name: str | None,
    problem: Problem,
    *,
    demonstrations: Demonstrations | None = None,
    expert: TreePolicy | None = None,
    generator: np.random.Generator,
) -> Start:
    """Return a start.

    Args:
        name: Which; None takes all that is given.
        problem: What is learned.
        demonstrations: Episodes of an expert, in the features of the problem.
        expert: The expert tree; fitted to the demonstrations if it is needed and not given.
        generator: Source of a random tree.

    Raises:
        InvalidArgumentError: The start lacks what it needs.
    """
    if name is None:
        name = _most(demonstrations, expert)
    check_choice("start", name, STARTS)
    if name == "nothing":
        return Start()
    if name == "random-tree":
        low, high = _box(problem, demonstrations)
        return Start(random_tree(problem, low, high, generator), random=True)
    episodes: tuple[Episode, ...] = ()
    if name in ("tree+demos", "demos"):
        episodes = _needed(demonstrations, name).kept
    if name == "demos":
        return Start(episodes=episodes)
    if expert is None:
        expert = replace(
            fit_expert_tree(_needed(demonstrations, name)),
            history=problem.history,
            past_actions=problem.past_actions,
        )
    return Start(expert, episodes)


def random_tree(
    problem: Problem,
    low: Floats,
    high: Floats,
    generator: np.random.Generator,
    *,
    n_leaves: int = RANDOM_LEAVES,
) -> TreePolicy:
    """Return a tree of random cuts with random actions.

    Args:
        problem: What is learned.
        low: Smallest value of each feature, shape [d].
        high: Largest value of each feature, shape [d].
        generator: Source of the cuts and the actions.
        n_leaves: Number of leaves; fewer where no feature has two values.
    """
    tree = DecisionTree.single_leaf(problem.n_features)
    boxes = [(low, high)]
    while len(boxes) < n_leaves and (low < high).any():
        leaf = int(generator.integers(len(boxes)))
        below, above = boxes[leaf]
        feature = int(generator.choice(np.flatnonzero(low < high)))
        threshold = float(generator.uniform(below[feature], above[feature]))
        tree = tree.split(leaf, feature, threshold)
        left, right = above.copy(), below.copy()
        left[feature] = right[feature] = threshold
        boxes[leaf] = (below, left)
        boxes.append((right, above))
    return TreePolicy(
        tree=tree,
        actions=generator.integers(problem.n_actions, size=tree.n_leaves),
        schema=problem.schema,
        environment=problem.environment,
        history=problem.history,
        past_actions=problem.past_actions,
    )


def _box(problem: Problem, demonstrations: Demonstrations | None) -> tuple[Floats, Floats]:
    """Return the range of each feature: what was seen, or else what is possible."""
    if demonstrations is not None and demonstrations.n_transitions:
        seen = demonstrations.observations
        return seen.min(axis=0), seen.max(axis=0)
    low, high = problem.low, problem.high
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise InvalidArgumentError(
            "start 'random-tree' needs demonstrations where a feature has no bounds: random cuts "
            "must lie somewhere"
        )
    return low, high


def _most(demonstrations: Demonstrations | None, expert: TreePolicy | None) -> str:
    if demonstrations is not None:
        return "tree+demos"
    return "nothing" if expert is None else "tree"


def _needed(demonstrations: Demonstrations | None, name: str) -> Demonstrations:
    if demonstrations is None:
        raise InvalidArgumentError(f"start {name!r} needs demonstrations, got none")
    if not demonstrations.n_transitions:
        raise InvalidArgumentError(
            f"start {name!r} needs demonstrations of at least one transition, got "
            f"{counted(len(demonstrations), 'episode')} without a step"
        )
    return demonstrations
