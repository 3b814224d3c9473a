"""Before the first episode: what repeats and what does not, and that looking changes nothing."""

import random
import warnings
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import TimeLimit

import eutree
from eutree.interaction import first_look
from eutree.interaction.first_look import first_difference, look_at
from eutree.recording import Recorder
from tests.interaction.sick import Healthy, raising


class Alternate:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return int(observation[0] > 0.5), state


class Unseeded(Healthy):
    def reset(self, *, seed=None, options=None):
        return super().reset(seed=None)


class Drawn(Unseeded):
    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012

    def __init__(self, render_mode=None):
        self.render_mode = render_mode


class Drifts(Healthy):
    """Each episode is a little other than the one before it, whatever the seed."""

    episode = 0

    def reset(self, *, seed=None, options=None):
        self.episode += 1
        return super().reset(seed=seed)

    def step(self, action):
        observation, reward, *rest = super().step(action)
        return observation, reward + self.episode * (self.count >= 3), *rest


class EarnsNothingKnown(Healthy):
    def step(self, action):
        observation, _, *rest = super().step(action)
        return observation, float("nan"), *rest


class DrawsFromAll(Healthy):
    """Chance of the whole process."""

    def step(self, action):
        observation, reward, *rest = super().step(action)
        return observation, reward + random.random() + np.random.rand(), *rest  # noqa: NPY002


class Slow(Healthy):
    """A step takes 0.02 s of a clock that only steps move."""

    seconds = 0.0

    def step(self, action):
        Slow.seconds += 0.02
        observation, reward, *_ = super().step(action)
        return np.minimum(observation, 1.0), reward, False, False, {}


class Counts(Healthy):
    """Knows how many were made, closed, and how often each was reset; it says no limit."""

    made, closed, resets = 0, 0, 0
    render_mode = None

    def __init__(self):
        type(self).made += 1

    def reset(self, *, seed=None, options=None):
        type(self).resets += 1
        return super().reset(seed=seed)

    def close(self):
        type(self).closed += 1


@pytest.fixture
def registered():
    """Register an environment for one test; return its id."""
    ids = []

    def register(kind, **options):
        ids.append(f"{kind.__name__}-v0")
        gymnasium.register(ids[-1], kind, **options)
        return ids[-1]

    yield register
    for name in ids:
        del gymnasium.registry[name]


@pytest.mark.parametrize(
    ("env", "step"),
    [
        (Healthy(), None),
        (EarnsNothingKnown(), None),  # a fault of another kind, which the run reports
        (Unseeded(), 0),
        (Drifts(), 3),
        (DrawsFromAll(), 1),
    ],
)
def test_the_first_step_that_differs_is_found(env, step):
    assert first_difference(env, 3) == step


@pytest.mark.parametrize("name", ["CartPole-v1", "eutree/Evasion2-v0", "FrozenLake-v1"])
def test_seeded_environments_repeat(name):
    with gymnasium.make(name) as env:
        assert first_difference(env, 5) is None


@pytest.mark.parametrize("env", [raising(OSError()), raising(SystemExit(1), at="reset")])
def test_one_that_fails_is_left_for_the_run_to_report(env):
    assert first_difference(env, 0) is None


def test_one_that_can_neither_be_made_nor_copied_is_not_judged():
    env = Unseeded()
    env.connection = (number for number in range(3))  # no generator can be copied
    assert first_difference(env, 0) is None


@pytest.mark.parametrize("kind", [Healthy, Unseeded, Drifts, DrawsFromAll])
@pytest.mark.filterwarnings("ignore:.*is not repeatable")
def test_looking_leaves_a_run_as_it_would_be(kind, monkeypatch):
    """The twin's episodes are none of the environment's, and draw no chance of this process."""
    looked = []
    for looks in (True, False):
        if not looks:
            monkeypatch.setattr(first_look, "first_difference", lambda env, seed: None)
        random.seed(0)
        np.random.seed(0)  # noqa: NPY002
        env = kind()
        env.np_random = np.random.default_rng(0)  # which an unseeded reset leaves
        looked.append(eutree.record(env, Alternate(), episodes=3, seed=4))
    assert looked[0].digest == looked[1].digest


def test_a_slow_simulator_is_looked_at_for_about_two_seconds(monkeypatch):
    monkeypatch.setattr(first_look, "time", SimpleNamespace(monotonic=lambda: Slow.seconds))
    monkeypatch.setattr(Slow, "seconds", 0.0)
    assert first_difference(Slow(), 0) is None
    assert 1.9 < Slow.seconds < 2.2  # two episodes of 200 steps would take 8


def test_one_that_is_registered_has_a_twin_that_is_closed(registered):
    env = gymnasium.make(registered(Counts))
    Counts.made = Counts.closed = Counts.resets = 0
    assert first_difference(env, 0) is None
    assert (Counts.made, Counts.closed, Counts.resets) == (1, 1, 2)


@pytest.mark.parametrize("run", ["record", "learn", "learn_runs", "recorder"])
def test_whoever_runs_is_told_in_a_sentence(run, registered, tmp_path):
    name = registered(Drawn, max_episode_steps=20)
    runs = {
        "record": lambda: eutree.record(gymnasium.make(name), Alternate(), episodes=2),
        "learn": lambda: eutree.learn(gymnasium.make(name), episodes=1, evaluation_episodes=2),
        "learn_runs": lambda: eutree.learn_runs(
            name, runs=1, out=tmp_path / "a", n_jobs=1, episodes=1, evaluation_episodes=2,
            selection_episodes=2, judging_episodes=2,
        ),
        "recorder": lambda: Recorder(
            gymnasium.make(name, render_mode="rgb_array"), tmp_path / "b", keys="a=0,b=1"
        ),
    }  # fmt: skip
    with pytest.warns(UserWarning, match=r"Drawn-v0 is not repeatable.*from reset on") as told:
        runs[run]()
    assert len([w for w in told if "repeatable" in str(w.message)]) == 1
    assert {w.filename for w in told} == {__file__}


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (Healthy, True),
        (lambda: TimeLimit(Healthy(), 9), False),
        (lambda: gymnasium.make("CartPole-v1"), False),
        (lambda: gymnasium.make("CartPole-v1", max_episode_steps=-1), True),
        (lambda: gymnasium.make("eutree/Evasion2-v0"), False),
        (lambda: gymnasium.make("Blackjack-v1"), True),
    ],
)
def test_an_environment_without_a_time_limit_is_said_to_be_one(make, says):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        look_at(make(), 0)
    assert [("names no time limit:" in str(w.message)) for w in told] == [True] * says
