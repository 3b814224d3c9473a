"""What is said of logs with rare losses, masks, corrected steps and no rewards."""

import dataclasses

import numpy as np
import pytest

from eutree.data import Demonstrations, Episode
from eutree.evaluation import Evaluation
from eutree.evaluation.expert_curve import expert_curve
from eutree.evaluation.off_policy import Log
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree

SCHEMA = Schema.anonymous(1, 2)


def always(action) -> TreePolicy:
    return TreePolicy(DecisionTree.single_leaf(1), np.array([action]), SCHEMA)


def with_rare_losses(seed) -> Demonstrations:
    """Action 1 earns one more, but loses a thousand once in five hundred: it is the worse one."""
    random, episodes = np.random.default_rng(seed), []
    for _ in range(24):
        actions = (random.random(30) < 0.1).astype(int)
        lost = 1000.0 * (actions * (random.random(30) < 0.002))
        rewards = random.normal(0.0, 0.02, 30) + actions - lost
        episodes.append(Episode(random.normal(size=(31, 1)), actions, rewards,
                                terminated=True, truncated=False))  # fmt: skip
    return Demonstrations(tuple(episodes), SCHEMA)


@pytest.mark.parametrize("known", [None, (-30000.0, 60.0)])
def test_single_deviations_need_many_steps_whatever_range_is_known(known) -> None:
    """With a range the worse action was believed in by 7 of 10 such logs, at some 60 steps."""
    for seed in range(1, 7):
        log = Log.of(with_rare_losses(seed), always(0), known, seed=seed)
        _, found = log.chosen(always(1), discount=0.99)
        assert found.needed == 300 > found.tried
        assert not found.believed
        assert "are needed where the range of returns is not known or bounds nothing" in str(
            found.describe()
        )


def noisy(n, teach) -> Demonstrations:
    """People err in a third of the steps; where they are taught, all of that is put right."""
    random, episodes = np.random.default_rng(1), []
    for _ in range(n):
        rows = random.random((31, 1))
        wanted = (rows[:-1, 0] > 0.5).astype(int)
        taken = np.where(random.random(30) < 0.3, 1 - wanted, wanted)
        episode = Episode(rows, taken, np.zeros(30), terminated=True, truncated=False)
        episodes.append(episode.teaching(wanted) if teach else episode)
    return Demonstrations(tuple(episodes), SCHEMA)


def test_the_curve_is_about_what_is_to_be_imitated() -> None:
    """It compared with the actions taken, and said that what decides is not observed."""
    taught, as_taken = expert_curve(noisy(12, True)), expert_curve(noisy(12, False))
    assert taught.points[-1].accuracy > 0.95
    assert "still errs" not in taught.advice
    assert as_taken.points[-1].accuracy < 0.75


def test_the_curve_leaves_out_what_was_cut() -> None:
    demos = noisy(12, True)
    cut = tuple(
        episode.teaching(np.where(np.arange(30) < 15, -1, episode.actions))
        for episode in noisy(12, False).episodes
    )
    half = tuple(replaced(episode, 15) for episode in noisy(12, False).episodes)
    curve = expert_curve(dataclasses.replace(demos, episodes=cut))
    assert curve.points[-1].accuracy < 0.8
    assert curve.most_frequent == pytest.approx(
        np.bincount(np.concatenate([one.actions for one in half])).max() / (12 * 15)
    )


def replaced(episode, first) -> Episode:
    return Episode(episode.observations[first:], episode.actions[first:], episode.rewards[first:],
                   terminated=True, truncated=False)  # fmt: skip


def test_the_curve_decides_among_what_is_allowed() -> None:
    random, episodes, schema = np.random.default_rng(1), [], Schema.anonymous(2, 3)
    for _ in range(12):
        rows = random.random((31, 2))
        allowed = np.ones((30, 3), dtype=np.bool_)
        forced = random.random(30) < 0.4
        allowed[forced, :2] = False
        actions = np.where(forced, 2, (rows[:-1, 0] > 0.5).astype(int))
        episodes.append(Episode(rows, actions, np.zeros(30), terminated=True, truncated=False,
                                steps={"allowed": allowed}))  # fmt: skip
    curve = expert_curve(Demonstrations(tuple(episodes), schema))
    assert curve.points[-1].accuracy > 0.95
    assert "still errs" not in curve.advice


def test_an_evaluation_without_rewards_can_be_printed() -> None:
    episode = Episode(np.zeros((3, 1)), [0, 0], [0.0, 0.0], terminated=True, truncated=False,
                      has_rewards=False)  # fmt: skip
    said = repr(Evaluation.of([episode, episode]))
    assert said.startswith("<Evaluation: 2 episodes: mean return nan, 2.0 steps")


def test_the_digest_covers_masks() -> None:
    episode = Episode(np.zeros((3, 1)), [0, 0], [0.0, 0.0], terminated=True, truncated=False)
    masked = dataclasses.replace(episode, steps={"allowed": np.array([[1, 0], [1, 1]], np.bool_)})
    one, other = (Demonstrations((each,), SCHEMA).digest for each in (episode, masked))
    assert one != other
