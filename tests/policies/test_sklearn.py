"""Policies as scikit-learn's classifiers, and scikit-learn's trees as policies."""

from itertools import pairwise

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.metrics import accuracy_score
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.tree import DecisionTreeClassifier, export_text

import eutree
from eutree import TreePolicy, TreePolicyClassifier
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.export.c import probes
from eutree.policies.sklearn_tree import float64_thresholds
from eutree.schema import Feature, Schema
from tests.export.policies import EVASION, policy_of, tree
from tests.frames import Table

NAMED = Schema(tuple(Feature(name) for name in "abc"), ("wait", "go"))


@pytest.fixture(scope="module")
def policy():
    return policy_of(tree(9, 3, seed=2), NAMED, statistics=True)


@pytest.fixture(scope="module")
def rows(policy):
    return probes(policy.tree, n_random=300)


def test_it_predicts_what_the_policy_does(policy, rows):
    wanted = policy.predict(rows)[0]
    model = TreePolicyClassifier(policy)
    np.testing.assert_array_equal(model.predict(rows), wanted)
    named = TreePolicyClassifier(policy, labels="name")
    assert named.classes_.tolist() == ["go", "wait"]
    np.testing.assert_array_equal(named.predict(rows), np.array(NAMED.actions)[wanted])
    np.testing.assert_array_equal(model.apply(rows), policy.tree.leaf_index(rows))
    assert (model.get_n_leaves(), model.get_depth()) == (9, policy.tree.depth)


def test_probabilities_are_shares_of_visits(policy, rows):
    visits = policy.leaves.visits[policy.tree.leaf_index(rows)]
    wanted = visits / visits.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(TreePolicyClassifier(policy).predict_proba(rows), wanted)
    named = TreePolicyClassifier(policy, labels="name").predict_proba(rows)
    np.testing.assert_allclose(named, wanted[:, ::-1])
    unknown = TreePolicyClassifier(policy_of(policy.tree, NAMED))
    assert not hasattr(unknown, "predict_proba")


def test_a_leaf_without_visits_gives_its_action_all(policy):
    none = eutree.LeafStatistics(*(np.zeros((9, 2)) for _ in range(3)))
    empty = TreePolicy(policy.tree, policy.actions, NAMED, leaves=none)
    shares = TreePolicyClassifier(empty).predict_proba(np.zeros((1, 3)))
    assert shares.argmax() == empty.act([0.0] * 3)
    assert shares.max() == 1.0


def test_pipelines_and_scores_take_it(policy):
    rows = np.random.default_rng(0).normal(size=(100, 3))
    actions = policy.predict(rows)[0]
    model = TreePolicyClassifier(policy)
    chain = make_pipeline(FunctionTransformer(lambda table: table * 2), model)
    wanted = (policy.predict(rows * 2)[0] == actions).mean()
    assert accuracy_score(actions, chain.fit(rows, actions).predict(rows)) == wanted
    scores = cross_val_score(model, rows, 1 - actions, cv=4)
    assert scores.tolist() == [0.0] * 4  # the policy is not changed by what it is scored on
    assert model.score(rows, actions) == 1.0
    assert clone(model).predict(rows).tolist() == actions.tolist()


def test_tables_with_names_of_columns_are_welcome(policy):
    pandas = pytest.importorskip("pandas")
    rows = np.random.default_rng(0).normal(size=(10, 3))
    table = pandas.DataFrame(rows, columns=NAMED.feature_names)
    model = TreePolicyClassifier(policy)
    assert model.predict(table).tolist() == model.predict(rows).tolist()


def test_what_does_not_fit_is_refused(policy):
    model = TreePolicyClassifier(policy)
    with pytest.raises(InvalidArgumentError, match=r"actions of the policy, \[0, 1\], got \[2\]"):
        model.fit(np.zeros((3, 3)), [0, 1, 2])
    with pytest.raises(ValueError, match="expecting 3 features"):
        model.predict(np.zeros((3, 2)))
    with pytest.raises(InvalidArgumentError, match="policy must be a TreePolicy"):
        TreePolicyClassifier(None).predict(np.zeros((3, 2)))
    with pytest.raises(UnknownNameError, match="labels"):
        TreePolicyClassifier(policy, labels="names").predict(np.zeros((3, 3)))


def test_scikit_learn_reads_the_tree(policy, rows):
    read = TreePolicyClassifier(policy, labels="name").to_decision_tree_classifier()
    exact = rows.astype(np.float32)
    exact = exact[np.isfinite(exact).all(axis=1)]
    wanted = TreePolicyClassifier(policy, labels="name").predict(exact.astype(np.float64))
    table = {"X": exact, "check_input": False}  # no names of columns
    np.testing.assert_array_equal(read.predict(**table), wanted)
    text = export_text(read, feature_names=list(NAMED.feature_names), decimals=6)
    assert text.count("class: ") == 9
    for threshold in policy.tree.threshold[policy.tree.feature >= 0]:
        assert f"{threshold:.6f}" in text
    assert read.tree_.n_node_samples[0] == policy.leaves.visits.sum()


def grown(seed, n_classes=3, size=400, **options):
    generator = np.random.default_rng(seed)
    rows = generator.normal(size=(size, 4)) * 10.0 ** generator.integers(-3, 4, size=4)
    labels = (rows[:, 0] > rows[:, 1]).astype(int) + (rows[:, 2] * rows[:, 3] > 0)
    return DecisionTreeClassifier(random_state=seed, **options).fit(rows, labels % n_classes)


def neighbours(classifier):
    """Return rows around every place where a float32 comparison changes its answer."""
    inner = classifier.tree_.children_left != -1
    values = {}
    for feature, threshold in zip(
        classifier.tree_.feature[inner], classifier.tree_.threshold[inner], strict=True
    ):
        near = np.float32(threshold)
        around = [np.nextafter(near, np.float32(-np.inf)), near]
        around.append(np.nextafter(near, np.float32(np.inf)))
        middles = [(float(a) + float(b)) / 2 for a, b in pairwise(around)]
        centres = [threshold, *map(float, around), *middles]
        ends = [np.nextafter(c, side) for c in centres for side in (-np.inf, np.inf)]
        values.setdefault(int(feature), []).extend([*centres, *ends])
    generator = np.random.default_rng(0)
    rows = []
    for feature, found in values.items():
        base = np.column_stack(
            [generator.choice(values.get(k, [0.0]), len(found)) for k in range(4)]
        )
        base[:, feature] = found
        rows.append(base)
    return np.concatenate(rows)


@pytest.mark.parametrize("seed", range(6))
def test_trees_of_scikit_learn_decide_the_same_everywhere(seed):
    classifier = grown(seed)
    policy = TreePolicy.from_sklearn(classifier)
    rows = neighbours(classifier)
    np.testing.assert_array_equal(policy.predict(rows)[0], classifier.predict(rows))
    assert policy.n_leaves == classifier.get_n_leaves()
    assert policy.leaves.visits.sum() == 400
    again = TreePolicy.from_bytes(policy.to_bytes())
    assert again == policy


def test_the_probes_tell_float32_from_float64():
    """The control: the classifier's own thresholds would not do."""
    classifier = grown(0)
    policy = TreePolicy.from_sklearn(classifier)
    inner = policy.tree.feature >= 0
    own = np.where(inner, classifier.tree_.threshold, np.nan)
    raw = TreePolicy(
        eutree.DecisionTree(
            4, policy.tree.feature, own, policy.tree.left, policy.tree.right, policy.tree.leaf
        ),
        policy.actions,
        policy.schema,
    )
    rows = neighbours(classifier)
    assert (raw.predict(rows)[0] != classifier.predict(rows)).any()


def test_thresholds_at_the_ends_of_float32():
    largest = float(np.finfo(np.float32).max)
    tiny = float(np.finfo(np.float32).smallest_subnormal)
    given = np.array([0.0, -0.0, tiny, -tiny, largest, -largest, 1.0, 1e300, -1e300, np.nan])
    found = float64_thresholds(given)
    with np.errstate(over="ignore"):
        for threshold, ours in zip(given[:-1], found[:-1], strict=True):
            assert np.float32(ours) <= threshold
            above = np.nextafter(ours, np.inf)
            assert not np.float32(above) <= threshold or not np.isfinite(np.float32(above))
    assert np.isnan(found[-1])


def test_names_and_numbers_of_classes():
    rows = np.random.default_rng(1).normal(size=(50, 3))
    labels = np.where(rows[:, 0] > 0, "go", "stop")
    classifier = DecisionTreeClassifier().fit(rows, labels)
    policy = TreePolicy.from_sklearn(classifier, EVASION)
    assert [EVASION.actions[a] for a in policy.predict(rows)[0]] == labels.tolist()
    assert TreePolicy.from_sklearn(classifier).schema.actions == ("go", "stop")
    numbers = DecisionTreeClassifier().fit(rows, (labels == "go").astype(int))
    np.testing.assert_array_equal(
        TreePolicy.from_sklearn(numbers, EVASION).predict(rows)[0], numbers.predict(rows)
    )
    with pytest.raises(UnknownNameError, match="class"):
        TreePolicy.from_sklearn(DecisionTreeClassifier().fit(rows, 7 * (labels == "go")), EVASION)


@pytest.mark.parametrize("kind", [int, np.int8, np.uint64])
def test_numbers_of_classes_are_numbers_of_actions_whatever_their_names(kind):
    """With actions named -1, 0 and 1, number 0 was taken for the action of that name."""
    rows = np.random.default_rng(1).normal(size=(50, 3))
    schema = Schema(NAMED.features, ("-1", "0", "1"))
    for classes in ([0, 1], [1, 2], [0, 1, 2], [2]):
        numbers = np.array(classes, dtype=kind)[np.arange(50) % len(classes)]
        classifier = DecisionTreeClassifier().fit(rows, numbers)
        policy = TreePolicy.from_sklearn(classifier, schema)
        assert policy.predict(rows)[0].tolist() == classifier.predict(rows).tolist()
        texts = DecisionTreeClassifier().fit(rows, np.array(schema.actions)[numbers])
        named = TreePolicy.from_sklearn(texts, schema)
        assert named.predict(rows)[0].tolist() == numbers.tolist()


def test_numbers_that_are_no_numbers_of_actions_are_names():
    rows = np.random.default_rng(1).normal(size=(50, 3))
    for names in ([-1, 0, 1], [1, 2, 3], [0, 100]):
        labels = np.array(names)[np.arange(50) % len(names)]
        classifier = DecisionTreeClassifier().fit(rows, labels)
        for schema in (Schema(NAMED.features, tuple(map(str, names))), None):
            policy = TreePolicy.from_sklearn(classifier, schema)
            found = [policy.schema.actions[action] for action in policy.predict(rows)[0]]
            assert found == list(map(str, labels))
    with pytest.raises(UnknownNameError, match="class '7'"):
        TreePolicy.from_sklearn(
            DecisionTreeClassifier().fit(rows, 7 * (rows[:, 0] > 0)),
            Schema(NAMED.features, ("a", "b")),
        )


def test_fit_compares_the_numbers_of_rows(policy, rows):
    """Five rows with two classes were taken."""
    model = TreePolicyClassifier(policy)
    with pytest.raises(ValueError, match=r"inconsistent numbers of samples: \[5, 2\]"):
        model.fit(rows[:5], [0, 1])
    assert model.fit(rows[:5]).fit(y=[0, 1]).fit(rows[:2], [0, 1]) is model


def test_weighted_rows_are_not_counted():
    rows = np.random.default_rng(1).normal(size=(50, 3))
    classifier = DecisionTreeClassifier(class_weight="balanced").fit(rows, np.arange(50) % 3 == 0)
    assert TreePolicy.from_sklearn(classifier).leaves is None


def test_what_is_no_classifier_is_refused():
    with pytest.raises(InvalidArgumentError, match=r"a fitted sklearn\.tree"):
        TreePolicy.from_sklearn(DecisionTreeClassifier())
    rows = np.random.default_rng(1).normal(size=(50, 3))
    two = DecisionTreeClassifier().fit(rows, rows[:, :2] > 0)
    with pytest.raises(InvalidArgumentError, match="one output, got 2"):
        TreePolicy.from_sklearn(two)
    one = DecisionTreeClassifier().fit(rows[:, :2], rows[:, 0] > 0)
    with pytest.raises(InvalidArgumentError, match="classifier's 2 features, got 3"):
        TreePolicy.from_sklearn(one, EVASION)


def test_a_schema_in_another_order_than_the_classifier_s_is_refused():
    """Features were taken by place, whatever the columns that the classifier had been shown."""
    pandas = pytest.importorskip("pandas")
    rows = np.random.default_rng(1).normal(size=(50, 3))
    frame = pandas.DataFrame(rows, columns=["level [m]", "flow", "x y"])
    classifier = DecisionTreeClassifier().fit(frame, np.where(rows[:, 0] > 0, "go", "wait"))
    level, flow, other = Feature("level", "m"), Feature("flow"), Feature("x y")
    for wrong in ((flow, level, other), (Feature("level [m]"), other, Feature("y"))):
        with pytest.raises(
            InvalidArgumentError, match=r"in the order of .* \['level \[m\]', 'flow'"
        ):
            TreePolicy.from_sklearn(classifier, Schema(wrong, NAMED.actions))
    for right in ((level, flow, other), (Feature("level [m]"), flow, other), NAMED.features):
        policy = TreePolicy.from_sklearn(classifier, Schema(right, NAMED.actions))
        wanted = classifier.predict(frame)
        assert [NAMED.actions[action] for action in policy.predict(rows)[0]] == wanted.tolist()


def test_columns_in_another_order_are_refused(policy, rows):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(rows, columns=list("abc"))
    model = TreePolicyClassifier(policy)
    np.testing.assert_array_equal(model.predict(frame), policy.predict(rows)[0])
    with pytest.raises(InvalidArgumentError, match="X must have its columns in the order"):
        model.predict(frame[["c", "a", "b"]])


def test_columns_of_a_table_of_pyarrow_are_in_order(policy, rows):
    names = policy.schema.feature_names
    model = TreePolicyClassifier(policy)
    wanted = policy.predict(rows)[0].tolist()
    assert model.predict(Table(rows, names)).tolist() == wanted
    with pytest.raises(InvalidArgumentError, match="X must have its columns in the order"):
        model.predict(Table(rows[:, ::-1], names[::-1]))


def test_a_frame_is_read_by_its_names(policy, rows):
    """A policy took the columns by place, whatever their names."""
    pandas = pytest.importorskip("pandas")
    rows = rows[np.isfinite(rows).all(axis=1)]
    frame = pandas.DataFrame(rows, columns=list("abc"))
    named = TreePolicy(policy.tree, policy.actions, Schema(tuple(map(Feature, "abc")), ("x", "y")))
    turned = frame[["c", "a", "b"]]
    wanted = named.predict(rows)[0]
    np.testing.assert_array_equal(named.predict(turned)[0], wanted)
    assert [named.predict(row)[0] for _, row in turned.iterrows()] == wanted.tolist()
    one, report = eutree.compress(named, turned, mode="lossless")
    assert report.agreement == 1.0
    np.testing.assert_array_equal(one.predict(rows)[0], wanted)
    np.testing.assert_array_equal(named.predict(frame.rename(columns=str.upper))[0], wanted)
    for strange in (frame.rename(columns={"a": "d"}), frame[["a", "b"]]):
        with pytest.raises(InvalidArgumentError, match="observation must have the columns"):
            named.predict(strange)
    with pytest.raises(InvalidArgumentError, match="X must have its columns in the order"):
        TreePolicyClassifier(named).predict(frame.rename(columns={"a": "d"}))


def test_it_takes_weights_and_names_its_columns(policy, rows):
    model = TreePolicyClassifier(policy)
    labels = model.predict(rows)
    assert model.fit(rows, labels, sample_weight=np.ones(len(rows))) is model
    assert model.feature_names_in_.tolist() == list(policy.schema.feature_names)
