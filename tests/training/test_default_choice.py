"""Which method learns where none is named."""

import itertools

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.envs.experts import EXPERTS, follow_the_fall
from eutree.learners import DistilledDQN
from eutree.learners.default_choice import Evidence, default_for


class Pushes:
    """Pushes to the right."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return 1, None


@pytest.fixture(scope="module")
def cart():
    env = gymnasium.make("CartPole-v1")
    return eutree.record(env, follow_the_fall, episodes=5, seed=0)


@pytest.fixture(scope="module")
def acrobot():
    env = gymnasium.make("Acrobot-v1")
    return eutree.record(env, EXPERTS["Acrobot-v1"]["both"], episodes=5, seed=0)


def test_many_features_and_many_steps_get_a_teacher(acrobot):
    choice = default_for(Evidence(acrobot, 100_000))
    assert choice.method == DistilledDQN()
    assert choice.reason.startswith("distilled-dqn learns: 6 features")


def test_everything_else_is_planned(cart, acrobot):
    for known, why in (
        (Evidence(None, 500_000), "planning learns: a network as teacher would need 5 dem"),
        (Evidence(cart, 500_000), "planning learns: 4 features are few enough for it"),
        (Evidence(acrobot, None), "planning learns: a network as teacher would need a budget"),
        (Evidence(acrobot, 40_000), "planning learns: a network as teacher would need 80000 steps"),
    ):
        choice = default_for(known)
        assert choice.method.name == "planning"
        assert choice.reason.startswith(why)


@pytest.mark.parametrize("method", [None, "auto"])
def test_a_run_says_why(cart, method):
    env = gymnasium.make("CartPole-v1")
    result = eutree.learn(
        env, demonstrations=cart, method=method, episodes=1, evaluation_episodes=2
    )
    assert result.method.name == "planning"
    assert "4 features are few enough" in result.reason


def test_what_is_named_is_taken(acrobot):
    env = gymnasium.make("Acrobot-v1")
    result = eutree.learn(
        env,
        demonstrations=acrobot,
        method="u-tree",
        steps=90_000,
        episodes=1,
        evaluation_episodes=1,
    )
    assert result.method.name == "u-tree"
    assert result.reason == ""


def test_who_names_a_teacher_wants_it_asked(cart):
    assert default_for(Evidence(cart, None, teacher=True)).method.name == "distilled-dqn"


def test_a_policy_that_stays_is_evaluated_once(cart, monkeypatch):
    evaluated = []
    plainly = eutree.training.learn.__globals__["evaluate"]

    def counted(policy, env, **arguments):
        evaluated.append(policy)
        return plainly(policy, env, **arguments)

    monkeypatch.setitem(eutree.training.learn.__globals__, "evaluate", counted)
    result = eutree.learn(
        gymnasium.make("CartPole-v1"),
        demonstrations=cart,
        method="u-tree",
        episodes=6,
        evaluate_every=2,
        evaluation_episodes=3,
    )
    assert len(result.curve) == 4
    changed = sum(
        one.tree != other.tree or not np.array_equal(one.actions, other.actions)
        for one, other in itertools.pairwise(evaluated)
    )
    assert len(evaluated) == 1 + changed  # the judgement's episodes are others
