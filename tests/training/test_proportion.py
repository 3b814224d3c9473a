"""Evaluation in proportion: where episodes are dear, few are played beside what is learned from."""

import json
import time

import gymnasium
import pytest

import eutree
from eutree.training.phases import EVERY, USUAL, allowance, curve_of, is_dear, left


class Counted(gymnasium.Wrapper):
    """CartPole of 30 steps at most, whose episodes are counted and may take their time."""

    def __init__(self, seconds=0.0):
        super().__init__(gymnasium.make("CartPole-v1", max_episode_steps=30))
        self.episodes, self._seconds = 0, seconds

    def reset(self, **options):
        self.episodes += 1
        return self.env.reset(**options)

    def step(self, action):
        time.sleep(self._seconds)
        return self.env.step(action)


class Walked(Counted):
    """The same, with its steps counted."""

    steps = 0

    def step(self, action):
        self.steps += 1
        return super().step(action)


@pytest.fixture(scope="module")
def shown():
    expert = eutree.experts.EXPERTS["CartPole-v1"]["balance"]
    env = gymnasium.make("CartPole-v1", max_episode_steps=30)
    return eutree.record(env, expert, episodes=3, seed=0)


@pytest.mark.parametrize("method", ["planning", "u-tree", "paper"])
@pytest.mark.parametrize("starts_from", ["nothing", "tree+demos"])
def test_forty_learned_episodes_come_with_twenty_at_most(shown, method, starts_from):
    env = Counted()
    demonstrations = None if starts_from == "nothing" else shown
    result = eutree.learn(
        env, demonstrations=demonstrations, method=method, start=starts_from, episodes=40, seed=1
    )
    assert result.episodes == 40
    assert env.episodes - 40 == result.evaluation_episodes <= 20
    assert [point.episode for point in result.curve] == [0, 40]


def test_what_is_handed_over_is_decided_by_what_was_played_and_its_range_is_said(shown):
    """Both trees are evaluated along the way, from common starts: ten pairs cost 20 episodes."""
    env = Counted()
    result = eutree.learn(env, method="corrected", start="nothing", episodes=40, seed=1)
    judgement = result.against_start
    assert (judgement.episodes, env.episodes) == (10, 60)
    assert "if no episode returns less than" in judgement.condition
    steps = result.environment_steps
    assert judgement.steps == steps.judging
    assert steps.evaluation > 0 < steps.judging
    assert steps.total == steps.learning + steps.judging


@pytest.mark.parametrize("starts_from", ["nothing", "tree"])
def test_the_steps_beside_the_start_are_counted_where_they_decide_nothing(shown, starts_from):
    env = Walked()
    demonstrations = None if starts_from == "nothing" else shown
    result = eutree.learn(
        env, demonstrations=demonstrations, start=starts_from, method="paper", episodes=40, seed=1
    )
    steps = result.environment_steps
    assert result.against_start.episodes > 0
    first_look = env.steps - steps.learning - steps.evaluation
    assert 0 <= first_look <= 2 * 30


def test_more_is_played_where_it_is_asked_for():
    options = {"method": "corrected", "start": "nothing", "episodes": 40, "seed": 1}
    more = eutree.learn(Counted(), evaluation_episodes=30, **options)
    assert more.evaluation_episodes >= 60
    often = eutree.learn(Counted(), evaluate_every=10, judge_episodes=0, **options)
    assert [point.episode for point in often.curve] == [0, 10, 20, 30, 40]
    surer = eutree.learn(Counted(), judge_episodes=50, **options)
    assert surer.against_start.episodes > 10


def test_a_run_of_the_usual_length_is_evaluated_as_ever():
    assert curve_of(None, None, USUAL, decides=False) == (EVERY, 100)
    assert curve_of(None, None, None, decides=False) == (EVERY, 100)
    assert not is_dear(USUAL)
    assert not is_dear(None)


@pytest.mark.parametrize("expected", [1, 4, 20, 40, 100, 399])
@pytest.mark.parametrize("decides", [False, True])
def test_the_curve_leaves_half_of_the_allowance(expected, decides):
    every, episodes = curve_of(None, None, expected, decides=decides)
    points = 1 + -(-expected // every)
    assert points * episodes <= max(allowance(expected) // 2, points)
    assert left(expected, points * episodes) >= allowance(expected) // 4


def test_side_by_side_episodes_are_not_dear():
    result = eutree.learn("eutree/Evasion2-v0", episodes=40, method="corrected", seed=1)
    assert len(result.curve) == 3
    assert result.evaluation_episodes >= 300


def test_minutes_count_everything_that_is_played():
    env, begin = Counted(seconds=0.002), time.monotonic()
    eutree.learn(env, method="corrected", episodes=1, evaluation_episodes=1, seed=1)  # compiles
    env, begin = Counted(seconds=0.002), time.monotonic()
    result = eutree.learn(env, method="corrected", start="nothing", minutes=0.1, seed=1)
    # All that was played took no more than it may; a loaded machine plays less, not longer.
    assert time.monotonic() - begin < 2 * 6.0
    assert 0 < result.evaluation_episodes == env.episodes - result.episodes
    assert result.evaluation_episodes < result.episodes


def test_a_stopped_run_counts_and_hands_over_the_same(tmp_path):
    options = {"method": "corrected", "start": "nothing", "episodes": 40, "seed": 1}
    whole = eutree.learn(Counted(), out=tmp_path / "whole", **options)
    left_over = iter(range(500))
    eutree.learn(
        Counted(), out=tmp_path / "part", stop=lambda: next(left_over, None) is None, **options
    )
    again = eutree.learn(Counted(), out=tmp_path / "part", resume=True, **options)
    assert again.evaluation_episodes == whole.evaluation_episodes
    assert again.environment_steps == whole.environment_steps
    assert again.learned.to_bytes() == whole.learned.to_bytes()
    assert again.against_start == whole.against_start
    config = json.loads((tmp_path / "whole" / "config.json").read_text())
    assert config["evaluation_episodes"] is None
    longer = eutree.learn(
        Counted(), out=tmp_path / "part", resume=True, **options | {"episodes": 60}
    )
    assert longer.episodes == 60
