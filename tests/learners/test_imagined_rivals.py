"""Rivals that a world model proposes: what they copy, how many are made, which of them race."""

import numpy as np
import pytest

from eutree.learners.contenders import Contender, prunings_earn_more
from eutree.learners.episode_buffer import FinishedEpisode
from eutree.learners.experience import Experience
from eutree.learners.imagined_rivals import PRUNED, ImaginedRivals
from eutree.learners.students import Students
from eutree.world_model.action_trees import n_leaves, single_action
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


@pytest.fixture(scope="module")
def experience():
    return rolled()


@pytest.fixture
def rivals(experience):
    settings = EnsembleSettings(members=2, hidden=16, batch=32, updates=300, more_updates=10)
    return ImaginedRivals(settings, Noted(), experience, n_actions=2, max_leaves=LIMIT)


GATHERED = 400


def test_rivals_are_carts_tree_and_prunings_of_larger_ones(rivals):
    made = rivals.make(2, GATHERED, np.random.default_rng(0), copies=False)
    assert [one.origin for one in made] == ["cart", "pruned-weighted", "pruned"]
    assert all(n_leaves(one.tree) <= LIMIT for one in made)
    whole = EPISODES * STEPS
    larger = [(whole, times * LIMIT, weighted) for times, weighted in PRUNED[:2]]
    assert rivals._students.asked == [(whole, LIMIT, False), *larger]


def test_where_prunings_have_earned_no_more_carts_trees_race_first(rivals):
    made = rivals.make(5, GATHERED, np.random.default_rng(2), copies=True)
    assert [one.origin[:6] for one in made] == ["cart"] * 4 + ["pruned"] * 2
    whole = EPISODES * STEPS
    of_limit = [one for one in rivals._students.asked if one[1] == LIMIT]
    assert set(of_limit) == {(n, LIMIT, w) for n in (whole, GATHERED) for w in (False, True)}


def test_no_more_rivals_are_made_than_can_be_afforded(rivals):
    made = rivals.make(2, GATHERED, np.random.default_rng(3), copies=True)
    assert [one.origin for one in made] == ["cart"] * 3


def test_the_first_of_what_is_stored_gives_the_tree_that_was_fitted_when_no_more_was(experience):
    observations = experience.history.observations
    later, then = Students(to_the_middle, 2), Students(to_the_middle, 2)
    later.fit(observations, 8, weighted=True)
    for weighted in (False, True):
        now = later.fit(observations[:GATHERED], 8, weighted=weighted)
        before = then.fit(observations[:GATHERED], 8, weighted=weighted)
        for mine, theirs in zip(now, before, strict=True):
            np.testing.assert_array_equal(mine, theirs)


def contender(origin, *returns):
    return Contender(single_action(0), origin, returns=list(returns))


@pytest.mark.parametrize(
    ("contenders", "more"),
    [
        ([], True),
        ([contender("start", 5.0)], True),
        ([contender("cart", 1.0), contender("pruned")], True),
        ([contender("cart", 1.0), contender("pruned", 0.0), contender("pruned", 4.0)], True),
        ([contender("cart", 1.0), contender("pruned-weighted", 0.0, 2.0)], False),
        ([contender("cart", 3.0), contender("cart", 1.0), contender("pruned", 1.5)], False),
    ],
)
def test_whether_prunings_earn_more_is_a_matter_of_real_returns(contenders, more):
    assert prunings_earn_more(contenders) is more
