"""The front of a tree: the best tree of each size, by playing, and which of them is handed back.

Three sets of starts, none of which has to do with another: those of the search make and choose the
best tree of each size, those of the contest pick one, and those of the report measure them all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eutree.arrays import Floats
from eutree.compression.episodes import Comparison, Demand, FrontEntry
from eutree.compression.playing import CommonEpisodes, Ground, Outcome
from eutree.compression.searching import FrontSearch
from eutree.compression.smaller_trees import merged, with_locks
from eutree.contests import SmallestWithin, hold, new_table
from eutree.evaluation import Interval
from eutree.policies import TreePolicy

STARTS, STEPS = 1000, 60_000_000  # of each size, and steps of all, where episodes run side by side
FEW_STARTS, FEW_STEPS = 60, 1_500_000  # where they run one by one
FEWEST_STARTS = 12  # of which a quarter sees that a change does harm
JUDGES = 200  # episodes of an evaluation, of which fewer mean a shorter search
PER_START = 800  # episodes of a search for each start, about
EACH = 2  # trees of a size that play
LOSES = 0.1  # of the range of returns: a size that loses more ends the search
SLACK = 0.01  # of the range of returns: a smaller difference counts as none
CONTEST, REPORT = 2**40, 2**41  # first starts

Finish = Callable[[TreePolicy], TreePolicy]


@dataclass(frozen=True, eq=False)
class Front:
    """The best tree of each size, and the one that is handed back."""

    picked: TreePolicy | None  # the tree to hand back; None where no other deserves it
    # The trees, the largest first, after the input; one that earned no more than a smaller one is
    # left out
    entries: tuple[FrontEntry, ...]
    verdict: Comparison | None  # the pick beside the input; None without one


def front_of(
    policy: TreePolicy, known: Sequence[TreePolicy], ground: Ground, demand: Demand, finish: Finish
) -> Front:
    """Return the front of a tree.

    The first of ``known`` makes the same decisions in no more leaves; it is handed back where no
    other tree deserves it. Any other is small enough, and plays beside one that was found to be.
    ``finish`` prepares a tree that was found before it is chosen: rounds it, say.
    """
    exact, most = known[0], demand.max_leaves
    common, steps = _extent(policy, ground, demand.episodes)
    search = FrontSearch([exact], common, steps, lambda one: with_locks(merged(one), policy))
    # A limit is kept whatever it loses: far below the tree's size a single action may be better
    # than what decides most like the tree.
    search.run(2, loses=LOSES if most is None else np.inf)
    sizes = list(search.found.values())
    if common.steps >= steps:  # before all sizes had their turn: the best of those that wait
        sizes += [waiting[:EACH] for waiting in search.waiting().values()]
    found = [one for trees in sizes for one in trees]
    if most is not None and any(one.n_leaves <= most for one in found):
        found += known[1:]
    played = [one for one in map(finish, found) if one.n_leaves <= exact.n_leaves]
    return front_among(policy, [finish(exact), *played], common, demand)


def front_among(
    policy: TreePolicy, trees: Sequence[TreePolicy], common: CommonEpisodes, demand: Demand
) -> Front:
    """Return the front of some challengers, shown beside the input, and the pick among them.

    The starts of the next draw of ``common`` make the front.
    """
    ground = common.ground
    common.redraw(policy)
    best = _best_of_each_size(trees, common)
    verdict = None
    allowed = _allowed(best, common, demand)
    if demand.max_leaves is not None:
        picked = allowed[0] if allowed else None  # of a front the largest is the best
    elif demand.floor is not None:
        picked = _near_best(allowed, ground, demand)
    else:
        picked, verdict = _contest(policy, allowed, ground, demand)
    report = CommonEpisodes(ground, demand.episodes, REPORT)
    report.redraw(policy)
    trees = [one for one, _ in best]
    outcomes = report.outcomes([picked or policy, *trees])
    entries = [FrontEntry.of(policy, report.outcome)]
    entries += [FrontEntry.of(one, o) for one, o in zip(trees, outcomes[1:], strict=True)]
    if picked is not None and verdict is None:
        verdict = Comparison.of(report.outcome.returns, outcomes[0].returns, demand)
    return Front(picked, tuple(entries), verdict)


def _extent(policy: TreePolicy, ground: Ground, episodes: int) -> tuple[CommonEpisodes, int]:
    """Return common episodes of as many starts as the search can afford, and its steps."""
    most = min(STARTS, max(3 * episodes // 2, FEW_STARTS))
    if ground.side_by_side:
        return CommonEpisodes(ground, most), STEPS
    few = min(FEW_STARTS, max(episodes, FEWEST_STARTS))
    common = CommonEpisodes(ground, few)
    common.redraw(policy)
    length, steps = common.traces.actions.size / few, few_steps(episodes)
    return CommonEpisodes(ground, int(np.clip(steps / (length * PER_START), few, most)), few), steps


def few_steps(episodes: int) -> int:
    """Return the most steps of a search where episodes run one by one: fewer if few judge."""
    return FEW_STEPS * min(episodes, JUDGES) // JUDGES


def _best_of_each_size(
    trees: Sequence[TreePolicy], common: CommonEpisodes
) -> list[tuple[TreePolicy, Outcome]]:
    """Return the best tree of each size from fresh starts, the largest first.

    One that is worth no more than a smaller one is left out.
    """
    found = [
        (float(common.worth(outcome).mean()), tree, outcome)
        for tree, outcome in zip(trees, common.outcomes(trees), strict=True)
    ]
    found.sort(key=lambda one: (one[1].n_leaves, -one[0]))
    best: list[tuple[TreePolicy, Outcome]] = []
    most = -np.inf
    for worth, tree, outcome in found:
        if worth > most:
            most = worth
            if best and best[-1][0].n_leaves == tree.n_leaves:
                best.pop()
            best.append((tree, outcome))
    return best[::-1]


def _allowed(
    best: Sequence[tuple[TreePolicy, Outcome]], common: CommonEpisodes, demand: Demand
) -> list[TreePolicy]:
    """Return the trees that are small enough and succeed as often as the floor, or the input.

    If none does where one has to be picked, those that come next: in so few episodes the floor may
    have been lucky, and the most successful of many trees was. Without the margin that one alone
    would be left, be it small and earn little.
    """
    least, most = common.outcome.success_rate, demand.max_leaves
    if demand.floor is not None:
        least = common.outcomes([demand.floor])[0].success_rate
    small = [(one, o.success_rate) for one, o in best if most is None or one.n_leaves <= most]
    if least is None:
        return [tree for tree, _ in small]
    if demand.floor is not None or most is not None:
        least = min(least, max((rate or 0.0 for _, rate in small), default=least))
    return [tree for tree, rate in small if (rate or 0.0) >= least - demand.success_margin]


def _near_best(trees: Sequence[TreePolicy], ground: Ground, demand: Demand) -> TreePolicy:
    """Return the smallest tree within one standard error of the best."""
    if len(trees) == 1:
        return trees[0]
    sizes = tuple(one.n_leaves for one in trees)
    rule = SmallestWithin(sizes=sizes, episodes=demand.episodes, slack=SLACK)
    return trees[hold(rule, new_table(len(trees), rule.most), _runs(trees, ground)).winner]


def _contest(
    policy: TreePolicy, trees: Sequence[TreePolicy], ground: Ground, demand: Demand
) -> tuple[TreePolicy | None, Comparison | None]:
    """Return the tree that wins, and how it did beside the input where that was shown."""
    entrants = [policy, *trees]
    rule = SmallestWithin(
        sizes=tuple(one.n_leaves for one in entrants),
        margin=demand.margin,
        error=demand.error,
        episodes=demand.episodes,
        known=demand.known_range,
    )
    table = new_table(len(entrants), rule.most)
    found = hold(rule, table, _runs(entrants, ground))
    if not found.winner:
        return None, None
    if not found.shown:
        return entrants[found.winner], None
    verdict = Comparison.of(table[0, found.starts], table[found.winner, found.starts], demand)
    change = verdict.return_change
    low = max(change.interval.low, -(demand.margin or 0.0))  # the bisection stops near it
    change = replace(change, interval=Interval(low, change.interval.high))
    return entrants[found.winner], replace(verdict, return_change=change)


def _runs(trees: Sequence[TreePolicy], ground: Ground) -> Callable[[int, Sequence[int]], Floats]:
    """Return a function that runs a tree, by its number, from some starts of a contest."""

    def run(tree: int, starts: Sequence[int]) -> Floats:
        numbers = CONTEST + np.array(starts)
        outcome, _ = ground.play([trees[tree]], np.zeros(len(starts), np.intp), numbers)
        return outcome.returns

    return run
