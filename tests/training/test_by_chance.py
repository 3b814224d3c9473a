"""A method that needs demonstrations, where there are none, begins from random episodes."""

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.classic_control import CartPoleEnv
from gymnasium.wrappers import TimeLimit

import eutree
from eutree.cli.main import run
from eutree.errors import InvalidArgumentError
from eutree.interaction import GriddedAction
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.neural import DoubleDQNSettings
from eutree.training.planned import default_for, shown_by_chance
from eutree.training.values import Asked, Budget
from eutree.world_model.ensemble import EnsembleSettings

SMALL = DistilledDQN(
    max_leaves=4,
    demonstration_updates=5,
    teacher=DoubleDQNSettings(hidden=8, batch=8),
    world_model=EnsembleSettings(members=2, hidden=8, batch=8, updates=10, more_updates=5),
)
QUICK = {"evaluate_every": 10**6, "evaluation_episodes": 1, "judge_episodes": 0, "front_steps": 0}


@pytest.mark.parametrize(
    ("features", "steps", "name"),
    [(8, 100_000, "distilled-dqn"), (8, 80_000, "planning"), (4, 500_000, "planning")],
)
def test_what_learns_from_nothing_depends_on_features_and_steps(features, steps, name):
    assert default_for(None, steps, features=features).method.name == name


class Counted(gymnasium.Wrapper):
    """Counts how often episodes begin."""

    begun = 0

    def reset(self, **arguments):
        self.begun += 1
        return self.env.reset(**arguments)


def test_an_angle_is_seen_at_the_starts_before_anything_is_shown():
    torques = {"torque": [-2.0, 0.0, 2.0]}
    env = GriddedAction(gymnasium.make("Pendulum-v1"), torques)
    run = {"steps": 400, "seed": 3, **QUICK}
    assert "would need 10000 steps, not 400" in eutree.learn(env, **run).reason
    cart = Counted(gymnasium.make("CartPole-v1"))
    asked = Asked(budget=Budget(steps=10_000))
    shown_by_chance(asked, None, None, cart, seed=3)
    assert cart.begun == 0
    choice, shown = shown_by_chance(asked, None, None, env, seed=3)
    assert choice.method.name == "distilled-dqn"
    assert len(shown) == 5


def test_who_is_shown_too_little_is_not_helped_by_chance():
    shown = eutree.record("Acrobot-v1", lambda o: 0, episodes=1, seed=0)
    assert default_for(shown, 100_000, features=6).method.name == "planning"


def test_a_run_shows_itself_what_nobody_has_shown():
    result = eutree.learn("CartPole-v1", method=SMALL, steps=700, seed=3, **QUICK)
    assert "5 episodes of random actions" in result.reason
    assert result.start == "nothing"
    spent = result.environment_steps
    assert 40 <= spent.demonstrations <= 5 * 100
    assert result.steps <= 700


def test_it_goes_on_to_the_same_bytes(tmp_path):
    whole = eutree.learn("CartPole-v1", method=SMALL, steps=1500, seed=3, **QUICK)
    calls = []

    def stop():
        calls.append(1)
        return len(calls) > 8

    options = {"method": SMALL, "steps": 1500, "seed": 3, **QUICK}
    eutree.learn("CartPole-v1", out=tmp_path / "run", stop=stop, **options)
    again = eutree.learn("CartPole-v1", out=tmp_path / "run", resume=True, **options)
    assert again.policy.to_bytes() == whole.policy.to_bytes()


class Unrepeatable(CartPoleEnv):
    """Begins elsewhere whatever the seed."""

    def reset(self, *, seed=None, options=None):
        return super().reset(options=options)


@pytest.mark.filterwarnings("ignore:.*not repeatable")
def test_it_goes_on_where_no_episode_can_be_had_again(tmp_path):
    env = TimeLimit(Unrepeatable(), 100)
    calls = []

    def stop():
        calls.append(1)
        return len(calls) > 8

    options = {"method": SMALL, "steps": 1500, "seed": 3, **QUICK}
    begun = eutree.learn(env, out=tmp_path / "run", stop=stop, **options)
    result = eutree.learn(env, out=tmp_path / "run", resume=True, **options)
    assert result.environment_steps.demonstrations == begun.environment_steps.demonstrations
    assert result.steps > begun.steps


def test_what_a_run_that_never_began_has_shown_itself_is_not_kept(tmp_path):
    eutree.learn("CartPole-v1", method=SMALL, steps=700, seed=3, out=tmp_path / "a", **QUICK)
    shown = eutree.Demonstrations.load(tmp_path / "a" / "shown")
    assert len(shown) == 5
    (tmp_path / "b").mkdir()
    shown.save(tmp_path / "b" / "shown")
    eutree.learn("CartPole-v1", method=SMALL, steps=700, seed=4, out=tmp_path / "b", **QUICK)
    assert eutree.Demonstrations.load(tmp_path / "b" / "shown").digest != shown.digest


def test_a_start_that_is_named_is_none_of_chance():
    with pytest.raises(
        InvalidArgumentError, match=r"starts from demos or tree\+demos, got nothing"
    ):
        eutree.learn("CartPole-v1", method=SMALL, start="nothing", steps=700, **QUICK)


class Masked(CartPoleEnv):
    """Allows one action at each step."""

    def action_masks(self):
        return np.arange(2) == int(self.state[2] > 0.0)


def test_random_actions_are_allowed_ones(tmp_path):
    env = TimeLimit(Masked(), 100)
    eutree.learn(env, method=SMALL, steps=700, seed=3, out=tmp_path / "run", **QUICK)
    for episode in eutree.Demonstrations.load(tmp_path / "run" / "shown").episodes:
        assert episode.actions.tolist() == (episode.observations[:-1, 2] > 0.0).tolist()


def test_random_actions_are_all_of_them(tmp_path):
    eutree.learn("CartPole-v1", method=SMALL, steps=700, seed=3, out=tmp_path / "run", **QUICK)
    shown = eutree.Demonstrations.load(tmp_path / "run" / "shown")
    assert {int(a) for one in shown.episodes for a in one.actions} == {0, 1}


def test_a_command_learns_where_nothing_is_shown(tmp_path, capsys):
    line = ["learn", "CartPole-v1", "--method", "distilled-dqn", "--steps", "600",
            "--judge-episodes", "0", "--front-steps", "0",
            "--out", str(tmp_path / "run")]  # fmt: skip
    assert run(line) == 0
    said = "".join(capsys.readouterr())
    assert "it begins from 5 episodes of random actions" in said
