"""What comes out of an environment is checked before anything learns from it."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete, MultiBinary

from eutree.errors import EnvironmentFault, InvalidArgumentError, UnsupportedSpaceError
from eutree.interaction import GuardedEnv
from tests.interaction.sick import SICK, Healthy, ResetWithoutInfo, answering


def run(env, **options):
    guarded = GuardedEnv(env, max_episode_steps=50, **options)
    guarded.reset(seed=0)
    while True:
        _, _, terminated, truncated, _ = guarded.step(1)
        if terminated or truncated:
            return guarded


@pytest.mark.promise(21)
@pytest.mark.parametrize("name", SICK)
def test_a_sick_environment_is_stopped_with_a_message_of_its_own(name):
    env, message = SICK[name]
    with pytest.raises(EnvironmentFault, match=message):
        run(env)


def test_messages_of_sick_environments_are_one_line_and_name_environment_and_episode():
    for env, _ in SICK.values():
        with pytest.raises(EnvironmentFault) as caught:
            run(env)
        assert str(caught.value).startswith(f"{type(env).__name__}, episode 0 (seed 0), ")


@pytest.mark.parametrize("success", [True, np.True_, 1, 1.0, np.float32(1), np.array(True)])
def test_success_may_be_said_in_numbers(success):
    env = answering(info={"is_success": success, "ending": np.array([1, 2])})
    assert run(env).step_number == 5


def test_a_healthy_environment_passes():
    assert run(Healthy()).step_number == 5


def test_an_observation_outside_the_space_warns_once_or_is_refused():
    env = answering(observation=np.array([0.5, 1.5]))
    with pytest.warns(UserWarning, match=r"'x1' must be in \[0, 1\].*got 1.5"):
        guarded = run(env)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        guarded.reset(seed=1)
        for _ in range(5):
            guarded.step(1)
    with pytest.raises(EnvironmentFault, match="'x1' must be in"):
        run(env, strict=True)
    with pytest.raises(InvalidArgumentError, match="strict must be a bool, got 'yes'"):
        run(env, strict="yes")


def test_a_reused_buffer_is_copied():
    class Reuses(Healthy):
        buffer = np.zeros(2)

        def step(self, action):
            observation, *rest = super().step(action)
            self.buffer[:] = observation
            return self.buffer, *rest

    guarded = GuardedEnv(Reuses())
    guarded.reset(seed=0)
    first = guarded.step(0)[0]
    kept = first.copy()
    guarded.step(0)
    np.testing.assert_array_equal(first, kept)


def test_an_action_outside_the_space_is_refused():
    guarded = GuardedEnv(Healthy())
    guarded.reset(seed=0)
    with pytest.raises(InvalidArgumentError, match=r"action must be in 0\.\.1, got 2"):
        guarded.step(2)


@pytest.mark.parametrize(
    ("observations", "actions", "message"),
    [
        (Box(-1, 1, (2,)), Box(-1, 1, (1,)), "Discrete action space.*Box.*--action-grid"),
        (Box(-1, 1, (2,)), MultiBinary(20), "1048576 combinations.*--action-grid"),
        (Box(-1, 1, (2,)), Discrete(2000, start=1), "at most 1,000 actions"),
        (Box(-1, 1, (2,)), gymnasium.spaces.Text(3), "MultiDiscrete.*TransformAction"),
        (Box(0, 255, (64, 64, 3), np.uint8), Discrete(2), "cannot learn from pixels"),
        (Box(-1, 1, (2, 2)), Discrete(2), "FlattenObservation"),
        (gymnasium.spaces.Text(5), Discrete(2), "flat Box"),
    ],
)
def test_spaces_that_a_tree_cannot_act_in_are_refused(observations, actions, message):
    class Other(Healthy):
        observation_space = observations
        action_space = actions

    with pytest.raises(UnsupportedSpaceError, match=message):
        GuardedEnv(Other())


class OldStep(Healthy):
    def step(self, action):
        observation, reward, terminated, _, info = super().step(action)
        return observation, reward, terminated, info


class OldReset(Healthy):
    def reset(self):
        return super().reset()[0]


@pytest.mark.parametrize("made", [False, True], ids=["as it is", "made by Gymnasium"])
@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (OldStep, r"step of four values is that of the old gym; shimmy.GymV21CompatibilityV0"),
        (OldReset, r"reset without seed and info is that of the old gym; shimmy.GymV21"),
        (ResetWithoutInfo, r"reset without seed and info is that of the old gym; shimmy.GymV21"),
        (lambda: answering(reward=np.zeros(3)), r"mo_gymnasium.wrappers.LinearReward\(env, weight"),
    ],
)
@pytest.mark.filterwarnings("ignore")  # Gymnasium's own, of the same
def test_an_interface_of_another_kind_is_said_with_the_wrapper_that_mends_it(kind, says, made):
    gymnasium.register("Other-v0", kind, max_episode_steps=50)
    try:
        env = gymnasium.make("Other-v0") if made else kind()
        with pytest.raises(EnvironmentFault, match=says):
            run(env)
    finally:
        del gymnasium.registry["Other-v0"]


def test_other_faults_are_no_sign_of_another_interface():
    for name in ("six values", "exception in step", "exception in reset", "no reward"):
        with pytest.raises(EnvironmentFault) as caught:
            run(SICK[name][0])
        assert "old gym" not in str(caught.value)
        assert "LinearReward" not in str(caught.value)
