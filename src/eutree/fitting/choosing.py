"""Choose a tree by playing: halve the candidates, then repair the winner where it does harm."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

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

    Each round plays a new block, the same for all who are left, and all blocks count. The first
    wins ties.

    Args:
        found: The candidates, at least one.
        player: Plays them.
        budget: Episodes of all of them together.
    """
    rounds = max(1, int(np.ceil(np.log2(len(found)))))
    plays: dict[int, Played] = {}
    left = list(range(len(found)))
    for number in range(rounds):
        episodes = max(1, budget // (rounds * len(left)))
        for rival in left:
            more = player.play(found[rival].policy, episodes, RACING + number)
            plays[rival] = plays[rival].followed_by(more) if rival in plays else more
        left.sort(key=lambda rival: plays[rival].merit, reverse=True)
        left = sorted(left[: (len(left) + 1) // 2])
    best = max(left, key=lambda rival: plays[rival].merit)
    return found[best], plays[best]


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
        own = player.play(candidate.policy, budget, REPAIRING + number)
        best, most = candidate, own.merit
        for rival in _repaired(candidate, played, demonstrations, person):
            merit = player.play(rival.policy, budget, REPAIRING + number).merit
            if merit > most:
                best, most = rival, merit
        if best is candidate:
            break
        first, again = (
            player.play(entry.policy, 2 * budget, CONFIRMING + number)
            for entry in (candidate, best)
        )
        if again.merit <= first.merit:
            break
        candidate, played = best, again
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
