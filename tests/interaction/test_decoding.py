"""Codes that stand for several things: said, and decoded by the environment's own method."""

import json
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

import eutree
from eutree.errors import InvalidArgumentError
from eutree.export import to_c
from eutree.interaction import DecodedObservation
from eutree.interaction.making import make
from eutree.interaction.spaces import describe, spec_of
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec
from tests.interaction.sick import Healthy
from tests.interaction.versions import TAXI

COLUMNS = 7


class Grid(gymnasium.Env):
    """A cell of a grid as one code from 5 on; in column 3 action 1 is right, elsewhere 0."""

    observation_space, action_space = Discrete(4 * COLUMNS, start=5), Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return self._next(), {}

    def step(self, action):
        reward = float(action == (self.column == 3))
        self.count += 1
        return self._next(), reward, False, self.count == 10, {}

    def decode(self, code):
        return divmod(code - 5, COLUMNS)

    def _next(self):
        code = 5 + int(self.np_random.integers(4 * COLUMNS))
        self.column = (code - 5) % COLUMNS
        return code


class Knows:
    """Acts as it should on codes, and on what they stand for."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        values = np.atleast_1d(observation)
        column = values[1] if values.size == 2 else (values[0] - 5) % COLUMNS
        return int(column == 3), None


@pytest.fixture
def registered():
    gymnasium.register("Grid-v0", Grid, max_episode_steps=1000)
    yield
    gymnasium.registry.pop("Grid-v0")


def test_taxi_says_where_everybody_is():
    env = make(EnvironmentSpec(TAXI, {"decode": True}))
    assert describe(env).feature_names == ("row", "column", "passenger", "destination")
    assert [f.high for f in describe(env).features] == [4.0, 4.0, 4.0, 3.0]
    observation, _ = env.reset(seed=0)
    assert observation.tolist() == list(env.unwrapped.decode(env.unwrapped.s))
    assert observation in env.observation_space


def test_a_code_is_never_taken_for_a_number_without_a_word(registered):
    """Taxi's 500 codes were ordered numbers to the tree: 47 leaves, -873, became one leaf."""
    with pytest.warns(UserWarning, match="one code of 28 values.*ordered number.*--decode"):
        coded = eutree.record(gymnasium.make("Grid-v0"), Knows(), episodes=20)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plain = eutree.record(DecodedObservation(gymnasium.make("Grid-v0")), Knows(), episodes=20)
    assert np.array_equal(coded.actions, plain.actions)
    ordered, decoded = eutree.fit_expert_tree(coded), eutree.fit_expert_tree(plain)
    assert decoded.n_leaves == 3 < ordered.n_leaves
    assert set(decoded.tree.feature[decoded.tree.feature >= 0]) == {1}
    with pytest.warns(UserWarning, match="one code of 28 values"):
        eutree.learn(gymnasium.make("Grid-v0"), episodes=1, evaluation_episodes=2)


def test_a_code_of_few_values_and_one_number_of_several_are_let_be(registered):
    for space in (Discrete(10), Box(0.0, 1.0, (2,)), gymnasium.spaces.Tuple([Discrete(32)])):
        env = gymnasium.wrappers.TransformObservation(Healthy(), lambda x: x, space)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            eutree.interaction.decoding.warn_of_codes(env)


def test_what_was_decoded_is_decoded_wherever_its_file_goes(registered, tmp_path, eutree_line):
    env = make(EnvironmentSpec("Grid-v0", {"decode": True, "max_episode_steps": 8}))
    demos = eutree.record(env, Knows(), episodes=20)
    assert dict(spec_of(env).arguments) == {"decode": True, "max_episode_steps": 8}
    demos.save(tmp_path / "demos")
    assert eutree_line("fit", "demos", "--out", "expert.json")["n_leaves"] == 3
    policy = TreePolicy.load(tmp_path / "expert.json")
    assert dict(policy.environment.arguments) == {"decode": True, "max_episode_steps": 8}
    assert eutree_line("evaluate", "expert.json", "--episodes", "5")["mean_return"] == 8.0
    line = ("evaluate", "expert.json", "Grid-v0", "--env-arg", "max_episode_steps=5", "--decode")
    assert eutree_line(*line, "--episodes", "5")["mean_return"] == 5.0
    assert eutree_line("demos", "check", "demos")["equal"] == 20
    assert "observation[1] <= " in to_c(policy)  # the second of two inputs: the column


@pytest.fixture
def eutree_line(tmp_path, monkeypatch, capsys):
    from eutree.cli.main import run

    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        capsys.readouterr()
        assert run([*arguments, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return call


@pytest.mark.parametrize(
    ("decode", "message"),
    [
        (lambda self, code: (code,) * (1 + code % 2), "decode raised ValueError"),
        (lambda self, code: (code // 2,), "others for each other code"),
        (lambda self, code: (code / 2, 1.0), "as many whole numbers"),
        (lambda self, code: 1 / 0, "decode raised ZeroDivisionError"),
        (None, "without decode"),
    ],
)
def test_what_decodes_nothing_is_refused(decode, message):
    other = type("Other", (Grid,), {"decode": decode})
    with pytest.raises(InvalidArgumentError, match=message):
        DecodedObservation(other())


def test_an_argument_of_that_name_is_the_environment_s_own():
    class Own(Healthy):
        def __init__(self, decode=False):
            self.own = decode

    gymnasium.register("Own-v0", Own)
    try:
        assert make(EnvironmentSpec("Own-v0", {"decode": True})).unwrapped.own is True
    finally:
        gymnasium.registry.pop("Own-v0")
