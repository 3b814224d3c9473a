"""Masks of actions: read, recorded, obeyed by trees and by every learner."""

import ctypes
import shutil
import subprocess

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree
from eutree.compression.smaller_trees import merged
from eutree.data import Demonstrations, Episode
from eutree.data.demonstrations import derive
from eutree.data.episode import allowed_in
from eutree.distillation import DistillationSettings
from eutree.errors import EnvironmentFault, InvalidArgumentError
from eutree.export import to_c, to_dot, to_python, to_structured_text, to_svg, to_text
from eutree.inspection import edit, enforce
from eutree.interaction import GriddedAction, GuardedEnv
from eutree.interaction.first_look import first_difference
from eutree.learners.registry import method as named
from eutree.learners.registry import with_choices
from eutree.policies import LeafStatistics, TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree
from tests.little_search import little_search
from tests.masked import Light, Longest


@pytest.fixture(scope="module", autouse=True)
def registered():
    for name, arguments in (("Light-v0", {}), ("AskedLight-v0", {"asked": True})):
        gymnasium.register(name, entry_point=Light, kwargs=arguments)
    yield
    for name in ("Light-v0", "AskedLight-v0"):
        del gymnasium.registry[name]


@pytest.mark.parametrize("name", ["Light-v0", "AskedLight-v0"])
def test_masks_are_read_and_recorded(name, tmp_path):
    env = gymnasium.make(name)
    guarded = GuardedEnv(env)
    guarded.reset(0)
    assert guarded.allowed.tolist() == [True, False, False]
    with pytest.raises(InvalidArgumentError, match="that the environment allows, north, got east"):
        guarded.step(1)
    demos = eutree.record(env, Longest, episodes=3, seed=0)
    demos.save(tmp_path / "demos")
    loaded = Demonstrations.load(tmp_path / "demos")
    allowed = allowed_in(loaded)
    assert allowed.shape == (demos.n_transitions, 3)
    assert allowed[np.arange(len(loaded.actions)), loaded.actions].all()
    assert not allowed.all()
    assert first_difference(env, 0) is None


def test_a_leaf_falls_to_its_next_best_action():
    tree = DecisionTree.single_leaf(1).split(0, 0, 0.0).split(1, 0, 1.0)
    schema = Schema.anonymous(1, 4)
    policy = TreePolicy(tree, [1, 2, 0], schema)
    assert policy.orders.tolist() == [[1, 0, 2, 3], [2, 0, 1, 3], [0, 2, 1, 3]]
    assert policy.act([0.5]) == 2
    assert policy.predict([0.5], action_masks=[0, 1, 0, 1])[0] == 1
    rows = [[-1.0], [0.5], [2.0]]
    masks = [[1, 1, 1, 1], [1, 0, 0, 1], [0, 0, 0, 1]]
    assert policy.predict(rows, action_masks=masks)[0].tolist() == [1, 0, 3]
    known = LeafStatistics(
        visits=np.array([[5, 0, 9, 0]] * 3),
        values=np.array([[3.0, np.nan, 1.0, np.nan]] * 3),
        deviations=np.zeros((3, 4)),
    )
    assert TreePolicy(tree, [1, 2, 0], schema, leaves=known).orders[0].tolist() == [1, 0, 2, 3]
    with pytest.raises(InvalidArgumentError, match="at least one action"):
        policy.predict([0.5], action_masks=[0, 0, 0, 0])
    with pytest.raises(InvalidArgumentError, match="shape"):
        policy.predict([0.5], action_masks=[1, 1])


def test_a_fitted_tree_plays_without_a_masked_action(tmp_path):
    demos = eutree.record("Light-v0", Longest, episodes=20, seed=0)
    policy = eutree.fit_expert_tree(demos)
    assert policy.masked
    policy.save(tmp_path / "policy.json")
    assert TreePolicy.load(tmp_path / "policy.json") == policy
    found = eutree.evaluate(policy, "Light-v0", episodes=20, seed=1)  # a masked action raises
    assert len(found.returns) == 20
    # One who knows of no masks is kept to them, too.
    always_south = TreePolicy(DecisionTree.single_leaf(5), [2], demos.schema)
    eutree.evaluate(always_south, "Light-v0", episodes=2)
    eutree.evaluate(lambda observation: 2, "Light-v0", episodes=2)


def test_a_leaf_names_nothing_that_was_masked_where_it_decides():
    demos = eutree.record("Light-v0", Longest, episodes=20, seed=0)
    policy = eutree.fit_expert_tree(demos)
    leaves = policy.tree.leaf_index(demos.observations)
    for leaf in np.unique(leaves):
        assert allowed_in(demos)[leaves == leaf, policy.actions[leaf]].any()


def test_a_leaf_that_a_monotone_rule_changes_names_nothing_masked_either():
    x = np.linspace(0.0, 9.0, 160)
    left = x < 5.0
    allowed = np.where(left[:, None], [[False, True, True]], [[True, False, True]])
    shown = Episode(
        observations=np.append(x, 9.0)[:, None],
        actions=np.where(left, 1, 0),
        rewards=np.zeros(160),
        terminated=False,
        truncated=True,
        steps={"allowed": allowed},
    )
    demos = Demonstrations((shown,), Schema.anonymous(1, 3))
    kept = eutree.fit(demos, episodes=0, monotone=["action_1 in x0"]).policy
    assert [kept.act([1.0]), kept.act([8.0])] == [2, 0]


def test_exports_take_a_mask_or_say_that_they_do_not(tmp_path):
    demos = eutree.record("Light-v0", Longest, episodes=20, seed=0)
    policy = eutree.fit_expert_tree(demos)
    rows = demos.observations[:200]
    generator = np.random.default_rng(0)
    masks = generator.random((len(rows), 3)) < 0.5
    masks[np.arange(len(rows)), generator.integers(3, size=len(rows))] = True
    wanted = policy.predict(rows, action_masks=masks)[0].tolist()
    module = {}
    exec(to_python(policy), module)  # the tests' own
    assert [module["decide_allowed"](*both) for both in zip(rows, masks, strict=True)] == wanted
    assert [module["decide"](row) for row in rows] == policy.predict(rows)[0].tolist()
    source = to_c(policy)
    library = compiled_c(source, tmp_path)
    found = [
        library.decide_allowed((ctypes.c_double * 5)(*row), (ctypes.c_ubyte * 3)(*map(int, mask)))
        for row, mask in zip(rows.tolist(), masks, strict=True)
    ]
    assert found == wanted
    assert [library.decide((ctypes.c_double * 5)(*row)) for row in rows.tolist()] == (
        policy.predict(rows)[0].tolist()
    )
    for text in (to_structured_text(policy), to_dot(policy), to_text(policy), to_svg(policy)):
        assert "this takes all to be allowed" in text


def test_derived_features_are_computed_before_the_order_is_asked_for(tmp_path):
    """A last value is kept by the step, whichever function is asked; a reset forgets it."""
    demos = eutree.record("Light-v0", Longest, episodes=3, seed=0)
    demos = derive(demos, ["gap = north - east", "rise = south - last(south)"])
    tree = DecisionTree.single_leaf(7).split_each([(0, 5, 0.0), (0, 6, 0.0), (2, 0, 2.5)])
    policy = TreePolicy(tree, [0, 1, 2, 1], demos.schema, masked=True)
    module, library = {}, compiled_c(to_c(policy), tmp_path)
    exec(to_python(policy), module)  # the tests' own
    for episode in demos:
        module["decide_reset"]()
        library.decide_reset()
        state = None
        rows = zip(episode.observations[:-1, :5], episode.allowed, strict=True)
        for step, (row, mask) in enumerate(rows):
            first = np.array(step == 0)
            wanted, state = policy.predict(row, state, first, action_masks=mask)
            measured = (ctypes.c_double * 5)(*row.tolist())
            found = library.decide_allowed(measured, (ctypes.c_ubyte * 3)(*map(int, mask)))
            assert module["decide_allowed"](row, mask) == found == wanted


def compiled_c(source, folder):
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    (folder / "decide.c").write_text(source)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]
    command = [compiler, *flags, "decide.c", "-o", "decide.so"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "decide.so"))


@pytest.mark.parametrize("method", ["planning", "distilled-dqn", "u-tree", "vqql"])
def test_learning_never_plays_a_masked_action(method):
    """In 3,000 steps, exploration and races included; the environment would raise."""
    demos = eutree.record("AskedLight-v0", Longest, episodes=10, seed=0)
    chosen = named(method)
    if method == "distilled-dqn":  # a small network: this is about what is played
        light = {
            "teacher.hidden": 16,
            "updates_per_step": 0.05,
            "demonstration_updates": 100,
            "world_model.updates": 500,
            "world_model.more_updates": 100,
        }
        chosen = with_choices(chosen, light)
    with little_search():
        result = eutree.learn(
            "AskedLight-v0",
            method=chosen,
            demonstrations=demos,
            steps=3_000,
            seed=0,
            evaluate_every=10**9,
            evaluation_episodes=5,
        )
    assert result.environment_steps.total >= 2_700
    assert result.policy.masked
    leaves = result.policy.tree.leaf_index(result.history.observations)
    allowed = result.history.columns.get("allowed")
    for leaf in np.unique(leaves):
        assert allowed[leaves == leaf, result.policy.actions[leaf]].any()


class Parts(gymnasium.Env):
    """Two valves of three and two settings, one of which may not be open."""

    observation_space = spaces.Box(0.0, 1.0, (1,))

    def __init__(self, mask, sizes=(3, 2)):
        self.mask, self.action_space = mask, spaces.MultiDiscrete(sizes)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {"action_mask": self.mask}

    def step(self, action):
        return np.zeros(1, np.float32), 0.0, False, True, {"action_mask": self.mask}


@pytest.mark.parametrize(
    ("mask", "allowed"),
    [
        ([1, 0, 1, 1, 0], [1, 0, 0, 0, 1, 0]),
        ((np.array([1, 0, 1]), np.array([1, 0])), [1, 0, 0, 0, 1, 0]),
        ([1, 1, 0, 0, 0, 1], [1, 1, 0, 0, 0, 1]),
    ],
)
def test_masks_of_actions_in_parts(mask, allowed):
    guarded = GuardedEnv(Parts(mask))
    guarded.reset(0)
    assert guarded.allowed.astype(int).tolist() == allowed
    assert GuardedEnv(GriddedAction(Parts(mask))).reset(0).tolist() == [0.0]


@pytest.mark.parametrize(
    ("mask", "allowed"),
    [
        ((np.array([1, 0]), np.array([1, 1])), [1, 1, 0, 0]),
        ([[1, 0], [1, 1]], [1, 1, 0, 0]),
        (np.array([[1, 0], [1, 1]]), [1, 0, 1, 1]),
    ],
)
def test_masks_of_two_parts_of_two_are_not_taken_for_those_of_four_actions(mask, allowed):
    """Four numbers are as many as there are combinations: forbidden actions were played."""
    guarded = GuardedEnv(Parts(mask, (2, 2)))
    guarded.reset(0)
    assert guarded.allowed.astype(int).tolist() == allowed


def test_lists_of_parts_of_different_lengths_are_masks_of_parts():
    guarded = GuardedEnv(Parts([[1], [0, 1], [1, 0, 1]], (1, 2, 3)))  # six numbers, six actions
    guarded.reset(0)
    assert guarded.allowed.astype(int).tolist() == [0, 0, 0, 1, 0, 1]


@pytest.mark.parametrize("mask", [[1, 0, 1, 1], np.array([1, 0, 1, 1])])
def test_four_numbers_for_two_parts_of_two_are_not_guessed_at(mask):
    with pytest.raises(EnvironmentFault, match=r"an action mask must be a tuple.* shape \(2, 2\)"):
        GuardedEnv(Parts(mask, (2, 2))).reset(0)


@pytest.mark.parametrize("mask", [[1, 1], [0] * 6, [2] * 6, "abcdef", [0.5] * 6])
def test_what_is_no_mask_is_a_fault(mask):
    with pytest.raises(EnvironmentFault, match="an action mask must"):
        GuardedEnv(Parts(mask)).reset(0)


class Switches(Parts):
    """Ten steps of parts that may be set above 0 each by a number of its own; it raises else."""

    observation_space = spaces.Box(-1.0, 1.0, (2,))

    def __init__(self, sizes=(2, 2)):
        super().__init__(None, sizes)

    def _now(self):
        self.x = self.np_random.uniform(-1, 1, 2)
        return self.x.astype(np.float32)

    def action_masks(self):
        sizes = self.action_space.nvec
        return tuple(np.arange(n) <= n * (x > 0) for x, n in zip(self.x, sizes, strict=True))

    def reset(self, *, seed=None, options=None):
        gymnasium.Env.reset(self, seed=seed)
        self.t = 0
        return self._now(), {}

    def step(self, action):
        assert all(mask[value] for mask, value in zip(self.action_masks(), action, strict=True))
        self.t += 1
        return self._now(), float(sum(action)), False, self.t == 10, {}


class PartsModel:
    """Sets each part as high as its mask allows, as a MaskablePPO takes masks."""

    def __init__(self, sizes):
        self.sizes = sizes

    def predict(
        self, observation, state=None, episode_start=None, deterministic=False, action_masks=None
    ):
        assert action_masks.shape == (sum(self.sizes),)
        parts = np.split(action_masks, np.cumsum(self.sizes)[:-1])
        assert [part[1:].all() for part in parts] == (observation > 0).tolist()
        return np.array([part.nonzero()[0][-1] for part in parts]), state


@pytest.mark.parametrize("sizes", [(2, 2), (3, 2)])
def test_a_model_of_parts_gets_the_masks_of_parts(sizes):
    """It got those of combinations: wrong numbers in silence for two of two, else an error."""
    gymnasium.register("Switches-v0", lambda: Switches(sizes))
    try:
        demos = eutree.record("Switches-v0", PartsModel(sizes), episodes=4)
        high = (demos.observations > 0) * (np.array(sizes) - 1)
        assert demos.actions.tolist() == np.ravel_multi_index(high.T, sizes).tolist()
        settings = DistillationSettings(iterations=2, episodes=2, validation_episodes=2)
        for n_jobs in (1, 2):  # the trees' episodes are played elsewhere
            given = {"demonstrations": demos, "n_jobs": n_jobs, "seed": 0}
            tree, _ = eutree.distill(PartsModel(sizes), "Switches-v0", settings, **given)
            found = eutree.evaluate(tree, "Switches-v0", episodes=5)
            assert len(found.returns) == 5
    finally:
        del gymnasium.registry["Switches-v0"]


def test_a_controller_of_combinations_gets_the_masks_of_combinations():
    seen = []

    class Of:
        def predict(self, observation, action_masks=None):
            seen.append(action_masks.astype(int).tolist())
            return [2, 1], None

    mask = [1, 1, 0, 0, 0, 1]  # no product of masks of parts
    eutree.record(Parts(mask), Of(), episodes=1)
    eutree.record(GriddedAction(Parts(np.array(mask).reshape(3, 2))), Of(), episodes=1)
    assert seen == [mask, mask]


@pytest.mark.parametrize("reads_features", [False, True])
def test_a_masked_answer_is_replaced_by_the_best_allowed_value(reads_features):
    """A controller of the environment's own observation got the first allowed action."""

    class Valued:
        def predict(self, observation):
            return 0

        def action_values(self, observations):
            assert observations.shape == (1, 1)
            return [[9.0, 1.0, 3.0, -np.inf, 2.0, 2.0]]  # as it may say of what is forbidden

    Valued.reads_features = reads_features
    shown = eutree.record(GriddedAction(Parts([0, 1, 1, 0, 1, 1])), Valued(), episodes=1)
    assert shown.actions.tolist() == [2]


class Choice(gymnasium.Env):
    """Three actions of which the best is often forbidden, and the second best now and then."""

    observation_space = spaces.Box(-1.0, 1.0, (2,))
    action_space = spaces.Discrete(3)

    def _now(self):
        self.x = self.np_random.uniform(-1, 1, 2)
        mask = np.array([self.x[0] <= 0.2, self.x[1] > 0.0, True])
        return self.x.astype(np.float32), {"action_mask": mask}

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        return self._now()

    def step(self, action):
        self.t += 1
        observation, info = self._now()
        return observation, [1.0, 0.5, 0.0][int(action)], False, self.t == 20, info


@pytest.mark.parametrize("seed", [2, 5])
def test_a_policy_is_evaluated_with_the_orders_of_its_own_leaves(seed):
    """A start and a result of the same tests were one, whatever they fall back on under masks."""
    env = gymnasium.wrappers.TimeLimit(Choice(), 20)
    result = eutree.learn(env, steps=1000, seed=seed)
    for policy, said in ((result.learned, result.curve[-1]), (result.first, result.curve[0])):
        played = eutree.evaluate(policy, env, episodes=200, seed=99)
        assert abs(played.mean_return - said.mean_return) < 1.0
    first = eutree.evaluate(result.first, env, episodes=200, seed=99).mean_return
    handed_over = eutree.evaluate(result.policy, env, episodes=200, seed=99).mean_return
    assert handed_over > first - 0.5


def falling_back(seed, n_leaves=12):
    """Return a policy of two features whose leaves fall back on values of their own."""
    generator = np.random.default_rng(seed)
    tree = DecisionTree.single_leaf(2)
    while tree.n_leaves < n_leaves:
        leaf = int(generator.integers(tree.n_leaves))
        tree = tree.split(leaf, int(generator.integers(2)), float(generator.normal()))
    values = generator.permuted(np.tile([3.0, 2.0, 1.0], (n_leaves, 1)), axis=1)
    values[generator.random(n_leaves) < 0.6] = [3.0, 2.0, 1.0]
    leaves = LeafStatistics(np.ones((n_leaves, 3), np.int64), values, np.zeros((n_leaves, 3)))
    schema = Schema((Feature("u"), Feature("v")), ("a", "b", "c"))
    return TreePolicy(tree, values.argmax(axis=1), schema, leaves=leaves, masked=True)


def decided_under_masks(policy, seed=0):
    generator = np.random.default_rng(seed)
    rows = generator.normal(size=(400, 2))
    masks = generator.random((400, 3)) < 0.5
    masks[np.arange(400), generator.integers(3, size=400)] = True
    return rows, policy.predict(rows, action_masks=masks)[0]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("mode", ["merge", "lossless"])
def test_a_lossless_compression_falls_back_as_before(seed, mode):
    """It said 100 % and played other actions wherever the best one was forbidden."""
    policy = falling_back(seed)
    rows, wanted = decided_under_masks(policy)
    small, report = eutree.compress(policy, rows, mode=mode)
    assert report.agreement == 1.0
    assert small.n_leaves <= policy.n_leaves
    assert (decided_under_masks(small)[1] == wanted).all()


def test_some_of_these_are_smaller():
    policies = [falling_back(seed) for seed in range(8)]
    rows = decided_under_masks(policies[0])[0]
    assert min(eutree.compress(one, rows, mode="merge")[0].n_leaves for one in policies) < 12


@pytest.mark.parametrize("seed", range(4))
def test_a_rule_changes_nothing_elsewhere_under_masks(seed):
    policy = falling_back(seed)
    rows, wanted = decided_under_masks(policy)
    ruled = enforce(policy, "always a when -0.001 < u <= 0.001 and v <= 0").policy
    elsewhere = ~((np.abs(rows[:, 0]) <= 0.001) & (rows[:, 1] <= 0))
    assert (decided_under_masks(ruled)[1] == wanted)[elsewhere].all()
    node = int(np.flatnonzero(policy.tree.feature >= 0)[0])
    moved = edit(policy, thresholds={node: float(policy.tree.threshold[node]) + 1e-9}).policy
    assert (decided_under_masks(moved)[1] == wanted).all()


@pytest.mark.parametrize("seed", [1001, 1002])
def test_what_is_learned_has_no_test_that_decides_nothing(seed):
    """A leaf whose own action was never allowed decided as its sibling, and both stayed."""
    result = eutree.learn("Light-v0", method="planning", steps=1600, seed=seed)
    assert merged(result.policy).n_leaves == result.policy.n_leaves
