"""Change a policy by hand: thresholds, actions, locks; checked, and never without a word."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from eutree.display import Displayed
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.inspection.properties import Property, parse
from eutree.inspection.regions import Region, is_box, leaf_parts
from eutree.policies import TreePolicy
from eutree.policies.reach import with_actions, with_pieces, within_kinds
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes
from eutree.trees.edit import graft
from eutree.trees.text import Digits, asked, printable
from eutree.validation import check_integer, check_number

_ENFORCED = -1


@dataclass(frozen=True)
class Edited(Displayed):
    """An edited policy.

    Attributes:
        policy: The policy with the changes.
        changes: The changes, in words.
        warnings: The side effects of the changes, in words: leaves that nothing reaches.
    """

    policy: TreePolicy
    changes: tuple[str, ...]
    warnings: tuple[str, ...]


def edit(
    policy: TreePolicy,
    *,
    thresholds: Mapping[int, float] | None = None,
    actions: Mapping[int, str] | None = None,
    lock: Iterable[int] = (),
    unlock: Iterable[int] = (),
) -> Edited:
    """Return the policy with some changes made by hand.

    A locked leaf stays: neither an edit nor ``learn`` changes its action, splits it or moves a
    threshold above it. Unlocking comes first, locking last.

    Args:
        policy: The policy to change.
        thresholds: New threshold of some inner nodes, within the bounds of their features.
        actions: New action, by name, of some leaves, by the number of the leaf.
        lock: Nodes below which all leaves are locked.
        unlock: Nodes below which no leaf stays locked.

    Raises:
        InvalidArgumentError: A node, a leaf or a threshold is out of range, or locked.
        UnknownNameError: There is no such action; names the nearest.
    """
    tree = policy.tree
    locked = set(policy.locked) - set(_leaves_below(tree, unlock))
    moved = dict(thresholds or {})
    changes = [_moved(policy, locked, node, value) for node, value in moved.items()]
    labels = policy.actions.copy()
    names = policy.schema.actions
    for leaf, name in (actions or {}).items():
        check_integer("leaf", leaf, high=policy.n_leaves - 1)
        if name not in names:
            raise UnknownNameError("action", name, names)
        if leaf in locked:
            raise InvalidArgumentError(f"leaf must not be locked, got {leaf}; unlock it first")
        old, labels[leaf] = names[labels[leaf]], names.index(name)
        changes.append(f"leaf {leaf}: {printable(old)} became {printable(name)}")
    cuts = tree.threshold.copy()
    cuts[list(moved)] = list(moved.values())
    locked |= set(_leaves_below(tree, lock))
    if locked != set(policy.locked):
        changes.append(f"locked leaves: {sorted(locked) or 'none'}")
    result = replace(
        with_actions(policy, labels) if actions else policy,
        tree=replace(tree, threshold=cuts),
        locked=tuple(sorted(locked)),
        # Counts of other boxes say nothing now, but under masks they are what is fallen back on.
        leaves=None if moved and not policy.masked else policy.leaves,
    )
    # Which leaves did an observation within the bounds reach before, and none does now?
    was, now = (is_box(*leaf_parts(one.tree, policy.schema)) for one in (policy, result))
    lost = np.flatnonzero(was & ~now).tolist()
    warnings = tuple(f"no observation reaches leaf {leaf} any more" for leaf in lost)
    return Edited(result, tuple(changes), warnings)


def numbered(policy: TreePolicy) -> str:
    """Return the tree with the numbers of its nodes and leaves, which edits refer to."""
    tree, lines, depth = policy.tree, [], {0: 0}
    digits = Digits(policy.schema, tree)
    for node in tree.preorder():
        if tree.feature[node] == tree.NO_FEATURE:
            leaf = int(tree.leaf[node])
            lock = ", locked" if leaf in policy.locked else ""
            words = f"leaf {leaf}: {printable(policy.schema.actions[policy.actions[leaf]])}{lock}"
        else:
            words = f"{asked(policy.schema, tree, node).question(digits)} ?"
            depth[int(tree.left[node])] = depth[int(tree.right[node])] = depth[node] + 1
        lines.append(f"{node:>4} {'    ' * depth[node]}{words}")
    return "\n".join(lines)


def _moved(policy: TreePolicy, locked: set[int], node: int, value: float) -> str:
    """Check a new threshold; return the change in words."""
    tree = policy.tree
    check_integer("node", node, high=tree.n_nodes - 1)
    if tree.feature[node] == tree.NO_FEATURE:
        raise InvalidArgumentError(f"node must be a test, got {node}, leaf {tree.leaf[node]}")
    feature = int(tree.feature[node])
    spec = policy.schema.features[feature]
    check_number(f"threshold of {printable(spec.name)}", value, low=spec.low, high=spec.high)
    held = sorted(locked & set(_leaves_below(tree, [node])))
    if held:
        raise InvalidArgumentError(
            f"node {node} must have no locked leaves below it, got {held}; unlock them first"
        )
    digits = Digits(policy.schema, tree, others=[(feature, float(value))])
    old = asked(policy.schema, tree, node)
    new = old._replace(threshold=float(value))
    return f"node {node}: {old.question(digits)} became {new.question(digits)}"


def _leaves_below(tree: DecisionTree, nodes: Iterable[int]) -> list[int]:
    above = {check_integer("node", node, high=tree.n_nodes - 1) for node in nodes}
    return [leaf for leaf in range(tree.n_leaves) if above.intersection(tree.path(leaf))]


def enforce(policy: TreePolicy, properties: str | Iterable[str]) -> Edited:
    """Return the policy with rules put above its tree, so that each property holds.

    Inside the box of a rule its action is chosen; everywhere else the policy decides as before.
    The leaf of a rule is locked: ``learn`` goes on around it. Tests that the kinds of features
    answer are gone. Of rules that overlap, the later ones must not contradict the earlier ones.

    Args:
        policy: The policy to put under rules.
        properties: ``"always ACTION when CONDITIONS"``, one or several, as for ``verify``; with
            two actions ``"never ACTION when CONDITIONS"`` too.

    Raises:
        InvalidArgumentError: A property cannot be enforced, or contradicts a locked leaf.
        UnknownNameError: A property names no feature or action of the policy.
    """
    texts = [properties] if isinstance(properties, str) else list(properties)
    changes = []
    for text in texts:
        rule = parse(text, policy.schema)
        for region in rule.regions:
            policy = _with_rule(policy, rule, region, _action(policy, rule))
        changes.append(f"{rule.text}: a rule of its own now, locked")
    policy = within_kinds(policy)
    lost = np.flatnonzero(~is_box(*leaf_parts(policy.tree, policy.schema))).tolist()
    warnings = tuple(f"no observation reaches leaf {leaf}" for leaf in lost)
    return Edited(policy, tuple(changes), warnings)


def _action(policy: TreePolicy, rule: Property) -> int:
    others = frozenset(range(policy.schema.n_actions)) - rule.actions
    left = {"always": rule.actions, "never": others}.get(rule.kind, frozenset())
    if len(left) == 1:
        return next(iter(left))
    raise InvalidArgumentError(
        f"property must be 'always ACTION when CONDITIONS' to be enforced, got {rule.text!r}"
    )


def _with_rule(policy: TreePolicy, rule: Property, region: Region, action: int) -> TreePolicy:
    _check_locks(policy, rule, region, action)
    box, inside = _box_tree(region, policy.tree.n_features)
    tree, origins, ruled = graft(box, {inside: _ENFORCED}, policy.tree, np.arange(policy.n_leaves))
    found = with_pieces(with_actions(policy, policy.actions), tree, origins)
    return replace(
        found,
        actions=np.where(origins == _ENFORCED, action, found.actions),
        locked=tuple(sorted(ruled.union(found.locked))),
        # Counts of other boxes say nothing now, but under masks they are what is fallen back on.
        leaves=found.leaves if policy.masked else None,
    )


def _check_locks(policy: TreePolicy, rule: Property, region: Region, action: int) -> None:
    """Raise InvalidArgumentError if a locked leaf decides otherwise somewhere in the rule's box."""
    low, high = leaf_boxes(policy.tree)
    for leaf in policy.locked:
        if is_box(*region.meet(low[leaf], high[leaf])) and policy.actions[leaf] != action:
            raise InvalidArgumentError(
                f"{rule.text!r} must not contradict leaf {leaf}, which is locked on "
                f"{printable(policy.schema.actions[policy.actions[leaf]])}; unlock it first"
            )


def _box_tree(region: Region, n_features: int) -> tuple[DecisionTree, int]:
    """Return a tree of which one leaf is the region, and that leaf."""
    tree, leaf = DecisionTree.single_leaf(n_features), 0
    for feature in range(n_features):
        if np.isfinite(region.low[feature]):
            tree, leaf = tree.split(leaf, feature, float(region.low[feature])), tree.n_leaves
        if np.isfinite(region.high[feature]):
            tree = tree.split(leaf, feature, float(region.high[feature]))
    return tree, leaf
