"""One rule for what a policy's answer means, wherever policies act: floats set, integers count."""

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree
from eutree.cli.main import run
from eutree.distillation import DistillationSettings
from eutree.errors import InvalidArgumentError, UnsupportedSpaceError
from eutree.interaction import GriddedAction, GuardedEnv, describe
from eutree.interaction.action_grid import grid_around
from eutree.interaction.decoding import DecodedObservation
from eutree.interaction.deriving import acting_as
from eutree.interaction.episode import replay
from eutree.interaction.making import make
from eutree.interaction.spaces import spec_of
from eutree.training.teaching import AskedTeacher

LEVELS = [-2, -1, 0, 1, 2]
TORQUE = {"torque [N m]": LEVELS}


class Plant(gymnasium.Env):
    """Rewards the sum of what the action sets, and notes each action as it comes."""

    observation_space = spaces.Box(-5, 5, (2,), np.float64)

    def __init__(self, space=None):
        self.action_space = spaces.Box(-2, 2, (1,), np.float32) if space is None else space
        self.taken = []

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.count = 0
        return self._observation(), {}

    def step(self, action):
        assert np.asarray(action, self.action_space.dtype)[()] in self.action_space, action
        self.taken.append(action)
        self.count += 1
        return self._observation(), float(np.sum(action)), False, self.count == 4, {}

    def _observation(self):
        return self.np_random.uniform(-5, 5, 2)


class Sets:
    """A controller whose answer never changes."""

    def __init__(self, answer):
        self.answer = answer

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return self.answer, state


def gridded(grid=None, space=None):
    return GriddedAction(Plant(space), TORQUE if grid is None else grid)


def steering():
    """Return a tree that sets -2 N m where its first number is negative, else 1 N m."""
    demos = eutree.record(gridded(), lambda o: np.array([-2.0 if o[0] < 0 else 1.0]), episodes=9)
    return eutree.fit_expert_tree(demos)


ANSWERS = [
    (np.array([2.0]), 4), (np.array([1.9], np.float32), 4), (2.0, 4), (0.4, 2), ([-0.6], 1),
    (np.array([2]), 2), (np.int64(4), 4), (np.array(0), 0), (3, 3), (-1.5, 0),
]  # fmt: skip


@pytest.mark.parametrize(("answer", "number"), ANSWERS)
def test_a_float_is_a_quantity_and_an_integer_a_number(answer, number):
    """`array([2.0])`, 2 N m, was recorded as action 2, 0 N m."""
    env, controller = gridded(), Sets(answer)
    assert set(eutree.record(env, controller, episodes=1).actions.tolist()) == {number}
    assert eutree.evaluate(controller, env, episodes=2).mean_return == 4 * LEVELS[number]
    assert eutree.play(controller, env).undiscounted_return == 4 * LEVELS[number]
    short = DistillationSettings(iterations=2, episodes=1, validation_episodes=2)
    tree, _ = eutree.distill(controller, env, short)
    assert set(tree.actions.tolist()) == {number}
    teacher = AskedTeacher(eutree.Teacher(controller, steps=0), GuardedEnv(env))
    assert teacher.action_values(np.zeros((1, 2))).argmax() == number
    env.reset()
    assert env.step(answer)[1] == LEVELS[number]


@pytest.mark.parametrize("answer", [2.1, -2.5, np.nan, np.inf, [1.0, 1.0], 5, -1, None, "2"])
def test_what_is_no_level_and_no_number_is_refused(answer):
    env = gridded()
    with pytest.raises(InvalidArgumentError, match=r"torque.*got"):
        eutree.record(env, Sets(answer), episodes=1)
    env.reset()
    with pytest.raises(InvalidArgumentError, match=r"an action must.*torque.*got"):
        env.step(answer)


def test_the_range_is_that_of_the_environment_as_rounded_as_it_is():
    narrow = {"heat": [0, 0.5]}
    env = gridded(narrow, spaces.Box(0, np.array([0.7], np.float32), (1,), np.float32))
    assert eutree.record(env, Sets(0.7), episodes=1).actions[0] == 1  # float32(0.7) < 0.7
    with pytest.raises(InvalidArgumentError, match=r"heat to a number in \[0, 0\.7\]"):
        eutree.record(env, Sets(0.71), episodes=1)
    endless = gridded(narrow, spaces.Box(-np.inf, np.inf, (1,), np.float32))
    assert eutree.record(endless, Sets(-1e300), episodes=1).actions[0] == 0
    with pytest.raises(InvalidArgumentError, match="inf"):
        eutree.record(endless, Sets(np.inf), episodes=1)


@pytest.mark.parametrize(
    ("answer", "number"),
    [((99.0, 0.9), 5), (np.array([[40.0], [-1.0]]), 2), ([0, 1], 1), (np.float32([60, 0]), 2),
     (4, 4)],
)  # fmt: skip
def test_two_quantities(answer, number):
    space = spaces.Box(np.array([[0], [-1]], np.float32), np.array([[100], [1]], np.float32))
    grid = {"hot [%]": [0, 50, 100], "cold": [-1, 1]}
    env = gridded(grid, space)
    demos = eutree.record(env, Sets(answer), episodes=1)
    assert set(demos.actions.tolist()) == {number}
    assert np.ravel(env.unwrapped.taken[-1]).tolist() == list(demos.schema.action_values[number])


def test_careless_hands_set_levels_and_late_ones_keep_quantities():
    """A random number of an action among floats was taken for a quantity."""
    env = gridded()
    for wrapped in (eutree.experts.careless, eutree.experts.late):
        controller = wrapped(lambda _: Sets(np.array([2.0], np.float32)), 1)
        assert set(eutree.record(env, controller, episodes=9).actions) <= {0, 1, 2, 3, 4}
    random = eutree.record(env, eutree.experts.careless(lambda _: Sets(2.0), 1.0), episodes=25)
    assert np.bincount(random.actions, minlength=5).min() > 5


def test_a_tree_of_quantities_acts_where_nobody_named_levels():
    tree, plain = steering(), Plant()
    with_grid = eutree.evaluate(tree, gridded(), episodes=5)
    assert eutree.evaluate(tree, plain, episodes=5).returns.tolist() == with_grid.returns.tolist()
    assert {float(action[0]) for action in plain.taken} == {-2.0, 1.0}
    assert eutree.record(plain, tree, episodes=1).schema.controls == tree.schema.controls
    assert eutree.play(tree, plain, seed=3).seed == 3
    learned = eutree.learn(plain, expert=tree, method="paper", episodes=1, evaluation_episodes=1)
    assert learned.policy.schema.controls == tree.schema.controls
    demos = eutree.record(gridded(), tree, episodes=5)
    assert eutree.fit(demos, plain, episodes=3).played is not None
    other = gridded({"torque": [-1, 1]})
    with pytest.raises(InvalidArgumentError, match="which has one already"):
        eutree.evaluate(tree, other, episodes=1)
    with pytest.raises(UnsupportedSpaceError, match="--action-grid"):
        eutree.evaluate(Sets(1.0), plain, episodes=1)


def test_the_loop_of_gymnasium_with_and_without_a_grid():
    """`env.step(policy.predict(o)[0])` sets the level number 4 as 4 N m where there is no grid."""
    tree = steering()
    for env in (gridded(), Plant()):
        observation, _ = env.reset(seed=0)
        for _ in range(4):
            observation, *_ = env.step(tree.predict_values(observation)[0])
    around = GriddedAction(Plant(), tree.schema.controls)
    observation, _ = around.reset(seed=0)
    around.step(tree.predict(observation)[0])
    assert around.unwrapped.taken[0] == tree.predict_values(observation)[0]


class Codes(Plant):
    """Observes a code that it can decode itself."""

    observation_space = spaces.Discrete(4)

    def decode(self, code):
        return divmod(int(code), 2)

    def _observation(self):
        return int(self.np_random.integers(4))


@pytest.fixture
def own_grid():
    """Yield the ids of environments that apply their grid, and decode, themselves."""
    made = {
        "tests/Gridded-v0": gridded,
        "tests/Bare-v0": gridded,
        "tests/Decoded-v0": lambda: DecodedObservation(GriddedAction(Codes(), TORQUE)),
        "tests/Chosen-v0": lambda action_grid=3: gridded({"torque": list(range(action_grid))}),
    }
    for name, creator in made.items():
        bare = {"order_enforce": False, "disable_env_checker": True} if "Bare" in name else {}
        gymnasium.register(name, creator, **bare)
    yield list(made)
    for name in made:
        gymnasium.registry.pop(name)


def test_a_grid_of_the_environment_s_own_is_not_put_around_it_again(own_grid, tmp_path, capsys):
    """Files said `action_grid` for it, and `make` put a second grid around the first."""
    for name in own_grid:
        out = str(tmp_path / name.replace("/", "-"))
        demos = eutree.record(name, Sets(1.0), episodes=3, out=out)
        assert demos.schema.controls
        tree = eutree.fit(demos, episodes=2).policy
        assert eutree.evaluate(tree, demos.environment, episodes=2).mean_return == 4.0
        assert spec_of(make(demos.environment)) == demos.environment
        learned = eutree.learn(
            name, demonstrations=demos, method="paper", episodes=1, evaluation_episodes=1
        )
        assert learned.policy.environment == demos.environment
        tree.save(f"{out}.json")
        assert run(["evaluate", f"{out}.json", "--episodes", "1"]) == 0
        capsys.readouterr()


def test_the_same_grid_may_be_asked_for_and_no_other(own_grid):
    env = make(eutree.EnvironmentSpec(own_grid[0], {"action_grid": TORQUE}))
    assert describe(env).n_actions == 5
    assert grid_around(env) is grid_around(acting_as(env, steering()))
    with pytest.raises(InvalidArgumentError, match="which has one already"):
        make(eutree.EnvironmentSpec(own_grid[0], {"action_grid": {"torque": [0, 1]}}))


PARTS = {
    "MultiDiscrete": (spaces.MultiDiscrete([3, 2]), (2, 1), 5, "control_0 2, control_1 1"),
    "shifted": (
        spaces.MultiDiscrete([2, 2], start=[1, -3]), [2, -3], 2, "control_0 2, control_1 -3"
    ),
    "a table": (spaces.MultiDiscrete([[2], [3]]), [[1], [0]], 3, "control_0 1, control_1 0"),
    "one part": (spaces.MultiDiscrete([3], start=[4]), [5], 1, "control_0 5"),
    "a fixed part": (spaces.MultiDiscrete([1, 2]), [0, 1], 1, "control_0 0, control_1 1"),
    "MultiBinary": (spaces.MultiBinary(3), [1, 0, 1], 5, "control_0 1, control_1 0, control_2 1"),
    "from one": (spaces.Discrete(3, start=1), np.int64(1), 0, "action 1"),
    "from below": (spaces.Discrete(3, start=-1), 1, 2, "action 1"),
}  # fmt: skip


@pytest.mark.parametrize("kind", PARTS)
def test_spaces_of_few_values_are_taken_as_they_are(kind, tmp_path):
    space, answer, number, name = PARTS[kind]
    env = Plant(space)
    demos = eutree.record(env, Sets(answer), episodes=2, out=tmp_path / "demos")
    assert set(demos.actions.tolist()) == {number}
    assert demos.schema.actions[number] == name
    assert space.contains(env.taken[-1])
    np.testing.assert_array_equal(env.taken[-1], answer)
    tree = eutree.fit_expert_tree(eutree.Demonstrations.load(tmp_path / "demos"))
    tree.save(tmp_path / "tree.json")
    tree = eutree.TreePolicy.load(tmp_path / "tree.json")
    assert name in str(tree)
    assert np.ravel(tree.predict_values([0.0, 0.0])[0]).tolist() == np.ravel(answer).tolist()
    env.taken.clear()
    assert eutree.evaluate(tree, env, episodes=2).mean_return == 4 * np.sum(answer)
    around = GriddedAction(env)
    observation, _ = around.reset(seed=0)
    around.step(tree.predict(observation)[0])
    assert all(np.array_equal(taken, answer) for taken in env.taken)
    learned = eutree.learn(
        env, demonstrations=demos, method="paper", episodes=2, evaluation_episodes=2
    )
    assert learned.policy.schema == demos.schema
    assert {r.problem for r in replay(demos, env)} == {""}
    random = eutree.record(env, eutree.experts.careless(lambda _: Sets(answer), 1.0), episodes=9)
    assert set(random.actions.tolist()) == set(range(demos.schema.n_actions))


def test_parts_have_the_names_that_the_environment_or_a_file_gives():
    class Named(Plant):
        action_names = ("heater [kW]", "fan")

    assert describe(Named(spaces.MultiDiscrete([3, 2]))).actions[5] == "heater 2 kW, fan 1"
    assert describe(Named(spaces.Discrete(2, start=1))).actions == ("heater [kW]", "fan")
    few = GriddedAction(
        Plant(spaces.MultiBinary(30)), {f"c{k}": [0] for k in range(29)} | {"d": [0, 1]}
    )
    assert describe(few).n_actions == 2
    with pytest.raises(InvalidArgumentError, match=r"whole levels of fan in \[0, 1\]"):
        GriddedAction(Plant(spaces.MultiBinary(1)), {"fan": [0, 0.5]})


def test_a_model_of_few_values_may_leave_the_nearest_of_fewer():
    """A model that was trained on all five values answers 3 where 0, 2 and 4 are named."""
    env = gridded({"a": [0, 2, 4], "b": [0, 1]}, spaces.MultiDiscrete([5, 2]))
    assert eutree.record(env, Sets(np.array([3, 1])), episodes=1).actions[0] == 3
