"""Recording an episode stores what was sensed, done and received, and how it ended."""

import numpy as np
import pytest

from eutree.errors import InvalidArgumentError
from eutree.interaction import episode_seed, record
from tests.interaction.sick import Healthy


class Alternate:
    """Acts 0, 1, 0, 1, ... within an episode, by its state."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        step = 0 if state is None else state
        return step % 2, step + 1


def test_an_episode_holds_one_observation_more_than_actions():
    demos = record(Healthy(), Alternate(), episodes=3, seed=7)
    assert len(demos) == 3
    for number, episode in enumerate(demos):
        assert episode.observations.shape == (6, 2)
        assert episode.actions.tolist() == [0, 1, 0, 1, 0]
        assert episode.rewards.tolist() == [0, 1, 0, 1, 0]
        assert (episode.terminated, episode.truncated) == (True, False)
        assert episode.is_success is True
        assert episode.seed == episode_seed(7, number, 1)
        np.testing.assert_array_equal(episode.observations[:, 1], np.arange(6) / 5)


def test_the_same_seed_gives_the_same_episodes_and_another_seed_others():
    first, again, other = (record(Healthy(), Alternate(), episodes=2, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(first.observations, again.observations)
    assert not np.array_equal(first.observations, other.observations)


def test_a_function_of_the_environment_makes_the_controller():
    def constant(env):
        assert isinstance(env, Healthy)
        return Alternate()

    assert record(Healthy(), constant, episodes=1).expert == "constant"


@pytest.mark.parametrize("controller", [3, lambda env: None])
def test_what_cannot_act_is_refused(controller):
    with pytest.raises(InvalidArgumentError, match="must have a method predict"):
        record(Healthy(), controller, episodes=1)


@pytest.mark.parametrize(("name", "value"), [("episodes", 0), ("episodes", 1.5), ("seed", -1)])
def test_bad_numbers_are_named(name, value):
    with pytest.raises(InvalidArgumentError, match=f"{name} must be an integer"):
        record(Healthy(), Alternate(), **{name: value})


def test_seeds_of_different_uses_differ():
    seeds = {episode_seed(seed, k, s) for seed in range(5) for k in range(20) for s in range(6)}
    assert len(seeds) == 600
