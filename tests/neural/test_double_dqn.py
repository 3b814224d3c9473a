"""The Double DQN of eutree.neural: stretches, a chain against value iteration, going on."""

import numpy as np
import pytest

from eutree.data import Episode
from eutree.errors import InvalidArgumentError
from eutree.neural import DoubleDQN, DoubleDQNSettings, Scaling, _kernels
from eutree.neural.double_dqn import reward_scale_of, stretches
from tests import naive_neural

LEFT, RIGHT = 0, 1
DISCOUNT = 0.9
PLACES = 6


def move(place, action):
    """Return next place, reward, whether it ended: 2 at the right end, 0.5 at the left."""
    there = place + (1 if action == RIGHT else -1)
    if there == PLACES:
        return there, 2.0, True
    if there < 0:
        return there, 0.5, True
    return there, -0.1, False


def value_iteration():
    values = np.zeros((PLACES, 2))
    for _ in range(200):
        for place in range(PLACES):
            for action in (LEFT, RIGHT):
                there, reward, ended = move(place, action)
                beyond = 0.0 if ended else DISCOUNT * values[there].max()
                values[place, action] = reward + beyond
    return values


def seen(place):
    return [float(place), float(place % 2)]


def walk(generator, most=12):
    place, observations, actions, rewards = int(generator.integers(PLACES)), [], [], []
    observations.append(seen(place))
    for _ in range(most):
        actions.append(int(generator.integers(2)))
        place, reward, ended = move(place, actions[-1])
        observations.append(seen(place))
        rewards.append(reward)
        if ended:
            break
    return Episode(np.array(observations), np.array(actions), np.array(rewards), ended, not ended)


def add(learner, episode):
    learner.add(
        episode.observations, episode.actions, episode.rewards, terminated=episode.terminated
    )


def chain_learner(seed, updates=3000, **settings):
    chosen = {"hidden": 32, "discount": DISCOUNT, "n_steps": 1, "rate": 2e-3} | settings
    generator = np.random.default_rng(seed)
    episodes = [walk(generator) for _ in range(300)]
    learner = DoubleDQN(
        DoubleDQNSettings(**chosen, batch=32, average=0.01, target=0.02),
        Scaling.of(np.concatenate([e.observations for e in episodes])),
        2,
        reward_scale=reward_scale_of([e.rewards for e in episodes], DISCOUNT),
        updates=updates,
        generator=generator,
    )
    for episode in episodes:
        add(learner, episode)
    return learner, generator


@pytest.mark.parametrize("quantiles", [1, 4])
@pytest.mark.parametrize("seed", range(5))
def test_a_chain_is_valued_as_value_iteration_values_it(seed, quantiles):
    learner, generator = chain_learner(seed, quantiles=quantiles)
    learner.update(3000, generator)
    places = np.array([seen(place) for place in range(PLACES)])
    exact = value_iteration()
    np.testing.assert_allclose(learner.action_values(places), exact, atol=0.1)
    assert [learner.act(place) for place in places] == exact.argmax(axis=1).tolist()


@pytest.mark.parametrize("limit", [0.2, 2.0])
@pytest.mark.parametrize("m", [1, 2, 7])
def test_errors_of_quantiles_are_the_differences_of_their_loss(m, limit):
    generator = np.random.default_rng(m)
    quantiles, goals = generator.standard_normal((2, m))
    errors, small = np.empty(m), 1e-6
    _kernels.quantile_errors(quantiles, goals, limit, errors)
    for k, error in enumerate(errors):
        above, below = quantiles.copy(), quantiles.copy()
        above[k] += small
        below[k] -= small
        change = naive_neural.quantile_loss(above, goals, limit)
        change -= naive_neural.quantile_loss(below, goals, limit)
        assert error == pytest.approx(change / (2 * small), rel=1e-5, abs=1e-8)


def test_a_single_quantile_has_the_error_of_a_value():
    error = np.empty(1)
    for difference in (-3.0, -0.5, 0.0, 0.7, 5.0):
        _kernels.quantile_errors(np.array([1.0 + difference]), np.ones(1), 2.0, error)
        assert error[0] == min(max(difference, -2.0), 2.0)


def test_the_value_of_an_action_is_the_mean_of_its_quantiles():
    out = np.random.default_rng(0).standard_normal((5, 12))
    values = np.empty((5, 3))
    _kernels.action_values(out, 3, values)
    np.testing.assert_allclose(values, naive_neural.action_values(out, 3), rtol=1e-14)


@pytest.mark.parametrize("terminated", [True, False])
def test_stretches_are_those_of_the_obvious_loop(terminated):
    generator = np.random.default_rng(3)
    for length in (1, 2, 3, 7):
        episode = Episode(
            np.zeros((length + 1, 1)),
            np.zeros(length, np.int64),
            generator.standard_normal(length),
            terminated,
            not terminated,
        )
        found = stretches(episode.rewards, 0.9, 3, terminated=terminated)
        for begin in range(length):
            earned, end, weight = naive_neural.stretch(episode, begin, 0.9, 3)
            assert found.earned[begin] == pytest.approx(earned)
            assert found.end[begin] == end
            assert found.discounts[begin] == pytest.approx(weight)


@pytest.mark.parametrize("quantiles", [1, 3])
def test_a_restored_learner_goes_on_to_the_same_bytes(quantiles):
    learner, _ = chain_learner(0, quantiles=quantiles)
    learner.update(20, np.random.default_rng(1))
    other, _ = chain_learner(0, 3000, quantiles=quantiles)
    other.restore({name: array.copy() for name, array in learner.state().items()})
    for one in (learner, other):
        one.update(20, np.random.default_rng(2))
    for name, array in learner.state().items():
        assert array.tobytes() == other.state()[name].tobytes()
    assert learner.updates == 40


def test_an_unlearned_learner_does_not_update():
    learner = DoubleDQN(
        DoubleDQNSettings(hidden=4),
        Scaling(np.zeros(2), np.ones(2)),
        2,
        reward_scale=1.0,
        updates=5,
        generator=np.random.default_rng(0),
    )
    learner.update(5, np.random.default_rng(0))
    assert learner.updates == 0


def test_rewards_are_scaled_by_the_largest_discounted_return():
    assert reward_scale_of([np.array([-1.0, -1.0]), np.zeros(0)], 0.5) == pytest.approx(10 / 1.5)
    assert reward_scale_of([], 0.5) == 1.0


def test_settings_are_checked():
    with pytest.raises(InvalidArgumentError, match="batch must be an integer >= 1, got 0"):
        DoubleDQNSettings(batch=0)
