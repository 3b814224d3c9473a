"""Actions that are quantities: a grid that a person names, in every file and every export."""

import ctypes
import itertools
import json
import subprocess
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree
from eutree.cli.main import run
from eutree.errors import FormatError, InvalidArgumentError, UnsupportedSpaceError
from eutree.export import export, to_c, to_c_header, to_c_test, to_python, to_structured_text
from eutree.interaction import GriddedAction, describe
from eutree.interaction.making import make
from eutree.interaction.spaces import spec_of
from eutree.policies import TreePolicy
from eutree.schema import Control, EnvironmentSpec, Schema, combined_actions
from tests.export.policies import NASTY, policy_of, tree
from tests.export.readers import C_FLAGS, compiled_c
from tests.export.structured_text import Program
from tests.export.tools import need

TORQUE = {"torque [N m]": [-2, -0.5, 0, 2]}
VALVES = (Control("hot", "%", (0.0, 25.0, 100.0)), Control("cold-tap", "l/min", (-0.1, 1.5)))


class Tap(gymnasium.Env):
    """Rewards what the action's two numbers are; takes them as float32 in a column."""

    observation_space = spaces.Box(-1, 1, (2,))
    action_space = spaces.Box(
        np.array([[0], [-1]], np.float32), np.array([[100], [0.1]], np.float32)
    )

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(2, np.float32), {}

    def step(self, action):
        assert action in self.action_space
        return np.zeros(2, np.float32), float(1000 * action[0, 0] + action[1, 0]), True, False, {}


def mixed(seed=0, n_leaves=9):
    """Return a policy that sets two valves."""
    schema = Schema(Schema.anonymous(3, 6).features, combined_actions(VALVES), VALVES)
    return policy_of(tree(n_leaves, 3, seed=seed), schema)


def test_each_combination_is_an_action_and_the_last_changes_fastest():
    env = GriddedAction(Tap(), {"hot [%]": [0, 25], "cold": [-1, 0, 0.1]})
    assert env.action_space == spaces.Discrete(6)
    schema = describe(env)
    assert schema.actions[1] == "hot 0 %, cold 0"
    assert schema.actions[5] == "hot 25 %, cold 0.1"
    assert schema.action_values[4] == (25.0, 0.0)
    for action, (hot, cold) in enumerate(schema.action_values):
        env.reset(seed=0)
        assert env.step(action)[1] == pytest.approx(1000 * hot + cold, abs=0.01)


def test_the_grid_is_part_of_how_an_environment_is_made():
    spec = EnvironmentSpec("Pendulum-v1", {"action_grid": TORQUE, "max_episode_steps": 7})
    env = make(spec)
    assert env.action_space == spaces.Discrete(4)
    again = make(spec_of(env))
    assert spec_of(again) == spec_of(env)
    assert describe(again) == describe(env)
    assert describe(env).actions == ("torque -2 N m", "torque -0.5 N m", "torque 0 N m",
                                     "torque 2 N m")  # fmt: skip
    assert describe(env).feature_names == ("cos angle", "sin angle", "turn rate")
    env.reset(seed=0), again.reset(seed=0)
    assert env.step(1)[1] == again.step(1)[1]


def test_without_a_grid_it_says_what_helps():
    with pytest.raises(UnsupportedSpaceError, match=r"--action-grid NAME=LEVEL"):
        describe(gymnasium.make("Pendulum-v1"))


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        ({"torque": [-3, 0]}, r"levels of torque in \[-2, 2\]"),
        ({"torque": [0]}, "from 2 to 1,000"),
        ({"torque": [0, 0]}, "all distinct"),
        ({"torque": [0, float("nan")]}, "finite"),
        ({"torque": ["a", "b"]}, "vector of numbers"),
        ({"": [0, 1]}, "must have a name"),
        ({"a": [0, 1], "b": [0, 1]}, "each of the 1 numbers"),
        ({}, "from 2 to 1,000"),
        ({"torque": list(np.linspace(-2, 2, 1001))}, "from 2 to 1,000"),
        ("torque", "must be like"),
        ([["torque", [0, 1], 2]], "must be like"),
    ],
)
def test_what_is_no_grid(grid, message):
    with pytest.raises(InvalidArgumentError, match=message):
        GriddedAction(gymnasium.make("Pendulum-v1"), grid)


def test_discrete_actions_need_none():
    with pytest.raises(UnsupportedSpaceError, match="that is a Box"):
        GriddedAction(gymnasium.make("CartPole-v1"), TORQUE)


def test_schemas_of_other_levels_do_not_fit():
    one = Schema(Schema.anonymous(1, 1).features, ("shut", "open"), (Control("v", "", (0, 1)),))
    other = replace(one, controls=(Control("v", "", (0, 2)),))
    one.check_same(replace(one, controls=()), "it", of="that")
    with pytest.raises(InvalidArgumentError, match="must have the features and actions"):
        one.check_same(other, "it", of="that")
    with pytest.raises(InvalidArgumentError, match="each of the 2 combinations"):
        Schema(one.features, ("shut",), one.controls)
    assert one.with_history(2, 1).controls == one.controls


@pytest.mark.parametrize("levels", [(0, 50), np.array([0, 50]), np.linspace(0.0, 50.0, 2)])
def test_levels_are_numbers_that_every_export_can_write(levels):
    """A module of Python named NumPy, and C had no digits."""
    controls = (Control("valve", "%", tuple(levels)),)
    schema = Schema(Schema.anonymous(1, 1).features, combined_actions(controls), controls)
    policy = policy_of(tree(2, 1), schema)
    assert combined_actions(controls) == ("valve 0 %", "valve 50 %")
    same = replace(schema, controls=(Control("valve", "%", (0.0, 50.0)),))
    for write in (to_c, to_python):
        assert write(policy) == write(replace(policy, schema=same))


def test_from_demonstrations_to_c(tmp_path, monkeypatch, capsys):
    """Record, fit, evaluate, learn, compress and export on the command line; files keep it."""
    monkeypatch.chdir(tmp_path)

    def line(*words):
        capsys.readouterr()
        assert run([*words, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    grid = ("--action-grid", "torque [N m]=-2:2:5")
    record = ("record", "Pendulum-v1", "--expert", "swing", "--episodes", "3")
    line(*record, *grid, "--out", "demos")
    assert line("demos", "check", "demos")["equal"] == 3
    line("fit", "demos", "--out", "expert.json", "--episodes", "4")
    policy = eutree.TreePolicy.load("expert.json")
    assert policy.schema.controls == (Control("torque", "N m", (-2.0, -1.0, 0.0, 1.0, 2.0)),)
    assert "torque 2 N m" in str(policy)
    assert line("evaluate", "expert.json", "--episodes", "2")["mean_length"] == 200
    again = line("evaluate", "expert.json", "Pendulum-v1", *grid, "--episodes", "2")
    assert again["mean_length"] == 200
    # By its name, too, the environment has the grid with which it was shown.
    line("learn", "Pendulum-v1", "--demos", "demos", "--out", "run", "--preset", "paper",
         "--episodes", "2", "--evaluation-episodes", "2", "--judge-episodes", "4",
         "--front-steps", "0")  # fmt: skip
    kept = eutree.TreePolicy.load("run/policy.json").environment
    assert kept == eutree.TreePolicy.load("expert.json").environment
    line("compress", "run", "--out", "small.json", "--mode", "lossless", "--evaluate",
         "--episodes", "2")  # fmt: skip
    line("export", "small.json", "--out", "swing.c", "--header")
    assert "double swing_torque(const double *observation);" in (tmp_path / "swing.h").read_text()
    assert line("show", "small.json")
    plain = line("evaluate", "small.json", "Pendulum-v1", "--episodes", "2")
    assert plain["mean_return"] == line("evaluate", "small.json", "--episodes", "2")["mean_return"]


@pytest.mark.parametrize("text", ["torque", "torque=", "torque=1:2", "torque=0:1:9999", "=0,1"])
def test_what_is_no_grid_on_the_command_line(text, capsys):
    assert run(["evaluate", "x.json", "Pendulum-v1", "--action-grid", text]) == 2
    assert "--action-grid" in capsys.readouterr().err


def test_a_file_keeps_the_levels_and_a_wrong_one_is_refused(tmp_path):
    policy = mixed()
    policy.save(tmp_path / "policy.json")
    assert eutree.TreePolicy.load(tmp_path / "policy.json") == policy
    document = json.loads((tmp_path / "policy.json").read_text())
    document["schema"]["controls"][0]["levels"].pop()
    (tmp_path / "policy.json").write_text(json.dumps(document))
    with pytest.raises(FormatError, match="combinations"):
        eutree.TreePolicy.load(tmp_path / "policy.json", hand_edited=True)


def test_the_policy_returns_quantities():
    policy = mixed()
    rows = np.random.default_rng(0).normal(size=(40, 3))
    values, _ = policy.predict_values(rows)
    assert values.shape == (40, 2)
    assert [tuple(row) for row in values.tolist()] == [
        policy.schema.action_values[action] for action in policy.predict(rows)[0]
    ]
    assert policy.predict_values(rows[0])[0].tolist() == values[0].tolist()
    with pytest.raises(InvalidArgumentError, match="action grid"):
        policy_of(tree(2, 3), Schema.anonymous(3, 2)).predict_values(rows)


def test_quantities_are_those_of_an_allowed_action():
    policy = replace(mixed(), masked=True)
    rows = np.random.default_rng(0).normal(size=(40, 3))
    masks = np.ones((40, policy.schema.n_actions), dtype=bool)
    masks[np.arange(40), policy.predict(rows)[0]] = False
    actions, _ = policy.predict(rows, action_masks=masks)
    values, _ = policy.predict_values(rows, action_masks=masks)
    assert [tuple(row) for row in values.tolist()] == [
        policy.schema.action_values[action] for action in actions
    ]
    alone, _ = policy.predict_values(rows[0], action_masks=masks[0])
    assert alone.tolist() == values[0].tolist() != policy.predict_values(rows[0])[0].tolist()
    heard = "It is the row of NAME_values then: functions of single values hear no masks."
    assert heard in to_c(policy)
    assert heard not in to_c(mixed())


def expected(policy, rows):
    return policy.predict_values(rows)[0]


ROWS = np.random.default_rng(1).normal(scale=20.0, size=(60, 3))


@pytest.mark.parametrize("number", ["double", "float"])
def test_c_returns_quantities(number, tmp_path):
    policy = mixed()
    kind, c_type = (
        (np.float64, ctypes.c_double) if number == "double" else (np.float32, ctypes.c_float)
    )
    library = compiled_c(to_c(policy, number=number), tmp_path)
    rows = ROWS.astype(kind)
    for column, name in enumerate(("decide_hot", "decide_cold_tap")):
        function = getattr(library, name)
        function.restype = c_type
        found = [function(row.ctypes.data_as(ctypes.c_void_p)) for row in rows]
        assert found == expected(policy, rows.astype(float))[:, column].astype(kind).tolist()


def test_c_in_several_files_compiles_with_integers_too(tmp_path):
    policy = mixed()
    for number in ("double", "int32"):
        options = {"name": "tap", "number": number} | ({"scale": 64.0} if number == "int32" else {})
        (tmp_path / "tap.c").write_text(to_c(policy, header=True, **options))
        (tmp_path / "tap.h").write_text(to_c_header(policy, **options))
        (tmp_path / "test.c").write_text(to_c_test(policy, **options))
        build = [need("gcc"), *C_FLAGS, "tap.c", "test.c", "-o", "run"]
        subprocess.run(build, cwd=tmp_path, check=True)
        subprocess.run(["./run"], cwd=tmp_path, check=True, capture_output=True)
    header = (tmp_path / "tap.h").read_text()
    assert "TAP_HOT_25_COLD_TAP_MINUS_0P1_L_MIN" in header  # the sign is not lost
    assert "float tap_cold_tap(const int32_t *observation);" in header


def test_python_returns_quantities():
    policy, module = mixed(), {}
    exec(to_python(policy), module)
    for row, (hot, cold) in zip(ROWS.tolist(), expected(policy, ROWS).tolist(), strict=True):
        assert module["decide_hot"](row) == hot
        assert module["decide_cold_tap"](row) == cold
    assert module["CONTROLS"] == ("hot [%]", "cold-tap [l/min]")


def test_structured_text_returns_quantities():
    policy = mixed()
    program = Program(to_structured_text(policy))
    for row, (hot, cold) in zip(ROWS.tolist(), expected(policy, ROWS).tolist(), strict=True):
        assert program.run("DECIDE_HOT", row) == hot
        assert program.run("DECIDE_COLD_TAP", row) == cold
        assert program.run("DECIDE", row) == policy.act(row)


def test_onnx_returns_quantities():
    onnxruntime = pytest.importorskip("onnxruntime")
    policy = mixed()
    session = onnxruntime.InferenceSession(export(policy, "onnx"))
    action, value = session.run(["action", "value"], {"observation": ROWS})
    np.testing.assert_array_equal(action, policy.predict(ROWS)[0])
    np.testing.assert_array_equal(value, expected(policy, ROWS))


@pytest.mark.parametrize("format", ["text", "dot", "svg", "latex"])
def test_pictures_and_rules_name_levels_with_units(format):
    schema = describe(make(EnvironmentSpec("Pendulum-v1", {"action_grid": TORQUE})))
    policy = policy_of(tree(5, 3), schema)
    name = policy.schema.actions[policy.actions[0]]
    assert name in export(policy, format).replace("#46;", ".").replace("#45;", "-")


def test_any_name_of_a_control_can_be_exported(tmp_path):
    names = [name for name in NASTY if name][:20]
    for name, other in itertools.pairwise(names):
        controls = (Control(name, other, (0.0, 1.0)), Control(other, "", (2.0, 3.0, 4.0)))
        policy = replace(mixed(n_leaves=4), schema=replace(mixed().schema, controls=controls))
        module = {}
        exec(to_python(policy), module)
        program = Program(to_structured_text(policy))
        assert len(program.functions) == 3
        export(policy, "onnx")
    compiled_c(to_c(policy), tmp_path)


def test_minari_keeps_the_actions_and_says_what_it_cannot_keep(tmp_path, monkeypatch):
    pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env = make(EnvironmentSpec("Pendulum-v1", {"action_grid": TORQUE, "max_episode_steps": 5}))
    demos = eutree.record(env, eutree.experts.swing_upright, episodes=2)
    with pytest.warns(UserWarning, match="stores no env_spec.*grid"):
        demos.to_minari("tests/grid-v0")
    again = eutree.Demonstrations.from_minari("tests/grid-v0")
    assert again.schema.controls == demos.schema.controls
    assert again.environment == demos.environment
    assert np.array_equal(again.actions, demos.actions)


def test_levels_have_the_digits_that_tell_them_apart(tmp_path):
    """An action was called torque -1.6363636363636365 N m; the level stays what it is."""
    grid = [["torque [N m]", [-2 + 4 * k / 11 for k in range(12)]]]
    schema = describe(make(EnvironmentSpec("Pendulum-v1", {"action_grid": grid})))
    assert schema.actions[:3] == ("torque -2 N m", "torque -1.636 N m", "torque -1.273 N m")
    assert schema.controls[0].levels[1] == -2 + 4 / 11
    near = Control("torque", "N m", (1.0, 1.0 + 1e-9, 5.0))
    assert len(set(near.names())) == 3

    path = tmp_path / "policy.json"  # as an earlier release wrote it
    policy_of(tree(5, 3), schema).save(path)
    document = json.loads(path.read_text())
    document.pop("checksum", None)
    for k, level in enumerate(schema.controls[0].levels):
        document["schema"]["actions"][k] = f"torque {level!r} N m".replace(".0 ", " ")
    path.write_text(json.dumps(document))
    assert TreePolicy.load(path, hand_edited=True).schema.actions == schema.actions
