"""Challengers that a world model proposes: how many are made, and of what."""

import numpy as np
import pytest

from eutree.features import Derivation
from eutree.learners.distilled_dqn import races
from eutree.learners.distilled_dqn.races import PARTS, RECIPES, ImaginedChallengers
from eutree.learners.distilled_dqn.teaching import Experience, Students
from eutree.policy_search.variation import Variation
from eutree.world_model.action_trees import n_leaves
from eutree.world_model.ensemble import EnsembleSettings
from eutree.world_model.ensemble_rollouts import EnsembleRollouts, climbed_by_rollouts
from tests.worlds import room_episode

EPISODES, STEPS = 30, 40
LIMIT = 3


def warmer_below_20(observations):
    """Return values of leaving a room alone and of heating it: it is to have 20 degrees."""
    return np.stack([observations[:, 0], 40.0 - observations[:, 0]], axis=1)


def lived_through() -> Experience:
    """Return what was shown of a room that cools, half of it at random."""
    generator = np.random.default_rng(0)
    return Experience(
        2,
        [
            room_episode(generator, lambda o: int(o[0] < 20.0), steps=STEPS, random=0.5)
            for _ in range(EPISODES)
        ],
    )


class Noted(Students):
    """Students that note which trees were asked of them: rows, leaves, weighted."""

    def __init__(self):
        super().__init__(warmer_below_20, 2)
        self.asked = []

    def fit(self, observations, max_leaves, *, weighted=False, labels=None):
        self.asked.append((len(observations), max_leaves, weighted))
        return super().fit(observations, max_leaves, weighted=weighted, labels=labels)


SETTINGS = EnsembleSettings(members=2, hidden=16, batch=32, updates=300, more_updates=10)


def challengers_of(students: Students, limit: int = LIMIT) -> ImaginedChallengers:
    return ImaginedChallengers(
        SETTINGS, students, lived_through(), 2, limit, derivation=lambda: Derivation(2)
    )


@pytest.mark.parametrize(("limit", "of_large"), [(LIMIT, 32), (40, 40)])
def test_challengers_are_carts_trees_and_prunings_of_larger_ones(limit, of_large):
    """What is pruned is large also where few leaves are allowed."""
    students = Noted()
    made = challengers_of(students, limit).make(1, np.random.default_rng(0))
    whole = EPISODES * STEPS
    own = [(whole, n, False) for n in sorted({max(limit // k, 2) for k in PARTS}, reverse=True)]
    assert len(own) > 1
    assert len(made) == len(own) + 1
    assert [one.origin for one in made[: len(own)]] == ["cart"] * len(own)
    assert {one.origin for one in made[len(own) :]} <= {"pruned", "pruned-weighted"}
    assert all(n_leaves(one.tree) <= limit for one in made)
    larger = [(whole, times * of_large, weighted) for times, weighted in RECIPES]
    assert students.asked == [*own, *larger]


@pytest.mark.parametrize("good", RECIPES)
def test_most_prunings_are_of_the_recipe_whose_trees_the_model_scores_best(good, monkeypatch):
    """Each has one tree; where one recipe's is right and all others' never heat, that goes on.

    Trees that are the same race once.
    """
    students, pruned = Noted(), []
    rows = lived_through().history.observations
    right = students.fit(rows, 2)
    never = students.fit(rows, 2, labels=np.zeros(len(rows), dtype=np.int32))
    larges = {}

    def prune(large, rollouts, max_leaves, generator):
        number = larges.setdefault(id(large), len(larges))  # the order in which they are asked for
        pruned.append(RECIPES[number])
        return (right if RECIPES[number] == good else never), 0.0

    monkeypatch.setattr(races, "pruned_by_rollouts", prune)
    made = challengers_of(students).make(3, np.random.default_rng(0))
    assert pruned == [*RECIPES, good, good, good]
    raced = [one for one in made if one.origin.startswith("pruned")]
    assert [one.tree for one in raced] == [right, never]


def test_half_of_the_prunings_climb_to_what_the_model_scores_higher():
    """A tree that heats below 5 degrees is moved towards 20, and no larger than is allowed."""
    students = Noted()
    rows = lived_through().history.observations
    late = students.fit(rows, 2, labels=(rows[:, 0] < 5.0).astype(np.int32))
    challengers = challengers_of(students)
    challengers.make(1, np.random.default_rng(0))
    rollouts = EnsembleRollouts(challengers.ensemble, 20, np.random.default_rng(1))
    variation = Variation(2, LIMIT, np.random.default_rng(2))
    climbed = climbed_by_rollouts(late, rollouts, variation.of)
    before, after = map(rollouts.score, rollouts.returns_of_each([late, climbed]))
    assert after > before
    assert 2 <= n_leaves(climbed) <= LIMIT
    assert students.act(climbed, np.array([12.0])) == 1
    again = EnsembleRollouts(challengers.ensemble, 20, np.random.default_rng(1))
    same = climbed_by_rollouts(late, again, Variation(2, LIMIT, np.random.default_rng(2)).of)
    assert all((one == other).all() for one, other in zip(climbed, same, strict=True))
    made = challengers.make(4, np.random.default_rng(3))
    assert len(made) == 2 + 4
    assert [one.origin for one in made[-2:]] == ["climbed", "climbed"]
