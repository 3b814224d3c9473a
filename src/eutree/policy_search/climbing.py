"""Climb in a world model: many small random changes of a policy tree, each kept if it earns more.

:mod:`eutree.policy_search.improvement` leaves thresholds that have to move together, or by less
than its few places allow, and trees that no single change improves. Thousands of changes cost no
step. Annealed first, changes that cost something are kept too, fewer and fewer of them
(Kirkpatrick, Gelatt and Vecchi 1983).

Such a search stays where all changes cost something. Other trees have earned as much in between, or
more in some episodes; a tree that C4.5 grows from the episodes that earned most is somewhere else.

Cut far down, a tree loses what only many leaves together do, and no small change finds it again.
So several are annealed *together* while the limit of leaves falls, and take over branches of each
other (crossover, as in the genetic programming of Koza 1992).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from eutree.arrays import Integers
from eutree.c45 import C45Settings, grow
from eutree.policy_search.improvement import Improvement
from eutree.policy_search.variation import Variation
from eutree.world_model import ActionTree, PairedRollouts, Transitions
from eutree.world_model.action_trees import from_decision_tree, n_leaves

TRIES = 1000
DRAWN = 4  # times that all chance of the rollouts is drawn again: one may be climbed on too long
ANNEALED = 4000  # changes tried
HOT = 0.02  # share of a typical return that a change may cost at first, about
HOT_LEAVES = 0.4  # such a share of those annealed together, times the leaves allowed
FALL = 0.6  # share of their changes in which the limit of leaves falls
MOST_ROWS = 20_000  # that a tree is grown from
LUCKY = 5  # episodes
BEST = 0.75  # quantile of the returns


def climbed(
    rollouts: PairedRollouts, policy: ActionTree, variation: Variation, *, price: float
) -> ActionTree:
    """Return a policy after many random changes, of which those stay that pay.

    ``price`` is the return that a leaf must earn.
    """
    for _ in range(DRAWN):
        rollouts.redraw()
        rollouts.run(policy)
        for _ in range(TRIES // DRAWN):
            _try(rollouts, variation.of(rollouts.policy, rollouts.observations), price, 0.0)
        policy = rollouts.policy
    return policy


def annealed(
    rollouts: PairedRollouts,
    policy: ActionTree,
    variation: Variation,
    *,
    price: float,
    scale: float,
) -> ActionTree:
    """Return the best of the policies that annealing comes by; few rollouts are enough.

    ``price`` is that of ``climbed``, and ``scale`` a typical size of returns.
    """
    rollouts.redraw()
    rollouts.run(policy)
    best, worth, most = policy, 0.0, 0.0
    for k in range(ANNEALED):
        temperature = HOT * scale * (1.0 - k / ANNEALED) ** 3
        challenger = variation.of(rollouts.policy, rollouts.observations)
        gain = _try(rollouts, challenger, price, temperature)
        worth += gain
        if gain and worth > most:
            best, most = rollouts.policy, worth
    return best


def annealed_together(
    rollouts: Sequence[PairedRollouts], improvement: Improvement, *, scale: float, changes: int
) -> list[ActionTree]:
    """Return the best of what each of some larger policies became, at most ``max_leaves`` in size.

    Each of them has run in its rollouts, few of which are enough, and tries so many changes.
    ``scale`` is a typical size of returns.
    """
    generator, allowed = rollouts[0].generator, improvement.limit
    spare = max(n_leaves(one.policy) for one in rollouts) - allowed
    price, best = improvement.price * scale, [(-np.inf, one.policy) for one in rollouts]
    widest = allowed + max(0, spare)
    variations = [Variation(one.n_actions, widest, generator) for one in rollouts]
    for k in range(changes):
        limit = allowed + max(0, spare - int((spare + 1) * k / (FALL * changes)))
        temperature = HOT_LEAVES / allowed * scale * (1.0 - k / changes) ** 3
        for i, (one, variation) in enumerate(zip(rollouts, variations, strict=True)):
            if n_leaves(one.policy) > limit:
                replace(improvement, max_leaves=limit).cut(one)
            mate = rollouts[int(generator.integers(len(rollouts)))].policy
            challenger = variation.of(one.policy, one.observations, mate)
            if challenger is not None and n_leaves(challenger) <= limit:
                _try(one, challenger, price, temperature)
            if limit == allowed and one.mean_return > best[i][0]:
                best[i] = one.mean_return, one.policy
    return [policy for _, policy in best]


def _try(
    rollouts: PairedRollouts, challenger: ActionTree | None, price: float, temperature: float
) -> float:
    """Let a challenger replace the policy if that pays or luck allows; return its gain."""
    if challenger is None:
        return 0.0
    needed = price * (n_leaves(challenger) - n_leaves(rollouts.policy))
    allowed = needed - temperature * rollouts.generator.exponential()
    gain = rollouts.gain(challenger, hopeless=allowed)
    if not gain.complete or gain.mean <= allowed:
        return 0.0
    rollouts.run(challenger)
    return gain.mean - needed


def restarts(data: Transitions, *, max_leaves: int) -> Iterator[ActionTree]:
    """Yield a tree of all episodes that earned more than average, of the best, of the old, the new.

    Each is grown from larger and larger leaves until it has no more than ``max_leaves``.
    """
    returns = data.episode_returns
    good = np.flatnonzero(returns > returns.mean())
    best = np.flatnonzero(returns >= np.quantile(returns, BEST))
    half = good.size // 2
    owner = np.cumsum(data.first) - 1
    for episodes in (good, best, good[:half], good[half:]):
        rows = np.flatnonzero(np.isin(owner, episodes))
        if rows.size:
            kept = np.unique(np.linspace(0, rows.size - 1, MOST_ROWS).astype(np.int64))
            yield _grown(data, rows[kept], max_leaves)


def luckiest(
    data: Transitions, generator: np.random.Generator, *, max_leaves: int
) -> ActionTree | None:
    """Return the tree of one of the few episodes that earned most; None if all earned the same."""
    returns = data.episode_returns
    if np.ptp(returns) == 0.0:
        return None
    most = int(generator.choice(np.argsort(-returns, kind="stable")[:LUCKY]))
    owner = np.cumsum(data.first) - 1
    return _grown(data, np.flatnonzero(owner == most), max_leaves)


def _grown(data: Transitions, rows: Integers, max_leaves: int) -> ActionTree:
    """Return C4.5's tree of some rows with at most so many leaves."""
    fewest = 2
    while True:
        settings = C45Settings(min_objects=fewest)
        shown = grow(
            data.observations[rows], data.actions[rows], n_classes=data.n_actions, settings=settings
        )
        tree = from_decision_tree(*shown.to_decision_tree())
        if n_leaves(tree) <= max_leaves:
            return tree
        fewest *= 2
