"""Make a property true by construction: a rule above the tree, locked.

``verify`` says whether a policy keeps a rule; this makes it keep the rule, and changes no decision
outside of it.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from eutree.errors import InvalidArgumentError
from eutree.inspection.edit import Edited
from eutree.inspection.properties import Property, parse
from eutree.inspection.regions import Region
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree
from eutree.trees.boxes import leaf_boxes
from eutree.trees.grafting import graft
from eutree.trees.text import printable

_ENFORCED = -1


def enforce(policy: TreePolicy, properties: str | Iterable[str]) -> Edited:
    """Return the policy with rules put above its tree, so that each property holds.

    Inside the box of a rule its action is chosen; everywhere else the policy decides as before.
    The leaf of a rule is locked: ``learn`` goes on around it. Of rules that overlap, the later
    ones must not contradict the earlier ones.

    Args:
        policy: The policy.
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
    return Edited(policy, tuple(changes), ())


def _action(policy: TreePolicy, rule: Property) -> int:
    """Return the action that a rule asks for."""
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
    numbers = np.arange(policy.n_leaves)
    tree, origins, ruled = graft(box, {inside: _ENFORCED}, policy.tree, numbers)
    kept = np.isin(origins, list(policy.locked))
    return replace(
        policy,
        tree=tree,
        actions=np.where(origins == _ENFORCED, action, policy.actions[origins]),
        locked=tuple(sorted(ruled | set(np.flatnonzero(kept).tolist()))),
        leaves=None,  # counts of other boxes say nothing now
    )


def _check_locks(policy: TreePolicy, rule: Property, region: Region, action: int) -> None:
    """Raise InvalidArgumentError if a locked leaf decides otherwise somewhere in the rule's box."""
    low, high = leaf_boxes(policy.tree)
    for leaf in policy.locked:
        meet = np.maximum(low[leaf], region.low) < np.minimum(high[leaf], region.high)
        if meet.all() and policy.actions[leaf] != action:
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
