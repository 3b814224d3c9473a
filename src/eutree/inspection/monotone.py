"""Make a tree keep monotone rules: the leaves that have to change, and no more than that.

``monotone stop in distance`` says that raising the distance never leads away from ``stop``. So the
leaves that stop must be closed: with a leaf, every leaf that lies above it. Of all closed sets of
leaves the one that costs least is a minimal cut of a graph (Picard, 1976), and with it each leaf's
action: exact for one action and any number of features. Rules of several actions are kept one
after the other, in the order that costs least; where none does, one action for all leaves keeps
any rule. A quantity that may not fall, ``monotone valve in level``, is such a set for each of its
levels: the leaves that set at least as much.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations, product

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.inspection.properties import Property, check_says_all, parse
from eutree.inspection.regions import is_box, ways
from eutree.policies import TreePolicy
from eutree.policies.reach import with_actions
from eutree.schema import Schema
from eutree.trees.boxes import leaf_boxes
from eutree.trees.edit import merge
from eutree.trees.text import printable
from eutree.validation import check_listed

MOST_ORDERED = 4  # sets of actions with rules, of which each order is tried

_Edges = tuple[frozenset[int], Integers, Integers]  # some actions, and pairs of leaves


def monotone_rules(texts: Sequence[str], schema: Schema) -> tuple[Property, ...]:
    """Return the rules that some texts ask for, ``"stop in distance"`` and the like.

    Args:
        texts: Each as for ``verify``, with or without the word ``monotone``.
        schema: Names of features and actions.

    Raises:
        InvalidArgumentError: A text is no monotone rule, two contradict each other, or one is about
            a feature that a derived one is made of.
        UnknownNameError: It names no feature or action.
    """
    rules = tuple(
        parse(text if text.split()[:1] == ["monotone"] else f"monotone {text}", schema)
        for text in check_listed("monotone", texts)
    )
    for number, rule in enumerate(rules):
        check_says_all(rule, schema)
        for other in rules[:number]:
            (mine, falls), (theirs, rises) = _direction(rule, schema), _direction(other, schema)
            if mine == theirs and falls != rises and _meet(rule, other):
                name = printable(schema.feature_names[rule.feature])
                raise InvalidArgumentError(
                    f"monotone rules must not ask for both directions of {name}, got "
                    f"{other.text!r} and {rule.text!r}: no tree that asks for it keeps both"
                )
    return rules


def keep_monotone(
    policy: TreePolicy,
    rules: Sequence[Property],
    weights: Floats | None = None,
    *,
    allowed: Booleans | None = None,
) -> TreePolicy:
    """Return the policy with the actions of some leaves changed, so that it keeps each rule.

    Where it keeps them already, it is returned as it is. Locked leaves keep their actions.

    Args:
        policy: The policy to change.
        rules: The result of ``monotone_rules``.
        weights: The worth of each action in each leaf, shape [L, A]: how often it was shown there,
            say. By default the visits of a leaf for the action it has.
        allowed: Which actions a leaf may name, shape [L, A] (``eutree.policies.reach.ever_allowed``
            says so of masks); another one is named only where no tree keeps the rules without it.

    Raises:
        InvalidArgumentError: Locked leaves contradict a rule.
    """
    if not rules:
        return policy
    worth = _worth(policy) if weights is None else np.asarray(weights, dtype=np.float64).copy()
    if allowed is not None:
        worth -= ~allowed * policy.n_leaves * (float(np.ptp(worth)) + 1.0)
    edges = [
        (chosen, *above)
        for rule in rules
        for above in [_above(policy, rule)]
        for chosen in _closed_sets(rule, policy.schema)
    ]
    free = np.ones(worth.shape, dtype=bool)
    for leaf in policy.locked:
        free[leaf] = np.arange(policy.schema.n_actions) == policy.actions[leaf]
    actions = policy.actions
    if all(
        not (np.isin(actions[one], list(chosen)) & ~np.isin(actions[two], list(chosen))).any()
        for chosen, one, two in edges
    ):
        return policy
    middle = policy.schema.n_actions / 2  # of the levels of a quantity it halves the others
    asked = sorted(
        {chosen for chosen, _, _ in edges},
        key=lambda chosen: (abs(len(chosen) - middle), sorted(chosen)),
    )
    orders = permutations(asked) if len(asked) <= MOST_ORDERED else [tuple(asked)]
    found = [labels for order in orders if (labels := _labels(worth, free, edges, order)).size]
    if not found and policy.locked:
        raise InvalidArgumentError("monotone rules must not contradict the locked leaves")
    leaves = np.arange(policy.n_leaves)
    one_for_all = np.full(policy.n_leaves, worth.sum(axis=0).argmax())  # keeps any rule
    actions = max(found or [one_for_all], key=lambda labels: float(worth[leaves, labels].sum()))
    if policy.locked or policy.masked:  # what leaves fall back on differs, too
        return with_actions(policy, actions)
    tree, labels = merge(policy.tree, actions)
    return replace(policy, tree=tree, actions=labels, leaves=None, ranks=None)


def _labels(
    worth: Floats, allowed: Booleans, edges: Sequence[_Edges], order: tuple[frozenset[int], ...]
) -> Integers:
    """Return an action for each leaf, rules kept set by set; nothing where that fails."""
    for chosen in order:
        pairs = [(one, two) for known, one, two in edges if known == chosen]
        one, two = (np.concatenate(part) for part in zip(*pairs, strict=True))
        member = np.isin(np.arange(worth.shape[1]), list(chosen))
        has = _closed(worth, allowed, member, one, two)
        allowed = allowed & (member == has[:, np.newaxis])
    if not allowed.any(axis=1).all():
        return np.empty(0, np.int64)
    labels: Integers = np.where(allowed, worth, -np.inf).argmax(axis=1)
    return labels


def _worth(policy: TreePolicy) -> Floats:
    """Return the worth of each action in each leaf: its visits, for the action that it has."""
    worth = np.full((policy.n_leaves, policy.schema.n_actions), 0.0)
    visits = np.ones(policy.n_leaves)
    if policy.leaves is not None:
        total = policy.leaves.visits.sum(axis=1)
        visits += total
        worth += policy.leaves.visits / (total[:, np.newaxis] + 1.0)
    worth[np.arange(policy.n_leaves), policy.actions] = visits
    return worth


def _above(policy: TreePolicy, rule: Property) -> tuple[Integers, Integers]:
    """Return pairs of leaves: changing the rule's feature leads from the first to the second."""
    found = [(np.empty(0, np.intp), np.empty(0, np.intp))]
    for region in rule.regions:
        low, high = region.meet(*leaf_boxes(policy.tree))
        is_asked = is_box(low, high)
        leaves = np.flatnonzero(is_asked)
        for one, two in ways(policy.tree, low, high, leaves, rule.feature, falls=rule.falls):
            found.append((one[is_asked[two]], two[is_asked[two]]))
    one, two = (np.concatenate(part) for part in zip(*found, strict=True))
    # Of two actions, the other one is closed the other way.
    return (two, one) if _is_mirrored(rule, policy.schema) else (one, two)


def _closed(
    worth: Floats, allowed: Booleans, member: Booleans, one: Integers, two: Integers
) -> Booleans:
    """Return which leaves get a member of a set, so that with ``one`` of a pair ``two`` does."""
    best = np.where(allowed & member, worth, -np.inf).max(axis=1)
    others = np.where(allowed & ~member, worth, -np.inf).max(axis=1)
    forced = ~np.isfinite(others)
    gain = np.where(forced, np.inf, best - np.where(forced, 0.0, others))
    gain = np.where(np.isfinite(best), gain, -np.inf)
    size = len(worth)
    bound = np.abs(gain[np.isfinite(gain)]).sum() + 1.0
    gain = np.clip(gain, -bound, bound)
    source, sink = size, size + 1
    room = np.zeros((size + 2, size + 2))
    room[source, :size], room[:size, sink] = np.maximum(gain, 0.0), np.maximum(-gain, 0.0)
    room[one, two] = np.inf
    while True:
        before = _reached(room, source)
        if before[sink] < 0:
            return before[:size] >= 0
        path = [sink]
        while path[-1] != source:
            path.append(int(before[path[-1]]))
        steps = (np.array(path[:0:-1]), np.array(path[-2::-1]))
        least = room[steps].min()
        room[steps] -= least
        room[steps[::-1]] += least


def _reached(room: Floats, source: int) -> Integers:
    """Return the node before each one on a shortest way with room; -1 where there is none."""
    before = np.full(len(room), -1, dtype=np.int64)
    before[source] = source
    front = [source]
    while front:
        following = []
        for node in front:
            fresh = np.flatnonzero((room[node] > 0.0) & (before < 0))
            before[fresh] = node
            following += fresh.tolist()
        front = following
    return before


def _is_mirrored(rule: Property, schema: Schema) -> bool:
    """Return whether a rule of the second of two actions is taken for one of the first."""
    return schema.n_actions == 2 and 1 in rule.actions


def _closed_sets(rule: Property, schema: Schema) -> list[frozenset[int]]:
    """Return of which actions the leaves are closed: of one, or of all from a level on."""
    if _is_mirrored(rule, schema):
        return [frozenset({0})]
    ranks = rule.ranks(schema)
    return [frozenset(np.flatnonzero(ranks >= level).tolist()) for level in np.unique(ranks)[1:]]


def _direction(rule: Property, schema: Schema) -> tuple[tuple[int, frozenset[int], int], bool]:
    """Return the control and the actions kept with the feature, and whether that falls."""
    mirrored = _is_mirrored(rule, schema)
    actions = frozenset({0}) if mirrored else rule.actions
    return (rule.control, actions, rule.feature), rule.falls != mirrored


def _meet(one: Property, other: Property) -> bool:
    """Return whether there are observations that both rules speak of."""
    pairs = product(one.regions, other.regions)
    return any(is_box(*theirs.meet(mine.low, mine.high)) for mine, theirs in pairs)
