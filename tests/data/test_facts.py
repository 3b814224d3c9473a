"""What an episode holds is what a file can hold, or is refused where it is made."""

import numpy as np
import pytest

import eutree
from eutree.data import Demonstrations, Episode
from eutree.errors import InvalidArgumentError
from eutree.schema import Schema
from eutree.trees import DecisionTree

SCHEMA = Schema.anonymous(2, 2)
ROWS = np.random.default_rng(0).normal(size=(41, 2))
ACTIONS = np.array([0, 1] * 20)


def episode(observations=ROWS, actions=ACTIONS, *, terminated=True, truncated=False, **facts):
    return Episode(observations, actions, np.ones(40), terminated, truncated, **facts)


def test_what_numpy_says_is_written_and_read(tmp_path):
    """`is_success=np.bool_(True)`, as a comparison of arrays says it, could not be written."""
    one = episode(
        terminated=np.bool_(False), truncated=np.bool_(True), is_success=np.bool_(True),
        kept=np.bool_(True), seed=np.int64(5), comment=np.str_("well"),
    )  # fmt: skip
    Demonstrations((one,), SCHEMA).save(tmp_path / "demos")
    read = Demonstrations.load(tmp_path / "demos").episodes[0]
    assert read.equals(one)
    assert (read.is_success, read.truncated, read.seed, read.comment) == (True, True, 5, "well")


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        ({"is_success": 1}, "is_success must be a bool, got 1"),
        ({"terminated": 1}, "terminated must be a bool, got 1"),
        ({"kept": "no"}, "kept must be a bool"),
        ({"seed": -5}, "seed must be an integer >= 0, got -5"),
        ({"ending": None}, "ending must be a str, got None"),
        ({"actions": ACTIONS + 0.9}, "actions must hold integers"),
        ({"steps": {"allowed": np.full((40, 2), 2)}}, r"steps\['allowed'\] must be 0 or 1"),
    ],
)
def test_what_no_file_would_give_back_is_refused_at_once(facts, said):
    with pytest.raises(InvalidArgumentError, match=said):
        episode(**facts)


@pytest.mark.parametrize("kind", [np.int8, np.float64, bool])
def test_masks_of_ones_forbid_nothing(kind):
    one = episode(steps={"allowed": np.ones((40, 2), kind)})
    assert Demonstrations((one,), SCHEMA).episodes[0].allowed.dtype == bool
    masks = np.ones((40, 2), kind)
    masks[7, 1] = 0
    with pytest.raises(InvalidArgumentError, match="masks action 1 in step=7"):
        Demonstrations((episode(steps={"allowed": masks}),), SCHEMA)


def test_no_tree_is_fitted_to_nan():
    rows = ROWS.copy()
    rows[5:9, 0] = np.nan
    with pytest.raises(InvalidArgumentError, match=r"observations must be finite, got nan at \[5,"):
        eutree.fit_expert_tree(Demonstrations((episode(rows),), SCHEMA))


def test_weights_that_allow_no_split_are_said():
    shown = Demonstrations((episode(actions=(ROWS[:-1, 0] > 0).astype(int)),), SCHEMA)
    with pytest.warns(UserWarning, match="the weights add up to 1: no test has two branches"):
        one = eutree.fit_expert_tree(shown, weights=np.full(40, 1 / 40))
    assert one.n_leaves == 1
    assert eutree.fit_expert_tree(shown, weights=np.ones(40)).n_leaves == 2


def test_names_are_texts_and_lists_are_tuples():
    """A policy with other names was written, and could not be read; one of lists was not itself."""
    features = [eutree.Feature("a"), eutree.Feature("b")]
    listed = Schema(features, ["go", "stop"])
    assert listed == Schema(tuple(features), ("go", "stop"))
    assert listed.with_history(1, 0).n_features == 4
    for wrong in (lambda: Schema(features, (1, 2)), lambda: Schema([eutree.Feature(0)], ("go",))):
        with pytest.raises(InvalidArgumentError, match=r"(name|actions) must be a str"):
            wrong()
    with pytest.raises(InvalidArgumentError, match="features must be a Feature"):
        Schema(("a",), ("go",))
    tree = DecisionTree.single_leaf(2)
    with pytest.raises(InvalidArgumentError, match="actions must hold integers"):
        eutree.TreePolicy(tree, np.array([0.9]), listed)
    policy = eutree.TreePolicy(tree, np.array([1]), listed, locked=[0])
    assert eutree.TreePolicy.from_bytes(policy.to_bytes(), "p") == policy
