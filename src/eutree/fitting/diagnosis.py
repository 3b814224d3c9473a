"""The facts that an engineer has to know before relying on a fitted tree, in sentences."""

from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Booleans, Floats, Integers
from eutree.data import Demonstrations
from eutree.data.demonstrations import lessons
from eutree.data.episode import DROPPED
from eutree.evaluation import Evaluation
from eutree.fitting.playing import Played, blame
from eutree.fitting.report import Person, result_in_words, verdict
from eutree.inspection import Region
from eutree.inspection.regions import domain
from eutree.learners.starts import shown_in
from eutree.policies import TreePolicy
from eutree.trees.boxes import leaf_boxes
from eutree.trees.text import printable

OFTEN = 0.05  # share of the episodes with one bad ending that is worth a sentence
MIXED = 0.1  # share of another action in a leaf that makes its decision doubtful
FEW = 10  # steps that say little
TOLD = 5  # actions that are named, of more than are shown
STILL = 0.5  # share of an episode's steps up to its end, all by one leaf: nothing moves on


@dataclass(frozen=True)
class Harm:
    """A leaf that ends episodes badly."""

    leaf: int  # the number of the leaf
    ending: str  # how these episodes end, in the environment's words
    share: float  # share of all episodes that fail with this ending
    share_in_leaf: float  # share of those that end in the leaf, or pass through it
    holds_on: bool  # whether the leaf decides for at least half of such an episode, up to its end
    shown: tuple[int, ...]  # how often each action was shown there
    # The lowest return of a demonstration, which these episodes do not come to; None where the
    # environment reports failures itself
    below: float | None = None


def about_demonstrations(demonstrations: Demonstrations) -> list[str]:
    """Return the faults of the demonstrations as a whole, in sentences."""
    names = demonstrations.schema.actions
    counts = np.bincount(lessons(demonstrations)[1], minlength=len(names))
    found = []
    dropped = {episode.extras.get(DROPPED) for episode in demonstrations}
    absent = np.flatnonzero(counts == 0).tolist()
    last = [printable(names[action]) for action in absent if action in dropped]
    missing = [printable(names[action]) for action in absent if action not in dropped]
    if last:
        found.append(
            f"The demonstrations show {' and '.join(last)} only as the last action of an episode, "
            "left out as no row says what it led to: no tree made of them can take it. Log one "
            "row more."
        )
    if missing:
        told = missing if len(missing) <= TOLD else [*missing[:TOLD], f"{len(missing) - TOLD} more"]
        found.append(
            f"The demonstrations never show {' nor '.join(told)}: no tree made of them can "
            "take that action. Show when it is right."
        )
    person = Person.of(demonstrations)
    if not person.episodes:
        found.append(_without_evidence(demonstrations))
    elif person.success_rate == 0.0:
        found.append(
            f"All {person.episodes} demonstrations failed: the tree copies what fails. Show at "
            "least some that succeed, or let it learn from the start."
        )
    return found


def _without_evidence(demonstrations: Demonstrations) -> str:
    """Return why no demonstration says how well its demonstrator does."""
    which = f"None of the {len(demonstrations)} demonstrations"
    if not any(episode.ending for episode in demonstrations):  # a table without such a column
        why = "says how it ended: no column terminated or truncated is set"
        return f"{which} {why}. Nothing says how well this way of acting does."
    alone = [episode for episode in demonstrations if episode.by_hand is None]
    ended = sum(episode.terminated or episode.truncated for episode in alone)
    counts = {
        "a tree drove in": len(demonstrations) - len(alone),
        "begun at a chosen start:": ended,
        "interrupted or stopped:": len(alone) - ended,
    }
    reasons = ", ".join(f"{words} {count}" for words, count in counts.items() if count)
    return (
        f"{which} was played to its end by the demonstrator alone, from any start ({reasons}). "
        "Nothing says how well this way of acting does."
    )


def about_size(policy: TreePolicy, demonstrations: Demonstrations) -> list[str]:
    """Return that a tree has one leaf although several actions were shown."""
    counts = shown_in(policy, demonstrations, free=True)[0]
    if policy.n_leaves > 1 or np.count_nonzero(counts) < 2:
        return []
    shown = _listing(counts.tolist(), policy.schema.actions)
    return [
        f"The tree is a single leaf: it {taking(policy, 0)}, although {shown} were shown. No test "
        "of the observation explains when."
    ]


def about_result(person: Person, tree: Evaluation, *, doubts: bool) -> list[str]:
    """Return that a tree is worse than its demonstrator, or, with ``doubts``, that it may be."""
    found = verdict(person.whole, tree)
    shown, reached = (result_in_words(side, found.measure) for side in (person.whole, tree))
    if found.is_worse:
        return [f"The tree is worse than the demonstrations: {reached}, they {shown}."]
    if not (doubts and found.is_open):
        return []
    return [
        f"Too close to tell whether the tree is as good as the demonstrations: {reached}, they "
        f"{shown}. More --episodes tell more, and more demonstrations."
    ]


def harms(played: Played, demonstrations: Demonstrations) -> list[Harm]:
    """Return for each frequent bad ending the leaf that has most to do with it, worst first.

    Where the environment reports no failures, an episode is bad that earns less than any
    demonstration: half of the demonstrations themselves earn less than their mean.
    """
    known = [e for e in demonstrations if e.has_rewards and (e.terminated or e.truncated)]
    ended = [episode.undiscounted_return for episode in known]
    below = None if played.evaluation.successes is not None else min(ended, default=np.nan)
    failed = played.failed(np.nan if below is None else below)
    endings, shown = played.evaluation.endings, shown_in(played.policy, demonstrations, free=True)
    found = []
    for ending in np.unique(endings[failed]).tolist():
        so = failed & (endings == ending)
        if so.mean() >= OFTEN:
            found.append(replace(_harm(played, so, ending, shown), below=below))
    return sorted(found, key=lambda harm: -harm.share)


def _harm(played: Played, so: Booleans, ending: str, shown: Integers) -> Harm:
    """Return the harm of the episodes ``so`` [E]; ``shown`` are the actions in each leaf [L, A]."""
    chosen = np.flatnonzero(so).tolist()
    leaves = played.leaves()
    paths = [leaves[number] for number in chosen]
    stuck = int(np.bincount([path[-1] for path in paths]).argmax())
    cut_short = np.mean([played.episodes[number].truncated for number in chosen])
    holds_on = bool(cut_short >= 0.5 and np.mean([_stay(p, stuck) for p in paths]) >= STILL)
    leaf = stuck if holds_on else _doubtful(played, so, paths, shown)
    inside = [path[-1] == leaf if holds_on else bool((path == leaf).any()) for path in paths]
    return Harm(
        leaf=leaf,
        ending=ending,
        share=float(so.mean()),
        share_in_leaf=float(np.mean(inside)),
        holds_on=holds_on,
        shown=tuple(shown[leaf].tolist()),
    )


def _doubtful(played: Played, so: Booleans, paths: list[Integers], shown: Integers) -> int:
    """Return the leaf to blame: one that was shown mixed, if it decided in half of the episodes."""
    guilt = blame(played, so)
    visited = np.mean([np.bincount(p, minlength=guilt.size) > 0 for p in paths], axis=0)
    agreed = shown[np.arange(guilt.size), played.policy.actions]
    mixed = (visited >= 0.5) & (agreed < (1.0 - MIXED) * shown.sum(axis=1))
    return int(np.where(mixed, guilt, -1.0).argmax() if mixed.any() else guilt.argmax())


def in_words(harm: Harm, policy: TreePolicy, n_shown: int) -> str:
    """Return the harm of a leaf and its cause, in words."""
    how = "hold on to the end in" if harm.holds_on else "pass through"
    bad = f"of the episodes end badly, in {harm.ending!r}"
    if harm.below is not None:
        least = f"less than any episode shown ({harm.below:.4g})"
        bad = f"of the episodes earn {least} and end in {harm.ending!r}"
    where = f"leaf {harm.leaf} ({leaf_in_words(policy, harm.leaf)})"
    told = f"{harm.share:.0%} {bad}; {harm.share_in_leaf:.0%} of these {how} {where}."
    return f"{told} {_cause(harm, policy, n_shown)}"


def leaf_in_words(policy: TreePolicy, leaf: int) -> str:
    """Return the action of a leaf and its region, in words."""
    low, high = (_rounded(bounds[leaf]) for bounds in leaf_boxes(policy.tree))
    region = Region(low, high).where(policy.schema, domain(policy.schema))
    return f"{printable(policy.schema.actions[policy.actions[leaf]])} {region}"


def taking(policy: TreePolicy, leaf: int) -> str:
    """Return that a leaf takes its action: always, unless actions are masked."""
    action = printable(policy.schema.actions[policy.actions[leaf]])
    return f"takes {action} wherever it is allowed" if policy.masked else f"always takes {action}"


def _cause(harm: Harm, policy: TreePolicy, n_shown: int) -> str:
    names, total = policy.schema.actions, sum(harm.shown)
    taken = int(policy.actions[harm.leaf])
    if not total:
        return "Nothing was shown there: show such situations."
    if harm.shown[taken] < (1.0 - MIXED) * total:
        return (
            f"There {_listing(list(harm.shown), names)} were shown, and no test of the tree tells "
            f"them apart, so it {taking(policy, harm.leaf)}."
        )
    if total < FEW:
        return f"Only {total} of the {n_shown} steps shown were there: show such situations."
    return (
        f"{printable(names[taken])} was shown in {harm.shown[taken]} of {total} steps there, so "
        "what made the difference is not in the numbers that the tree sees, for example where "
        "something heads, or it lies earlier."
    )


def _stay(path: Integers, leaf: int) -> float:
    """Return the share of an episode's steps, up to its end, that one leaf decided."""
    elsewhere = np.flatnonzero(path != leaf)
    return (len(path) - 1 - (int(elsewhere[-1]) if elsewhere.size else -1)) / len(path)


def _rounded(bounds: Floats) -> Floats:
    return np.array([float(f"{value:.4g}") for value in bounds])


def _listing(counts: list[int], names: tuple[str, ...]) -> str:
    parts = [f"{printable(names[a])} {count} times" for a, count in enumerate(counts) if count]
    return " and ".join(parts)
