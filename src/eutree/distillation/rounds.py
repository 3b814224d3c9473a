"""The rounds of a distillation: its settings, what observations weigh, the fits, and the report."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers
from eutree.c45 import grow
from eutree.compression.candidates import Costs, Prunings, merged
from eutree.errors import InvalidArgumentError, MissingExtraError
from eutree.evaluation import Interval
from eutree.policies import TreePolicy
from eutree.policies.sklearn_tree import exact_tree
from eutree.schema import EnvironmentSpec, Schema
from eutree.trees import DecisionTree
from eutree.validation import check_choice, check_integer

# CART (Breiman et al. 1984) is scikit-learn's: it grows best first up to the limit. C4.5 has no
# limit: its tree is cut back to the best pruning of that size, by the weight of wrong decisions.


METHODS = ("dagger", "viper", "cloning")


@dataclass(frozen=True, kw_only=True)
class DistillationSettings:
    """How a teacher is distilled.

    Attributes:
        method: ``"cloning"`` fits one tree to the teacher's own episodes; ``"dagger"`` and
            ``"viper"`` go on to fit trees to what the trees themselves come to.
        learner: ``"c4.5"``, or ``"cart"`` (extra ``sklearn``).
        max_leaves: Most leaves of the tree; None for what the learner makes.
        iterations: Trees that are fitted, the first to the teacher's episodes alone.
        episodes: Episodes gathered before each tree.
        validation_episodes: Episodes of the validation of each tree.

    Raises:
        InvalidArgumentError: One of them is not as described.
    """

    method: str = "dagger"
    learner: str = "c4.5"
    max_leaves: int | None = 32
    iterations: int = 10
    episodes: int = 10
    validation_episodes: int = 50

    def __post_init__(self) -> None:
        check_choice("method", self.method, METHODS)
        check_choice("learner", self.learner, LEARNERS)
        check_integer("iterations", self.iterations, low=1)
        check_integer("episodes", self.episodes, low=1)
        check_integer("validation_episodes", self.validation_episodes, low=2)
        if self.max_leaves is not None:
            check_integer("max_leaves", self.max_leaves, low=1)

    @property
    def rounds(self) -> int:
        """Trees that are fitted."""
        return 1 if self.method == "cloning" else self.iterations


# Bastani et al. (2018): a wrong decision costs V(o) - Q(o, a) under the teacher's values, at most
# V(o) - min_a Q(o, a). Observations at which every action is as good as another do not matter.


ActionValues = Callable[[Floats], ArrayLike]  # observations [N, d] -> Q [N, A]
Stakes = Callable[[Floats], Floats]  # observations [N, d] -> [N]


def stakes_of(teacher: Any, action_values: ActionValues | None, n_actions: int) -> Stakes | None:
    """Return what is at stake by the teacher's values; None if it has none.

    Looked for, in this order: ``action_values``, a method ``action_values`` of the teacher, the
    values of the leaves of a ``TreePolicy``.
    """
    values = action_values or getattr(teacher, "action_values", None)
    if values is not None:
        return lambda observations: _gap(values(observations), (len(observations), n_actions))
    if _has_gaps(teacher):
        return lambda observations: Costs.of(teacher, observations, "q-gap").of_action.max(axis=1)
    return None


def weights(stakes: Floats) -> Floats:
    """Return the stakes as weights of mean 1; all 1 if nothing is at stake anywhere."""
    total = float(stakes.sum())
    return stakes * (stakes.size / total) if total > 0.0 else np.ones_like(stakes)


def _gap(values: ArrayLike, shape: tuple[int, int]) -> Floats:
    """Return max_a Q - min_a Q of each row."""
    table = np.asarray(values, dtype=np.float64)
    if table.shape != shape or not np.isfinite(table).all():
        raise InvalidArgumentError(
            f"action_values must return finite numbers of shape {shape}, got shape {table.shape}"
        )
    gap: Floats = table.max(axis=1) - table.min(axis=1)
    return gap


def _has_gaps(teacher: Any) -> bool:
    """Return whether a teacher is a tree whose leaves compare actions by what decides."""
    if not isinstance(teacher, TreePolicy) or teacher.history:
        return False
    return teacher.leaves is not None and teacher.leaves.compares_actions


LEARNERS = ("c4.5", "cart")


@dataclass(frozen=True, eq=False)
class Labelled:
    """Observations with the teacher's action on each.

    Attributes:
        observations: What was sensed.
        actions: What the teacher does there.
        weights: How much a wrong decision counts.
    """

    observations: Floats  # [N, d]
    actions: Integers  # [N]
    weights: Floats  # [N]


def fit(
    learner: str,
    data: Labelled,
    schema: Schema,
    environment: EnvironmentSpec | None,
    max_leaves: int | None,
) -> TreePolicy:
    """Return the tree that a learner makes of labelled observations; equal siblings are joined."""
    make = _c45 if learner == "c4.5" else _cart
    tree, actions = make(data, schema.n_actions, max_leaves)
    policy = merged(TreePolicy(tree, actions, schema, environment))
    if max_leaves is None or policy.n_leaves <= max_leaves:
        return policy
    of_action = np.repeat(data.weights[:, np.newaxis], schema.n_actions, axis=1)  # [N, A]
    of_action[np.arange(data.actions.size), data.actions] = 0.0
    costs = Costs(data.observations, of_action, float(data.weights.sum()))
    return merged(Prunings(policy, costs).of_size(max_leaves))


def _c45(data: Labelled, n_actions: int, max_leaves: int | None) -> tuple[DecisionTree, Integers]:
    grown = grow(data.observations, data.actions, n_classes=n_actions, weights=data.weights)
    return grown.to_decision_tree()


def _cart(data: Labelled, n_actions: int, max_leaves: int | None) -> tuple[DecisionTree, Integers]:
    """Return CART's tree, which decides as scikit-learn's does on every finite observation."""
    try:
        from sklearn.tree import DecisionTreeClassifier
    except ImportError as error:
        raise MissingExtraError("scikit-learn", "sklearn") from error
    limit = max_leaves if max_leaves != 1 else 2  # it knows no tree of one leaf
    model = DecisionTreeClassifier(max_leaf_nodes=limit, random_state=0)
    model.fit(data.observations, data.actions, sample_weight=data.weights)
    tree, leaves = exact_tree(model)
    return tree, model.classes_[model.tree_.value[leaves, 0, :].argmax(axis=1)].astype(np.int64)


@dataclass(frozen=True)
class Round:
    """One tree of a distillation.

    Attributes:
        n_transitions: Labelled observations that the tree was fitted to.
        n_leaves: Leaves of the tree.
        agreement: Share of them on which the tree decides as the teacher does.
        mean_return: Mean return of the validation episodes.
    """

    n_transitions: int
    n_leaves: int
    agreement: float
    mean_return: float


@dataclass(frozen=True)
class DistillationReport:
    """What a distillation did.

    Attributes:
        method: ``"cloning"``, ``"dagger"`` or ``"viper"``.
        learner: ``"cart"`` or ``"c4.5"``.
        rounds: Every tree, in the order in which they were fitted.
        best: Number of the round whose tree was returned.
        return_interval: 95 % interval of its mean return. The mean of the best of many is a
            little too high: evaluate the tree on episodes of its own.
        labels: Observations with an action of the teacher.
        environment_steps: All steps: the demonstrations', the trees' and those of validation.
        validation_steps: Those of validation.
        teacher_steps: Those in which the teacher was trained before, none of the above; None where
            it does not say so itself (``num_timesteps``, as models of SB3 do).
        weighted: Whether observations were weighted by the teacher's action values.
    """

    method: str
    learner: str
    rounds: tuple[Round, ...]
    best: int
    return_interval: Interval
    labels: int
    environment_steps: int
    validation_steps: int
    weighted: bool
    teacher_steps: int | None = None

    @property
    def n_leaves(self) -> int:
        """Leaves of the returned tree."""
        return self.rounds[self.best].n_leaves

    @property
    def mean_return(self) -> float:
        """Mean return of the returned tree's validation episodes."""
        return self.rounds[self.best].mean_return
