"""C4.5 as a scikit-learn estimator; needs the extra ``sklearn``."""

from collections.abc import Iterable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.c45 import categories, text
from eutree.c45.learner import grow
from eutree.c45.settings import C45Settings, Dialect
from eutree.c45.tree import C45Tree
from eutree.display import framed
from eutree.errors import InvalidArgumentError, MissingExtraError
from eutree.trees import DecisionTree
from eutree.validation import check_choice

try:
    from sklearn.base import BaseEstimator, ClassifierMixin
    from sklearn.utils.class_weight import compute_sample_weight
    from sklearn.utils.multiclass import check_classification_targets
    from sklearn.utils.validation import _check_sample_weight, check_is_fitted, validate_data
except ImportError as error:
    raise MissingExtraError("scikit-learn", "sklearn") from error


class C45Classifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # sklearn has no types
    """Quinlan's C4.5 release 8, as a scikit-learn classifier.

    Numbers are compared in float64. NaN is an unknown value: such a case goes down all branches of
    a test, weighted by their shares (*fractional cases*), in training and in prediction. Equal
    tests are decided for the first attribute and the smallest threshold; no randomness is used.

    Args:
        min_objects: Least weight of a branch (``-m``); at least two branches must have it.
        confidence: CF of the pessimistic error estimate (``-c``); smaller prunes more.
        prune: Whether to prune by estimated errors.
        z: ``"table"`` for release 8, ``"normal"`` for Weka's J48.
        collapse: Whether a subtree that makes no fewer training errors becomes a leaf.
        subtree_raising: Whether pruning may replace a node by its largest branch.
        nominal_features: Which columns hold names, not numbers: indices, column names or a mask;
            ``"auto"`` takes the columns of dtype ``category`` of a data frame; None takes none.
        grouped: Whether values of a nominal attribute may share a branch (``-s``); if not, each
            value has its own.
        handle_unknown: What to do with a nominal value that training did not have: ``"error"``,
            or ``"missing"`` to treat it as unknown.
        gap: A cut needs neighbours further apart than this. 0 tells any two numbers apart;
            release 8 and J48 have 1e-5.
        class_weight: As in scikit-learn: None, ``"balanced"`` or a dict from class to weight.

    Attributes:
        classes_: The classes, sorted.
        tree_: The tree, a ``C45Tree``; it has ``n_leaves``, ``depth`` and arrays over its nodes.
        categories_: The values of each nominal column; None for a continuous one.
        n_features_in_: Number of columns.
        feature_names_in_: Their names, if ``fit`` saw any.

    >>> from eutree import C45Classifier
    >>> model = C45Classifier().fit([[1.0], [2.0], [3.0], [4.0]], ["low", "low", "high", "high"])
    >>> model.predict([[2.4], [2.6]])
    array(['high', 'high'], dtype='<U4')
    >>> print(model.export_text())
    x0 <= 2: low (2)
    x0 > 2: high (2)
    """

    def __init__(
        self,
        *,
        min_objects: float = 2,
        confidence: float = 0.25,
        prune: bool = True,
        z: Dialect = "table",
        collapse: bool = True,
        subtree_raising: bool = True,
        nominal_features: Any = "auto",
        grouped: bool = False,
        handle_unknown: Literal["error", "missing"] = "error",
        gap: float = 0.0,
        class_weight: Any = None,
    ) -> None:
        self.min_objects = min_objects
        self.confidence = confidence
        self.prune = prune
        self.z = z
        self.collapse = collapse
        self.subtree_raising = subtree_raising
        self.nominal_features = nominal_features
        self.grouped = grouped
        self.handle_unknown = handle_unknown
        self.gap = gap
        self.class_weight = class_weight

    def __sklearn_tags__(self) -> Any:
        """Return scikit-learn's tags: unknown values are welcome, names are if declared."""
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags

    def fit(
        self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> "C45Classifier":
        """Learn the tree of a training set.

        Args:
            X: Shape [N, d]; NaN where a value is unknown.
            y: Class of each row, shape [N].
            sample_weight: Weight of each row; a weight of 2 counts as the row twice.
        """
        check_choice("handle_unknown", self.handle_unknown, ("error", "missing"))
        settings = self._settings()
        rows, y = self._validated(X, y, fitting=True)
        check_classification_targets(y)
        self.classes_, actions = np.unique(y, return_inverse=True)
        weights = _check_sample_weight(
            sample_weight, rows, dtype=np.float64, ensure_non_negative=True
        )
        if self.class_weight is not None:
            weights = weights * compute_sample_weight(self.class_weight, y)
        self.tree_ = grow(
            rows,
            actions,
            n_classes=len(self.classes_),
            weights=weights,
            n_values=[0 if values is None else len(values) for values in self.categories_],
            settings=settings,
        )
        return self

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Return the most probable class of each row, shape [N]; the first of equal ones."""
        rows = self._rows(X)
        return np.asarray(self.classes_[self.tree_.predict(rows)])

    def predict_proba(self, X: ArrayLike) -> Floats:
        """Return the probability of each class in ``classes_``, shape [N, n_classes]."""
        return self._tree().predict_proba(self._rows(X))

    def apply(self, X: ArrayLike) -> Int32s:
        """Return the leaf (its node) of each row; of a fractional case that of most weight."""
        return self._tree().leaf_node(self._rows(X))

    def decision_path(self, X: ArrayLike) -> Any:
        """Return which nodes each row visits on its way to ``apply``, sparse [N, n_nodes]."""
        from scipy.sparse import csr_matrix  # untyped

        paths = [self._tree().path(leaf) for leaf in self.apply(X).tolist()]
        nodes = np.concatenate([np.empty(0, np.int64), *paths])
        ends = np.cumsum([0, *map(len, paths)])
        shape = (len(paths), self.tree_.n_nodes)
        return csr_matrix((np.ones(len(nodes), dtype=np.int64), nodes, ends), shape=shape)

    @property
    def feature_importances_(self) -> Floats:
        """Importance of each column, shape [d]: its share of the information that tests gain.

        As in scikit-learn's trees they add up to 1, or are all 0 for a tree without a test.
        """
        return self._tree().importances

    def get_depth(self) -> int:
        """Return the number of tests on the longest path."""
        return self._tree().depth

    def get_n_leaves(self) -> int:
        """Return the number of leaves."""
        return self._tree().n_leaves

    def to_decision_tree(self) -> tuple[DecisionTree, Integers]:
        """Return the tree for eutree's exports, and the index of the class of each leaf.

        Raises:
            InvalidArgumentError: If the tree tests a nominal attribute.
        """
        return self._tree().to_decision_tree()

    def export_text(self) -> str:
        """Return the tree in C4.5's own format: one line a branch, (cases/errors) at leaves."""
        return text.to_text(self._tree(), self._names())

    def export_dot(self) -> str:
        """Return the tree as a Graphviz digraph."""
        return text.to_dot(self._tree(), self._names())

    def export_svg(self) -> str:
        """Return a drawing of the tree."""
        return text.to_svg(self._tree(), self._names())

    def export_json(self) -> str:
        """Return the tree as JSON: names, and nested tests and leaves with their classes."""
        return text.to_json(self._tree(), self._names())

    def _html_repr(self) -> str:
        """Return what notebooks show: scikit-learn's diagram, and below it the fitted tree."""
        diagram = str(super()._html_repr())
        if not hasattr(self, "tree_"):
            return diagram
        return f"{diagram}{framed(self.export_svg())}"

    def _settings(self) -> C45Settings:
        return C45Settings(
            min_objects=self.min_objects,
            confidence=self.confidence,
            prune=self.prune,
            z=self.z,
            collapse=self.collapse,
            subtree_raising=self.subtree_raising,
            grouped=self.grouped,
            gap=self.gap,
        )

    def _tree(self) -> C45Tree:
        check_is_fitted(self)
        tree: C45Tree = self.tree_
        return tree

    def _names(self) -> text.Names:
        columns: Iterable[object] = getattr(
            self, "feature_names_in_", [f"x{i}" for i in range(self.n_features_in_)]
        )
        return text.Names(
            features=tuple(map(str, columns)),
            classes=tuple(map(str, self.classes_)),
            values=tuple(
                () if values is None else tuple(map(str, values)) for values in self.categories_
            ),
        )

    def _rows(self, X: ArrayLike) -> Floats:
        check_is_fitted(self)
        return self._validated(X, fitting=False)[0]

    def _validated(
        self, X: ArrayLike, y: ArrayLike | None = None, *, fitting: bool
    ) -> tuple[Floats, Any]:
        """Return X as numbers and codes of nominal values, and y; set what ``fit`` learns."""
        if fitting:
            nominal = categories.nominal_mask(X, self.nominal_features)
        else:
            nominal = np.array([values is not None for values in self.categories_])
        extra: dict[str, Any] = {"y": y} if fitting else {"reset": False}
        if nominal.any():
            checks = {"dtype": object, "ensure_all_finite": False}
        else:
            checks = {"dtype": np.float64, "ensure_all_finite": "allow-nan", "order": "C"}
        try:
            checked = validate_data(self, X, **extra, **checks)
        except ValueError as error:
            if "could not convert string" not in str(error):
                raise
            texts = categories.text_columns(X, nominal)
            raise InvalidArgumentError(
                "X must hold numbers in columns that are not nominal; for the columns of strings "
                f"say nominal_features={texts!r}, or give them the dtype category: {error}"
            ) from None
        table, y = checked if fitting else (checked, None)
        if fitting:
            self.categories_: list[NDArray[Any] | None] = self._categories(X, table, nominal)
        if not nominal.any():
            return table, y
        return categories.encode(table, self.categories_, self.handle_unknown), y

    def _categories(
        self, X: ArrayLike, table: NDArray[Any], nominal: Booleans
    ) -> list[NDArray[Any] | None]:
        """Return the values of each nominal column, None for a continuous one."""
        if not nominal.any():
            return [None] * table.shape[1]
        return [
            categories.values_of(X, table, j) if nominal[j] else None for j in range(table.shape[1])
        ]
