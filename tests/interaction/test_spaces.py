"""Any flat space becomes a vector of named numbers."""

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.wrappers import (
    FilterObservation,
    FlattenObservation,
    FrameStackObservation,
    MaxAndSkipObservation,
    NormalizeObservation,
    RecordEpisodeStatistics,
    RescaleObservation,
    TimeAwareObservation,
    TimeLimit,
    TransformAction,
    TransformObservation,
    TransformReward,
)

import eutree
from eutree.errors import InvalidArgumentError, RunFolderError, UnsupportedSpaceError
from eutree.interaction import GuardedEnv
from eutree.interaction.making import make
from eutree.interaction.names import Names
from eutree.interaction.spaces import decoder, describe, encoder, spec_of
from eutree.recording.keys import keys_of_environment
from eutree.trees import DecisionTree
from tests.interaction.sick import Healthy
from tests.interaction.versions import CLIFF

pytestmark = pytest.mark.filterwarnings("ignore:.*precision lowered")  # of bounds, by Gymnasium
LIMITED = {"max_episode_steps": 100}
SPACES = {
    "box": (spaces.Box(-1, 1, (2,), np.float32), ["x0", "x1"], [-1, -1], [1, 1]),
    "discrete": (spaces.Discrete(4, start=2), ["x0"], [2], [5]),
    "several discrete": (spaces.MultiDiscrete([3, 2]), ["x0", "x1"], [0, 0], [2, 1]),
    "bits": (spaces.MultiBinary(2), ["x0", "x1"], [0, 0], [1, 1]),
    "tuple": (
        spaces.Tuple([spaces.Discrete(3), spaces.Box(0, 1, (2,))]),
        ["x0", "x1.x0", "x1.x1"],
        [0, 0, 0],
        [2, 1, 1],
    ),
    "dict of single numbers": (
        spaces.Dict({"speed": spaces.Box(0, 9, ()), "at": spaces.Discrete(3)}),
        ["at", "speed"],
        [0, 0],
        [2, 9],
    ),
    "dict": (
        spaces.Dict({"speed": spaces.Box(0, 9, (1,)), "at": spaces.MultiBinary(2)}),
        ["at.x0", "at.x1", "speed"],
        [0, 0, 0],
        [1, 1, 9],
    ),
}


@pytest.mark.parametrize("name", SPACES)
def test_names_bounds_and_encoding(name):
    space, names, low, high = SPACES[name]

    class Of(Healthy):
        observation_space = space

    schema = describe(Of())
    assert list(schema.feature_names) == names
    assert [f.low for f in schema.features] == low
    assert [f.high for f in schema.features] == high
    space.seed(3)
    for _ in range(20):
        sample = space.sample()
        vector = encoder(space)(sample)
        assert vector.dtype == np.float64
        assert vector.shape == (len(names),)
        assert (np.array(low) <= vector).all()
        assert (vector <= np.array(high)).all()
        again = decoder(space)(vector)
        assert spaces.utils.flatten(space, again) == pytest.approx(
            spaces.utils.flatten(space, sample)
        )
        assert again in space


def test_gymnasium_s_own_tasks_have_names():
    schema = describe(gymnasium.make("CartPole-v1"))
    assert schema.feature_names == ("position", "velocity", "angle", "turn rate")
    assert schema.actions == ("left", "right")


def test_the_spec_makes_the_environment_again():
    env = gymnasium.make("CartPole-v1", sutton_barto_reward=True, render_mode="rgb_array")
    spec = spec_of(env)
    assert spec is not None
    assert (spec.id, dict(spec.arguments)) == ("CartPole-v1", {"sutton_barto_reward": True})
    assert spec_of(Healthy()) is None


@pytest.mark.parametrize("what", ["feature_names", "feature_units", "action_names"])
def test_names_of_another_number_are_refused(what):
    env = gymnasium.make("CartPole-v1")
    setattr(env.unwrapped, what, ["only this"])
    with pytest.raises(InvalidArgumentError, match=f"CartPole-v1: {what} must be [24] texts"):
        describe(env)


def test_names_of_what_a_wrapper_replaced_are_left_out():
    env = gymnasium.make("CartPole-v1")
    env.unwrapped.feature_names = ["place", "speed", "tilt", "turn rate"]
    seen = TransformObservation(env, lambda one: one[:2], spaces.Box(-9, 9, (2,)))
    assert describe(seen).feature_names == ("x0", "x1")


class Gate(Healthy):
    """Names its numbers, of which the second is a flag."""

    feature_names = ("place", "open")
    feature_units = ("m", "")
    feature_kinds = {"open": "flag"}  # noqa: RUF012 - as an environment declares it
    observation_space = spaces.Box(np.float32([-1.0, 0.0]), np.float32([1.0, 1.0]))


def told(env):
    return [(one.name, one.unit, one.is_integer) for one in describe(env).features]


UNNAMED = [("x0", "", False), ("x1", "", False)]
WIDE = spaces.Box(-9, 9, (2,))


@pytest.mark.parametrize(
    "wrapped",
    [
        lambda env: RescaleObservation(env, -1.0, 1.0),
        lambda env: TransformObservation(env, lambda one: 9 * one, WIDE),
        lambda env: TimeLimit(RescaleObservation(env, 0.0, 2.0), 9),
        lambda env: FlattenObservation(RescaleObservation(env, 0.0, 2.0)),
    ],
)
def test_numbers_that_a_wrapper_made_are_no_more_what_the_environment_says(wrapped):
    """A rescaled position was printed in metres, and an angle fitted as a flag."""
    assert told(wrapped(Gate())) == UNNAMED


@pytest.mark.parametrize(
    ("wrapped", "size"),
    [
        (lambda env: FlattenObservation(FrameStackObservation(env, 2)), 4),
        (lambda env: TimeAwareObservation(TimeLimit(env, 30)), 3),
    ],
)
def test_kinds_of_what_a_wrapper_replaced_are_left_out(wrapped, size):
    """It was refused for a name that nobody had given to a wrapper."""
    assert describe(wrapped(Gate())).feature_names == tuple(f"x{j}" for j in range(size))


def test_names_of_numbers_that_are_the_same_hold():
    own = told(Gate())
    assert own == [("place", "m", False), ("open", "", True)]
    assert told(TimeLimit(Gate(), 9)) == own
    space = Gate.observation_space
    for same in (space, spaces.Box(*map(np.float64, (space.low, space.high)), dtype=np.float64)):
        assert told(TransformObservation(Gate(), lambda one: one, same)) == own
    assert told(FlattenObservation(Gate())) == own


def test_tasks_that_are_known_are_known_no_more_behind_a_wrapper():
    cartpole = NormalizeObservation(gymnasium.make("CartPole-v1"))
    assert describe(cartpole).features[0] == eutree.Feature("x0")
    free = Gate()
    free.observation_space = spaces.Box(-np.inf, np.inf, (2,))
    assert told(NormalizeObservation(free)) == UNNAMED  # though its bounds are as before
    assert describe(cartpole).actions == ("left", "right")


def test_a_wrapper_may_name_what_it_makes():
    seen = RescaleObservation(Gate(), 0.0, 1.0)
    seen.feature_names, seen.feature_units = ("share", "ajar"), ("%", "")
    assert told(TimeLimit(seen, 9)) == [("share", "%", False), ("ajar", "", False)]
    seen.feature_kinds = {"ajar": "flag"}
    assert told(seen)[1] == ("ajar", "", True)
    seen.feature_names = ("share",)
    with pytest.raises(InvalidArgumentError, match="feature_names must be 2 texts"):
        describe(seen)
    other = RescaleObservation(Gate(), 0.0, 1.0)
    Names(features=("part [%]", "ajar"), kinds={"ajar": "flag"}).give(other)
    assert told(other) == [("part", "%", False), ("ajar", "", True)]
    assert told(other.env)[0] == ("place", "m", False)


def test_what_is_of_one_environment_is_refused_behind_another_wrapper(tmp_path):
    """Positions from 0 to 1 and from -1.2 to 0.6 stood in one history."""

    def plain():
        return gymnasium.make("MountainCar-v0")

    def scaled():
        return RescaleObservation(plain(), 0.0, 1.0)

    short = {"seed": 0, "judge_episodes": 0, "front_steps": 0, "evaluation_episodes": 1}
    for one, other in ((plain, scaled), (scaled, plain)):
        demos = eutree.record(one(), lambda seen: 2, episodes=1, seed=0)
        policy = eutree.TreePolicy(DecisionTree.single_leaf(2), [1], demos.schema)
        with pytest.raises(InvalidArgumentError, match=r"must have the features.*'x1'\]") as caught:
            eutree.evaluate(policy, other(), episodes=1)
        with pytest.raises(InvalidArgumentError, match=r"demonstrations must have the features"):
            eutree.learn(other(), demonstrations=demos, episodes=1, **short)
        assert "--names" not in str(caught.value)  # they would not make them the same
        assert eutree.evaluate(policy, one(), episodes=1).mean_return == -200.0
    asked = {"method": "paper", "start": "nothing", **short, "out": tmp_path / "run"}
    eutree.learn(scaled(), episodes=1, **asked)
    with pytest.raises(RunFolderError, match=r"started with names \('x0', .*with \('position'"):
        eutree.learn(plain(), episodes=2, resume=True, **asked)


@pytest.mark.parametrize(
    ("env", "arguments"),
    [
        (lambda: gymnasium.make(CLIFF), {}),
        (lambda: gymnasium.make(CLIFF, max_episode_steps=100), LIMITED),
        (lambda: TimeLimit(gymnasium.make(CLIFF), 100), LIMITED),
        (lambda: TimeLimit(gymnasium.make("CartPole-v1"), 100), LIMITED),
        (lambda: TimeLimit(gymnasium.make("CartPole-v1", max_episode_steps=100), 900), LIMITED),
        (lambda: gymnasium.make("CartPole-v1", max_episode_steps=500), {}),
        (lambda: gymnasium.make("CartPole-v1", max_episode_steps=-1), {"max_episode_steps": -1}),
        (lambda: gymnasium.make("CartPole-v1", disable_env_checker=True),
         {"disable_env_checker": True}),
    ],
)  # fmt: skip
def test_the_spec_keeps_what_gymnasium_make_was_told(env, arguments):
    """`max_episode_steps=100` was lost, and learning then ran for 100,000 steps without an end."""
    made = env()
    spec = spec_of(made)
    assert dict(spec.arguments) == arguments
    assert spec_of(make(spec)) == spec
    assert steps_of(make(spec)) == steps_of(made) <= 500 or made.spec.max_episode_steps is None


def steps_of(env):
    """Return after how many steps an episode is cut short; 501 for none up to there."""
    env.reset(seed=0)
    for step in range(1, 501):
        if env.step(0)[3]:
            return step
        env.unwrapped.state = 0.0, 0.0, 0.0, 0.0  # a pole that stays up
        env.unwrapped.steps_beyond_terminated = None
    return 501


def test_what_no_file_holds_is_no_spec():
    gymnasium.register("Tooled-v0", lambda tool: Healthy())
    try:
        assert spec_of(gymnasium.make("Tooled-v0", tool=[1.5])) is not None
        assert spec_of(gymnasium.make("Tooled-v0", tool=object())) is None
    finally:
        gymnasium.registry.pop("Tooled-v0")


class Repeating(gymnasium.Wrapper):
    """Takes each action twice."""

    def step(self, action):
        first = self.env.step(action)
        return first if first[2] or first[3] else self.env.step(action)


class Masking(gymnasium.Wrapper):
    """Forbids an action, as sb3-contrib's ActionMasker does."""

    def action_masks(self):
        return np.array([True, False])


class Starting(gymnasium.Wrapper):
    """Starts episodes elsewhere."""

    def reset(self, *, seed=None, options=None):
        return self.env.reset(seed=seed, options={"low": -0.2, "high": 0.2})


class Exploring(Starting):
    """Starts elsewhere so that the task is learned everywhere."""

    same_task = True


class Shaping(gymnasium.RewardWrapper):
    """Rewards what is nearer than before, which it forgets when an episode begins."""

    def reset(self, **arguments):
        self.last = 0.0
        return self.env.reset(**arguments)

    def reward(self, reward):
        return reward + self.last


def listening(env):
    """Return an environment in a wrapper of the name of Stable-Baselines3's Monitor."""
    module = {"__module__": "stable_baselines3.common.monitor"}
    return type("Monitor", (Repeating,), module)(env)


def scaled(env):
    """Return CartPole in other units, within the same bounds."""
    return TransformObservation(env, lambda observation: observation / 2, env.observation_space)


@pytest.mark.parametrize(
    "wrapped",
    [
        scaled,
        lambda env: TransformReward(scaled(env), float),
        lambda env: TransformAction(env, lambda action: 1 - action, env.action_space),
        lambda env: FlattenObservation(FrameStackObservation(env, 2)),
        lambda env: MaxAndSkipObservation(env, 4),
        lambda env: Repeating(env),
        lambda env: Masking(env),
        lambda env: RecordEpisodeStatistics(Starting(env)),
    ],
)
def test_what_a_wrapper_changes_no_spec_makes_again(wrapped):
    """Its policies were evaluated, and proofs made, in the environment without the wrapper."""
    assert spec_of(wrapped(gymnasium.make("CartPole-v1"))) is None


def test_a_wrapper_that_changes_no_meaning_keeps_the_spec():
    env = gymnasium.make("CartPole-v1")
    for same in (
        TransformReward(env, float),
        RecordEpisodeStatistics(env),
        FlattenObservation(env),
        listening(env),
        Shaping(env),
        Exploring(env),
    ):
        assert spec_of(same).id == "CartPole-v1"


def test_a_wrapper_of_the_registration_is_made_again_with_it():
    gymnasium.register(
        "Stacked-v0",
        lambda: Healthy(),
        additional_wrappers=(
            FrameStackObservation.wrapper_spec(stack_size=2, padding_type="reset"),
        ),
    )
    try:
        env = gymnasium.make("Stacked-v0")
        assert isinstance(env, FrameStackObservation)
        assert spec_of(env).id == "Stacked-v0"
    finally:
        gymnasium.registry.pop("Stacked-v0")


@pytest.mark.parametrize(
    ("id_", "module", "words"),
    [
        ("FrozenLake-v1", "frozen_lake", ("LEFT", "DOWN", "RIGHT", "UP")),
        (CLIFF, "cliffwalking", ("UP", "RIGHT", "DOWN", "LEFT")),
    ],
)
def test_actions_of_toy_tasks_have_the_names_that_gymnasium_gives_them(id_, module, words):
    task = pytest.importorskip(f"gymnasium.envs.toy_text.{module}")
    env = gymnasium.make(id_)
    names = describe(env).actions
    keys = keys_of_environment(env, describe(env))
    for word in words:
        number = getattr(task, word)
        assert names[number] == word.lower()
        assert keys.keys_of(number)[0] == word.lower()  # the arrow of that direction
    assert describe(env).feature_names == ("square",)


class Symbols(Healthy):
    """What MiniGrid observes: 7 x 7 squares of three symbols, a direction, and a text."""

    observation_space = spaces.Dict(
        {
            "image": spaces.Box(0, 255, (7, 7, 3), np.uint8),
            "direction": spaces.Discrete(4),
            "mission": spaces.Text(50),
        }
    )

    def reset(self, *, seed=None, options=None):
        return self.observed(super().reset(seed=seed)[0]), {}

    def step(self, action):
        observation, *rest = super().step(action)
        return self.observed(observation), *rest

    def observed(self, numbers):
        image = (10 * numbers[0] * np.ones((7, 7, 3))).astype(np.uint8)
        return {"image": image, "direction": np.int64(1), "mission": "go"}


def test_symbols_are_no_pixels_and_two_wrappers_make_numbers_of_them():
    env = Symbols()
    with pytest.raises(UnsupportedSpaceError, match=r"Text.*leave it out.*FilterObservation"):
        describe(env)
    env = FilterObservation(env, ["image", "direction"])
    with pytest.raises(UnsupportedSpaceError, match=r"FlattenObservation, if these are symbols"):
        describe(env)
    env = FlattenObservation(env)
    assert describe(env).n_features == 7 * 7 * 3 + 4
    guarded = GuardedEnv(env)
    guarded.reset(seed=0)
    assert guarded.step(0)[0].shape == (151,)


def test_pixels_are_pixels_and_bytes_are_numbers():
    env = Symbols()
    env.observation_space = spaces.Box(0, 255, (96, 96, 3), np.uint8)
    with pytest.raises(UnsupportedSpaceError, match="a tree cannot learn from pixels"):
        describe(env)
    env.observation_space = spaces.Box(0, 255, (128,), np.uint8)
    assert describe(env).n_features == 128


class Grid(Healthy):
    """Observes a matrix: two rows of two."""

    observation_space = spaces.Box(0.0, 2.0, (2, 2), np.float64)

    def reset(self, *, seed=None, options=None):
        return np.outer([1, 2], super().reset(seed=seed)[0]), {}

    def step(self, action):
        observation, *rest = super().step(action)
        return np.outer([1, 2], observation), *rest


class Picture(Grid):
    observation_space = spaces.Box(0, 255, (64, 64), np.uint8)


@pytest.fixture
def registered():
    """Register the environments that observe a matrix and a picture."""
    for of in (Grid, Picture):
        gymnasium.register(f"{of.__name__}-v0", of, disable_env_checker=True)
    yield
    for of in (Grid, Picture):
        gymnasium.registry.pop(f"{of.__name__}-v0")


@pytest.mark.usefixtures("registered")
def test_a_matrix_is_laid_out_in_a_row_where_an_id_is_made():
    env = make("Grid-v0")
    matrix = env.env.reset(seed=3)[0]
    assert matrix.shape == (2, 2)
    assert env.reset(seed=3)[0].tolist() == matrix.ravel().tolist()
    assert describe(env).feature_names == ("x0", "x1", "x2", "x3")
    spec = spec_of(env)
    assert describe(make(spec)) == describe(env)
    assert spec_of(make(spec)) == spec
    with pytest.raises(UnsupportedSpaceError, match="FlattenObservation"):
        describe(gymnasium.make("Grid-v0"))
    with pytest.raises(UnsupportedSpaceError, match="pixels"):
        describe(make("Picture-v0"))


@pytest.mark.usefixtures("registered")
def test_a_matrix_has_the_names_that_its_environment_gives():
    env = make("Grid-v0")
    env.unwrapped.feature_names = ["a", "b", "c", "d"]
    env.unwrapped.feature_units = ["m", "", "", ""]
    assert describe(env).feature_names == ("a", "b", "c", "d")
    assert describe(env).features[0].unit == "m"
    flat = FlattenObservation(gymnasium.make("CartPole-v1"))
    assert describe(flat).feature_names == describe(gymnasium.make("CartPole-v1")).feature_names


def test_choices_in_a_table_can_be_flattened():
    class Table(gymnasium.Env):
        observation_space = spaces.MultiDiscrete([[2, 3], [4, 5]])
        action_space = spaces.Discrete(2)

    schema = describe(FlattenObservation(Table()))
    assert [len(group) for group in schema.groups.values()] == [2, 3, 4, 5]
    assert schema.n_features == 14
