"""Rivals that a world model proposes: what they copy, how many are made, which of them race."""

from collections import Counter

import numpy as np
import pytest

from eutree.learners.contenders import Contender, prunings_earn_more
from eutree.learners.episode_buffer import FinishedEpisode
from eutree.learners.experience import Experience
from eutree.learners.imagined_rivals import PRUNED, ImaginedRivals
from eutree.learners.students import Students
from eutree.world_model.action_trees import n_leaves, single_action
from eutree.world_model.ensemble import EnsembleSettings
from eutree.world_model.ensemble_rollouts import EnsembleRollouts

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


def test_half_of_the_prunings_copy_what_was_said_in_daggers_rounds_alone(rivals):
    made = rivals.make(2, GATHERED, np.random.default_rng(0), students=False)
    assert made[0].origin == "cart"
    assert len(made) == 3
    assert all(one.origin.startswith("pruned") for one in made[1:])
    assert all(n_leaves(one.tree) <= LIMIT for one in made)
    whole = EPISODES * STEPS
    first, *asked = rivals._students.asked
    assert first == (whole, LIMIT, False)
    expected = [(rows, t * LIMIT, w) for t, w in PRUNED[:2] for rows in (whole, GATHERED)]
    assert Counter(asked) == Counter(expected)


def test_of_the_prunings_those_race_that_score_best_where_none_was_chosen(rivals, monkeypatch):
    """The model's word on every tree that was made, in the same episodes for all."""
    scores = []
    real = EnsembleRollouts.score

    def score(self, returns):
        scores.append(real(self, returns))
        return scores[-1]

    monkeypatch.setattr(EnsembleRollouts, "score", score)
    made = rivals.make(3, GATHERED, np.random.default_rng(1), students=False)
    judged = scores[-6:]  # the last six are those of the six that were pruned
    assert [one.imagined for one in made[1:]] == sorted(judged, reverse=True)[:3]


def test_where_prunings_have_earned_no_more_carts_trees_race_first(rivals):
    made = rivals.make(5, GATHERED, np.random.default_rng(2), students=True)
    assert [one.origin[:6] for one in made] == ["cart"] * 4 + ["pruned"] * 2
    whole = EPISODES * STEPS
    of_limit = [one for one in rivals._students.asked if one[1] == LIMIT]
    assert set(of_limit) == {(n, LIMIT, w) for n in (whole, GATHERED) for w in (False, True)}


def test_no_more_rivals_are_made_than_can_be_afforded(rivals):
    made = rivals.make(2, GATHERED, np.random.default_rng(3), students=True)
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
