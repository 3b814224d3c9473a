"""A tree reads what its environment observes, whatever the form."""

from collections import OrderedDict
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import SyncVectorEnv

import eutree
from eutree.errors import InvalidArgumentError
from eutree.interaction import DerivedObservation, GuardedEnv, describe
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree
from tests.frames import Frame, Table

SPACES = {
    "dict": spaces.Dict(
        {
            "speed": spaces.Box(0, 9, (1,), np.float32),
            "at": spaces.Dict({"floor": spaces.Discrete(4), "doors": spaces.MultiBinary(2)}),
            "alone": spaces.Dict({"inner": spaces.Box(-1, 1, (1,))}),
        }
    ),
    "tuple": spaces.Tuple(
        [spaces.Discrete(5), spaces.Box(0, 5, (2,)), spaces.Tuple([spaces.Discrete(5)] * 2)]
    ),
    "tuple of equals": spaces.Tuple([spaces.Box(0, 1, (2,)), spaces.Box(0, 1, (2,))]),
    "tuple of codes": spaces.Tuple([spaces.Discrete(3), spaces.Discrete(5), spaces.Discrete(2)]),
    "one code": spaces.Discrete(9),
    "bits": spaces.MultiBinary(3),
}


class Sees(gymnasium.Env):
    """Five random observations; the sum of their numbers is what the action should know."""

    action_space = spaces.Discrete(2)

    def __init__(self, space):
        self.observation_space = space

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.observation_space.seed(seed)
        self.count = 0
        return self.observation_space.sample(), {}

    def step(self, action):
        self.count += 1
        return self.observation_space.sample(), float(action), False, self.count == 5, {}


def reversed_(value):
    """Return nested dicts with their keys the other way round."""
    if not isinstance(value, dict):
        return value
    return OrderedDict((key, reversed_(value[key])) for key in reversed(value))


def learned(env, history=0):
    """Return a tree of a rule by all numbers of an observation."""
    guarded = GuardedEnv(env)
    middle = np.array([(f.low + f.high) / 2 for f in guarded.schema.measured.features])
    weights = 1.0 + np.arange(middle.size)
    rule = eutree.experts.RulePolicy(lambda o: ((o - middle) @ weights > 0).astype(int))
    demos = eutree.record(env, rule, episodes=30, seed=1)
    tree = eutree.fit_expert_tree(demos.with_history(history) if history else demos)
    assert tree.n_leaves > 1
    return replace(tree, history=history), guarded


@pytest.mark.parametrize("history", [0, 1])
@pytest.mark.parametrize("name", SPACES)
def test_a_tree_decides_by_the_environments_own_observation(name, history):
    """`policy.predict(env.reset()[0])` of a Dict raised a bare TypeError."""
    env = Sees(SPACES[name])
    tree, guarded = learned(env, history)
    state = own_state = turned = None
    for seed in range(40):
        features = guarded.reset(seed)
        own = guarded.own_observation(features)
        wanted, state = tree.predict(features, state)
        found, own_state = tree.predict(own, own_state)
        assert found == wanted
        again, turned = tree.predict(reversed_(own), turned)
        assert again == wanted


def stacked(samples):
    """Return a batch as a vector environment gives it: arrays in the form of one observation."""
    first = samples[0]
    if isinstance(first, dict):
        return {key: stacked([sample[key] for sample in samples]) for key in first}
    if isinstance(first, tuple):
        return tuple(stacked(list(entries)) for entries in zip(*samples, strict=True))
    return np.stack(samples)


@pytest.mark.parametrize("name", ["dict", "tuple", "tuple of equals", "tuple of codes", "bits"])
def test_a_batch_of_them(name):
    """Of as many observations as a tuple has entries the columns were taken for rows."""
    env = Sees(SPACES[name])
    tree, guarded = learned(env)
    rows = np.array([guarded.reset(seed) for seed in range(7)])
    for size in range(2, 8):
        batch = stacked([guarded.own_observation(row) for row in rows[:size]])
        assert tree.predict(batch)[0].tolist() == tree.predict(rows[:size])[0].tolist()


@pytest.mark.parametrize("name", ["dict", "tuple", "tuple of equals", "tuple of codes"])
def test_what_is_derived_is_derived_of_the_environments_own_observation(name):
    """Of a tuple it was a bare ValueError; of a batch of d, columns were taken for rows."""
    env = Sees(SPACES[name])
    first = describe(env).feature_names[0]
    tree, guarded = learned(DerivedObservation(env, [f'twice = 2 * "{first}"']))
    n_measured, plain = tree.derivation.n_measured, GuardedEnv(env)
    rows = np.array([plain.reset(seed) for seed in range(7)])
    own = [plain.own_observation(row) for row in rows]
    for row, one in zip(rows, own, strict=True):
        assert tree.predict(one)[0] == tree.predict(row)[0]
    for size in (2, n_measured, n_measured + 1):
        wanted = tree.predict(rows[:size])[0].tolist()
        assert tree.predict(stacked(own[:size]))[0].tolist() == wanted
    complete = guarded.reset(0)
    assert tree.predict(tuple(complete.tolist()))[0] == tree.predict(complete)[0]


def test_rows_of_numbers_in_a_tuple_stay_rows():
    tree, guarded = learned(Sees(SPACES["tuple of codes"]))
    rows = [tuple(guarded.reset(seed).tolist()) for seed in range(7)]
    for size in range(2, 8):
        assert tree.predict(tuple(rows[:size]))[0].tolist() == tree.predict(rows[:size])[0].tolist()


@pytest.mark.parametrize(
    "wrong",
    [{"speed": [1.0]}, {"speed": "fast"}, {}, (), (1.0, [2.0]), None, "left", 3.0, [[1.0], [1, 2]]],
)
def test_what_is_no_observation_is_one_line(wrong):
    tree, _ = learned(Sees(SPACES["dict"]))
    with pytest.raises(InvalidArgumentError, match="observation must have"):
        tree.predict(wrong)


def test_columns_in_any_order_are_read_by_their_names():
    """Also those of a table of pyarrow, whose ``columns`` are arrays."""
    tree, guarded = learned(Sees(SPACES["tuple of codes"]))
    rows = np.array([guarded.reset(seed) for seed in range(20)])
    wanted, turned = tree.predict(rows)[0].tolist(), guarded.schema.feature_names[::-1]
    assert tree.predict(rows[:, ::-1])[0].tolist() != wanted
    for kind in (Frame, Table):
        assert tree.predict(kind(rows[:, ::-1], turned))[0].tolist() == wanted
        with pytest.raises(InvalidArgumentError, match="observation must have the columns"):
            tree.predict(kind(rows[:, :2], turned[:2]))


def test_columns_of_pyarrow_are_read_by_their_names():
    pyarrow = pytest.importorskip("pyarrow")
    tree, guarded = learned(Sees(SPACES["tuple of codes"]))
    rows = np.array([guarded.reset(seed) for seed in range(20)])
    names = guarded.schema.feature_names
    turned = pyarrow.table({names[k]: rows[:, k] for k in (2, 0, 1)})
    wanted = tree.predict(rows)[0].tolist()
    for table in (turned, turned.to_batches()[0]):
        assert tree.predict(table)[0].tolist() == wanted


class Missing:
    """As pandas.NA: no number."""


@pytest.mark.parametrize(("value", "said"), [("auto", "'auto'"), (Missing(), "not 'Missing'")])
def test_a_frame_with_what_is_no_number_is_told_so(value, said):
    """It was said that the shape was wrong, which was right."""
    tree, guarded = learned(Sees(SPACES["tuple of codes"]))
    names, rows = guarded.schema.feature_names, [guarded.reset(0).tolist() for _ in range(2)]
    rows[1][0] = value
    with pytest.raises(InvalidArgumentError, match=f"observation must have numbers.*{said}"):
        tree.predict(Frame(rows, names))


def test_where_names_are_the_environments_own_it_says_what_helps():
    class Named(Sees):
        feature_names = ("a", "b", "c", "d", "e")

    tree, guarded = learned(Named(SPACES["dict"]))
    assert describe(guarded.env).feature_names == ("a", "b", "c", "d", "e")
    own = guarded.own_observation(guarded.reset(0))
    with pytest.raises(InvalidArgumentError, match=r"entries 'a, b.*got.*at\.doors.*eutree\.play"):
        tree.predict(own)
    assert len(eutree.play(tree, guarded.env)) == 5


def remembering(*derived, actions=0):
    """Return a policy that remembers a step of two numbers and of what is derived."""
    own = eutree.Schema((eutree.Feature("a"), eutree.Feature("b")), ("l", "r")).derive(derived)
    schema = own if derived else own.with_history(1, actions)
    tree = eutree.DecisionTree.single_leaf(schema.n_features).split(0, 0, 0.0)
    past = {} if derived else {"history": 1, "past_actions": actions}
    return eutree.TreePolicy(tree, [0, 1], schema, **past)


@pytest.mark.parametrize(
    ("policy", "size"),
    [
        (remembering(), 4),
        (remembering(actions=1), 7),
        (remembering("c = a - last(a)"), 3),
    ],
)
def test_what_is_remembered_must_be_of_the_rows_observed(policy, size):
    """NumPy could not broadcast it, or it was taken for every row."""
    rows = np.zeros((3, 2))
    state = policy.predict(rows)[1]
    assert state.shape == (3, size)
    for observed, given, begins, wanted in (
        (rows[:2], state, None, rf"state must have shape \(2, {size}\), got \(3, {size}\)"),
        (rows[0], state, None, rf"state must have shape \({size},\), got \(3, {size}\)"),
        (rows, state[:, :1], None, rf"state must have shape \(3, {size}\), got \(3, 1\)"),
        (rows, 0.0, None, rf"state must have shape \(3, {size}\), got \(\)"),
        (rows, state, [True, False], r"episode_start must have shape \(3,\), got \(2,\)"),
        (rows[0], state[0], [True, False], r"episode_start must have shape \(\), got \(2,\)"),
    ):
        with pytest.raises(InvalidArgumentError, match=wanted):
            policy.predict(observed, given, begins)
    for begins in (True, [True]):  # of one, as Stable-Baselines3 says it, too
        assert policy.predict(rows[0], state[0], begins)[1].shape == (size,)
    for begins in (True, [True] * 3):
        assert policy.predict(rows, state, begins)[1].shape == (3, size)


@pytest.mark.parametrize(
    ("features", "threshold"),
    [
        (np.array([0.1], np.float32), 0.1),
        ([np.float32(0.1)], 0.1),
        (np.array([0.1], np.float16), 0.1),
        ([2**53 + 1], 2.0**53),
        (np.array([2**53 + 1]), 2.0**53),
        ([True], 0.5),
    ],
)
def test_act_compares_doubles_as_predict_does(features, threshold):
    """In float32 0.1 equals itself, and a whole number of Python is compared exactly."""
    tree = DecisionTree.single_leaf(1).split(0, 0, threshold)
    policy = TreePolicy(tree, np.array([0, 1]), Schema.anonymous(1, 2))
    assert policy.act(features) == policy.predict(features)[0] == policy.predict([features])[0][0]
    assert policy.act(features) == policy.act([float(features[0])])


CODE = spaces.Discrete(9)
PARTS = {
    "codes by name": spaces.Dict({"a": CODE, "b": CODE}),
    "one code by name": spaces.Dict({"a": CODE}),
    "one code in a tuple": spaces.Tuple([CODE]),
    "numbers by name": spaces.Dict({"a": spaces.Box(0, 1, (1,)), "b": spaces.Box(0, 1, (1,))}),
    "arrays by name": spaces.Dict({"pos": spaces.Box(0, 1, (2,)), "v": spaces.Box(0, 1, (1,))}),
    "array and code": spaces.Dict({"pos": spaces.Box(0, 1, (2,)), "a": CODE}),
    "nested": spaces.Dict({"at": spaces.Tuple([CODE, spaces.Box(0, 1, (1,))]), "a": CODE}),
    "bits": spaces.Dict({"a": spaces.MultiBinary(1), "b": spaces.MultiBinary(1)}),
}
FLAT = {
    "array": spaces.Box(0, 1, (3,)),
    "one number": spaces.Box(0, 1, (1,)),
    "codes": spaces.MultiDiscrete([4, 5]),
    "one code": spaces.MultiDiscrete([4]),
}
SINGLE = {"code": CODE, "scalar": spaces.Box(0, 1, ())}


def halved(space):
    """Return an environment of a space, a tree with a cut in each feature, and its guard."""
    guarded = GuardedEnv(Sees(space))
    features = guarded.schema.features
    tree = DecisionTree.single_leaf(len(features))
    for j, feature in enumerate(features):
        tree = tree.split(j, j, (feature.low + feature.high) / 2)
    return TreePolicy(tree, np.arange(tree.n_leaves) % 2, guarded.schema), guarded


def vector_of(space, copies):
    return SyncVectorEnv([lambda: Sees(space)] * copies)


@pytest.mark.parametrize("copies", [1, 2, 3])
@pytest.mark.parametrize(
    "space", [*SPACES.values(), *PARTS.values(), *FLAT.values(), *SINGLE.values()]
)
def test_a_vector_environment_takes_what_a_tree_answers(space, copies):
    """A batch of one gave a number, which no vector environment takes; (E,) was refused."""
    policy, guarded = halved(space)
    venv, is_single = vector_of(space, copies), space.shape == ()
    for seed in range(8):
        seen = venv.reset(seed=seed)[0]
        wanted = policy.predict([guarded.reset(seed + k) for k in range(copies)])[0]
        actions, _ = policy.predict(seen[:, np.newaxis] if is_single and copies == 1 else seen)
        assert (actions.shape, actions.tolist()) == ((copies,), wanted.tolist())
        venv.step(actions)


@pytest.mark.parametrize(
    "space", [*SPACES.values(), *PARTS.values(), *FLAT.values(), *SINGLE.values()]
)
def test_one_observation_is_no_batch_of_one(space):
    """The control: what a single environment observes gets a number, whatever its form."""
    policy, guarded = halved(space)
    for seed in range(8):
        features = guarded.reset(seed)
        action = policy.predict(guarded.own_observation(features))[0]
        assert isinstance(action, int)
        assert action == policy.predict(features)[0]


def test_frozen_lake_in_copies():
    lake = gymnasium.make_vec("FrozenLake-v1", num_envs=3, vectorization_mode="sync")
    schema = describe(gymnasium.make("FrozenLake-v1"))
    policy = TreePolicy(DecisionTree.single_leaf(1).split(0, 0, 0.5), [1, 2], schema)
    seen, _ = lake.reset(seed=0)
    for _ in range(5):
        actions, _ = policy.predict(seen)
        assert actions.tolist() == [1 if square == 0 else 2 for square in seen]
        seen = lake.step(actions)[0]
    assert policy.predict(np.int64(3))[0] == policy.predict([3])[0] == 2


def test_a_batch_of_single_numbers_remembers_and_derives():
    """A row of numbers is one observation where as many were derived, as it was."""
    policy, _ = halved(CODE)
    past = replace(policy, tree=DecisionTree.single_leaf(2).split(0, 1, 3.5), history=1,
                   schema=policy.schema.with_history(1))  # fmt: skip
    state = past.predict([1, 5, 8])[1]
    assert past.predict([5, 1, 8], state)[0].tolist() == [0, 1, 1]
    schema = policy.schema.derive(["twice = 2 * x0"])
    made = TreePolicy(DecisionTree.single_leaf(2).split(0, 1, 7.0), [0, 1], schema)
    assert made.predict([1, 5, 8])[0].tolist() == [0, 1, 1]
    assert made.predict([1, 2])[0] == made.predict([1])[0] == 0
    for wrong in ([], np.zeros((2, 3)), (1.0, 2.0, 3.0)):
        with pytest.raises(InvalidArgumentError, match="observation must have"):
            policy.predict(wrong)
