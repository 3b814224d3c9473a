"""Why a policy decides as it does: the path, the margin of each test, the nearest alternatives."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats
from eutree.data import Demonstrations
from eutree.display import Displayed, counted
from eutree.errors import InvalidArgumentError
from eutree.features import Derivation, formulas_of
from eutree.inspection.regions import Region, domain, is_box, leaf_parts
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees.boxes import leaf_boxes
from eutree.trees.text import Digits, asked, printable, whole
from eutree.validation import check_kind, check_number, check_vector, in_order


@dataclass(frozen=True)
class PathTest:
    """One test on the path.

    Attributes:
        node: The node that tests.
        feature: The feature tested.
        threshold: The largest value for which the test is true.
        value: The observation's value.
        is_true: Whether the value is at most the threshold.
        distance: How far the value is from the threshold, in the feature's unit; how much changes
            the answer where the feature has whole values.
        words: All this in words.
    """

    node: int
    feature: int
    threshold: float
    value: float
    is_true: bool
    distance: float
    words: str


@dataclass(frozen=True, eq=False)
class Alternative:
    """The nearest observation with another action, derived features as free as measured ones.

    Attributes:
        action: The other action.
        observation: The nearest observation of doubles that gets it, whole where features are.
        distance: Largest change of a feature, each in its scale.
        leaf: The leaf of that observation.
        words: The changes that it needs, in words.
        occurs: Whether its derived features are what its measured ones make of them.
    """

    action: int
    observation: Floats  # [d]
    distance: float
    leaf: int
    words: str
    occurs: bool = True


@dataclass(frozen=True)
class Support:
    """A step of a demonstration whose observation fell in the leaf.

    Attributes:
        episode: Number of the episode among the kept ones.
        step: Step within the episode.
        action: The action shown.
    """

    episode: int
    step: int
    action: int


@dataclass(frozen=True)
class Explanation(Displayed):
    """Why a policy decides as it does for one observation.

    Attributes:
        action: The action decided.
        leaf: The number of the leaf that decides.
        path: The tests from the root to the leaf.
        region: The leaf's box in words.
        alternatives: For each other action that some leaf has, the nearest observation that gets
            it; the nearest first.
        visits: Transitions that left the leaf, for each action; None if unknown.
        values: Value of each action in the leaf, NaN where never tried; None if unknown. See
            ``LeafStatistics``: Q, or the mean of the returns that followed.
        support: The demonstrations' steps in the leaf; None without demonstrations.
        text: All this in words.
    """

    action: int
    leaf: int
    path: tuple[PathTest, ...]
    region: str
    alternatives: tuple[Alternative, ...]
    visits: tuple[int, ...] | None
    values: tuple[float, ...] | None
    support: tuple[Support, ...] | None
    text: str

    def __str__(self) -> str:
        """Return the explanation in words."""
        return self.text


def why(
    policy: TreePolicy,
    observation: ArrayLike,
    *,
    demonstrations: Demonstrations | None = None,
    scale: ArrayLike | None = None,
) -> Explanation:
    """Explain one decision.

    The distance between two observations is the largest change of a feature, each divided by its
    scale (scaled L-infinity). The nearest observation of another action is exact: that of the
    nearest leaf, at its nearest double within the bounds of the features.

    Args:
        policy: The policy that decides.
        observation: The features of the tree, shape [d] (history included); or the measured ones
            alone, as at the first step of an episode.
        demonstrations: Whose steps in the same leaf to name.
        scale: Of each feature, shape [d]; by default the width between its bounds, 1 where they
            are infinite or equal.
    """
    tree, schema = check_kind("policy", policy, TreePolicy).tree, policy.schema
    names, derivation = schema.feature_names, policy.derivation
    if is_measured := np.shape(observation) == (derivation.n_measured,) != (tree.n_features,):
        names = names[: derivation.n_measured]
    point = check_vector(
        "observation", in_order("observation", observation, names), size=len(names)
    )
    if is_measured:
        point = policy.features.first(derivation.rows(point))
    leaf = tree.leaf_of(point.tolist())
    action = int(policy.actions[leaf])
    low, high = leaf_boxes(tree)
    digits = Digits(schema, tree, others=enumerate(point.tolist()))
    region = Region(low[leaf], high[leaf]).words(schema, domain(schema), digits=digits)
    known = policy.leaves
    path = _path(policy, point, leaf, digits)
    alternatives = _alternatives(policy, point, action, _scale(policy, scale), digits)
    support = None if demonstrations is None else _support(policy, leaf, demonstrations)
    visits = None if known is None else tuple(known.visits[leaf].tolist())
    values = None if known is None else tuple(known.values[leaf].tolist())
    name = printable(schema.actions[action])
    lines = [f"{name}, by leaf {leaf}: {region}", *(f"  {step.words}" for step in path)]
    lines += [f"  {alternative.words}" for alternative in alternatives]
    lines += [f"  {line}" for line in _tried(policy, leaf)]
    if support is not None:
        lines.append(f"  {_shown(policy, support)}")
    return Explanation(
        action, leaf, path, region, alternatives, visits, values, support, "\n".join(lines)
    )


def _path(policy: TreePolicy, point: Floats, leaf: int, digits: Digits) -> tuple[PathTest, ...]:
    tree, steps = policy.tree, []
    for node in tree.path(leaf)[:-1]:
        test = asked(policy.schema, tree, node)
        feature, one, cut = test
        value = float(point[feature])
        distance = abs(value - cut)
        if one.is_integer:
            distance = abs(value - (np.floor(cut) + (value <= cut)))
        words = f"{test.question(digits)} ? {test.answer(is_left=value <= cut)}"
        if not (one.is_flag or one.categories):
            words += f": {digits.text(feature, value)}, by {_margin(digits, feature, distance)}"
            words += f" {printable(one.unit)}" if one.unit else ""
        steps.append(PathTest(node, feature, cut, value, value <= cut, distance, words))
    return tuple(steps)


def _alternatives(
    policy: TreePolicy, point: Floats, action: int, scale: Floats, digits: Digits
) -> tuple[Alternative, ...]:
    """Return the nearest observation of each other action, the nearest first."""
    schema = policy.schema
    low, high = leaf_parts(policy.tree, schema)
    is_whole = np.array([feature.is_integer for feature in schema.features])
    # The nearest double of a box: the first one above its exclusive bound, or its upper bound.
    first = np.where(is_whole, low + 1.0, np.nextafter(low, np.inf))
    nearest = np.where(point <= low, first, np.minimum(point, high))  # [L, d]
    for group in map(list, schema.groups.values()):  # one category for another
        here = high[:, group] >= 1.0  # [L, k]
        kept = (here & (point[group] == 1.0)).any(axis=1)
        other = np.arange(len(group)) == here.argmax(axis=1)[:, np.newaxis]
        nearest[:, group] = np.where(kept[:, np.newaxis], point[group], other)
    changes = np.abs(nearest - point) / scale
    distances, totals = changes.max(axis=1), changes.sum(axis=1)
    found = []
    for other in range(policy.schema.n_actions):
        leaves = np.flatnonzero(is_box(low, high) & (policy.actions == other))
        if other == action or not leaves.size:
            continue
        leaf = int(leaves[np.lexsort((totals[leaves], distances[leaves]))[0]])
        words = _changes(policy, point, nearest[leaf], other, digits)
        if not (occurs := _occurs(schema, nearest[leaf].tolist())):
            words += " (the derived features of that observation do not fit its measured ones)"
        found.append(Alternative(other, nearest[leaf], float(distances[leaf]), leaf, words, occurs))
    return tuple(sorted(found, key=lambda alternative: alternative.distance))


def _occurs(schema: Schema, point: Sequence[float]) -> bool:
    """Return whether derived features, but those of an unknown step, follow from the others."""
    made = ((j, one) for j, one in formulas_of(schema).items() if not one.remembers)
    return all(one.compute(point, point.__getitem__) == point[j] for j, one in made)


def _changes(
    policy: TreePolicy, point: Floats, nearest: Floats, action: int, digits: Digits
) -> str:
    parts = []
    for j in np.flatnonzero(nearest != point).tolist():
        feature = policy.schema.features[j]
        unit = f" {printable(feature.unit)}" if feature.unit else ""
        bound = float(nearest[j])
        # Just above an exclusive bound: name the bound, not its neighbour.
        below = float(np.nextafter(bound, -np.inf))
        words = digits.above(j, below) if bound > point[j] else digits.at_most(j, bound)
        if feature.is_flag or feature.categories:
            if bound or not feature.group:
                parts.append(whole(feature, bound - 1.0, bound))
            continue
        if feature.is_integer:
            words = f"{'>=' if bound > point[j] else '<='} {digits.text(j, bound)}"
        by = _margin(digits, j, abs(bound - float(point[j])))
        parts.append(f"{printable(feature.name)} {words}{unit} (by {by})")
    numbers = any(part.endswith(")") for part in parts)
    words = f"from {' and '.join(parts)} on" if numbers else f"where {' and '.join(parts)}"
    return f"{printable(policy.schema.actions[action])} {words}"


def _margin(digits: Digits, feature: int, distance: float) -> str:
    """Return a distance in the digits of its feature, rounded up: so far is far enough."""
    return digits.text(feature, -distance).removeprefix("-")  # what is below 0 goes down


def _scale(policy: TreePolicy, scale: ArrayLike | None) -> Floats:
    if scale is not None:
        ordered = in_order("scale", scale, policy.schema.feature_names)
        scales = check_vector("scale", ordered, size=policy.tree.n_features)
        check_number("each of scale", float(scales.min()), low=0.0, low_open=True)
        return scales
    width = np.array([feature.high - feature.low for feature in policy.schema.features])
    return np.where(np.isfinite(width) & (width > 0), width, 1.0)


def _support(policy: TreePolicy, leaf: int, demonstrations: Demonstrations) -> tuple[Support, ...]:
    found = []
    shown = check_kind("demonstrations", demonstrations, Demonstrations)
    if Derivation.of(shown.schema).formulas != policy.derivation.formulas:
        mine, theirs = ([f.formula for f in of.schema.derived] for of in (policy, shown))
        raise InvalidArgumentError(
            f"demonstrations must have the derived features of the policy, {mine}, got {theirs}; "
            "eutree.data.derive makes them"
        )
    for number, episode in enumerate(shown.with_history(policy.history, policy.past_actions)):
        steps = np.flatnonzero(policy.tree.leaf_index(episode.observations[:-1]) == leaf).tolist()
        found += [Support(number, step, int(episode.actions[step])) for step in steps]
    return tuple(found)


def _tried(policy: TreePolicy, leaf: int) -> list[str]:
    """Return the facts on each action that was tried in the leaf, and the actions that were not."""
    known, names = policy.leaves, [printable(name) for name in policy.schema.actions]
    if known is None:
        return []
    visits, values = known.visits[leaf], known.values[leaf]
    tried = np.flatnonzero((visits > 0) | ~np.isnan(values)).tolist()
    untried = [name for number, name in enumerate(names) if number not in tried]
    lines = []
    for action in tried:
        words = f"{names[action]}: {counted(int(visits[action]), 'visit')}"
        if not np.isnan(values[action]):
            error = known.deviations[leaf, action]
            words += f", value {values[action]:.4g}"
            words += "" if np.isnan(error) else f" +- {error:.2g}"
        lines.append(words)
    if untried:
        several = f"the other {len(untried)}" if tried else f"any of the {len(untried)} actions"
        never = " and ".join(untried) if len(untried) < 3 else several
        lines.append(f"never tried here: {never}")
    if tried and not np.isnan(values).all():
        lines.append(f"({known.meaning})")
    return lines


def _shown(policy: TreePolicy, support: tuple[Support, ...]) -> str:
    if not support:
        return "no demonstration was here"
    episodes = len({entry.episode for entry in support})
    counts = np.bincount([entry.action for entry in support]).tolist()
    names = policy.schema.actions
    shown = [f"{count} x {printable(names[a])}" for a, count in enumerate(counts) if count]
    steps = counted(len(support), "demonstrated step")
    return f"{steps} of {counted(episodes, 'episode')}: {', '.join(shown)}"
