"""Where a learner begins, by name.

| start       | the paper's name | state tree at the start | history at the start |
|-------------|------------------|-------------------------|----------------------|
| nothing     | C. U-Tree        | a single leaf           | empty                |
| tree        | EU-Tree - DT     | the expert tree         | empty                |
| tree+demos  | EU-Tree          | the expert tree         | the demonstrations   |
| demos       | -                | a single leaf           | the demonstrations   |
| random-tree | -                | a random tree           | empty                |
"""

from dataclasses import dataclass, replace
from itertools import product
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Floats, Integers
from eutree.c45 import C45Settings, grow, warn_of_light
from eutree.data import Demonstrations, Episode
from eutree.data.demonstrations import check_shown, lesson_masks, lessons, taught_in, weights_in
from eutree.data.episode import CUT, allowed_in
from eutree.display import counted
from eutree.errors import InvalidArgumentError
from eutree.learners.learner import Decisions, Problem, Start, StartName
from eutree.policies import LeafStatistics, TreePolicy
from eutree.policies.reach import among_allowed, within_kinds
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes
from eutree.validation import check_choice, check_kind, check_vector

RELEASE_8 = C45Settings()


def fit_expert_tree(
    demonstrations: Demonstrations,
    *,
    settings: C45Settings = RELEASE_8,
    weights: ArrayLike | None = None,
) -> TreePolicy:
    """Return the policy that C4.5 learns from demonstrations: observations to the expert's actions.

    Args:
        demonstrations: Episodes recorded under the expert, at least one step in all.
        settings: The choices of C4.5; release 8 by default.
        weights: Weight of each transition, in the order of ``demonstrations.observations``; None
            takes ``Episode.weights``.

    Raises:
        InvalidArgumentError: If there is no transition, or weights do not fit.
    """
    check_shown(demonstrations)
    observations, taught = lessons(demonstrations)
    if not len(taught):
        raise InvalidArgumentError("demonstrations must not be cut altogether: nothing is left")
    given = weights_in(demonstrations) if weights is None else weights
    weighed = check_vector("weights", given, size=demonstrations.n_transitions)
    check_kind("settings", settings, C45Settings)
    if weights is not None:
        warn_of_light(weighed, settings.min_objects)
    weighed, n = weighed[taught_in(demonstrations) != CUT], demonstrations.schema.n_actions
    grown = grow(observations, taught, n_classes=n, weights=weighed, settings=settings)
    tree, actions = grown.to_decision_tree()
    policy = TreePolicy(tree, actions, demonstrations.schema, demonstrations.environment)
    policy, allowed = within_kinds(policy), allowed_in(demonstrations)
    if allowed is None:
        return policy
    policy = falling_back(policy, observations, taught)
    return among_allowed(policy, demonstrations.observations, allowed)


def shown_in(policy: TreePolicy, demonstrations: Demonstrations, *, free: bool = False) -> Integers:
    """Return how often each action was shown in each leaf, or where its own was free, [L, A]."""
    known = demonstrations.with_history(policy.history)
    return _counts(policy, *lessons(known), lesson_masks(known) if free else None)


def _counts(
    policy: TreePolicy, observations: Floats, actions: Integers, masks: Booleans | None = None
) -> Integers:
    leaves = policy.tree.leaf_index(observations)
    counts = np.zeros((policy.n_leaves, policy.schema.n_actions), dtype=np.int64)
    times = 1 if masks is None else masks[np.arange(leaves.size), policy.actions[leaves]]
    np.add.at(counts, (leaves, actions), times)
    return counts


def falling_back(policy: TreePolicy, observations: Floats, actions: Integers) -> TreePolicy:
    """Return the policy; where its own action is masked, a leaf takes what was shown in it most."""
    visits = _counts(policy, observations, actions)
    unknown = np.full(visits.shape, np.nan)
    return replace(policy, leaves=LeafStatistics(visits, unknown, unknown))


# The expert trees of release 8 come first. Its penalty for cuts of continuous attributes,
# log2(tries) / N off the gain, is meant for many cases; in the few dozen steps at a place where a
# person waits it forbids the test that says when to go on. So it may be off, m may be larger
# against careless keys, CF smaller. One previous observation as features shows what moves where.


FOLDS = 5  # of whole episodes
SETTINGS = tuple(
    C45Settings(use_penalty=penalty, min_objects=least, confidence=confidence, collapse=collapse)
    for penalty, least, confidence, collapse in (
        *product((True, False), (2, 4, 8), (0.25, 0.05), (True,)),
        (False, 2, 0.25, False),
    )
)


@dataclass(frozen=True, eq=False)
class FittedTree:
    """A tree to choose, and how it was made."""

    policy: TreePolicy  # the tree
    settings: C45Settings  # the choices of C4.5 that made it
    correct: Floats  # [E] share of an episode's steps that a tree of the others decides as shown
    repairs: tuple[str, ...] = ()  # the changes of the tree since, in words

    def __str__(self) -> str:
        """Return how the tree was made, in words."""
        chosen = self.settings
        parts = []
        if not chosen.use_penalty:
            parts.append("without the penalty for continuous cuts")
        if not chosen.collapse:
            parts.append("without collapsing")
        if not chosen.prune:
            parts.append("without pruning")
        elif chosen.confidence != RELEASE_8.confidence:
            parts.append(f"CF {chosen.confidence:g}")
        if chosen.min_objects != RELEASE_8.min_objects:
            parts.append(f"m {chosen.min_objects:g}")
        if n := self.policy.history:
            more = f"{n} previous observations"
            parts.append(f"with {'one previous observation' if n == 1 else more}")
        return ", ".join(["C4.5" if parts else "C4.5 of release 8", *parts, *self.repairs])


def fitted_trees(
    demonstrations: Demonstrations, *, settings: tuple[C45Settings, ...], histories: tuple[int, ...]
) -> list[FittedTree]:
    """Return the different trees of these settings, each with its cross-validation.

    Of two settings or numbers of previous observations that give the same tree the first counts.
    """
    found: dict[bytes, FittedTree] = {}
    for history in histories:
        known = demonstrations.with_history(history) if history else demonstrations
        for chosen in settings:
            policy = replace(fit_expert_tree(known, settings=chosen), history=history)
            key = policy.to_bytes()
            if key not in found:
                found[key] = FittedTree(policy, chosen, _correct(known, chosen))
    return list(found.values())


def promising(found: list[FittedTree], most: int) -> list[FittedTree]:
    """Return the first tree and the best others by episodes left out, at most ``most``.

    One with more previous observations than the first is among them only if it explains the
    actions left out better than the best one that has as few, by more than a standard error of the
    paired difference.
    """
    first = found[0]
    simple = [entry for entry in found if entry.policy.history == first.policy.history]
    best = max(simple, key=_share_correct)
    further = [entry for entry in found if entry not in simple and _explains_more(entry, best)]
    ordered = sorted([*simple, *further], key=_share_correct, reverse=True)
    return [first, *(entry for entry in ordered if entry is not first)][:most]


def best_left_out(found: list[FittedTree]) -> FittedTree:
    """Return the tree that decides most like the episodes left out: ``fit`` without playing.

    Of one with more previous observations than the first the same is asked as by ``promising``.
    """
    return max(promising(found, len(found)), key=_share_correct)


def _share_correct(fitted: FittedTree) -> float:
    return float(fitted.correct.mean())


def _explains_more(other: FittedTree, best: FittedTree) -> bool:
    gain = other.correct - best.correct
    return bool(gain.mean() > gain.std() / np.sqrt(gain.size))


def _correct(demonstrations: Demonstrations, settings: C45Settings) -> Floats:
    """Return the share of each episode's steps that a tree without it decides as shown, [E]."""
    episodes = [episode for episode in demonstrations if (episode.taught != CUT).any()]
    correct = np.zeros(len(episodes))
    n_folds = min(FOLDS, len(episodes))
    for fold in range(n_folds):
        rest = tuple(e for number, e in enumerate(episodes) if number % n_folds != fold)
        if not rest:  # a single episode: nothing is left to learn from
            return np.ones(1)
        tree = fit_expert_tree(replace(demonstrations, episodes=rest), settings=settings)
        for number in range(fold, len(episodes), n_folds):
            episode = episodes[number]
            decided = tree.decide(episode.observations[:-1], episode.allowed)
            correct[number] = (decided == episode.taught)[episode.taught != CUT].mean()
    return correct


STARTS: tuple[str, ...] = get_args(StartName)
RANDOM_LEAVES = 16


def start_of(
    name: str | None,  # None takes all that is given
    problem: Problem,
    *,
    demonstrations: Demonstrations | None = None,  # in the features of the problem
    expert: TreePolicy | None = None,  # if needed and not given, fitted to the demonstrations
    generator: np.random.Generator,  # of a random tree
) -> Start:
    """Return a start.

    Raises:
        InvalidArgumentError: The start lacks something that it needs.
    """
    if name is None:
        least = "nothing" if expert is None else "tree"
        name = least if demonstrations is None else "tree+demos"
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
    problem: Problem, low: Floats, high: Floats, generator: np.random.Generator
) -> TreePolicy:
    """Return a tree of ``RANDOM_LEAVES`` leaves, or fewer, with random actions.

    Its cuts lie between the smallest and the largest value of each feature, shape [d].
    """
    tree = DecisionTree.single_leaf(problem.n_features)
    while tree.n_leaves < RANDOM_LEAVES and (low < high).any():
        leaf = int(generator.integers(tree.n_leaves))
        feature = int(generator.choice(np.flatnonzero(low < high)))
        below, above = (box[leaf, feature] for box in leaf_boxes(tree))
        ends = max(below, low[feature]), min(above, high[feature])
        tree = tree.split(leaf, feature, float(generator.uniform(*ends)))
    actions = generator.integers(problem.n_actions, size=tree.n_leaves)
    return Decisions(tree, actions).policy(problem)


def _box(problem: Problem, demonstrations: Demonstrations | None) -> tuple[Floats, Floats]:
    """Return the range of each feature: the observed one, or else the possible one."""
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


def _needed(demonstrations: Demonstrations | None, name: str) -> Demonstrations:
    if demonstrations is None:
        raise InvalidArgumentError(f"start {name!r} needs demonstrations, got none")
    if not demonstrations.n_transitions:
        raise InvalidArgumentError(
            f"start {name!r} needs demonstrations of at least one transition, got "
            f"{counted(len(demonstrations), 'episode')} without a step"
        )
    return demonstrations
