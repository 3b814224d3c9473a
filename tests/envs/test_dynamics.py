"""The physics against a slow twin that walks leg by leg."""

import dataclasses
import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree.envs import _dynamics as dynamics
from eutree.envs._dynamics import EvasionParameters
from eutree.envs.evasion import EvasionEnv
from eutree.envs.vector import EvasionVectorEnv
from eutree.errors import InvalidArgumentError, UnknownNameError
from tests.envs.conftest import evasion_arguments
from tests.naive_envs import NaiveEvasion, bounce


@given(
    place=st.floats(-1, 1),
    direction=st.sampled_from([-1.0, 1.0]),
    half=st.floats(0.5, 50),
    paths=st.floats(0, 20),
)
def test_reflection_is_walking_to_and_fro(
    place: float, direction: float, half: float, paths: float
) -> None:
    distance = paths * 2 * half
    folded, turns = dynamics.reflect(np.array([place * half + direction * distance]), half)
    expected, heading = bounce(place * half, direction, distance, half)
    assert folded[0] == pytest.approx(expected, abs=1e-9 * half * (1 + paths))
    near_end = half - abs(expected) < 1e-6 * half
    assert near_end or turns[0] * direction == heading


def test_turning_at_an_end_by_hand() -> None:
    held, turns = dynamics.turn(np.array([12.0, -13.0, 34.0, 11.0, -11.0, 3.0]), 11.0)
    assert held.tolist() == [11.0, -11.0, 11.0, 11.0, -11.0, 3.0]
    assert turns.tolist() == [-1.0, -1.0, -1.0, -1.0, 1.0, 1.0]


def test_starts_by_hand() -> None:
    uniforms = np.array([0.25, 0.75, 0.2, 0.9])  # two places, two coins
    for start, places, directions in (
        ("anywhere", [-5.5, 5.5], [-1.0, 1.0]),
        ("either end", [11.0, -11.0], [-1.0, 1.0]),
        ("same end", [11.0, 11.0], [-1.0, -1.0]),
    ):
        state = dynamics.start(EvasionParameters(start=start), uniforms)
        assert state.opponents.tolist() == places
        assert state.directions.tolist() == directions


def test_a_step_without_reflection_is_exact() -> None:
    folded, turns = dynamics.reflect(np.array([0.0 + 3.2, -10.9]), 11.0)
    assert folded.tolist() == [3.2, -10.9]
    assert turns.tolist() == [1.0, 1.0]


def test_reflection_at_both_ends_by_hand() -> None:
    # half path 11: 12 is one beyond the upper end; -13 two beyond the lower; 34 there and back.
    folded, turns = dynamics.reflect(np.array([12.0, -13.0, 34.0, 11.0, -11.0]), 11.0)
    assert folded.tolist() == [10.0, -9.0, -10.0, 11.0, -11.0]
    assert turns.tolist() == [-1.0, -1.0, 1.0, -1.0, 1.0]


@settings(max_examples=60, deadline=None)
@given(arguments=evasion_arguments, seed=st.integers(0, 2**32 - 1))
def test_environment_equals_the_naive_one(arguments: dict[str, Any], seed: int) -> None:
    env = EvasionEnv(**arguments)
    naive = NaiveEvasion(env.parameters)
    actions = np.random.default_rng(seed).integers(0, 2, size=300).tolist()
    count = env.parameters.n_opponents
    observation, _ = env.reset(seed=seed)
    generator, _ = gymnasium.utils.seeding.np_random(seed)
    np.testing.assert_allclose(observation[: count + 1], naive.reset(generator), atol=1e-12)
    for action in actions:
        observation, reward, terminated, truncated, info = env.step(action)
        expected, expected_reward, ending = naive.step(action)
        # Only rounding may differ, and it grows with the distance walked.
        walked = naive.step_number * env.parameters.opponent_step * (1 + env.parameters.noise)
        np.testing.assert_allclose(
            observation[: count + 1], expected, atol=1e-9 * (1 + walked), rtol=0
        )
        assert env.observation_space.contains(observation)
        if info.get("ending") != ending:  # rounding at the edge of a collision or of the goal
            assert min_gap(env) < 1e-6
            return
        assert reward == expected_reward
        assert info["is_success"] == (ending == "goal")
        assert terminated == (ending in ("goal", "collision"))
        assert truncated == (ending == "time limit")
        if ending is not None:
            return
    raise AssertionError("no ending within the trial limit")


def min_gap(env: EvasionEnv) -> float:
    """Return how near the state is to the edge of any ending."""
    p, state = env.parameters, env.state
    distance = np.hypot(state.position - p.crossing, state.opponents)
    to_goal = abs(p.main_path_length - float(state.position))
    return float(min(np.abs(distance - p.collision_distance).min(), to_goal))


@pytest.mark.parametrize(
    ("count", "expected"), [(1, [15.0]), (2, [10.0, 20.0]), (3, [7.5, 15.0, 22.5])]
)
def test_crossings_are_equally_spaced(count: int, expected: list[float]) -> None:
    assert EvasionParameters(n_opponents=count).crossing.tolist() == expected


@pytest.mark.parametrize(
    ("limit", "step", "expected"),
    [(60, 1.0, 60), (60, 0.1, 600), (0.3, 0.1, 3), (1.0, 0.3, 4), (0.2, 1.0, 1), (60, 7, 9)],
)
def test_number_of_steps(limit: float, step: float, expected: int) -> None:
    assert EvasionParameters(trial_limit=limit, time_step=step).max_steps == expected


def test_derived_constants_are_read_only() -> None:
    parameters = EvasionParameters()
    with pytest.raises(ValueError, match="read-only"):
        parameters.crossing[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        parameters.noise = 1.0


NAN, INF = float("nan"), float("inf")
WRONG = [
    ("n_opponents", 0, "n_opponents must be an integer >= 1, got 0"),
    ("n_opponents", 2.0, "n_opponents must be an integer >= 1, got 2.0"),
    ("n_opponents", True, "n_opponents must be an integer >= 1, got True"),
    ("opponent_speed", -0.1, "opponent_speed must be a number in [0, inf), got -0.1"),
    ("opponent_speed", NAN, "opponent_speed must be a number in [0, inf), got nan"),
    ("opponent_speed", "fast", "opponent_speed must be a number in [0, inf), got 'fast'"),
    ("agent_speed", 0.0, "agent_speed must be a number in (0, inf), got 0.0"),
    ("path_length", -22, "path_length must be a number in (0, inf), got -22"),
    ("main_path_length", INF, "main_path_length must be a number in (0, inf), got inf"),
    ("main_path_length", None, "main_path_length must be a number in (0, inf), got None"),
    ("noise", -0.02, "noise must be a number in [0, inf), got -0.02"),
    ("time_step", 0, "time_step must be a number in (0, inf), got 0"),
    ("time_step", 1e-9, "trial_limit / time_step must be at most 3333333 steps"),
    ("collision_distance", "2", "collision_distance must be a number in [0, inf), got '2'"),
    ("start", "middle", "start 'middle'"),
    ("bounce", "jump", "bounce 'jump'"),
    ("trial_limit", -60, "trial_limit must be a number in (0, inf), got -60"),
    ("goal_reward", NAN, "goal_reward must be a number in (-inf, inf), got nan"),
    ("stop_reward", [1], "stop_reward must be a number in (-inf, inf), got [1]"),
    ("observe_direction", 1, "observe_direction must be True or False, got 1"),
    ("crossings", 10, "crossings must be None or a sequence of 2 numbers, got 10"),
    ("crossings", "ab", "crossings must be None or a sequence of 2 numbers, got 'ab'"),
    ("crossings", (10,), "crossings must hold n_opponents = 2 numbers, got 1"),
    ("crossings", (10, 31), "crossings[1] must be a number in [0, 30], got 31"),
    ("crossings", (NAN, 20), "crossings[0] must be a number in [0, 30], got nan"),
]


@pytest.mark.parametrize(("name", "value", "message"), WRONG)
def test_wrong_arguments_have_clear_messages(name: str, value: Any, message: str) -> None:
    with pytest.raises(InvalidArgumentError, match=re.escape(message)):
        gymnasium.make("eutree/Evasion2-v0", **{name: value})


@pytest.mark.parametrize("make", [EvasionEnv, EvasionVectorEnv])
def test_unknown_arguments_name_the_nearest(make: Any) -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'opponent_speed'"):
        make(oponent_speed=3.0)
