"""Exact answers to questions about a policy, by intersecting boxes: a proof or a counter-example.

Everything is decided over the doubles: a property that holds does so for every observation within
the schema's bounds and of its kinds, and the point of a counter-example is an observation that
breaks it. NaN takes the right branch of every test. It is outside of every statement where it is
observed, not where it is derived of numbers. Masks are: all actions are taken to be allowed.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers
from eutree.display import Displayed, counted
from eutree.errors import InvalidArgumentError
from eutree.inspection.occurring import Occurrence, Occurring
from eutree.inspection.properties import Property, check_says_all, parse
from eutree.inspection.regions import Region, domain, finite_box, is_box, ways
from eutree.policies import TreePolicy
from eutree.schema import Feature
from eutree.trees.boxes import leaf_boxes, possible, volumes
from eutree.trees.text import Digits, printable
from eutree.validation import check_kind, check_observations

_MOST_SWITCHES = 20


@dataclass(frozen=True, eq=False)
class CounterExample:
    """Where a property fails.

    Attributes:
        region: A box of observations that break it, none of which keeps it.
        point: An observation inside.
        raised: For monotonicity: ``point`` with the feature changed, where the action is another.
        action: The decision at ``point``; for monotonicity at ``raised``.
        leaf: The leaf of ``point``.
        share: Share of the region in question that the box takes.
        words: The box in words.
        occurs: Whether ``point`` is an observation. Else, which can only be where features are
            derived, none was found in the box, and it is not known that there is none.
    """

    region: Region
    point: Floats  # [d]
    raised: Floats | None  # [d]
    action: int
    leaf: int
    share: float
    words: str
    occurs: bool = True


@dataclass(frozen=True)
class Verification(Displayed):
    """The answer to a question.

    Attributes:
        property: The property in question.
        holds: Whether it is proven; else it is refuted.
        counter_examples: Where it fails, the largest box first; empty for a proof.
        share: Share of the region in question where it fails; for monotonicity of the largest box.
        leaves_checked: How many leaves reach into the region in question.
        note: A caution for the reader of a proof; empty for none.
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


class _Part(NamedTuple):
    """A property in one box: how many leaves reach into it, and how large it is."""

    examples: list[CounterExample]
    leaves: int
    size: float
    is_asked: bool = False  # whether a test asks for the feature of a monotone property


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
      switches away from the action, or never lowers a quantity set by the actions (``in falling
      FEATURE``: lowering it).
    - ``no dead leaves``: each leaf was reached by one of the recorded observations.

    Args:
        policy: The policy in question.
        question: A property; the language is that of :mod:`eutree.inspection.properties`.
        observations: Recorded observations, shape [N, d]; for dead leaves only.
        everywhere: Ask for all doubles, whatever the bounds and kinds of the features.

    Raises:
        InvalidArgumentError: The text is no property, or asks about no observation at all.
    """
    schema = check_kind("policy", policy, TreePolicy).schema
    asked = parse(question, schema) if isinstance(question, str) else question
    check_kind("question", asked, Property)
    check_says_all(asked, schema, frozenset(policy.tree.feature.tolist()))
    if everywhere:
        free = (Feature(one.name, one.unit, formula=one.formula) for one in schema.features)
        policy = replace(policy, schema=replace(schema, features=tuple(free)))
    if asked.kind == "no dead leaves":
        parts = [_dead(policy, observations)]
    else:
        parts = list(filter(None, (_part(policy, asked, region) for region in asked.regions)))
        if not parts:
            raise InvalidArgumentError(
                "conditions must hold somewhere within the bounds of the features, got none where "
                f"{asked.regions[0].words(policy.schema)}"
            )
    total = sum(part.size for part in parts)
    weights = [part.size / total if total else 1.0 / len(parts) for part in parts]
    examples = [
        replace(example, share=example.share * weight)
        for part, weight in zip(parts, weights, strict=True)
        for example in part.examples
    ]
    examples.sort(key=lambda example: -example.share)
    shares = [example.share for example in examples]
    return Verification(
        property=asked.text,
        holds=not examples,
        counter_examples=tuple(examples),
        share=max(shares, default=0.0) if asked.kind == "monotone" else float(sum(shares)),
        leaves_checked=max(part.leaves for part in parts),
        note="; ".join(filter(None, _cautions(policy, asked, parts))),
    )


def _part(policy: TreePolicy, asked: Property, region: Region) -> _Part | None:
    """Return the part of a property in one of its boxes; None where it holds no observation."""
    schema = policy.schema
    is_free = np.isinf(region.low) & np.isinf(region.high)
    occurring = Occurring(schema, frozenset(np.flatnonzero(is_free).tolist()))
    region = Region(*possible(*domain(schema).meet(region.low, region.high), schema))
    low, high = possible(*region.meet(*leaf_boxes(policy.tree)), schema)
    if not is_box(region.low, region.high) or occurring.within(region) is None:
        return None
    reaching = np.flatnonzero(is_box(low, high))
    is_asked = False
    if asked.kind == "monotone":
        found = _switching(policy, asked, (low, high), reaching, occurring)
        sides = low[reaching, asked.feature], high[reaching, asked.feature]
        is_asked = any(np.unique(side).size > 1 for side in sides)
    else:
        has = np.isin(policy.actions[reaching], list(asked.actions))
        wrong = reaching[has if asked.kind == "never" else ~has]
        found = _examples(policy, region, wrong, (low, high), occurring.within)
    size = float(volumes(region.low, region.high, *_finite(policy, domain(schema)), schema))
    return _Part(found, int(reaching.size), size, is_asked)


def _cautions(policy: TreePolicy, asked: Property, parts: list[_Part]) -> Iterator[str]:
    """Yield that no test asks for the feature of a monotone property, and that masks may differ."""
    if asked.kind == "monotone" and not any(part.is_asked for part in parts):
        where = " there" if asked.feature in policy.tree.feature else ""
        yield f"no test{where} asks for {printable(policy.schema.features[asked.feature].name)}"
    if policy.masked and asked.kind != "no dead leaves":
        yield "where all actions are allowed: masks may choose another"


def _examples(
    policy: TreePolicy,
    whole: Region,
    leaves: Integers,
    boxes: tuple[Floats, Floats],
    find: Callable[[Region], Occurrence | None],
) -> list[CounterExample]:
    """Return the boxes of some leaves, as parts of a region, in which something is found."""
    schema, inside, (low, high) = policy.schema, domain(policy.schema), boxes
    names = [printable(name) for name in schema.actions]
    shares = volumes(low[leaves], high[leaves], *_finite(policy, whole), schema)
    examples = []
    for leaf, share in zip(leaves.tolist(), shares.tolist(), strict=True):
        region, action = Region(low[leaf], high[leaf]), int(policy.actions[leaf])
        if found := find(region):
            words = f"{names[action]} {region.where(schema, inside)} (leaf {leaf}){found.caution}"
            examples.append(
                CounterExample(region, found.point, None, action, leaf, share, words, found.is_real)
            )
    return examples


def _switching(
    policy: TreePolicy,
    asked: Property,
    boxes: tuple[Floats, Floats],
    reaching: Integers,
    occurring: Occurring,
) -> list[CounterExample]:
    """Return pairs of leaves between which changing one feature switches away from the action.

    Or, where it is a quantity that is asked for, lowers it. Only the largest are kept: there may
    be as many as pairs of leaves.
    """
    low, high = boxes
    schema, j = policy.schema, asked.feature
    rank = asked.ranks(schema)[policy.actions]  # [L]: the value that must not fall
    keeps = reaching[rank[reaching] > rank[reaching].min(initial=np.inf)]
    is_reached = np.zeros(policy.n_leaves, dtype=bool)
    is_reached[reaching] = True
    found: list[_Pair] = []
    whole = _finite(policy, domain(schema))
    most = None if schema.derived else _MOST_SWITCHES  # of those pairs some may not occur
    for one, two in ways(policy.tree, low, high, keeps, j, falls=asked.falls):
        loses = is_reached[two] & (rank[two] < rank[one])
        one, two = one[loses], two[loses]
        lows, highs = np.maximum(low[one], low[two]), np.minimum(high[one], high[two])
        lows[:, j], highs[:, j] = low[one, j], high[one, j]
        lows, highs = possible(lows, highs, schema)
        real = is_box(lows, highs)
        one, two, lows, highs = one[real], two[real], lows[real], highs[real]
        shares = volumes(lows, highs, *whole, schema)
        for k in np.argsort(-shares, kind="stable")[:most].tolist():
            leaves = int(one[k]), int(two[k])
            found.append(_Pair(float(shares[k]), *leaves, Region(lows[k], highs[k])))
    found.sort(key=lambda pair: -pair.share)
    switches = (_switch(policy, asked, pair, boxes, occurring) for pair in found)
    return list(islice(filter(None, switches), _MOST_SWITCHES))


def _switch(
    policy: TreePolicy,
    asked: Property,
    pair: _Pair,
    boxes: tuple[Floats, Floats],
    occurring: Occurring,
) -> CounterExample | None:
    """Return a switch between two leaves; None where no observation is there."""
    (share, leaf, other, region), (low, high) = pair, boxes
    schema, j = policy.schema, asked.feature
    if (occurs := occurring.within(region)) is None:
        return None
    point = occurs.point
    raised = point.copy()
    raised[j] = Region(low[other], high[other]).point(schema)[j]
    action = int(policy.actions[other])
    names = [printable(schema.actions[number]) for number in (policy.actions[leaf], action)]
    ends = [float(point[j]), float(raised[j])]
    digits = Digits(schema, policy.tree, others=[(j, end) for end in ends])
    values = [digits.text(j, end) for end in ends]
    words = (
        f"{names[0]} becomes {names[1]} where "
        f"{region.words(schema, domain(schema), digits=digits)} when "
        f"{printable(schema.features[j].name)} goes from {values[0]} to {values[1]}"
        f"{occurs.caution}"
    )
    return CounterExample(region, point, raised, action, leaf, share, words, occurs.is_real)


def _dead(policy: TreePolicy, observations: ArrayLike | None) -> _Part:
    if observations is None:
        raise InvalidArgumentError(
            "dead leaves need recorded observations (--demos or --run; observations in Python), "
            "got none"
        )
    rows = check_observations("observations", observations, names=policy.schema.feature_names)
    reached = np.bincount(policy.tree.leaf_index(rows), minlength=policy.n_leaves) > 0
    whole = domain(policy.schema)

    def anything(box: Region) -> Occurrence:  # what nothing can reach is dead, too
        return Occurrence(box.point(policy.schema), True)

    found = _examples(policy, whole, np.flatnonzero(~reached), leaf_boxes(policy.tree), anything)
    return _Part(found, policy.n_leaves, 1.0)


def _finite(policy: TreePolicy, whole: Region) -> tuple[Floats, Floats]:
    """Return the bounds of a region; infinite sides end a little beyond the thresholds."""
    low, high = whole.meet(*finite_box(policy.schema, policy.tree))
    return low, np.maximum(low, high)
