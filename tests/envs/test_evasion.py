"""The single environment: its card, endings, keys and manners."""

import dataclasses
import re

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from eutree.envs._dynamics import EvasionParameters
from eutree.envs.evasion import RIGHT_ARROW, SPACE, EvasionEnv
from eutree.errors import InvalidArgumentError, UnknownNameError
from tests.envs.cards import HEADINGS


def section(heading: str) -> str:
    card = str(EvasionEnv.__doc__)
    return card.split(f"## {heading}\n")[1].split("\n    ## ")[0]


def test_card_has_gymnasiums_headings_in_order() -> None:
    assert re.findall(r"^ *## (.*)$", str(EvasionEnv.__doc__), re.MULTILINE) == HEADINGS


def test_card_lists_every_argument_with_its_default() -> None:
    rows = re.findall(r"\| `(\w+)` \| (\S+) \|", section("Arguments"))
    defaults = [(f.name, f.default) for f in dataclasses.fields(EvasionParameters) if f.init]
    assert [name for name, _ in rows] == [name for name, _ in defaults] + ["render_mode"]
    for (_, written), (_, default) in zip(rows, defaults, strict=False):
        assert written == str(default) or float(written) == default


def test_card_agrees_with_the_spaces() -> None:
    env = EvasionEnv(observe_direction=True)
    rows = re.findall(r"\| (-?\d+) \| (-?\d+) \|", section("Observation Space"))
    low, high = env.observation_space.low.tolist(), env.observation_space.high.tolist()
    ends = [(low[i], high[i]) for i in (0, 1, 3)]
    assert [(float(a), float(b)) for a, b in rows] == ends
    for number, name in enumerate(env.action_names):
        assert f"| {number} | `{name}` |" in section("Action Space")


def test_names_and_units_match_the_observation() -> None:
    env = EvasionEnv(n_opponents=2, observe_direction=True)
    assert env.feature_names == (
        "position", "opponent_1", "opponent_2", "direction_1", "direction_2",
    )  # fmt: skip
    assert env.feature_units == ("m", "m", "m", "", "")
    assert env.action_names == ("stop", "go")
    observation, _ = env.reset(seed=3)
    assert set(observation[3:].tolist()) <= {-1.0, 1.0}


def test_collision_terminates() -> None:
    # The opponent stands still somewhere on a path that is wholly within reach.
    env = EvasionEnv(n_opponents=1, opponent_speed=0.0, path_length=1.0, noise=0.0)
    env.reset(seed=0)
    *_, info = step_until_end(env, 1)
    assert info == {"is_success": False, "ending": "collision"}
    assert float(env.state.position) == 14.0  # the first stop within 2 m of 15 m


def test_goal_terminates_even_at_the_time_limit() -> None:
    env = EvasionEnv(
        n_opponents=1, opponent_speed=0.0, collision_distance=0.0, noise=0.0, trial_limit=15.0
    )
    env.reset(seed=0)
    observation, reward, terminated, truncated, info = step_until_end(env, 1)
    assert (reward, terminated, truncated) == (100.0, True, False)
    assert info == {"is_success": True, "ending": "goal"}
    assert observation[0] == 30.0


def test_time_limit_truncates() -> None:
    env = EvasionEnv(trial_limit=5.0)
    env.reset(seed=0)
    _, reward, terminated, truncated, info = step_until_end(env, 0)
    assert (reward, terminated, truncated) == (-2.0, False, True)
    assert info == {"is_success": False, "ending": "time limit"}


def test_collision_counts_before_the_goal() -> None:
    env = EvasionEnv(n_opponents=1, crossings=(30.0,), opponent_speed=0.0, path_length=1.0)
    env.reset(seed=0)
    *_, info = step_until_end(env, 1)
    assert info["ending"] == "collision"


def test_success_is_reported_at_every_step() -> None:
    env = EvasionEnv()
    env.reset(seed=0)
    assert env.step(0)[4] == {"is_success": False}


def test_rewards_are_arguments() -> None:
    env = EvasionEnv(
        n_opponents=1, path_length=1.0, collision_reward=-7.0, stop_reward=-1.5, crossings=(1.0,)
    )
    env.reset(seed=0)
    assert env.step(0)[1] == -8.5


def step_until_end(env: EvasionEnv, action: int) -> tuple:
    while True:
        answer = env.step(action)
        if answer[2] or answer[3]:
            return answer


def test_same_seed_same_episode() -> None:
    def episode(env: EvasionEnv) -> list[list[float]]:
        observations = [env.reset(seed=11)[0].tolist()]
        for step in range(8):
            observations.append(env.step(step % 2)[0].tolist())
        return observations

    env = EvasionEnv()
    first = episode(env)
    assert episode(env) == first
    assert episode(EvasionEnv()) == first


def test_episode_does_not_depend_on_the_actions_of_the_one_before() -> None:
    def second_start(action: int) -> list[float]:
        env = EvasionEnv(trial_limit=3.0)
        env.reset(seed=5)
        env.step(action)
        return env.reset()[0].tolist()

    assert second_start(0) == second_start(1)


def test_observation_is_a_fresh_array() -> None:
    env = EvasionEnv()
    observation, _ = env.reset(seed=0)
    observation[:] = 1e9
    assert env.step(0)[0][0] == 0.0


@pytest.mark.parametrize("action", [2, -1, 1.0, "go", None, True, np.array([0, 1])])
def test_wrong_action(action: object) -> None:
    env = EvasionEnv()
    env.reset(seed=0)
    with pytest.raises(InvalidArgumentError, match=r"action must be 0 \(stop\) or 1 \(go\), got"):
        env.step(action)


def test_numpy_actions_are_actions() -> None:
    env = EvasionEnv()
    env.reset(seed=0)
    for action in (np.int64(1), np.array(1), np.uint8(0)):
        env.step(action)


def test_step_before_reset_and_after_the_end() -> None:
    env = EvasionEnv(trial_limit=1.0)
    with pytest.raises(ResetNeeded, match="call reset"):
        env.step(0)
    env.reset(seed=0)
    env.step(0)
    with pytest.raises(ResetNeeded, match="the episode has ended"):
        env.step(0)


def test_unknown_render_mode() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'rgb_array'"):
        EvasionEnv(render_mode="rgb_arrays")


def test_keys() -> None:
    pygame = pytest.importorskip("pygame", reason="needs the extra record")
    assert (SPACE, RIGHT_ARROW) == (pygame.K_SPACE, pygame.K_RIGHT)
    keys = EvasionEnv().get_keys_to_action()
    assert set(keys) == {(SPACE,), (RIGHT_ARROW,), (SPACE, RIGHT_ARROW)}
    assert set(keys.values()) == {1}
    assert all(list(combination) == sorted(combination) for combination in keys)


def test_pace_is_that_of_the_clock() -> None:
    assert EvasionEnv(time_step=0.25).metadata["render_fps"] == 4.0
    assert gymnasium.make("eutree/Evasion2-v0").metadata["render_fps"] == 1.0
