"""Polishing: the better tree wins the race, a worse one never replaces the policy, steps count."""

import importlib

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.envs.experts import careless
from eutree.errors import InvalidArgumentError
from eutree.learners import History
from eutree.training import polishing
from eutree.training.trials import Trials
from tests.compression.test_gates import Corridor, striped

RIGHT = striped(0, 5.0, 1)  # earns most
WRONG = striped(0, 7.0, 1)  # wrong on a fifth of the places


def trials(limit=10_000, worth=0.0):
    held = Trials(Corridor(), 0, seed=3, worth=worth, longest=10)
    held.limit = limit
    return held


def test_the_best_wins_the_race_and_every_step_counts():
    held = trials()
    assert held.race([WRONG, striped(0), RIGHT, striped(1)]) is RIGHT
    # 4 trees run 4 episodes of 10 steps, then 2 run 8 more; what is the same episode runs once.
    assert 0 < held.steps <= 4 * 4 * 10 + 2 * 8 * 10
    assert held.steps == sum(map(len, held.episodes))


def test_no_episode_begins_that_might_not_fit():
    held = trials(limit=39)
    assert held.episodes_of(RIGHT, 4) is None
    assert held.steps == 30
    held.race([WRONG, RIGHT])
    assert held.steps <= 39


def test_an_episode_in_which_nothing_is_decided_otherwise_is_not_run_again():
    held = trials()
    same = eutree.TreePolicy(
        RIGHT.tree.split(0, 0, 2.5), np.append(RIGHT.actions, RIGHT.actions[0]), RIGHT.schema
    )
    own = held.episodes_of(RIGHT, 4)
    steps = held.steps
    assert held.episodes_of(same, 4) == own
    assert held.steps == steps


def test_the_better_tree_is_clearly_better_and_leaves_are_paid_for():
    assert trials().better(WRONG, RIGHT)
    assert trials().better(WRONG, RIGHT, of_many=True)
    assert not trials().better(RIGHT, WRONG)
    # The same returns: without a price nothing is gained, with one a leaf less is.
    larger = eutree.TreePolicy(
        RIGHT.tree.split(0, 0, 2.5), np.append(RIGHT.actions, RIGHT.actions[0]), RIGHT.schema
    )
    assert not trials().better(larger, RIGHT)
    assert trials(worth=0.01).better(larger, RIGHT)
    assert not trials(worth=0.01).better(RIGHT, larger)


def test_few_episodes_prove_nothing():
    assert trials(limit=16 * 2 * 10).better(WRONG, RIGHT) is None
    assert trials(limit=7 * 2 * 10).better(WRONG, RIGHT) is False


@pytest.fixture(scope="module")
def learned():
    env = gymnasium.make("MountainCar-v0")
    shown = eutree.record(env, eutree.experts.push_along, episodes=10, seed=1000)
    sloppy = eutree.record(env, careless(eutree.experts.push_along, 0.3), episodes=20, seed=1000)
    budget = {"evaluate_every": 10**6, "evaluation_episodes": 1, "seed": 1000, "episodes": 0}
    expert = eutree.fit_expert_tree(shown)
    return env, eutree.learn(env, demonstrations=sloppy, expert=expert, **budget)


def test_polishing_improves_a_tree_within_its_budget_and_repeats(learned):
    env, result = learned
    options = {"steps": 30_000, "n_steps": 10_000, "max_leaves": 6, "seed": 1}
    policy, report = eutree.polish(result.policy, result.history, env, **options)
    before, after = (
        eutree.evaluate(p, env, episodes=60, seed=9).mean_return for p in (result.policy, policy)
    )
    assert after > before + 5
    assert report.n_leaves_after == policy.n_leaves <= 6
    assert report.won >= 1
    assert 6_000 < report.environment_steps <= 30_000
    again, _ = eutree.polish(result.policy, result.history, env, **options)
    assert again.to_bytes() == policy.to_bytes()


def test_a_limit_of_leaves_is_kept_whatever_it_costs(learned):
    env, result = learned
    options = {"steps": 1_000, "n_steps": 2_000, "seed": 1}
    policy, report = eutree.polish(result.policy, result.history, env, max_leaves=2, **options)
    assert policy.n_leaves <= 2 or report.n_leaves_before <= 2


def test_learning_ends_with_it_if_asked(learned, monkeypatch):
    env, plain = learned
    asked = {}

    def polish(policy, history, env, *, steps, seed):
        asked.update(steps=steps, seed=seed, size=history.size)
        return policy, polishing.PolishReport(policy.n_leaves, policy.n_leaves, 0, 0, 7)

    monkeypatch.setattr(importlib.import_module("eutree.training.learn"), "polish", polish)
    budget = {"evaluate_every": 10**6, "evaluation_episodes": 1, "seed": 5, "episodes": 1}
    result = eutree.learn(env, expert=plain.policy, polish_steps=500, **budget)
    assert asked == {"steps": 500, "seed": 5, "size": result.history.size}
    assert (result.polishing.environment_steps, plain.polishing) == (7, None)


def test_what_is_refused(learned):
    env, result = learned
    for options, message in (
        ({"steps": 0}, "steps"),
        ({"steps": 1, "max_leaves": 1}, "max_leaves"),
        ({"steps": 1, "price": -1.0}, "price"),
        ({"steps": 1, "n_steps": 0}, "n_steps"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            eutree.polish(result.policy, result.history, env, **options)
    with pytest.raises(InvalidArgumentError, match="history must hold transitions"):
        eutree.polish(RIGHT, History(1, 2), Corridor(), steps=1)
    locked = eutree.TreePolicy(RIGHT.tree, RIGHT.actions, RIGHT.schema, locked=(0,))
    with pytest.raises(InvalidArgumentError, match="no locked leaves"):
        eutree.polish(locked, History(1, 2), Corridor(), steps=1)
    with pytest.raises(InvalidArgumentError, match="polish_steps must be 0"):
        eutree.learn(None, polish_steps=1)
