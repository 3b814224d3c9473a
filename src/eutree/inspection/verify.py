"""Exact answers to questions about a policy, by intersecting boxes: a proof or a counter-example.

Everything is decided over the doubles: a property that holds does so for every observation within
the schema's bounds, and the point of a counter-example is an observation that breaks it. NaN, which
is no number and takes the right branch of every test, is outside of every statement.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers
from eutree.display import Displayed
from eutree.errors import InvalidArgumentError
from eutree.inspection.properties import Property, parse
from eutree.inspection.regions import Region, domain, finite_box, is_box, volumes
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees.boxes import leaf_boxes, meetings
from eutree.trees.digits import Digits
from eutree.trees.text import printable
from eutree.validation import check_observations
from eutree.wording import counted

_MOST_SWITCHES = 20


@dataclass(frozen=True, eq=False)
class CounterExample:
    """Where a property fails.

    Attributes:
        region: A box of observations that break it, none of which keeps it.
        point: An observation inside.
        raised: For monotonicity: ``point`` with the feature changed, where the action is another.
        action: What is decided at ``point``; for monotonicity at ``raised``.
        leaf: The leaf of ``point``.
        share: Share of the region in question that the box takes.
        words: The box in words.
    """

    region: Region
    point: Floats  # [d]
    raised: Floats | None  # [d]
    action: int
    leaf: int
    share: float
    words: str


@dataclass(frozen=True)
class Verification(Displayed):
    """The answer to a question.

    Attributes:
        property: The question.
        holds: Whether it is proven; else it is refuted.
        counter_examples: Where it fails, the largest box first; empty for a proof.
        share: Share of the region in question where it fails; for monotonicity of the largest box.
        leaves_checked: How many leaves reach into the region in question.
        note: What a reader of a proof should know besides; empty for none.
    """

    property: str
    holds: bool
    counter_examples: tuple[CounterExample, ...]
    share: float
    leaves_checked: int
    note: str = ""

    def __str__(self) -> str:
        """Return the answer in words."""
        if self.holds:
            checked = f"{counted(self.leaves_checked, 'leaf')} checked"
            return f"proven: {self.property} ({checked}{self.note and f'; {self.note}'})"
        first = self.counter_examples[0]
        return f"refuted: {self.property}; {first.words}"


class _Pair(NamedTuple):
    """Two leaves between which one feature switches the action, and where in the first one."""

    share: float
    leaf: int
    other: int
    region: Region


def verify(
    policy: TreePolicy,
    question: str | Property,
    *,
    observations: ArrayLike | None = None,
    everywhere: bool = False,
) -> Verification:
    """Prove a property of a policy, or refute it with boxes and points.

    - ``never ACTION when ...``: no observation that meets the conditions gets the action.
    - ``always ACTION when ...``: all of them do.
    - ``monotone ACTION in FEATURE when ...``: raising the feature, and nothing else, never
      switches away from the action (``in falling FEATURE``: lowering it).
    - ``no dead leaves``: each leaf was reached by one of the recorded observations.

    Args:
        policy: The policy.
        question: A property; the language is that of :mod:`eutree.inspection.properties`.
        observations: Recorded observations, shape [N, d]; for dead leaves only.
        everywhere: Ask for all doubles, not only those within the schema's bounds.

    Raises:
        InvalidArgumentError: The text is no property, or asks about no observation at all.
    """
    asked = parse(question, policy.schema) if isinstance(question, str) else question
    region = asked.region if everywhere else _within(asked.region, policy.schema)
    low, high = leaf_boxes(policy.tree)
    low, high = np.maximum(low, region.low), np.minimum(high, region.high)
    reaching = np.flatnonzero(is_box(low, high))
    if asked.kind == "no dead leaves":
        found = _dead(policy, observations)
    elif asked.kind == "monotone":
        found = _switching(policy, asked, low, high, reaching)
    else:
        has = policy.actions[reaching] == asked.action
        wrong = reaching[has if asked.kind == "never" else ~has]
        found = _examples(policy, region, wrong, low, high)
    found.sort(key=lambda example: -example.share)
    shares = [example.share for example in found]
    return Verification(
        property=asked.text,
        holds=not found,
        counter_examples=tuple(found),
        share=max(shares, default=0.0) if asked.kind == "monotone" else float(sum(shares)),
        leaves_checked=int(reaching.size),
        note=_unasked(policy, asked, low[reaching], high[reaching]),
    )


def _unasked(policy: TreePolicy, asked: Property, low: Floats, high: Floats) -> str:
    """Return that no test asks for the feature of a monotone property, where none does."""
    if asked.kind != "monotone":
        return ""
    j = asked.feature
    if np.unique(low[:, j]).size > 1 or np.unique(high[:, j]).size > 1:
        return ""
    where = " there" if j in policy.tree.feature else ""
    return f"no test{where} asks for {printable(policy.schema.features[j].name)}"


def _within(region: Region, schema: Schema) -> Region:
    bounds = domain(schema)
    both = Region(np.maximum(region.low, bounds.low), np.minimum(region.high, bounds.high))
    if not is_box(both.low, both.high):
        raise InvalidArgumentError(
            "conditions must hold somewhere within the bounds of the features, got none where "
            f"{region.words(schema)}"
        )
    return both


def _examples(
    policy: TreePolicy, whole: Region, leaves: Integers, low: Floats, high: Floats
) -> list[CounterExample]:
    """Return the boxes of some leaves, as parts of a region, as counter-examples."""
    schema, inside = policy.schema, domain(policy.schema)
    names = [printable(name) for name in schema.actions]
    shares = volumes(low[leaves], high[leaves], *_finite(policy, whole))
    examples = []
    for leaf, share in zip(leaves.tolist(), shares.tolist(), strict=True):
        region, action = Region(low[leaf], high[leaf]), int(policy.actions[leaf])
        words = f"{names[action]} where {region.words(schema, inside)} (leaf {leaf})"
        examples.append(CounterExample(region, region.point(), None, action, leaf, share, words))
    return examples


def _switching(
    policy: TreePolicy, asked: Property, low: Floats, high: Floats, reaching: Integers
) -> list[CounterExample]:
    """Return pairs of leaves between which changing one feature switches away from the action.

    Only the largest are kept: there may be as many as pairs of leaves.
    """
    has = policy.actions[reaching] == asked.action
    keeps, others = reaching[has], reaching[~has]
    is_other = np.zeros(policy.n_leaves, dtype=bool)
    is_other[others] = True
    found: list[_Pair] = []
    whole = _finite(policy, domain(policy.schema))
    j = asked.feature
    ways = low[keeps], high[keeps]  # where raising (or lowering) the feature leads from each
    ways[0][:, j], ways[1][:, j] = (
        (-np.inf, low[keeps, j]) if asked.falls else (high[keeps, j], np.inf)
    )
    for number, two in meetings(*ways, policy.tree):
        one = keeps[number]
        beyond = high[two, j] <= low[one, j] if asked.falls else low[two, j] >= high[one, j]
        one, two = (leaves[is_other[two] & beyond] for leaves in (one, two))
        lows, highs = np.maximum(low[one], low[two]), np.minimum(high[one], high[two])
        lows[:, j], highs[:, j] = low[one, j], high[one, j]
        shares = volumes(lows, highs, *whole)
        for k in np.argsort(-shares, kind="stable")[:_MOST_SWITCHES].tolist():
            leaves = int(one[k]), int(two[k])
            found.append(_Pair(float(shares[k]), *leaves, Region(lows[k], highs[k])))
    found.sort(key=lambda pair: -pair.share)
    return [_switch(policy, asked, pair, low, high) for pair in found[:_MOST_SWITCHES]]


def _switch(
    policy: TreePolicy, asked: Property, pair: _Pair, low: Floats, high: Floats
) -> CounterExample:
    share, leaf, other, region = pair
    schema, j = policy.schema, asked.feature
    point = region.point()
    raised = point.copy()
    raised[j] = Region(low[other, j : j + 1], high[other, j : j + 1]).point()[0]
    action = int(policy.actions[other])
    names = [printable(schema.actions[number]) for number in (asked.action, action)]
    ends = [float(point[j]), float(raised[j])]
    digits = Digits(schema, policy.tree, others=[(j, end) for end in ends])
    values = [digits.text(j, end) for end in ends]
    words = (
        f"{names[0]} becomes {names[1]} where "
        f"{region.words(schema, domain(schema), digits=digits)} when "
        f"{printable(schema.features[j].name)} goes from {values[0]} to {values[1]}"
    )
    return CounterExample(region, point, raised, action, leaf, share, words)


def _dead(policy: TreePolicy, observations: ArrayLike | None) -> list[CounterExample]:
    if observations is None:
        raise InvalidArgumentError("dead leaves need recorded observations, got none")
    rows = check_observations("observations", observations, n_features=policy.tree.n_features)
    reached = np.bincount(policy.tree.leaf_index(rows), minlength=policy.n_leaves) > 0
    low, high = leaf_boxes(policy.tree)
    whole = domain(policy.schema)
    return _examples(policy, whole, np.flatnonzero(~reached), low, high)


def _finite(policy: TreePolicy, whole: Region) -> tuple[Floats, Floats]:
    """Return the bounds of a region; infinite sides end a little beyond the thresholds."""
    tree = policy.tree
    cuts = [tree.threshold[tree.feature == j] for j in range(tree.n_features)]
    low, high = finite_box(policy.schema, cuts)
    low, high = np.maximum(low, whole.low), np.minimum(high, whole.high)
    return low, np.maximum(low, high)
