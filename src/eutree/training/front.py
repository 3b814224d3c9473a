"""The front of a run: the best tree of each size, and which of them meets the start.

From the trees that the run had last, smaller ones are made: imagined by the learner's world model
where it has one, which costs no step, else by the decisions at stored observations. Those that
promise most play: from some starts the best of each size is found, from others the pick, from
others again the reported returns. Steps are few beside those of the run where they are dear.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eutree.compression.episodes import Demand
from eutree.compression.front import EACH, Front, front_among
from eutree.compression.imagined import ImaginedCommonEpisodes
from eutree.compression.playing import CommonEpisodes, Ground
from eutree.compression.searching import FrontSearch
from eutree.compression.smaller_trees import Costs, Ladder, merged, with_locks
from eutree.learners import Learner
from eutree.learners.learner import Imagines
from eutree.policies import TreePolicy
from eutree.training.proposals import key

IMAGINED, MOST_IMAGINED = 2000, 40_000_000  # steps for each step of the run, and at most
FEWEST, MOST = 60, 1000  # starts
TREES = 24  # that play, if there are steps for so many
ROUNDS = 2.0  # of the starts, that all trees together play from
IMAGINED_EPISODES = 1000
IMAGINING = 500_000  # steps a second that a slow machine imagines
TIMES = 2  # leaves of a tree to make smaller ones of, in those allowed; else labels cut it first
LOSES = 0.15  # of the range of returns: a size that is imagined to lose more is the last one
ROWS = 5000  # stored observations by which a tree is cut where nothing is imagined


@dataclass(frozen=True, kw_only=True)
class Extent:
    """How much a front may play.

    Attributes:
        starts: Starts of each choice.
        trees: Most trees.
        imagined: Steps in the world model, about.
    """

    starts: int
    trees: int
    imagined: int

    @classmethod
    def of(cls, steps: int, taken: int, episodes: int, *, least: int = 0) -> "Extent | None":
        """Return the effort that so many steps are enough for, if any.

        The run has taken so many steps in so many episodes. At the ``least`` so many trees have to
        play, from however few starts.
        """
        affordable = steps / (ROUNDS * max(taken / max(episodes, 1), 1.0))
        starts = int(np.clip(affordable / TREES, FEWEST, MOST))
        trees = int(affordable / starts)
        if trees < least:
            starts, trees = max(int(affordable / least), 2), least
        imagined = min(IMAGINED * taken, MOST_IMAGINED)
        return cls(starts=starts, trees=trees, imagined=imagined) if trees >= 2 else None


def front_of_run(
    trees: Sequence[TreePolicy],
    start: TreePolicy,
    learner: Learner,
    ground: Ground,
    extent: Extent,
    keeping: Callable[[TreePolicy], TreePolicy],
    *,
    tried: TreePolicy | None,
    max_leaves: int | None,
    success_margin: float,
    generator: np.random.Generator,
) -> Front:
    """Return the front of a run; the pick is never None.

    Args:
        trees: The learned tree, then those learned before.
        start: The run's first policy, which the pick succeeds as often as, but for the margin.
        learner: Imagines, where it can, and knows the transitions seen.
        ground: Where trees play.
        extent: How much.
        keeping: Makes a tree keep the run's rules.
        tried: Plays as it is: a model that is wrong about it is wrong about all cut from it.
        max_leaves: Most leaves of the pick; None for any number.
        success_margin: That of the judgement that follows.
        generator: Source of all chance that is not of an episode.
    """
    learned = trees[0]

    def here(one: TreePolicy) -> TreePolicy:
        # An earlier incumbent may be the expert tree, which was shown in another environment, or
        # one from before features were derived.
        tree = replace(one.tree, n_features=learned.tree.n_features)
        return replace(
            one,
            tree=tree,
            environment=learned.environment,
            schema=learned.schema,
            history=learned.history,
            past_actions=learned.past_actions,
        )

    def checked(one: TreePolicy) -> TreePolicy:
        return keeping(with_locks(merged(here(one)), learned))

    rollouts = None
    if isinstance(learner, Imagines):
        rollouts = learner.imagined(IMAGINED_EPISODES, generator)

    def by_labels(one: TreePolicy) -> list[TreePolicy]:
        return _by_labels(one, learner, checked)

    most = max_leaves or math.inf
    if rollouts is not None:
        episodes = ImaginedCommonEpisodes(rollouts)
        begun = [_within(one, TIMES * most, by_labels) for one in map(here, trees)]
        search = FrontSearch(begun, episodes, extent.imagined, checked)
        search.run(2, loses=LOSES if max_leaves is None else math.inf)
        best = search.waiting() | search.found
        found = [one for size in sorted(best, reverse=True) for one in best[size][:EACH]]
        if max_leaves is not None:
            # One that decides as the learned tree did in the world, whatever the model thinks.
            found = [_within(begun[0], most, by_labels), *_by_gain(found, episodes)]
    else:
        found = by_labels(learned)
        if max_leaves is not None:  # then the start may be too large itself
            found += by_labels(here(start))
            found.sort(key=lambda one: -one.n_leaves)
    demand = Demand(
        episodes=extent.starts,
        max_leaves=max_leaves,
        floor=here(start),
        success_margin=success_margin,
    )
    beside = [] if tried is None else [checked(tried)]
    play = [checked(learned), *beside, *found]
    if max_leaves is not None:  # no other can be picked: those that may not would take their place
        play = [one for one in play if one.n_leaves <= most] or play
    common = CommonEpisodes(ground, extent.starts)
    chosen = _few(play, extent.trees, spread=max_leaves is None)
    return front_among(learned, chosen, common, demand)


def earns_more(challenger: TreePolicy, incumbent: TreePolicy, ground: Ground, starts: int) -> bool:
    """Return whether a tree does better by more than a standard error, in common episodes."""
    common = CommonEpisodes(ground, starts)
    common.redraw(incumbent)
    (gain,) = common.gains([challenger])
    return gain.mean > gain.error


def _by_labels(
    policy: TreePolicy, learner: Learner, checked: Callable[[TreePolicy], TreePolicy]
) -> list[TreePolicy]:
    """Return the trees that decide most like one of the run's, the largest first."""
    seen = policy.derivation.behind(learner.history.observations)
    if len(seen) == 0 or seen.shape[1] != policy.tree.n_features:
        return []
    costs = Costs.of(policy, seen[:: len(seen) // ROWS + 1], "visits")
    return [checked(one) for one in reversed(Ladder(policy, costs).rungs())]


def _within(
    policy: TreePolicy, most: float, by_labels: Callable[[TreePolicy], list[TreePolicy]]
) -> TreePolicy:
    """Return the tree of at most so many leaves that decides most like a policy, if one is known.

    From a tree of many leaves the search would spend all it has on sizes that may not be picked.
    """
    small = [policy] if policy.n_leaves <= most else by_labels(policy)
    return next((one for one in small if one.n_leaves <= most), policy)


def _by_gain(trees: Sequence[TreePolicy], episodes: ImaginedCommonEpisodes) -> list[TreePolicy]:
    """Return trees in the order of their imagined returns, the best first."""
    episodes.redraw(trees[0])
    gains = [one.mean for one in episodes.gains(trees)]
    return [trees[k] for k in np.argsort(-np.array(gains), kind="stable").tolist()]


def _few(trees: Sequence[TreePolicy], most: int, *, spread: bool) -> list[TreePolicy]:
    """Return trees that differ, at most so many: the first ones, or spread evenly over sizes.

    Spread, the first tree plays, and of each size the one that stands first before the others.
    """
    distinct = list({key(one): one for one in trees}.values())
    if len(distinct) <= most or not spread:
        return distinct[:most]
    best = list({one.n_leaves: one for one in reversed(distinct[1:])}.values())[::-1]
    if len(best) >= most:
        places = np.linspace(0, len(best) - 1, most - 1).astype(int).tolist()
        return [distinct[0], *(best[k] for k in places)]
    others = [one for one in distinct[1:] if all(one is not other for other in best)]
    return [distinct[0], *best, *others][:most]
