"""C4.5 as a scikit-learn estimator; needs the extra ``sklearn``."""

import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eutree.arrays import Booleans, Floats, Int32s, Integers
from eutree.c45.growing import C45Settings, Dialect, grow, warn_of_light
from eutree.c45.tree import C45Names, C45Tree, to_text
from eutree.display import framed
from eutree.errors import InvalidArgumentError, UnknownNameError, needed
from eutree.trees import DecisionTree
from eutree.validation import check_choice, columns_of, has_own

CATEGORIES = ("category", "Categorical", "Enum", "dictionary")  # of pandas, polars, pyarrow
_OF_STRINGS = re.compile("could not convert string|Cannot cast (str|object)")  # NumPy's, pandas'


def _types(table: Any) -> list[Any]:
    """Return the types of the columns of a frame; none of what is no frame."""
    if has_own(table, "column_names"):
        return list(table.schema.types)
    return list(getattr(table, "dtypes", ())) if has_own(table, "columns") else []


def nominal_mask(table: Any, nominal: Any) -> Booleans:
    """Return which columns are nominal, shape [d]; an empty mask if there is nothing to choose.

    ``nominal`` is indices, column names, a mask, ``"auto"`` (columns of categories) or None.
    """
    if nominal is None:
        return np.zeros(0, dtype=bool)
    if isinstance(nominal, str) and nominal == "auto":
        return np.array([str(one).startswith(CATEGORIES) for one in _types(table)], dtype=np.bool_)
    if isinstance(nominal, str) or not np.iterable(nominal):
        raise InvalidArgumentError(
            "nominal_features must be 'auto', None, indices, column names or a mask, "
            f"got {nominal!r}"
        )
    shape = np.shape(table)
    _check_2d(shape)
    return _chosen(list(nominal), shape[1], list(map(str, columns_of(table))))


def _check_2d(shape: Sequence[int]) -> None:
    if len(shape) != 2:
        raise InvalidArgumentError(f"X must have shape (N, d) and be 2D, got shape {shape}")


def _no_numbers(what: str, table: Any, nominal: Booleans, error: Exception) -> InvalidArgumentError:
    """Return the error that ``what`` must hold numbers; of strings it says what helps.

    Columns are named in a data frame, else numbered. ``nominal`` is a mask, shape [d], or empty.
    """
    helps = ""
    if _OF_STRINGS.search(str(error)):
        rows = np.asarray(table, dtype=object)
        _check_2d(rows.shape)
        wanted = [
            _called(table, column)
            for column, values in enumerate(rows.T)
            if nominal[column : column + 1].any() or any(map(_is_name, values))
        ]
        helps = (
            "; for the columns of strings say "
            f"nominal_features={wanted!r}, or give them the dtype category"
        )
    return InvalidArgumentError(f"{what} must hold numbers{helps}: {error}")


def _called(table: Any, column: int) -> str | int:
    """Return the name of a column of a data frame, else its number."""
    names = columns_of(table)
    return str(names[column]) if names else column


def _is_name(value: Any) -> bool:
    """Return whether a value is known and no number."""
    try:
        float(value)
    except (TypeError, ValueError):
        return not is_missing(value)
    return False


def _chosen(nominal: list[Any], n_features: int, columns: Sequence[str]) -> Booleans:
    mask = np.zeros(n_features, dtype=bool)
    if nominal and all(isinstance(entry, bool | np.bool_) for entry in nominal):
        if len(nominal) != n_features:
            raise InvalidArgumentError(
                f"nominal_features must have {n_features} entries as a mask, got {len(nominal)}"
            )
        return np.array(nominal, dtype=bool)
    for entry in nominal:
        if isinstance(entry, str):
            if entry not in columns:
                raise UnknownNameError("column in nominal_features", entry, columns)
            mask[columns.index(entry)] = True
        elif isinstance(entry, int | np.integer) and 0 <= entry < n_features:
            mask[entry] = True
        else:
            raise InvalidArgumentError(
                f"nominal_features must hold indices in 0..{n_features - 1} or names, got {entry!r}"
            )
    return mask


def values_of(frame: Any, table: NDArray[Any], column: int) -> NDArray[Any]:
    """Return the values of a nominal column: those its dtype declares, else those that occur."""
    for dtype in _types(frame)[column : column + 1]:
        declared: Any = getattr(dtype, "categories", None)
        if np.ndim(declared) == 1:  # those of a Categorical of polars are no list
            return np.asarray(declared, dtype=object)
    known = [value for value in table[:, column] if not is_missing(value)]
    found = sorted(set(known), key=lambda value: (str(type(value)), value))
    return np.array([*found, None], dtype=object)[:-1]  # one-dimensional, also of sequences


def is_missing(value: object) -> bool:
    """Return whether a value stands for an unknown one: None, NaN or pandas.NA."""
    return value is None or type(value).__name__ == "NAType" or value != value


def encode(
    frame: Any, table: NDArray[Any], categories: Sequence[NDArray[Any] | None], handle_unknown: str
) -> Floats:
    """Return the table of a frame as numbers: codes in nominal columns, NaN for unknown values.

    Raises:
        InvalidArgumentError: If a continuous column does not hold finite numbers (or NaN), or a
            nominal one holds a new value and ``handle_unknown`` is ``"error"``.
    """
    numbers = np.empty(table.shape)
    for j, values in enumerate(categories):
        column, called = table[:, j], f"column {_called(frame, j)!r}"
        if values is None:
            try:
                known = [np.nan if is_missing(value) else value for value in column]
                numbers[:, j] = np.array(known, dtype=np.float64)
            except (TypeError, ValueError) as error:
                nominal = np.array([values is not None for values in categories])
                raise _no_numbers(called, frame, nominal, error) from None
            if np.isinf(numbers[:, j]).any():
                raise InvalidArgumentError(f"{called} must not hold infinity")
            continue
        code_of = {value: code for code, value in enumerate(values)}
        numbers[:, j] = [np.nan if is_missing(v) else code_of.get(v, -1) for v in column]
        new = numbers[:, j] < 0
        if new.any() and handle_unknown == "error":
            listing = sorted({repr(value) for value in column[new]})
            raise InvalidArgumentError(
                f"found unknown categories [{', '.join(listing)}] in {called}; "
                "handle_unknown='missing' would treat them as unknown values"
            )
        numbers[new, j] = np.nan
    return numbers


with needed("scikit-learn", "sklearn"):
    from sklearn.base import BaseEstimator, ClassifierMixin
    from sklearn.utils.class_weight import compute_sample_weight
    from sklearn.utils.multiclass import check_classification_targets
    from sklearn.utils.validation import _check_sample_weight, check_is_fitted, validate_data


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
            ``"auto"`` takes the columns of categories of a data frame; None takes none.
        handle_unknown: ``"error"`` refuses a nominal value that training did not have,
            ``"missing"`` treats it as unknown.
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
        warn_of_light(weights, self.min_objects)
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

        It tests a nominal attribute by the place of its value in ``categories_``.
        """
        return self._tree().to_decision_tree()

    def export_text(self) -> str:
        """Return the tree in C4.5's own format: one line a branch, (cases/errors) at leaves."""
        tree = self._tree()
        columns: Iterable[object] = getattr(
            self, "feature_names_in_", [f"x{i}" for i in range(self.n_features_in_)]
        )
        values = [[] if some is None else list(map(str, some)) for some in self.categories_]
        names = C45Names(list(map(str, columns)), list(map(str, self.classes_)), values)
        return to_text(tree, names)

    def _html_repr(self) -> str:
        """Return scikit-learn's diagram for notebooks, and below it the fitted tree."""
        diagram = str(super()._html_repr())
        if not hasattr(self, "tree_"):
            return diagram
        return f"{diagram}{framed(f'<pre>{escape(self.export_text())}</pre>')}"

    def _settings(self) -> C45Settings:
        names = ("min_objects", "confidence", "prune", "z", "collapse", "subtree_raising",
                 "gap")  # fmt: skip
        return C45Settings(**{name: getattr(self, name) for name in names})

    def _tree(self) -> C45Tree:
        check_is_fitted(self)
        tree: C45Tree = self.tree_
        return tree

    def _rows(self, X: ArrayLike) -> Floats:
        check_is_fitted(self)
        return self._validated(X, fitting=False)[0]

    def _validated(
        self, X: ArrayLike, y: ArrayLike | None = None, *, fitting: bool
    ) -> tuple[Floats, Any]:
        """Return X as numbers and codes of nominal values, and y; ``fit`` sets the attributes."""
        if fitting:
            nominal = nominal_mask(X, self.nominal_features)
        else:
            nominal = np.array([values is not None for values in self.categories_])
        extra: dict[str, Any] = {"y": y} if fitting else {"reset": False}
        numbers = {"dtype": np.float64, "ensure_all_finite": "allow-nan", "order": "C", **extra}
        checked = None
        try:
            if not nominal.any():
                checked = validate_data(self, X, **numbers)
        except (TypeError, ValueError) as error:
            if _OF_STRINGS.search(str(error)):
                raise _no_numbers("columns that are not nominal", X, nominal, error) from None
            if "NAType" not in str(error):  # which as an object is an unknown value
                raise
        if checked is None:
            given = X.astype(object) if hasattr(X, "astype") else X  # or NumPy makes numbers of it
            checked = validate_data(self, given, dtype=object, ensure_all_finite=False, **extra)
        table, y = checked if fitting else (checked, None)
        if fitting:
            named = np.flatnonzero(nominal)
            self.categories_: list[NDArray[Any] | None] = [
                values_of(X, table, j) if j in named else None for j in range(table.shape[1])
            ]
        if table.dtype != object:
            return table, y
        return encode(X, table, self.categories_, self.handle_unknown), y
