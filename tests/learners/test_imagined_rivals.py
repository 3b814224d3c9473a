"""Rivals that a world model proposes: how many are made, and of what."""

import numpy as np

from eutree.learners.episode_buffer import FinishedEpisode
from eutree.learners.experience import Experience
from eutree.learners.imagined_rivals import PRUNED, ImaginedRivals
from eutree.learners.students import Students
from eutree.world_model.action_trees import n_leaves
from eutree.world_model.ensemble import EnsembleSettings

EPISODES, STEPS = 60, 20
LIMIT = 3


def to_the_middle(observations):
    """Return values of pushing a ball left and right: it is to come to the middle."""
    return np.stack([observations[:, 0], -observations[:, 0]], axis=1)


def rolled() -> Experience:
    """Return episodes of a ball between walls, which earns by being near the middle."""
    generator = np.random.default_rng(0)
    experience = Experience(1, [])
    for _ in range(EPISODES):
        places = np.empty(STEPS + 1)
        places[0] = generator.uniform(-1, 1)
        actions = generator.integers(2, size=STEPS)
        for step, action in enumerate(actions):
            places[step + 1] = np.clip(places[step] + 0.4 * (2 * action - 1), -2, 2)
        experience.add(
            FinishedEpisode(
                places[:, np.newaxis], actions, -np.abs(places[1:]), np.zeros(STEPS, bool), True
            )
        )
    return experience


class Noted(Students):
    """Students that note which trees were asked of them: rows, leaves, weighted."""

    def __init__(self):
        super().__init__(to_the_middle, 2)
        self.asked = []

    def fit(self, observations, max_leaves, *, weighted=False, labels=None):
        self.asked.append((len(observations), max_leaves, weighted))
        return super().fit(observations, max_leaves, weighted=weighted, labels=labels)


def test_rivals_are_carts_tree_and_prunings_of_larger_ones():
    settings = EnsembleSettings(members=2, hidden=16, batch=32, updates=300, more_updates=10)
    students = Noted()
    rivals = ImaginedRivals(settings, students, rolled(), n_actions=2, max_leaves=LIMIT)
    made = rivals.make(2, np.random.default_rng(0))
    assert [one.origin for one in made] == ["cart", "pruned-weighted", "pruned"]
    assert all(n_leaves(one.tree) <= LIMIT for one in made)
    whole = EPISODES * STEPS
    larger = [(whole, times * LIMIT, weighted) for times, weighted in PRUNED[:2]]
    assert students.asked == [(whole, LIMIT, False), *larger]
