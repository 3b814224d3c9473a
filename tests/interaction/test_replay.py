"""Replaying: equal episodes are found equal, and every tampering is found."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.data import Demonstrations
from eutree.errors import InvalidArgumentError
from eutree.interaction import GuardedEnv, run_episode
from eutree.interaction.episode import replay


@pytest.fixture(scope="module")
def demos():
    env = gymnasium.make("eutree/Evasion2-v0", opponent_speed=2.5)
    return eutree.record(env, eutree.experts.wait_at_crossing, episodes=3, seed=5)


def test_a_recording_replays_bit_for_bit(demos, tmp_path):
    demos.save(tmp_path / "demos")
    results = replay(Demonstrations.load(tmp_path / "demos"))
    assert [r.is_equal for r in results] == [True] * 3
    assert [r.n_steps for r in results] == [len(e) for e in demos]


def test_an_episode_of_a_release_with_larger_seeds_replays(tmp_path):
    env = GuardedEnv(gymnasium.make("eutree/Evasion2-v0"))
    policy = eutree.experts.wait_at_crossing(env.env)
    episodes = tuple(run_episode(env, policy, seed) for seed in (2**31, 2**32 - 1))
    Demonstrations(episodes, env.schema, env.spec).save(tmp_path / "demos")
    loaded = Demonstrations.load(tmp_path / "demos")
    assert [episode.seed for episode in loaded] == [2**31, 2**32 - 1]
    assert [result.problem for result in replay(loaded)] == ["", ""]


def tampered(episode):
    yield replace(episode, seed=None), "seed was not recorded"
    yield replace(episode, seed=episode.seed + 1), "at reset: observation was"
    for name in ("observations", "rewards"):
        array = getattr(episode, name).copy()
        array.flat[-1] = np.nextafter(array.flat[-1], np.inf)
        step = len(episode) - 1
        yield replace(episode, **{name: array}), f"at step {step}: {name[:-1]} was"
    yield replace(episode, actions=1 - episode.actions), "at step"
    yield replace(episode, terminated=not episode.terminated), "terminated, truncated were"


def test_every_tampering_is_found(demos):
    for episode, message in tampered(demos.episodes[1]):
        results = replay(replace(demos, episodes=(demos.episodes[0], episode)))
        assert results[0].is_equal
        assert message in results[1].problem


def test_a_trimmed_episode_replays(demos):
    episode = demos.episodes[0]
    shorter = replace(
        episode,
        observations=episode.observations[:4],
        actions=episode.actions[:3],
        rewards=episode.rewards[:3],
        terminated=False,
        truncated=False,
    )
    assert replay(replace(demos, episodes=(shorter,)))[0].is_equal


def test_mistakes_give_one_clear_line(demos):
    with pytest.raises(InvalidArgumentError, match="no episodes to replay"):
        replay(replace(demos, episodes=()))
    with pytest.raises(InvalidArgumentError, match="name no environment"):
        replay(replace(demos, environment=None))
    with pytest.raises(InvalidArgumentError, match=r"are of .*Evasion2.*, not of .*Evasion3"):
        replay(demos, gymnasium.make("eutree/Evasion3-v0"))
    with pytest.raises(InvalidArgumentError, match="have 3 features and 2 actions"):
        replay(replace(demos, environment=None), gymnasium.make("eutree/Evasion3-v0"))
