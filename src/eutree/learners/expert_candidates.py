"""The trees that `fit` chooses among: C4.5 with other settings, and what was seen before.

The expert trees of release 8 are the first candidates. Its penalty for cuts of continuous
attributes, log2(tries) / N off the gain, is meant for many cases; in the few dozen steps at a place
where a person waits it forbids the test that says when to go on. So it may be off, m may be larger
against careless keys, CF smaller. One previous observation as features shows what moves where.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from eutree.arrays import Floats
from eutree.c45 import C45Settings
from eutree.data import Demonstrations
from eutree.learners.expert_tree import fit_expert_tree
from eutree.policies import TreePolicy

RELEASE_8 = C45Settings()
FOLDS = 5  # of whole episodes
SETTINGS = tuple(
    C45Settings(use_penalty=penalty, min_objects=least, confidence=confidence, collapse=collapse)
    for penalty, least, confidence, collapse in (
        *product((True, False), (2, 4, 8), (0.25, 0.05), (True,)),
        (False, 2, 0.25, False),
    )
)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A tree to choose, and how it was made.

    Attributes:
        policy: The tree.
        settings: The choices of C4.5 that made it.
        correct: Share of the steps of each episode that a tree of the others decides as shown.
        repairs: What was changed in the tree since, in words.
    """

    policy: TreePolicy
    settings: C45Settings
    correct: Floats  # [E]
    repairs: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return how the tree was made, in words."""
        chosen = self.settings
        parts = []
        if not chosen.use_penalty:
            parts.append("without the penalty for continuous cuts")
        if not chosen.collapse:
            parts.append("without collapsing")
        if not chosen.prune:
            parts.append("without pruning")
        elif chosen.confidence != RELEASE_8.confidence:
            parts.append(f"CF {chosen.confidence:g}")
        if chosen.min_objects != RELEASE_8.min_objects:
            parts.append(f"m {chosen.min_objects:g}")
        if self.policy.history:
            parts.append("with one previous observation")
        return ", ".join(["C4.5" if parts else "C4.5 of release 8", *parts, *self.repairs])


def candidates(
    demonstrations: Demonstrations, *, settings: tuple[C45Settings, ...], histories: tuple[int, ...]
) -> list[Candidate]:
    """Return the different trees of these settings, each with its cross-validation.

    Args:
        demonstrations: What was shown.
        settings: The choices of C4.5; of two that give the same tree the first one counts.
        histories: Numbers of previous observations.
    """
    found: dict[bytes, Candidate] = {}
    for history in histories:
        known = demonstrations.with_history(history) if history else demonstrations
        for chosen in settings:
            policy = replace(fit_expert_tree(known, settings=chosen), history=history)
            key = policy.to_bytes()
            if key not in found:
                found[key] = Candidate(policy, chosen, _correct(known, chosen))
    return list(found.values())


def promising(found: list[Candidate], most: int) -> list[Candidate]:
    """Return the first candidate and the best others by episodes left out, at most ``most``.

    One with more previous observations than the first is among them only if it explains the
    actions left out better than the best one that has as few, by more than a standard error of the
    paired difference.
    """
    first = found[0]
    simple = [entry for entry in found if entry.policy.history == first.policy.history]
    best = max(simple, key=_share_correct)
    further = [entry for entry in found if entry not in simple and _explains_more(entry, best)]
    ordered = sorted([*simple, *further], key=_share_correct, reverse=True)
    return [first, *(entry for entry in ordered if entry is not first)][:most]


def best_left_out(found: list[Candidate]) -> Candidate:
    """Return the candidate that decides most like the episodes left out: ``fit`` without playing.

    Of one with more previous observations than the first the same is asked as by ``promising``.
    """
    return max(promising(found, len(found)), key=_share_correct)


def _share_correct(candidate: Candidate) -> float:
    return float(candidate.correct.mean())


def _explains_more(rival: Candidate, best: Candidate) -> bool:
    gain = rival.correct - best.correct
    return bool(gain.mean() > gain.std() / np.sqrt(gain.size))


def _correct(demonstrations: Demonstrations, settings: C45Settings) -> Floats:
    """Return the share of each episode's steps that a tree without it decides as shown, [E]."""
    episodes = [episode for episode in demonstrations if len(episode)]
    correct = np.zeros(len(episodes))
    n_folds = min(FOLDS, len(episodes))
    for fold in range(n_folds):
        rest = tuple(e for number, e in enumerate(episodes) if number % n_folds != fold)
        if not rest:  # a single episode: nothing is left to learn from
            return np.ones(1)
        tree = fit_expert_tree(replace(demonstrations, episodes=rest), settings=settings)
        for number in range(fold, len(episodes), n_folds):
            episode = episodes[number]
            decided = tree.actions[tree.tree.leaf_index(episode.observations[:-1])]
            correct[number] = (decided == episode.actions).mean()
    return correct
