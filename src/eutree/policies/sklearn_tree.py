"""Trees of scikit-learn's ``DecisionTreeClassifier`` as trees of ours, with the same decisions.

scikit-learn rounds an observation to float32 and compares that with a float64 threshold t; we
compare float64. Rounding keeps the order, so the observations that go left are those up to a
largest one, and that is our threshold: the middle between the largest float32 number up to t and
the next one, or the float64 number just below where the middle itself is rounded up.
"""

from typing import Any

import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.policies.document import PolicyParts
from eutree.policies.leaf_statistics import LeafStatistics
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from eutree.validation import elsewhere

_LEAF = -1  # scikit-learn's children of a leaf


def parts_of(classifier: Any, schema: Schema | None) -> PolicyParts:
    """Return the parts of the ``TreePolicy`` that decides like a fitted classifier.

    Raises:
        InvalidArgumentError: It is no fitted classifier of one output, or the schema is another's.
        UnknownNameError: A class of the classifier is no action of the schema.
    """
    grown = getattr(classifier, "tree_", None)
    if grown is None or not hasattr(classifier, "classes_") or not hasattr(grown, "children_left"):
        raise InvalidArgumentError(
            "classifier must be a fitted sklearn.tree.DecisionTreeClassifier, got "
            f"{type(classifier).__name__}"
        )
    if grown.n_outputs != 1:
        raise InvalidArgumentError(
            f"classifier must have one output, got {grown.n_outputs}: a policy has one action"
        )
    if schema is None:
        schema = _schema(classifier)
    elif schema.n_features != grown.n_features:
        raise InvalidArgumentError(
            f"schema must name the classifier's {grown.n_features} features, "
            f"got {schema.n_features}"
        )
    names = schema.feature_names
    labels = [str(label) for label in getattr(classifier, "feature_names_in_", ())]
    given = [one if one in names else Feature.from_label(one).name for one in labels]
    if elsewhere(given, names):
        raise InvalidArgumentError(
            f"schema must have its features in the order of the classifier's, {labels}, got "
            f"{list(names)}"
        )
    tree, leaves = exact_tree(classifier)
    shares = grown.value[leaves, 0, :]  # [L, n_classes]
    numbers = _numbers(classifier.classes_, schema)
    return PolicyParts(
        tree=tree,
        actions=numbers[shares.argmax(axis=1)],
        schema=schema,
        leaves=_statistics(grown, shares, leaves, numbers, schema.n_actions),
    )


def exact_tree(classifier: Any) -> tuple[DecisionTree, Booleans]:
    """Return the tree that decides like a fitted classifier on every finite observation.

    Its leaves are numbered in the order of scikit-learn's nodes. With it comes which of these nodes
    are leaves, shape [M].
    """
    grown = classifier.tree_
    inner = grown.children_left != _LEAF
    leaf = np.full(grown.node_count, DecisionTree.NO_LEAF)
    leaf[~inner] = np.arange(int((~inner).sum()))
    tree = DecisionTree(
        int(grown.n_features),
        feature=np.where(inner, grown.feature, DecisionTree.NO_FEATURE),
        threshold=float64_thresholds(np.where(inner, grown.threshold, np.nan)),
        left=np.where(inner, grown.children_left, DecisionTree.NO_NODE),
        right=np.where(inner, grown.children_right, DecisionTree.NO_NODE),
        leaf=leaf,
    )
    return tree, ~inner


def float64_thresholds(thresholds: Floats) -> Floats:
    """Return the largest float64 numbers that in float32 are at most the thresholds; NaN stays."""
    with np.errstate(over="ignore"):
        below = thresholds.astype(np.float32)
        below = np.where(below > thresholds, np.nextafter(below, np.float32(-np.inf)), below)
        above = np.nextafter(below, np.float32(np.inf))
        # Beyond the largest number float32 would have 2**128, had it room for it.
        ends = [np.clip(end.astype(np.float64), -(2.0**128), 2.0**128) for end in (below, above)]
        middle = (ends[0] + ends[1]) / 2
        rounds_down = middle.astype(np.float32) <= thresholds
    result: Floats = np.where(rounds_down, middle, np.nextafter(middle, -np.inf))
    return np.where(np.isnan(thresholds), np.nan, result)


def _schema(classifier: Any) -> Schema:
    numbered = [f"x{number}" for number in range(classifier.tree_.n_features)]
    names = getattr(classifier, "feature_names_in_", numbered)
    actions = tuple(str(label) for label in classifier.classes_.tolist())
    return Schema(tuple(Feature(str(name)) for name in names), actions)


def _numbers(classes: Any, schema: Schema) -> Any:
    """Return the action of each class: classes are numbers of actions, or else their names.

    A number may be the name of another action, too; demonstrations hold numbers.
    """
    labels, numbers = classes.tolist(), range(schema.n_actions)
    if all(label in numbers for label in labels):
        return np.array(labels, dtype=np.int64)
    strange = [label for label in labels if str(label) not in schema.actions]
    if strange:  # what is no number either, before others
        raise UnknownNameError("class", str(min(strange, key=numbers.__contains__)), schema.actions)
    return np.array([schema.actions.index(str(label)) for label in labels], dtype=np.int64)


def _statistics(
    grown: Any, shares: Floats, leaves: Any, numbers: Any, n_actions: int
) -> LeafStatistics | None:
    """Return how many rows of each class were in each leaf; None where rows had weights."""
    sizes = grown.n_node_samples[leaves]
    if not np.array_equal(sizes, grown.weighted_n_node_samples[leaves]):
        return None
    visits = np.zeros((len(sizes), n_actions), dtype=np.int64)
    visits[:, numbers] = np.rint(shares * sizes[:, np.newaxis]).astype(np.int64)
    unknown = np.full(visits.shape, np.nan)
    return LeafStatistics(visits, unknown, unknown)
