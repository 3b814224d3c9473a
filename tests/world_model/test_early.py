"""Rewards and ends that where a step is taken tells, and where it leads does not."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree
from eutree.features import Derivation
from eutree.schema import Schema
from eutree.world_model import Transitions, fit_world_models
from eutree.world_model.action_trees import nested, packed
from eutree.world_model.rollouts import PairedRollouts
from eutree.world_model.transitions import seen_as
from tests import naive_world_model
from tests.world_model.walks import model_of, walks

SLOW, FAST = 0, 1
LENGTH = 20


class Hazard(gymnasium.Env):
    """Fast earns 1 and slow 0.5; fast where the first number is above 0.8 breaks something.

    All observations are fresh. With ``wager`` nothing breaks: what fast earns is 1 below 0.8, else
    -20.
    """

    observation_space = spaces.Box(0.0, 1.0, (3,), np.float64)
    action_space = spaces.Discrete(2)

    def __init__(self, wager=False):
        self.wager = wager

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps, self.seen = 0, self.np_random.random(3)
        return self.seen, {}

    def step(self, action):
        self.steps += 1
        breaks = action == FAST and self.seen[0] > 0.8
        self.seen = self.np_random.random(3)
        reward = -20.0 if breaks else (1.0 if action == FAST else 0.5)
        return self.seen, reward, breaks and not self.wager, self.steps >= LENGTH, {}


def tried(wager, n_episodes=150):
    """Return transitions of random actions."""
    env = Hazard(wager)
    generator = np.random.default_rng(0)
    rows = []
    for episode in range(n_episodes):
        seen, _ = env.reset(seed=episode)
        over = False
        while not over:
            action = int(generator.integers(2))
            then, reward, terminated, truncated, _ = env.step(action)
            rows.append((seen, action, reward, then, terminated, episode))
            seen, over = then, terminated or truncated
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return Transitions(*columns, 2)


CAREFUL = packed((0, 0.8, FAST, SLOW))


@pytest.mark.parametrize("wager", [False, True])
def test_imagined_steps_earn_and_end_as_those_of_the_task(wager):
    model = model_of(tried(wager))
    assert model.n_features == 3
    assert model.n_hidden > 0
    rollouts = PairedRollouts(model, 400, 1.0, np.random.default_rng(1))
    rollouts.run(CAREFUL)
    # Thresholds lie somewhere in their gaps: now and then an imagined step is on the wrong side.
    assert rollouts.mean_return == pytest.approx(LENGTH * 0.9, abs=1.5)
    assert rollouts.gain(packed(SLOW)).mean == pytest.approx(-LENGTH * 0.4, abs=1.5)
    assert rollouts.gain(packed(FAST)).mean < -20.0
    steps = np.arange(0, rollouts.n_steps, 7)
    gains = rollouts.deviations(steps)[:, FAST]
    assert gains[rollouts.observations[steps, 0] > 0.85].max() < -15.0


def test_hidden_numbers_are_those_of_naive_episodes_to_the_bit():
    """The naive twin has a wider state, and knows nothing else of them."""
    model = model_of(tried(False, 40))
    rollouts = PairedRollouts(model, 20, 1.0, np.random.default_rng(2))
    rollouts.run(CAREFUL)
    width, episodes = model.starts.shape[1], rollouts._episodes
    draws, stride = rollouts._conditions.draws, 7919
    for e in range(20):
        states, _, rewards = naive_world_model.episode(
            model,
            nested(CAREFUL),
            episodes.states[episodes.first[e], :width],
            lambda t, i, e=e: draws[(e * stride + t * (width + 1) + i) % draws.size],
        )
        assert (episodes.states[episodes.first[e] : episodes.first[e + 1]] == states).all()
        assert episodes.returns[e] == sum(rewards)


def test_a_chance_of_an_end_is_that_of_where_the_step_is_taken():
    data = tried(False, 400)
    luck = np.random.default_rng(5).random(data.rewards.size) < 0.3
    ended = data.terminated & luck
    (model,) = fit_world_models(replace(data, terminated=ended), [0.5])
    rollouts = PairedRollouts(model, 2000, 1.0, np.random.default_rng(1))
    rollouts.run(packed(FAST))
    lengths = np.diff(rollouts._episodes.first)
    first = np.mean(model.starts[:, 0] > 0.8) * ended.sum() / data.terminated.sum()
    assert np.mean(lengths == 1) == pytest.approx(first, abs=0.015)


def test_where_a_step_leads_comes_first_if_it_tells_as_much():
    assert model_of(walks(200, 0)).n_hidden == 0


def test_derived_features_stand_before_what_is_hidden():
    derivation = Derivation.of(Schema.anonymous(3, 2).derive(["gap = x0 - x1"]))
    (model,) = fit_world_models(seen_as(derivation, tried(False)), [0.5])
    assert (model.n_features, model.n_hidden > 0) == (4, True)
    rollouts = PairedRollouts(model, 100, 1.0, np.random.default_rng(3))
    rollouts.run(CAREFUL)
    seen = rollouts.observations
    assert (seen[:, 3] == seen[:, 0] - seen[:, 1]).all()
    assert rollouts.mean_return == pytest.approx(LENGTH * 0.9, abs=1.5)


@pytest.mark.parametrize("shown", ["fast", "slow"])
def test_planning_learns_what_breaks(shown):
    action = FAST if shown == "fast" else SLOW
    demonstrations = eutree.record(Hazard(), lambda seen: action, episodes=15, seed=0)
    learned = eutree.learn(
        Hazard(), demonstrations=demonstrations, method="planning", steps=4000, seed=0
    )
    outcome = eutree.evaluate(learned.policy, Hazard(), episodes=200, seed=99)
    assert learned.policy.n_leaves <= 3
    assert outcome.mean_return > 17.0  # of 18; slow alone earns 10, fast alone -16


def test_what_a_mask_forbids_does_what_was_done_in_its_place():
    """The second action pays 2, and is masked above 0.5, where another one earns 0.5."""
    generator = np.random.default_rng(0)
    seen = generator.random((4000, 1))
    allowed = np.ones((4000, 2), dtype=bool)
    allowed[:, 1] = seen[:, 0] <= 0.5
    actions = np.where(allowed[:, 1], generator.integers(2, size=4000), 0)
    then, episodes = np.roll(seen, -1, axis=0), np.arange(4000) // LENGTH
    paid, never = np.where(actions == 1, 2.0, 0.5), np.zeros(4000, dtype=bool)
    columns = seen, actions, paid, then, never, episodes
    for known, mean in ((allowed, 0.5 * 2.0 + 0.5 * 0.5), (None, 2.0)):
        rollouts = PairedRollouts(
            model_of(Transitions(*columns, 2, allowed=known)), 200, 1.0, generator
        )
        rollouts.run(packed(1))
        assert rollouts.mean_return / LENGTH == pytest.approx(mean, abs=0.1)


def test_an_action_that_is_seldom_allowed_is_forbidden_in_the_same_share_of_its_rows():
    generator = np.random.default_rng(0)
    allowed = np.ones((3000, 2), dtype=bool)
    allowed[:, 1] = generator.random(3000) < 0.25  # nothing that is observed tells when
    actions = np.where(allowed[:, 1] & (generator.random(3000) < 0.2), 1, 0)
    seen, never = generator.random((3000, 1)), np.zeros(3000, dtype=bool)
    paid = np.where(actions == 1, 4.0, 0.0)
    columns = seen, actions, paid, np.roll(seen, -1, axis=0), never, np.arange(3000) // LENGTH
    rollouts = PairedRollouts(
        model_of(Transitions(*columns, 2, allowed=allowed)), 200, 1.0, generator
    )
    rollouts.run(packed(1))
    assert rollouts.mean_return / LENGTH == pytest.approx(0.25 * 4.0, abs=0.15)
