"""Episodes divided among processes: the same results, the same errors."""

import os
import pickle
import warnings

import gymnasium
import joblib
import numpy as np
import pytest
from joblib._parallel_backends import SequentialBackend

import eutree
from eutree.compression import RealEpisodes
from eutree.distillation import DistillationSettings
from eutree.errors import (
    EnvironmentFault,
    FileError,
    FormatError,
    InvalidArgumentError,
    MissingExtraError,
    UnknownNameError,
)
from eutree.interaction.making import Recipe
from eutree.interaction.names import Names, named
from eutree.parallel import Workers
from eutree.schema import EnvironmentSpec
from tests.little_search import little_search

GATE = EnvironmentSpec("eutree/Evasion2-v0", {"opponent_speed": 4.2})


class Parity:
    """Acts by the sign of what it sees first; knows nothing of features."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.int64(np.asarray(observation).reshape(-1)[2] > 0), None


class Breaks(gymnasium.Env):
    """Gives NaN in the episode whose seed is the fifth of an evaluation's."""

    observation_space = gymnasium.spaces.Box(-1, 1, (3,))
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self._bad = seed == eutree.interaction.episode_seed(0, 5)
        return np.zeros(3, np.float32), {}

    def step(self, action):
        reward = float("nan") if self._bad else 1.0
        return np.zeros(3, np.float32), reward, True, False, {}


@pytest.fixture
def impatient(monkeypatch):
    """Let processes be started at once, however little there is to do."""
    monkeypatch.setattr("eutree.parallel.PATIENCE", 0.0)


def here(_):
    return os.getpid()


def number_of_processes(_):
    return joblib.effective_n_jobs(-1), Workers(-1).count


def warns(number):
    warnings.warn(f"odd {number % 2}", stacklevel=1)
    return number


def test_warnings_of_other_processes_are_given_here_once(impatient):
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("default")
        assert Workers(2).map(warns, range(8)) == list(range(8))
    assert sorted(str(warning.message) for warning in given) == ["odd 0", "odd 1"]


def test_results_come_in_the_order_of_the_arguments(impatient):
    assert Workers(2).map(abs, range(-9, 0)) == list(range(9, 0, -1))
    assert sorted(Workers(2).as_finished(abs, range(-9, 0))) == list(range(1, 10))


def test_short_work_stays_in_this_process_and_long_work_does_not(monkeypatch):
    monkeypatch.setattr("eutree.parallel.PATIENCE", 1e9)
    assert set(Workers(2).map(here, range(8))) == {os.getpid()}
    monkeypatch.setattr("eutree.parallel.PATIENCE", 0.0)
    assert os.getpid() not in set(Workers(2).map(here, range(8)))


def test_workers_start_no_processes_of_their_own(impatient):
    assert set(Workers(2).map(number_of_processes, range(4))) == {(1, 1)}


class Whole(SequentialBackend):
    """Hands everything back at the end, as Ray's back end does."""

    supports_return_generator = False


def test_a_back_end_that_hands_back_whole_batches_will_do():
    joblib.register_parallel_backend("whole", Whole)
    with joblib.parallel_config(backend="whole"):
        assert list(Workers(None).as_finished(abs, range(-3, 0))) == [3, 2, 1]


def test_one_process_is_what_nobody_asked_otherwise():
    assert Workers().count == 1
    with joblib.parallel_config(n_jobs=2):
        assert Workers().count == 2
    assert Workers(-1).count == joblib.cpu_count()


@pytest.mark.parametrize("n_jobs", [0, 1.5, True, "two"])
def test_what_is_no_number_of_processes(n_jobs):
    with pytest.raises(InvalidArgumentError, match="n_jobs must be"):
        eutree.evaluate(Parity(), "CartPole-v1", episodes=2, n_jobs=n_jobs)


def test_blocks_hold_every_number_once():
    for n in (1, 2, 7, 100, 5000):
        blocks = Workers(2).blocks(n, 256)
        assert [k for block in blocks for k in block] == list(range(n))
        assert max(map(len, blocks)) <= 256


@pytest.mark.parametrize("environment", ["CartPole-v1", GATE], ids=str)
def test_an_evaluation_is_the_same_in_two_processes(environment, impatient):
    alone = eutree.evaluate(Parity(), environment, episodes=40, seed=3)
    divided = eutree.evaluate(Parity(), environment, episodes=40, seed=3, n_jobs=2)
    for name in ("returns", "lengths", "endings", "successes"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(divided, name))


def test_an_environment_of_this_process_alone_and_its_names_go_along(impatient):
    gymnasium.register("tests/Breaks-v0", Breaks)
    try:
        recipe = Recipe.of("tests/Breaks-v0")
        with pytest.raises(EnvironmentFault, match=r"episode 5 \(seed \d+\), step 0") as alone:
            eutree.evaluate(Parity(), "tests/Breaks-v0", episodes=9)
        with pytest.raises(EnvironmentFault) as divided:
            eutree.evaluate(Parity(), "tests/Breaks-v0", episodes=9, n_jobs=2)
        with named(Names(features=("a", "b [m]", "c"))):
            given = Recipe.of("tests/Breaks-v0")
    finally:
        del gymnasium.registry["tests/Breaks-v0"]
    assert str(divided.value) == str(alone.value)
    assert divided.value.episode == 5
    assert divided.value.seed == alone.value.seed == eutree.interaction.episode_seed(0, 5)
    assert eutree.interaction.describe(recipe.make()).feature_names == ("x0", "x1", "x2")
    assert eutree.interaction.describe(given.make()).feature_names == ("a", "b", "c")
    del gymnasium.registry["tests/Breaks-v0"]


def test_an_environment_that_is_made_stays(impatient):
    env = gymnasium.make("CartPole-v1")
    for call in (
        lambda: eutree.evaluate(Parity(), env, n_jobs=2),
        lambda: eutree.distill(Parity(), env, n_jobs=2),
    ):
        with pytest.raises(InvalidArgumentError, match="made already"):
            call()


def test_a_distilled_tree_is_the_same_in_two_processes(impatient):
    settings = DistillationSettings(iterations=3, episodes=3, validation_episodes=6)
    alone, report = eutree.distill(Parity(), "CartPole-v1", settings, seed=4)
    divided, again = eutree.distill(Parity(), "CartPole-v1", settings, seed=4, n_jobs=2)
    assert divided == alone
    assert again == report


@little_search()
def test_a_race_is_the_same_in_two_processes(impatient):
    env = gymnasium.make("CartPole-v1")
    demos = eutree.record(env, Parity(), episodes=5, seed=0)
    policy = eutree.fit_expert_tree(demos)
    (alone, report), (divided, again) = (
        eutree.compress(
            policy,
            demos.observations,
            env=RealEpisodes("CartPole-v1", margin=30.0, episodes=64, n_jobs=n_jobs),
            seed=2,
        )
        for n_jobs in (None, 2)
    )
    assert divided == alone
    assert again == report
    assert report.environment_steps > 0


@pytest.mark.parametrize(
    "error",
    [
        EnvironmentFault("Env-v0", 3, 4, "reward must be finite"),
        FormatError("a.json", "nodes[3]", "is cut"),
        FileError("write", "b.json", "disk full"),
        MissingExtraError("ray", ""),
        UnknownNameError("environment", "Cartpole", ["CartPole-v1"]),
    ],
    ids=lambda error: type(error).__name__,
)
def test_errors_of_other_processes_arrive(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)
