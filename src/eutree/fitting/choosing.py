"""Choose a tree by playing: halve the candidates, then repair the winner where it does harm.

Both are contests (:mod:`eutree.contests`) that promise nothing: who judges the tree that they hand
on plays fresh episodes.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from eutree.contests import Halving
from eutree.data import Demonstrations
from eutree.fitting.person import Person
from eutree.fitting.playing import Played, Player
from eutree.fitting.repair import blame, repairs
from eutree.learners.expert_candidates import Candidate

RACING, REPAIRING, CONFIRMING, JUDGING, COMPARING = 0, 100, 200, 300, 301  # first blocks
MOST_REPAIRS = 3  # one after the other
BLAMED_LEAVES = 3  # that are tried for each of them
# At two actions: each leaf has three repairs; the tree itself, and twice two longer plays.
MOST_REPAIR_PLAYS = MOST_REPAIRS * (3 * BLAMED_LEAVES + 1 + 4)


def race(found: list[Candidate], player: Player, budget: int) -> tuple[Candidate, Played]:
    """Return the winner and what it has played: the worse half drops out after each round.

    All play the same episodes, in each round as many more as they have played. The first wins ties.

    Args:
        found: The candidates, at least one.
        player: Plays them.
        budget: Episodes of all of them together.
    """
    left, cost, rounds = len(found), len(found), 1
    while left > 2:  # a round doubles what each of those left has played
        left = (left + 1) // 2
        cost += left * 2 ** (rounds - 1)
        rounds += 1
    first = max(1, budget // cost)
    rule = Halving(first=first, most=first * 2 ** (rounds - 1))
    winner, played = player.contest(rule, [entry.policy for entry in found], RACING)
    return found[winner], played


def mend(
    candidate: Candidate,
    played: Played,
    demonstrations: Demonstrations,
    player: Player,
    budget: int,
) -> tuple[Candidate, Played]:
    """Return the candidate, repaired leaf by leaf as long as it falls short of the person.

    Each repair plays the same new block as the tree that it is made of; the best one is taken if
    it does better there and again on another block, twice as long.

    Args:
        candidate: A tree.
        played: What it has played.
        demonstrations: What was shown.
        player: Plays the repaired trees.
        budget: Episodes in which each of them is tried.
    """
    person = Person.of(demonstrations)
    for number in range(MOST_REPAIRS):
        if not person.is_above(played.evaluation):
            break
        tried = [candidate, *_repaired(candidate, played, demonstrations, person)]
        for block, episodes in ((REPAIRING, budget), (CONFIRMING, 2 * budget)):
            rule = Halving(first=episodes, most=episodes)
            policies = [entry.policy for entry in tried]
            winner, again = player.contest(rule, policies, block + number)
            if winner == 0:
                return candidate, played
            tried = [candidate, tried[winner]]
        candidate, played = tried[1], again
    return candidate, played


def _repaired(
    candidate: Candidate, played: Played, demonstrations: Demonstrations, person: Person
) -> Iterable[Candidate]:
    """Yield the repairs of the leaves that have most to do with failing."""
    guilt = blame(played, played.failed(person.mean_return))
    for leaf in np.argsort(-guilt, kind="stable")[:BLAMED_LEAVES].tolist():
        if guilt[leaf] > 0.0:
            for policy, words in repairs(candidate.policy, demonstrations, leaf):
                yield replace(candidate, policy=policy, repairs=(*candidate.repairs, words))
