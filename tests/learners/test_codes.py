"""Learning where observations are codes, from nothing."""

import gymnasium
import numpy as np
import pytest

import eutree
from tests.interaction.versions import CLIFF

pytestmark = pytest.mark.filterwarnings("ignore:.*observes one code of", "ignore:.*names no time")


def learned(env, steps, seed=0):
    found = eutree.learn(
        env, steps=steps, seed=seed, judge_episodes=0, front_steps=0, evaluate_every=10**6
    )
    return found.policy, eutree.evaluate(found.policy, env, episodes=400, seed=9).returns.mean()


def test_a_slippery_lake_is_crossed_nearly_as_well_as_can_be():
    """0.74 is the optimum, and trees of means earn half of it in more steps."""
    policy, earned = learned(gymnasium.make("FrozenLake-v1"), 12_000)
    assert earned > 0.5
    assert policy.tree.n_leaves <= 12


def test_a_goal_that_chance_never_finds_is_found_by_what_was_not_tried():
    policy, earned = learned(gymnasium.make(CLIFF, max_episode_steps=200), 15_000)
    assert earned == -13.0  # the shortest way
    assert policy.tree.n_leaves == 3


def test_where_sticking_ends_the_hand_that_stays_as_it_is():
    _, earned = learned(gymnasium.make("Blackjack-v1"), 3_000)
    assert earned > -0.2  # a single action: -0.2 at best, -0.05 the optimum


class Switches(gymnasium.Env):
    """Two switches, of which one may be pressed only where the other is on."""

    observation_space = gymnasium.spaces.MultiDiscrete([3, 3])
    action_space = gymnasium.spaces.Discrete(3)

    def _seen(self):
        mask = np.array([True, self.at[0] == 2, self.at[0] == 2], dtype=np.int8)
        return self.at.copy(), {"action_mask": mask}

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = np.array([0, int(self.np_random.integers(2))])
        return self._seen()

    def step(self, action):
        assert self._seen()[1]["action_mask"][action]
        self.at[0] = (self.at[0] + 1) % 3 if action == 0 else self.at[0]
        self.at[1] += action == 1 and self.at[1] < 2
        done = action == 2 and self.at[1] == 2
        return self._seen()[0], 10.0 * done - 1.0, done, False, self._seen()[1]


@pytest.mark.parametrize("seed", [0, 1])
def test_masks_are_kept_and_what_they_forbid_is_not_what_is_curious(seed):
    env = gymnasium.wrappers.TimeLimit(Switches(), 30)
    _, earned = learned(env, 3_000, seed)
    assert earned > 4.0
