"""What was shown keeps no better tree out: one action everywhere, a reckless first challenger."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.learners import DEFAULT, Start
from eutree.policy_search.planner import Planned, Planner
from eutree.world_model.action_trees import nested, packed
from tests.world_model.walks import GO, STAY, Unimproved, walks
from tests.worlds import Walk


class Line(gymnasium.Env):
    """A place between 0 and 10, and a coin that says nothing; an episode has 50 steps."""

    observation_space = gymnasium.spaces.Box(0.0, 10.0, (2,))
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.steps = self.start(), 0
        return self.seen(), {}

    def step(self, action):
        self.steps += 1
        reward, ends = self.go(action)
        return self.seen(), reward, ends, self.steps >= 50, {}

    def seen(self):
        return np.clip([self.place, self.np_random.random()], 0.0, 10.0).astype(np.float32)


class FarChain(Line):
    """The near end pays 0.3 a step, the far one 5; one step in seven goes the other way."""

    def start(self):
        return int(self.np_random.integers(4))

    def go(self, action):
        if action != (self.np_random.random() < 0.15):
            self.place = min(9, self.place + 1)
            return 5.0 * (self.place == 9), False
        self.place = max(0, self.place - 2)
        return 0.3 * (self.place == 0), False


class Pits(Line):
    """A goal in the middle, a pit at each end; most episodes begin on the right."""

    def start(self):
        left = self.np_random.random() < 0.1
        return self.np_random.uniform(0.5, 2.0) if left else self.np_random.uniform(8.0, 9.5)

    def go(self, action):
        self.place += (0.5 if action else -0.5) + 0.1 * self.np_random.standard_normal()
        if not 0.0 < self.place < 10.0:
            return -10.0, True
        return (10.0, True) if 4.5 < self.place < 5.5 else (-0.1, False)


@pytest.mark.parametrize(
    ("env", "shown", "least"), [(FarChain(), 0, 120.0), (Pits(), 1, 8.5)], ids=["chain", "pits"]
)
def test_other_actions_are_found_where_a_single_one_was_shown(env, shown, least):
    """Both stayed at what was shown, 12.6 and -8: from nothing they were learned."""
    demonstrations = eutree.record(env, lambda _: shown, episodes=20, seed=100)
    for seed in (1, 2):
        found = eutree.learn(
            env, demonstrations=demonstrations, steps=8_000, seed=seed, method="planning",
            judge_episodes=0, front_steps=0,
        )  # fmt: skip
        assert eutree.evaluate(found.policy, env, episodes=100, seed=5).mean_return > least


@pytest.mark.parametrize(("own", "finds"), [(9, False), (10, True)])
def test_each_action_everywhere_is_tried_once_what_was_shown_is_known(own, finds, monkeypatch):
    """No single change leads there; before it has played, the person's own way is what counts."""
    monkeypatch.setattr("eutree.policy_search.planner.restarts", lambda data, max_leaves: ())
    plan = Planned(packed(STAY), incumbent_episodes=tuple(range(2 + own)), demonstrations=2)
    planner = Planner(n_episodes=200, improvement=Unimproved())
    challenger = planner.plan(plan, walks(200, 7), np.random.default_rng(0)).challenger
    assert (challenger is not None and nested(challenger) == GO) == finds


def test_half_of_its_explorers_are_then_random_trees():
    learner = DEFAULT.start(Walk.problem, Start())
    learner._informed = True
    generator, trees = np.random.default_rng(1), []
    learner.plan = replace(learner.plan, explorer=packed(STAY))
    for _ in range(200):
        learner.start_episode(np.zeros(Walk.problem.n_features), generator)
        if learner._explores:
            trees.append(learner._acting)
        learner.discard_episode()
    assert 0.3 < np.mean([one is not learner.plan.explorer for one in trees]) < 0.7
    assert {int(action) for one in trees for action in one.action} == {STAY, GO}


@pytest.mark.parametrize(
    ("shown", "bad", "good", "few", "forgets"),
    [
        (1, 9.0, 1.0, 20, True),
        (0, 9.0, 1.0, 20, False),  # what the first of all earned is no bar from nothing
        (1, 9.0, 1.0, 4, False),
        (1, 0.0, 9.0, 20, False),
        (1, 9.0, -9.0, 20, False),
    ],
)
def test_a_reckless_challenger_does_not_keep_out_those_after_it(shown, bad, good, few, forgets):
    """Not by a few lucky episodes, nor where those before were as good as the incumbent."""
    generator = np.random.default_rng(0)
    returns = generator.normal(0.0, 1.0, 60)  # 20 episodes of the incumbent, 20 before, 20 own
    returns[20:40] -= bad
    returns[40:] += good
    plan = Planned(
        packed(STAY),
        challenger=packed(GO),
        incumbent_episodes=tuple(range(20)),
        challenger_episodes=tuple(range(20, 40 + few)),
        demonstrations=shown,
    )
    after = Planner()._without_reckless(plan, 40, returns).challenger_episodes
    assert after == (tuple(range(40, 40 + few)) if forgets else plan.challenger_episodes)
