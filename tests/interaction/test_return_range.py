"""The range of an episode's return: where it is known no episode leaves it."""

import gymnasium
import pytest
from gymnasium.wrappers import (
    FlattenObservation,
    NormalizeReward,
    RecordEpisodeStatistics,
    TimeLimit,
    TransformReward,
)

import eutree  # noqa: F401 - registers its environments
from eutree.errors import InvalidArgumentError
from eutree.interaction import DerivedObservation
from eutree.interaction.first_look import return_range
from tests.interaction.versions import CLIFF, TAXI

KNOWN = {
    "eutree/Evasion2-v0": (-170.0, 100.0),
    "CartPole-v1": (0.0, 500.0),
    "MountainCar-v0": (-200.0, 0.0),
    "Acrobot-v1": (-500.0, 0.0),
    "FrozenLake-v1": (0.0, 1.0),
    "Blackjack-v1": (-1.0, 1.5),
    TAXI: (-2000.0, 20.0),
}


def played(env, episodes=20):
    env.action_space.seed(0)
    for seed in range(episodes):
        env.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            _, reward, terminated, truncated, _ = env.step(env.action_space.sample())
            total, over = total + float(reward), terminated or truncated
        yield total


@pytest.mark.parametrize("name", [name for name in KNOWN if name in gymnasium.registry])
def test_no_episode_leaves_the_known_range(name):
    env = gymnasium.make(name)
    low, high = return_range(env)
    assert (low, high) == KNOWN[name]
    assert all(low <= total <= high for total in played(env))


def test_an_environments_own_rewards_and_limit_count():
    env = gymnasium.make("eutree/Evasion2-v0", goal_reward=-5.0, stop_reward=1.0)
    assert return_range(env) == (-50.0, 60.0)
    assert return_range(gymnasium.make("CartPole-v1", max_episode_steps=20)) == (0.0, 20.0)


class Shaped(gymnasium.Wrapper):
    """A wrapper that is no RewardWrapper, and adds to rewards all the same."""

    def step(self, action):
        observation, reward, *rest = self.env.step(action)
        return observation, reward + 1000.0, *rest


class Quicker(gymnasium.ActionWrapper):
    """An action wrapper that pays for actions, in a ``step`` of its own."""

    def action(self, action):
        return action

    def step(self, action):
        observation, reward, *rest = super().step(action)
        return observation, reward - action, *rest


class Turned(gymnasium.ActionWrapper):
    """An action wrapper that is nothing else."""

    def action(self, action):
        return self.action_space.n - 1 - action


class Said(gymnasium.RewardWrapper):
    """A reward that knows the range of what it makes."""

    return_range = (-500.0, 0.0)

    def reward(self, reward):
        return -reward


def patched():
    env = gymnasium.make("CartPole-v1")
    env.step = Shaped(env.env).step
    return env


@pytest.mark.parametrize(
    "env",
    [
        TransformReward(gymnasium.make("CartPole-v1"), lambda reward: -reward),
        NormalizeReward(gymnasium.make("CartPole-v1")),
        Shaped(gymnasium.make("CartPole-v1")),
        TimeLimit(Shaped(gymnasium.make("eutree/Evasion2-v0")), 9),
        Quicker(gymnasium.make("CartPole-v1")),
        patched(),
        gymnasium.make("CartPole-v1", sutton_barto_reward=True),
        gymnasium.make("CartPole-v1").unwrapped,  # its spec has a limit that nothing keeps
        gymnasium.make("eutree/Evasion2-v0", max_episode_steps=5),  # no ending, fewer stops
        gymnasium.make(CLIFF),  # without a time limit
    ],
)
def test_a_range_that_nobody_knows_is_none(env):
    assert return_range(env) is None


@pytest.mark.parametrize(
    ("env", "known"),
    [
        (Turned(gymnasium.make("CartPole-v1")), (0.0, 500.0)),
        (FlattenObservation(gymnasium.make("CartPole-v1")), (0.0, 500.0)),
        (RecordEpisodeStatistics(gymnasium.make("CartPole-v1")), (0.0, 500.0)),
        (TimeLimit(gymnasium.make("CartPole-v1"), 20), (0.0, 20.0)),
        (TimeLimit(gymnasium.make("CartPole-v1"), 1000), (0.0, 500.0)),
        (Turned(gymnasium.make("eutree/Evasion2-v0")), (-170.0, 100.0)),
        (DerivedObservation(gymnasium.make("MountainCar-v0"), ["v2 = 2 * velocity"]), (-200.0, 0)),
        (Said(gymnasium.make("CartPole-v1")), (-500.0, 0.0)),
        (gymnasium.make("MountainCar-v0"), (-200.0, 0.0)),
    ],
)
def test_wrappers_that_leave_rewards_alone_leave_the_range(env, known):
    """Any wrapper but a RewardWrapper was taken for one, NormalizeReward too."""
    assert return_range(env) == known
    low, high = known
    assert all(low <= total <= high for total in played(env, episodes=5))


def test_a_range_that_is_none_is_refused():
    env = gymnasium.make("CartPole-v1")
    env.unwrapped.return_range = (1.0, 0.0)
    with pytest.raises(
        InvalidArgumentError, match="return_range must be the lowest and the highest"
    ):
        return_range(env)
