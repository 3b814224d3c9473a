"""Improve a policy tree in a world model: a local search, one tested change at a time.

*Box insertion*: in each leaf find the box in which another action pays most, judged by one-step
deviations, and give it that action. *Subtree replacement*: replace a node by one of its children
where that costs less than the leaves it saves. *Threshold perturbation*: move a threshold where
that pays. A change is accepted only if the changed policy earns more than the present one, by
paired rollouts, by more than its price in leaves.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.features import threshold_between
from eutree.policy_search import _kernels_search
from eutree.validation import check_amounts, check_number
from eutree.world_model import ActionTree, PairedRollouts
from eutree.world_model.action_trees import Nested, n_leaves, nested, packed, with_box, with_child

MOST_BOXES = 12
MOST_LEAVES, MOST_OF_CODES = 40, 100  # where none are named
SHIFTS = (0.02, 0.05, 0.1, 0.2, 0.4)
FEW = 20
OTHERS = 2  # other actions up to which all are tried at as many steps
CYCLES, GROWN = 3, 5  # of shrinking, and leaves by which a policy may grow between two
# What a deviation inside a box has to pay on average, as a share of the most that one pays.
LEAST_GAINS = (0.25, 0.5, 0.75)


class _Deviations(NamedTuple):
    """Gains of single deviations from a policy, per episode."""

    gains: Floats  # [n, A]
    observations: Floats  # [n, d] where
    node: Integers  # [n] leaf node of the policy


@dataclass(frozen=True, kw_only=True)
class Improvement:
    """How a policy tree is improved.

    Attributes:
        rounds: Rounds of box insertion, subtree replacement and threshold perturbation, each with
            other random numbers.
        price: Return per episode that a leaf must earn, as a share of a typical return's size.
        deviations: Steps at which single deviations are tried, at most; with more than three
            actions so many fewer that no more deviations are tried than with three.
        min_rows: Fewest deviations inside a box.
        max_leaves: Most leaves of the tree; None for 40, or where codes are counted for 100.
    """

    rounds: int = 1
    price: float = 0.002
    deviations: int = 6000
    min_rows: int = 8
    max_leaves: int | None = None

    def __post_init__(self) -> None:
        check_amounts(self, rounds=1, deviations=1, min_rows=1, max_leaves=2)
        check_number("price", self.price, low=0.0)

    @property
    def limit(self) -> int:
        """Most leaves of a tree that grew by changes."""
        return MOST_LEAVES if self.max_leaves is None else self.max_leaves

    def of_codes(self) -> "Improvement":
        """Return the same for trees of codes, which are not grown but solved for, whole."""
        return replace(self, max_leaves=self.max_leaves or MOST_OF_CODES)

    def improve(
        self, rollouts: PairedRollouts, policy: ActionTree, scale: float, *, begin: bool = False
    ) -> ActionTree:
        """Return a policy that earns more or is smaller; the rollouts end with it run.

        ``scale`` is a typical size of returns. ``begin`` says that no policy is known yet but a
        single action: then boxes are also tried where fewer deviations pay, and each of them more.
        """
        price = self.price * scale
        for _ in range(self.rounds):
            rollouts.redraw()
            rollouts.run(policy)
            self._insert_boxes(rollouts, price, begin=begin)
            _replace_subtrees(rollouts, price)
            _perturb_thresholds(rollouts)
            policy = packed(nested(rollouts.policy))
        return policy

    def shrunk(
        self, rollouts: PairedRollouts, policy: ActionTree, scale: float
    ) -> Iterator[ActionTree]:
        """Yield policies of at most ``max_leaves``, each made of the last one.

        Cut to size, a policy may grow again by a few leaves that cost nothing and is cut once more:
        so leaves move to where they earn most. Arguments are those of ``improve``.
        """
        wide = replace(self, price=0.0, max_leaves=self.limit + GROWN)
        rollouts.redraw()
        rollouts.run(policy)
        for cycle in range(CYCLES):
            self.cut(rollouts)
            policy = self.improve(rollouts, rollouts.policy, scale)
            yield policy
            if cycle + 1 < CYCLES:
                wide.improve(rollouts, policy, scale)
                rollouts.redraw()
                rollouts.run(rollouts.policy)

    def cut(self, rollouts: PairedRollouts) -> None:
        """Cut the policy to size: the node first by which least is lost, thresholds moved after."""
        while n_leaves(rollouts.policy) > self.limit:
            policy = rollouts.policy
            most, chosen = -np.inf, policy
            for node in np.flatnonzero(policy.feature >= 0).tolist():
                for goes_left in (True, False):
                    challenger, _ = with_child(policy, node, goes_left=goes_left)
                    gain = rollouts.gain(challenger, hopeless=most)
                    if gain.mean > most and n_leaves(challenger) > 1:
                        most, chosen = gain.mean, challenger
            rollouts.run(chosen)
            _perturb_thresholds(rollouts)

    def _insert_boxes(self, rollouts: PairedRollouts, price: float, *, begin: bool) -> None:
        """Insert the most promising boxes, one for each leaf, that pass the test.

        Where a single deviation pays almost everywhere, as when any delay brings the agent past
        somebody, the box that pays most is where to deviate for ever. It is refused, and would be
        for ever: who is to ``begin`` and has one action still tries smaller ones.
        """
        deviations = self._deviations(rollouts)
        base = rollouts.policy
        self._try_boxes(rollouts, price, self._boxes(rollouts, price, deviations))
        if begin and rollouts.policy is base and n_leaves(base) == 1:
            self._begin(rollouts, price, deviations)

    def _begin(self, rollouts: PairedRollouts, price: float, deviations: _Deviations) -> None:
        """Insert the best box of those in which each deviation pays more, if it passes the test."""
        base = rollouts.policy
        most, chosen = 0.0, None
        for least in LEAST_GAINS:
            for leaf, change in self._boxes(rollouts, price, deviations, least):
                challenger = packed(nested(base, instead={leaf: change}))
                needed = price * (n_leaves(challenger) - 1)
                gain = rollouts.gain(challenger, hopeless=needed + most)
                passes = gain.complete and gain.mean - gain.error > needed
                if passes and n_leaves(challenger) <= self.limit and gain.mean - needed > most:
                    most, chosen = gain.mean - needed, challenger
        if chosen is not None:
            rollouts.run(chosen)

    def _try_boxes(
        self, rollouts: PairedRollouts, price: float, boxes: list[tuple[int, Nested]]
    ) -> None:
        """Insert those of the first boxes that pass the test, one for each leaf."""
        base = rollouts.policy
        changes: dict[int, Nested] = {}
        for leaf, change in boxes[:MOST_BOXES]:
            if leaf in changes:
                continue
            challenger = packed(nested(base, instead={**changes, leaf: change}))
            if n_leaves(challenger) > self.limit:
                continue
            needed = price * (n_leaves(challenger) - n_leaves(rollouts.policy))
            gain = rollouts.gain(challenger, hopeless=needed)
            if gain.complete and gain.mean - gain.error > needed:
                changes[leaf] = change
                rollouts.run(challenger)

    def _deviations(self, rollouts: PairedRollouts) -> _Deviations:
        """Return the gains of single deviations at some steps of the policy's episodes."""
        n_steps = rollouts.n_steps
        others = max(rollouts.n_actions - 1, OTHERS)
        n = min(self.deviations * OTHERS // others, n_steps)
        steps = np.sort(rollouts.generator.choice(n_steps, n, replace=False))
        gains = rollouts.deviations(steps) * (n_steps / n / rollouts.n_episodes)  # [n, A]
        return _Deviations(gains, rollouts.observations[steps], rollouts.node[steps])

    def _boxes(
        self, rollouts: PairedRollouts, price: float, deviations: _Deviations, least: float = 0.0
    ) -> list[tuple[int, Nested]]:
        """Return leaf nodes and the trees to put in their place, the most promising first.

        ``least`` is the gain that a deviation inside a box needs on average, as a share of the most
        that one pays.
        """
        gains, observations, node = deviations
        found: list[tuple[float, int, Nested]] = []
        box = np.empty((observations.shape[1], 2))
        for leaf in np.unique(node):
            rows = np.flatnonzero(node == leaf)
            taken = int(rollouts.policy.action[leaf])
            for action in range(gains.shape[1]):
                if rows.size < 2 * self.min_rows or action == taken:
                    continue
                mine: Floats = np.ascontiguousarray(gains[:, action])
                if least > 0.0:
                    mine = mine - least * mine.max()
                gain, cuts = _kernels_search.best_box(
                    observations, mine, rows, self.min_rows, price, box
                )
                if gain > price * cuts:
                    found.append((price * cuts - gain, int(leaf), with_box(box, action, taken)))
        return [(leaf, change) for _, leaf, change in sorted(found, key=lambda item: item[:2])]


def _replace_subtrees(rollouts: PairedRollouts, price: float) -> None:
    """Replace the node that pays most by a child, again and again, while any pays.

    Another node's gain is weighed again only when its turn comes, and all once more at the end.
    """
    while True:
        policy = rollouts.policy
        pays: dict[tuple[int, bool], float] = {}
        for node in np.flatnonzero(policy.feature >= 0).tolist():
            for goes_left in (True, False):
                challenger, _ = with_child(policy, node, goes_left=goes_left)
                worth = _worth(rollouts, challenger, price)
                if worth > 0.0:
                    pays[node, goes_left] = worth
        if not pays:
            return
        weighed = set(pays)
        while pays:
            node, goes_left = best = max(pays, key=pays.__getitem__)
            challenger, source = with_child(rollouts.policy, node, goes_left=goes_left)
            if best not in weighed:
                weighed.add(best)
                pays[best] = _worth(rollouts, challenger, price)
                if pays[best] <= 0.0:
                    del pays[best]
                continue
            rollouts.run(challenger)
            now = {old: k for k, old in enumerate(source.tolist()) if challenger.feature[k] >= 0}
            pays = {(now[old], side): w for (old, side), w in pays.items() if old in now}
            weighed = set()


def _worth(rollouts: PairedRollouts, challenger: ActionTree, price: float) -> float:
    """Return a smaller challenger's gain, leaves included; 0 if it is clearly not more than 0."""
    saved = price * (n_leaves(rollouts.policy) - n_leaves(challenger))
    gain = rollouts.gain(challenger, hopeless=-saved)
    return gain.mean + saved if gain.complete else 0.0


def _perturb_thresholds(rollouts: PairedRollouts) -> None:
    """Move each threshold to the best of a few places near it, if that pays."""
    for node in rollouts.generator.permutation(np.flatnonzero(rollouts.policy.feature >= 0)):
        policy = rollouts.policy
        values = rollouts.values_at(int(node), int(policy.feature[node]))
        if values.size < FEW:
            continue
        best, best_challenger = 0.0, None
        for sign in (-1, 1):
            last = 0.0
            for threshold in _places(values, float(policy.threshold[node]), sign):
                thresholds = policy.threshold.copy()
                thresholds[node] = threshold
                challenger = policy._replace(threshold=thresholds)
                gain = rollouts.gain(challenger, hopeless=last)
                if not gain.complete:
                    break
                last = max(last, gain.mean)
                if gain.mean > max(best, gain.error):
                    best, best_challenger = gain.mean, challenger
        if best_challenger is not None:
            rollouts.run(best_challenger)


def _places(values: Floats, threshold: float, sign: int) -> list[float]:
    """Return thresholds a few per cent of the smaller side away, on one side, the nearest first."""
    n = values.size
    at = int(np.searchsorted(values, threshold))
    reach = min(n, 4 * min(at, n - at) + FEW)
    places = []
    for share in SHIFTS:
        i = at + sign * max(1, int(share * reach))
        if 1 <= i < n:
            places.append(threshold_between(*values[i - 1 : i + 1].tolist()))
    return places
