"""Which method learns where none is named."""

import itertools
import json
import subprocess
import sys
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli.main import run
from eutree.data import Episode
from eutree.envs.experts import EXPERTS, follow_the_fall
from eutree.errors import InvalidArgumentError
from eutree.interaction import GriddedAction
from eutree.learners import DistilledDQN
from eutree.schema import Schema
from eutree.training.planned import default_for


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


def shown_with(n_features):
    """Return demonstrations of so many features."""
    episodes = tuple(
        Episode(
            np.random.default_rng(k).random((9, n_features)), [0, 1] * 4, [1.0] * 8, True, False
        )
        for k in range(5)
    )
    return eutree.Demonstrations(episodes, Schema.anonymous(n_features, 2))


@pytest.mark.parametrize(
    ("n_features", "steps", "name"),
    [
        (21, 20_000, "distilled-dqn"),
        (21, 19_999, "planning"),
        (12, 20_000, "distilled-dqn"),
        (8, 80_000, "planning"),
        (8, 95_000, "distilled-dqn"),
        (4, 500_000, "planning"),
    ],
)
def test_the_more_features_the_fewer_steps_a_teacher_needs(n_features, steps, name):
    choice = default_for(shown_with(n_features), steps)
    assert choice.method.name == name
    assert {name, choice.alternative} == {"planning", "distilled-dqn"}
    assert choice.said().endswith(f"; the other is method {choice.alternative!r}")


def test_many_features_and_many_steps_get_a_teacher(acrobot):
    choice = default_for(acrobot, 100_000)
    assert choice.method == DistilledDQN()
    assert choice.reason.startswith("distilled-dqn learns: 6 features")


def test_everything_else_is_planned(cart, acrobot):
    for known, why, alternative in (
        ((None, 500_000), "a network as teacher would need 5 demonstrations", ""),
        ((cart, 500_000), "4 features are few enough for it", "distilled-dqn"),
        ((cart, None), "4 features are few enough for it", ""),
        ((acrobot, None), "a network as teacher needs a budget of steps", ""),
        ((acrobot, 40_000), "of 6 features a network as teacher would need 90000 steps, "
         "not 40000", "distilled-dqn"),
    ):  # fmt: skip
        choice = default_for(*known)
        assert choice.method.name == "planning"
        assert choice.reason == f"planning learns: {why}"
        assert choice.alternative == alternative


def test_an_angle_is_left_to_a_network_however_few_the_features():
    torques = {"torque": [-2.0, 0.0, 2.0]}
    env = GriddedAction(gymnasium.make("Pendulum-v1"), torques)
    shown = eutree.record(env, EXPERTS["Pendulum-v1"]["swing"], episodes=5, seed=0)
    choice = default_for(shown, 10_000)
    assert choice.said() == (
        "distilled-dqn learns: planning does little with an angle's cosine and sine, and 10000 "
        "steps are enough for a teacher of its own; the other is method 'planning'"
    )
    fewer = default_for(shown, 9_999)
    assert fewer.reason == (
        "planning learns: of 3 features a network as teacher would need 10000 steps, not 9999"
    )
    assert fewer.alternative == "distilled-dqn"


@pytest.mark.parametrize(
    "pair",
    [
        lambda angle: (np.cos(angle), np.cos(angle + 1.0)),
        lambda angle: (angle > 3.0, angle <= 3.0),
        lambda angle: (0.6 + 0.0 * angle, 0.8 + 0.0 * angle),
        lambda angle: (3.0 * np.cos(angle), 3.0 * np.sin(angle)),
    ],
    ids=["two cosines", "two flags", "a constant angle", "a place on a circle of three metres"],
)
def test_what_only_looks_like_an_angle_is_planned(pair):
    def shown(*pair):
        rows = np.column_stack([*pair, np.linspace(-8.0, 8.0, 9)])
        episodes = tuple(Episode(rows, [0, 1] * 4, [1.0] * 8, True, False) for _ in range(5))
        return eutree.Demonstrations(episodes, Schema.anonymous(3, 2))

    angle = np.linspace(0.0, 6.0, 9)
    assert default_for(shown(*pair(angle)), 10_000).method.name == "planning"
    assert default_for(shown(np.cos(angle), np.sin(angle)), 10_000).method.name == "distilled-dqn"


def test_episodes_without_a_step_show_no_angle():
    nothing = tuple(Episode(np.zeros((1, 3)), [], [], False, True) for _ in range(5))
    shown = eutree.Demonstrations(nothing, Schema.anonymous(3, 2))
    assert default_for(shown, 10_000).method.name == "planning"


SCRIPT = """
import eutree
env = "CartPole-v1"
shown = eutree.record(env, eutree.experts.follow_the_fall, episodes=5, seed=0)
for _ in range(2):
    eutree.learn(env, demonstrations=shown, steps=600, episodes=1, evaluation_episodes=1,
                 judge_episodes=0, front_steps=0)
eutree.learn(env, demonstrations=shown, method="planning", steps=600, episodes=1,
             evaluation_episodes=1, judge_episodes=0, front_steps=0)
"""


def test_a_plain_script_says_once_which_method_learns_and_what_the_other_is():
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True
    )
    said = "planning learns: 4 features are few enough for it; the other is method 'distilled-dqn'"
    assert done.stderr.splitlines().count(said) == 1


def test_the_command_says_it_and_its_json_too(tmp_path, cart, capsys):
    cart.save(tmp_path / "demos")
    line = ["learn", "CartPole-v1", "--demos", str(tmp_path / "demos"), "--steps", "600",
            "--episodes", "1", "--evaluation-episodes", "1", "--judge-episodes", "0",
            "--front-steps", "0",
            "--json", "--out", str(tmp_path / "run")]  # fmt: skip
    assert run(line) == 0
    out, err = capsys.readouterr()
    said = "planning learns: 4 features are few enough for it; the other is method 'distilled-dqn'"
    assert err.count(said) == 1
    assert json.loads(out)["reason"] == said
    assert (
        json.loads((tmp_path / "run" / "config.json").read_text())["method"]["name"] == "planning"
    )


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
    assert default_for(cart, None, teacher=True).method.name == "distilled-dqn"


def test_a_policy_that_stays_is_evaluated_once(cart, monkeypatch):
    evaluated = []
    plainly = eutree.training.learn.__globals__["evaluate_starts"]

    def counted(policy, env, starts, **arguments):
        evaluated.append(policy)
        return plainly(policy, env, starts, **arguments)

    monkeypatch.setitem(eutree.training.learn.__globals__, "evaluate_starts", counted)
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


def test_locked_leaves_stay_or_the_method_refuses():
    """Four methods dropped the locks of the start, and acted otherwise there, without a word."""
    env = gymnasium.make("eutree/Evasion2-v0")
    shown = eutree.record(env, eutree.experts.wait_at_crossing, episodes=6, seed=3)
    expert = eutree.fit_expert_tree(shown)
    locked = replace(expert, locked=(0, expert.n_leaves - 1))
    begins = {"demonstrations": shown, "expert": locked, "seed": 1}
    for name in ("distilled-dqn", "vrd", "parti-game", "vqql"):
        with pytest.raises(InvalidArgumentError, match="does not keep the locked leaves"):
            eutree.learn(env, method=name, episodes=4, **begins)
    for name in ("u-tree", "adaptive-q", "density-tree", "history-u-tree", "auto"):
        result = eutree.learn(env, method=name, episodes=4, front_steps=0, **begins)
        assert len(result.learned.locked) == 2
    assert result.reason == "planning learns: it keeps the locked leaves"
