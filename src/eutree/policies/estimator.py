"""A policy as a scikit-learn classifier; needs the extra ``sklearn``."""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Floats, Int32s, Integers
from eutree.errors import InvalidArgumentError, needed
from eutree.policies.tree_policy import TreePolicy
from eutree.validation import check_choice, check_kind, columns_of

with needed("scikit-learn", "sklearn"):
    from sklearn.base import BaseEstimator, ClassifierMixin
    from sklearn.tree import DecisionTreeClassifier
    from sklearn.tree._tree import Tree
    from sklearn.utils.metaestimators import available_if
    from sklearn.utils.validation import _check_n_features, check_array, check_consistent_length


class TreePolicyClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # sklearn has no types
    """A finished policy where scikit-learn wants a classifier: pipelines, scores, inspection.

    The tree is never changed: ``fit`` only checks its arguments, so that ``cross_val_score`` scores
    the same policy on each part. Numbers are compared in float64 and NaN takes the "no" branch, as
    in the policy.

    Args:
        policy: The policy; its features are the columns, history included.
        labels: Whether classes are the actions' numbers (``"number"``) or their names
            (``"name"``).

    Attributes:
        classes_: The classes, sorted: all actions of the policy's schema.
        n_features_in_: Number of columns.
        feature_names_in_: Their names.

    >>> import numpy as np
    >>> from eutree import Schema, TreePolicy, TreePolicyClassifier, DecisionTree
    >>> tree = DecisionTree.single_leaf(1).split(0, 0, 2.5)
    >>> policy = TreePolicy(tree, np.array([1, 0]), Schema.anonymous(1, 2))
    >>> TreePolicyClassifier(policy).fit().predict([[2.4], [2.6]])
    array([1, 0])
    """

    def __init__(self, policy: TreePolicy, *, labels: Literal["number", "name"] = "number") -> None:
        self.policy = policy
        self.labels = labels

    def __sklearn_tags__(self) -> Any:
        """Return scikit-learn's tags: NaN is welcome."""
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.requires_fit = False
        return tags

    def __sklearn_is_fitted__(self) -> bool:
        """Return True: there is nothing to learn."""
        return True

    @property
    def classes_(self) -> NDArray[Any]:
        """The classes, sorted."""
        return self._sorted()[0]

    @property
    def n_features_in_(self) -> int:
        """Number of columns."""
        return self._policy().tree.n_features

    @property
    def feature_names_in_(self) -> NDArray[Any]:
        """Names of the columns."""
        return np.array(self._policy().schema.feature_names, dtype=object)

    def fit(
        self,
        X: ArrayLike | None = None,
        y: ArrayLike | None = None,
        sample_weight: ArrayLike | None = None,
    ) -> "TreePolicyClassifier":
        """Learn nothing; check that the policy fits the data, if any is given.

        Args:
            X: Shape [N, d].
            y: Classes, shape [N].
            sample_weight: Not used.

        Raises:
            InvalidArgumentError: ``y`` holds a value that is no action of the policy.
            ValueError: ``X`` and ``y`` have different numbers of rows.
        """
        if X is not None:
            check_consistent_length(self._rows(X), y)
        if y is not None:
            strange = np.setdiff1d(np.asarray(y), self.classes_)
            if strange.size:
                raise InvalidArgumentError(
                    f"y must hold actions of the policy, {self.classes_.tolist()}, "
                    f"got {strange[:5].tolist()}"
                )
        return self

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Return the policy's action for each row, shape [N]."""
        actions = self._policy().actions[self.apply(X)]
        classes, order = self._sorted()
        return np.asarray(classes[np.argsort(order)[actions]])

    @available_if(lambda self: self.policy.leaves is not None)  # type: ignore[untyped-decorator]  # sklearn has no types
    def predict_proba(self, X: ArrayLike) -> Floats:
        """Return how often each action was taken in the leaf of each row, shape [N, n_classes].

        That is the share of the transitions recorded in the policy's leaf. The policy itself takes
        one action, which need not be the most frequent. A leaf without visits gives it 1.
        """
        policy = self._policy()
        visits = np.zeros((policy.n_leaves, policy.schema.n_actions))
        if policy.leaves is not None:
            visits[:] = policy.leaves.visits
        empty = np.flatnonzero(visits.sum(axis=1) == 0)
        visits[empty, policy.actions[empty]] = 1.0
        shares: Floats = visits / visits.sum(axis=1, keepdims=True)
        return shares[self.apply(X)][:, self._sorted()[1]]

    def apply(self, X: ArrayLike) -> Int32s:
        """Return the number of the leaf of each row, shape [N]."""
        return self._policy().tree.leaf_index(self._rows(X))

    def get_depth(self) -> int:
        """Return the number of tests on the longest path."""
        return self._policy().tree.depth

    def get_n_leaves(self) -> int:
        """Return the number of leaves."""
        return self._policy().n_leaves

    def to_decision_tree_classifier(self) -> Any:
        """Return the tree as a fitted ``sklearn.tree.DecisionTreeClassifier``, to be read.

        ``sklearn.tree.plot_tree``, ``export_text`` and tools that explain trees take it. It rounds
        observations to float32, as all trees of scikit-learn do, so it decides like the policy on
        numbers that float32 holds exactly; between two of those, within half a unit in the last
        place of float32 of a threshold, it may not.
        """
        policy = self._policy()
        tree, schema = policy.tree, policy.schema
        order = self._sorted()[1]
        one_hot = np.equal.outer(policy.actions, np.arange(schema.n_actions)).astype(np.float64)
        known = None if policy.leaves is None else policy.leaves.visits.sum(axis=1)
        # scikit-learn's class is the most frequent: the action gets all visits of its leaf.
        sizes = np.ones(policy.n_leaves) if known is None else np.maximum(known, 1)
        counts = tree.totals(one_hot * sizes[:, np.newaxis])
        shares = (counts / counts.sum(axis=1, keepdims=True))[:, np.newaxis, order]
        grown = Tree(tree.n_features, np.array([schema.n_actions], dtype=np.intp), 1)
        grown.__setstate__(
            {
                "max_depth": tree.depth,
                "node_count": tree.n_nodes,
                "nodes": self._nodes(counts, grown.__getstate__()["nodes"].dtype),
                "values": np.ascontiguousarray(shares),
            }
        )
        result = DecisionTreeClassifier()
        result.tree_ = grown
        result.n_features_in_ = tree.n_features
        result.feature_names_in_ = self.feature_names_in_
        result.classes_ = self.classes_
        result.n_classes_ = schema.n_actions
        result.n_outputs_ = 1
        result.max_features_ = tree.n_features
        return result

    def _nodes(self, counts: Floats, dtype: Any) -> Any:
        """Return scikit-learn's table of nodes."""
        tree = self._policy().tree
        inner = tree.feature != tree.NO_FEATURE
        nodes = np.zeros(tree.n_nodes, dtype=dtype)
        nodes["left_child"] = np.where(inner, tree.left, -1)
        nodes["right_child"] = np.where(inner, tree.right, -1)
        nodes["feature"] = np.where(inner, tree.feature, -2)
        nodes["threshold"] = np.where(inner, tree.threshold, -2.0)
        sizes = counts.sum(axis=1)
        nodes["impurity"] = 1 - ((counts / sizes[:, np.newaxis]) ** 2).sum(axis=1)
        nodes["n_node_samples"] = sizes
        nodes["weighted_n_node_samples"] = sizes
        return nodes

    def _sorted(self) -> tuple[NDArray[Any], Integers]:
        """Return the classes in order, and the action of each."""
        check_choice("labels", self.labels, ("number", "name"))
        schema = self._policy().schema
        if self.labels == "number":
            return np.arange(schema.n_actions), np.arange(schema.n_actions)
        names = np.array(schema.actions)
        order = np.argsort(names)
        return names[order], order

    def _policy(self) -> TreePolicy:
        return check_kind("policy", self.policy, TreePolicy)

    def _rows(self, X: ArrayLike) -> Floats:
        given, names = columns_of(X), list(self._policy().schema.feature_names)
        if given != names and set(given) & set(names):
            raise InvalidArgumentError(f"X must have its columns in the order {names}, got {given}")
        rows: Floats = check_array(X, dtype=np.float64, ensure_all_finite=False, order="C")
        _check_n_features(self, rows, reset=False)
        return rows
