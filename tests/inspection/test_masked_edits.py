"""Where actions may be masked, an edit leaves what other leaves fall back on as it was."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

import eutree
from eutree.compression.smaller_trees import with_locks, with_tree
from eutree.errors import FormatError, InvalidArgumentError
from eutree.inspection import edit, enforce, keep_monotone, monotone_rules, verify
from eutree.policies import LeafStatistics, TreePolicy
from eutree.policies.reach import within_kinds
from eutree.schema import Feature, Schema
from eutree.training.proposals import identity
from eutree.trees import DecisionTree
from tests import naive_trees

SCHEMA = Schema(
    (Feature("u"), Feature("v"), Feature("n", low=0.0, high=4.0, is_integer=True)),
    ("a", "b", "c", "d"),
)
MASKS = np.array([mask for mask in itertools.product([False, True], repeat=4) if any(mask)])
RULE = "always d when 1 < u <= 3 and v <= 2"  # d is in no leaf of the trees
KINDS = pytest.mark.parametrize("kind", ["alone", "visits", "values"])
SEEDS = pytest.mark.parametrize("seed", range(12))


def masked_policy(seed, kind):
    """Return a policy of random leaves, with statistics that know some actions or with none."""
    generator = np.random.default_rng(seed)
    tree = naive_trees.random_tree(generator, 16, 3, n_values=5)
    shape = (tree.n_leaves, 4)
    visits = generator.integers(3, size=shape)
    values = np.where(generator.random(shape) < 0.5, generator.normal(size=shape), np.nan)
    leaves = None
    if kind != "alone":
        values = values if kind == "values" else np.full(shape, np.nan)
        leaves = LeafStatistics(visits, values, np.full(shape, np.nan))
    actions = generator.integers(3, size=tree.n_leaves)
    return within_kinds(TreePolicy(tree, actions, SCHEMA, leaves=leaves, masked=True))


def rows_of(policy, seed):
    """Return random rows, and thresholds of the tree with their neighbours."""
    generator = np.random.default_rng(seed)
    rows = generator.uniform(-1.0, 5.0, size=(300, 3))
    rows[:, 2] = np.floor(rows[:, 2].clip(0.0, 4.0))
    cuts = policy.tree.threshold[policy.tree.feature == 0]
    rows[: 2 * cuts.size, 0] = np.concatenate([cuts, np.nextafter(cuts, np.inf)])[:300]
    return rows


def decided(policy, rows):
    """Return the decisions under every mask, shape [N, masks]."""
    return np.array([[policy.act(row, mask) for mask in MASKS] for row in rows.tolist()])


def loaded_again(policy, tmp_path):
    policy.save(tmp_path / "policy.json")
    loaded = TreePolicy.load(tmp_path / "policy.json")
    assert loaded == policy
    return loaded


def test_the_fallback_of_an_untouched_leaf_stays():
    """[0, 1, 2] became [0, 2, 1], for the rule's leaf was one of the nearest."""
    schema = Schema((Feature("x", low=0, high=1),), ("p", "q", "r"))
    tree = DecisionTree.single_leaf(1).split(0, 0, 0.5)
    policy = TreePolicy(tree, np.array([0, 0]), schema, masked=True)
    ruled = enforce(policy, "always r when x > 0.9").policy
    mask = [False, True, True]
    assert [one.predict([0.1], action_masks=mask)[0] for one in (policy, ruled)] == [1, 1]
    assert ruled.predict([0.95], action_masks=[True, True, False])[0] in (0, 1)


@KINDS
@SEEDS
def test_a_rule_changes_nothing_outside_of_its_box(kind, seed, tmp_path):
    policy = masked_policy(seed, kind)
    rows = rows_of(policy, seed)
    ruled = loaded_again(enforce(policy, RULE).policy, tmp_path)
    assert verify(ruled, RULE).holds
    inside = (rows[:, 0] > 1) & (rows[:, 0] <= 3) & (rows[:, 1] <= 2)
    assert inside.any()
    before, after = decided(policy, rows), decided(ruled, rows)
    assert (after == before)[~inside].all()
    assert (after[inside][:, MASKS[:, 3]] == 3).all()
    assert all(MASKS[k, action] for row in after for k, action in enumerate(row))


@KINDS
@SEEDS
def test_rules_one_after_the_other_change_nothing_but_their_boxes(kind, seed, tmp_path):
    policy = masked_policy(seed, kind)
    rows = rows_of(policy, seed)
    once = enforce(policy, RULE).policy
    rules = ["always c when u > 4", "always a when n = 2 and u <= 0"]
    both = loaded_again(enforce(loaded_again(once, tmp_path), rules).policy, tmp_path)
    elsewhere = (rows[:, 0] <= 4) & ((rows[:, 2] != 2) | (rows[:, 0] > 0))
    assert (decided(both, rows) == decided(once, rows))[elsewhere].all()


@KINDS
@SEEDS
def test_another_action_of_a_leaf_changes_no_other_leaf(kind, seed, tmp_path):
    policy = masked_policy(seed, kind)
    leaf = int(np.random.default_rng(seed).integers(policy.n_leaves))
    changed = edit(policy, actions={leaf: "d"}, lock=[0]).policy
    orders = loaded_again(changed, tmp_path).orders
    others = np.arange(policy.n_leaves) != leaf
    assert orders[others].tolist() == policy.orders[others].tolist()
    assert orders[leaf, 0] == 3
    assert edit(policy, lock=[0]).policy.ranks is None


@KINDS
@SEEDS
def test_a_monotone_rule_changes_no_leaf_that_keeps_its_action(kind, seed):
    policy = masked_policy(seed, kind)
    changed = 0
    for text in ("a in u", "a in falling u", "b in v", "b in falling v"):
        kept = keep_monotone(policy, monotone_rules([text], SCHEMA))
        assert verify(kept, f"monotone {text}").holds
        same = kept.actions == policy.actions
        changed += np.count_nonzero(~same)
        assert kept.orders[same].tolist() == policy.orders[same].tolist()
    assert changed


@KINDS
@SEEDS
def test_a_compression_decides_as_the_ruled_policy_under_masks(kind, seed):
    ruled = enforce(masked_policy(seed, kind), RULE).policy
    rows = rows_of(ruled, seed)
    for policy in (ruled, edit(ruled, unlock=[0]).policy):
        for mode in ("merge", "lossless", "auto"):
            small, _ = eutree.compress(policy, rows, mode=mode)
            assert (decided(small, rows) == decided(policy, rows)).all()


@KINDS
@SEEDS
def test_a_locked_leaf_falls_back_as_before_in_any_other_tree(kind, seed):
    """So it is in what `learn` makes of a start, and in every mode of `compress`."""
    policy = masked_policy(seed, kind)
    locked = edit(policy, lock=policy.tree.node_of_leaf[:3].tolist()).policy
    other = masked_policy(seed + 100, kind)
    found = with_locks(with_tree(locked, other.tree, other.actions), locked)
    rows = rows_of(policy, seed)
    held = np.isin(policy.tree.leaf_index(rows), locked.locked)
    assert held.any()
    assert (decided(found, rows) == decided(policy, rows))[held].all()


def test_policies_that_fall_back_on_something_else_are_two():
    schema = Schema((Feature("x", low=0, high=1),), ("p", "q", "r"))
    tree = DecisionTree.single_leaf(1).split(0, 0, 0.5)
    policy = TreePolicy(tree, np.array([0, 0]), schema, masked=True)
    ranks = [np.array([[0, *one], [0, 1, 2]]) for one in ([1, 2], [2, 1])]
    one, other = (replace(policy, ranks=rank) for rank in ranks)
    assert policy != one != other
    assert identity(policy) == identity(one) != identity(other)


def test_without_masks_nothing_is_kept():
    policy = replace(masked_policy(0, "values"), masked=False)
    assert enforce(policy, RULE).policy.ranks is None
    assert '"ranks"' not in policy.to_bytes().decode()


def test_ranks_are_one_for_each_action_of_each_leaf(tmp_path):
    policy = enforce(masked_policy(0, "alone"), RULE).policy
    for bad in (np.zeros((1, 4)), np.zeros(4)):
        with pytest.raises(InvalidArgumentError, match="ranks must have shape"):
            replace(policy, ranks=bad)
    with pytest.raises(InvalidArgumentError, match="ranks must hold integers"):
        replace(policy, ranks=policy.ranks + 0.5)
    path = tmp_path / "policy.json"
    for spoil in (lambda leaf: leaf.pop("ranks"), lambda leaf: leaf["ranks"].append(1)):
        document = json.loads(policy.to_bytes())
        spoil(document["leaves"][1])
        path.write_text(json.dumps(document))
        with pytest.raises(FormatError, match="every leaf must have 4 ranks"):
            TreePolicy.load(path, hand_edited=True)
