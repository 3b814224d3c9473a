"""The vector environment gives the single environment's episodes, bit for bit."""

import statistics
import time
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import SyncVectorEnv
from hypothesis import given, settings
from hypothesis import strategies as st

from eutree import compiled
from eutree.envs.evasion import EvasionEnv
from eutree.envs.vector import EvasionVectorEnv
from eutree.errors import InvalidArgumentError
from tests.envs.conftest import evasion_arguments


def assert_same_run(
    arguments: dict[str, Any],
    seeds: list[int],
    actions: np.ndarray,  # [T, E]
) -> int:
    """Step our vector environment and Gymnasium's around the single one; return the episodes."""
    copies = len(seeds)
    ours = EvasionVectorEnv(copies, **arguments)
    theirs = SyncVectorEnv([lambda: EvasionEnv(**arguments)] * copies)
    answer, expected = ours.reset(seed=seeds), theirs.reset(seed=seeds)
    assert answer[0].tobytes() == expected[0].tobytes()
    assert answer[1] == expected[1] == {}
    ended = 0
    for row in actions:
        answer, expected = ours.step(row), theirs.step(row)
        for array, twin in zip(answer[:4], expected[:4], strict=True):
            assert array.dtype == twin.dtype
            assert array.shape == twin.shape
            assert array.tobytes() == twin.tobytes()
        assert_same_info(answer[4], expected[4])
        ended += int((answer[2] | answer[3]).sum())
    theirs.close()
    return ended


def assert_same_info(info: dict[str, Any], expected: dict[str, Any]) -> None:
    if not expected:  # every copy began an episode: Gymnasium has nothing to say then
        assert not info["_is_success"].any()
        return
    assert set(info) == set(expected)
    for key, array in info.items():
        assert array.dtype == expected[key].dtype, key
        assert array.tolist() == expected[key].tolist(), key


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_thousands_of_steps_equal_the_single_environment(count: int) -> None:
    generator = np.random.default_rng(count)
    actions = (generator.random((400, 8)) < 0.8).astype(np.int64)
    ended = assert_same_run({"n_opponents": count}, list(range(100, 108)), actions)
    assert ended > 100


@settings(max_examples=60, deadline=None)
@given(
    arguments=evasion_arguments,
    seeds=st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=4),
    share=st.sampled_from([0.0, 0.5, 0.95, 1.0]),
)
def test_any_parameters_equal_the_single_environment(
    arguments: dict[str, Any], seeds: list[int], share: float
) -> None:
    generator = np.random.default_rng(seeds)
    actions = (generator.random((60, len(seeds))) < share).astype(np.int64)
    assert_same_run(arguments, seeds, actions)


def test_int_seed_counts_up() -> None:
    first, _ = EvasionVectorEnv(3).reset(seed=7)
    second, _ = EvasionVectorEnv(3).reset(seed=[7, 8, 9])
    assert first.tobytes() == second.tobytes()


def test_reset_without_seed_goes_on_with_the_generators() -> None:
    env, single = EvasionVectorEnv(1), EvasionEnv()
    env.reset(seed=3), single.reset(seed=3)
    assert env.reset()[0][0].tolist() == single.reset()[0].tolist()


def test_copies_without_a_seed_differ() -> None:
    observations, _ = EvasionVectorEnv(4).reset(seed=[1, None, None, 1])
    assert observations[0].tolist() == observations[3].tolist()
    assert len({tuple(row) for row in observations.tolist()}) == 3


def test_make_vec() -> None:
    env = gymnasium.make_vec(
        "eutree/Evasion3-v0", num_envs=5, vectorization_mode="vector_entry_point", noise=0.1
    )
    assert isinstance(env.unwrapped, EvasionVectorEnv)
    assert env.unwrapped.parameters.noise == 0.1
    assert env.single_observation_space == gymnasium.make("eutree/Evasion3-v0").observation_space
    assert env.observation_space.shape == (5, 4)
    assert env.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.NEXT_STEP
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()


def test_gymnasiums_statistics_wrapper_understands_it() -> None:
    env = gymnasium.wrappers.vector.RecordEpisodeStatistics(EvasionVectorEnv(4, trial_limit=6.0))
    env.reset(seed=0)
    for _ in range(6):
        *_, info = env.step(np.zeros(4, dtype=np.int64))
    finished = info["_episode"]
    assert info["episode"]["l"][finished].tolist() == [6] * int(finished.sum())
    assert finished.any()


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.array([0, 2]), r"actions must be 0 \(stop\) or 1 \(go\), got 2 at \[1\]"),
        (np.array([0.0, 1.0]), r"actions must be 2 integers, got shape \(2,\) of float64"),
        (np.array([0]), r"actions must be 2 integers, got shape \(1,\)"),
    ],
)
def test_wrong_actions(actions: np.ndarray, message: str) -> None:
    env = EvasionVectorEnv(2)
    env.reset(seed=0)
    with pytest.raises(InvalidArgumentError, match=message):
        env.step(actions)


def test_wrong_resets() -> None:
    env = EvasionVectorEnv(2)
    with pytest.raises(ResetNeeded, match="every copy"):
        env.step(np.array([0, 0]))
    with pytest.raises(InvalidArgumentError, match=r"one seed for each of the 2 copies, got 3"):
        env.reset(seed=[1, 2, 3])
    with pytest.raises(InvalidArgumentError, match=r"seed must be an integer from 0 to .*, got -1"):
        env.reset(seed=-1)
    with pytest.raises(InvalidArgumentError, match="num_envs must be an integer >= 1, got 0"):
        EvasionVectorEnv(0)
    with pytest.raises(InvalidArgumentError, match="render_mode must be None"):
        EvasionVectorEnv(2, render_mode="human")
    with pytest.raises(InvalidArgumentError, match="options must have no reset_mask"):
        env.reset(options={"reset_mask": np.array([True, False])})


def test_answers_are_fresh_arrays() -> None:
    env = EvasionVectorEnv(2)
    env.reset(seed=0)
    first = env.step(np.array([1, 1]))
    copies = [array.copy() for array in first[:4]]
    env.step(np.array([1, 1]))
    assert all((a == b).all() for a, b in zip(first[:4], copies, strict=True))


@pytest.mark.skipif(not compiled.ENABLED, reason="EUTREE_JIT=0: nothing is compiled")
def test_many_copies_are_much_faster_than_one() -> None:
    """The benchmark shows 50 and more; here there is slack for a busy machine."""
    single, vector = EvasionEnv(), EvasionVectorEnv(256)
    actions = np.ones(256, dtype=np.int64)
    vector.reset(seed=0)
    vector.step(actions)  # compiles
    ratios = []
    for _ in range(5):
        begun = time.thread_time()
        single.reset(seed=0)
        for _ in range(500):
            *_, terminated, truncated, _ = single.step(1)
            if terminated or truncated:
                single.reset()
        between = time.thread_time()
        for _ in range(100):
            vector.step(actions)
        ratios.append((100 * 256 / (time.thread_time() - between)) / (500 / (between - begun)))
    assert statistics.median(ratios) > 15
