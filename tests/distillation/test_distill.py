"""Distillation: cases worked by hand, a naive twin, what is counted and what is refused."""

import sys

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.data import Demonstrations, Episode
from eutree.distillation import (
    LEARNERS,
    DistillationSettings,
    Labelled,
    actions_on,
    fit,
    stakes_of,
    weights,
)
from eutree.envs.experts import late
from eutree.errors import InvalidArgumentError, MissingExtraError, UnknownNameError
from eutree.interaction import DerivedObservation, GuardedEnv
from eutree.policies import LeafStatistics
from eutree.schema import Feature, Schema
from eutree.training.teaching import AskedTeacher
from tests.naive_distillation import naive_dagger

RIGHT, JUMP, CLIMB = 1, 0, 2


class Cellar(gymnasium.Env):
    """A walk from 0; who jumps falls to -5, from where only climbing earns 1 and ends the task."""

    observation_space = gymnasium.spaces.Box(-10, 10, (1,), np.float64)
    action_space = gymnasium.spaces.Discrete(3)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.steps = 0.0, 0
        return np.array([self.place]), {}

    def step(self, action):
        self.steps += 1
        climbs = action == CLIMB and self.place < 0
        self.place = -5.0 if action == JUMP else min(self.place + (action == RIGHT), 9.0)
        return np.array([self.place]), float(climbs), climbs, self.steps >= 10, {}


class Teacher:
    """Walks to 2, jumps, climbs; says what a wrong action costs if it is to."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        x = np.asarray(observation)[..., 0]
        return np.where(x < 0, CLIMB, np.where(x >= 2, JUMP, RIGHT)), state


def shown_until_the_jump(n=5):
    """Demonstrations that stop where the teacher has jumped: nothing of the cellar."""
    episode = Episode(
        observations=[[0.0], [1.0], [2.0], [-5.0]],
        actions=[RIGHT, RIGHT, JUMP],
        rewards=[0.0, 0.0, 0.0],
        terminated=False,
        truncated=True,
    )
    schema = eutree.record(Cellar(), Teacher(), episodes=1).schema
    return Demonstrations((episode,) * n, schema)


def distilled(teacher, env, *, seed=0, demonstrations=None, action_values=None, **settings):
    return eutree.distill(
        teacher,
        env,
        DistillationSettings(**settings),
        demonstrations=demonstrations,
        action_values=action_values,
        seed=seed,
    )


def test_dagger_asks_where_the_tree_comes_to_and_cloning_does_not():
    shown, budget = shown_until_the_jump(), {"episodes": 2, "validation_episodes": 2}
    clone, report = distilled(Teacher(), Cellar(), demonstrations=shown, method="cloning", **budget)
    assert (report.mean_return, report.n_leaves, len(report.rounds)) == (0.0, 2, 1)
    assert (report.labels, report.validation_steps, report.environment_steps) == (15, 20, 35)
    tree, report = distilled(Teacher(), Cellar(), demonstrations=shown, iterations=2, **budget)
    assert [made.mean_return for made in report.rounds] == [0.0, 1.0]
    assert [made.n_transitions for made in report.rounds] == [15, 35]
    assert (report.best, report.n_leaves, report.rounds[1].agreement) == (1, 3, 1.0)
    # 15 shown; the clone twice 10 in validation, twice 10 asked; then twice 4 in validation.
    assert (report.labels, report.environment_steps, report.validation_steps) == (35, 63, 28)
    assert report.teacher_steps is None  # it does not say
    assert [int(tree.predict([x])[0]) for x in (-5.0, 0.0, 2.0)] == [CLIMB, RIGHT, JUMP]
    assert int(clone.predict([-5.0])[0]) != CLIMB


def test_the_best_round_wins_and_the_smaller_of_equals():
    teacher, env = eutree.experts.balance, gymnasium.make("CartPole-v1")
    tree, report = distilled(
        teacher, env, max_leaves=4, iterations=3, episodes=2, validation_episodes=5, seed=3
    )
    returns = [made.mean_return for made in report.rounds]
    assert report.mean_return == max(returns)
    ties = [m.n_leaves for m in report.rounds if m.mean_return == max(returns)]
    assert tree.n_leaves == report.n_leaves == min(ties) <= 4
    assert report.return_interval.low <= report.mean_return <= report.return_interval.high


def test_aggregation_is_that_of_the_naive_twin():
    env = gymnasium.make("CartPole-v1")
    budget = {"iterations": 3, "episodes": 3, "validation_episodes": 4, "seed": 5}
    sizes, returns = naive_dagger(
        lambda o: int(float(o[2]) + 0.2 * float(o[3]) > 0.0), env, **budget
    )
    _, report = distilled(eutree.experts.balance, env, max_leaves=None, **budget)
    assert [made.n_transitions for made in report.rounds] == sizes
    assert [made.mean_return for made in report.rounds] == returns


@pytest.mark.parametrize("learner", LEARNERS)
def test_the_same_seed_gives_the_same_bytes(learner):
    env = gymnasium.make("MountainCar-v0")
    budget = {"learner": learner, "max_leaves": 3, "iterations": 2, "episodes": 1}
    first, again = (
        distilled(eutree.experts.push_along, env, validation_episodes=2, seed=7, **budget)
        for _ in range(2)
    )
    assert first[0].to_bytes() == again[0].to_bytes()
    assert first[1] == again[1]


SCHEMA = Schema((Feature("x"),), ("left", "right"))


@pytest.mark.parametrize("learner", LEARNERS)
def test_a_leaf_decides_by_weight_not_by_number(learner):
    rows, actions = np.arange(4.0)[:, np.newaxis], np.array([1, 1, 1, 0])
    for last, chosen in ((1.0, 1), (10.0, 0)):
        data = Labelled(rows, actions, np.array([1.0, 1.0, 1.0, last]))
        assert fit(learner, data, SCHEMA, None, 1).actions.tolist() == [chosen]


@pytest.mark.parametrize("learner", LEARNERS)
def test_no_more_leaves_than_allowed_and_the_costliest_errors_avoided(learner):
    rows = np.arange(40.0)[:, np.newaxis]
    actions = (rows[:, 0] // 10 % 2).astype(np.int64)  # 0, 1, 0, 1 in blocks of 10
    data = Labelled(rows, actions, np.where(rows[:, 0] >= 30, 5.0, 1.0))
    sizes = [fit(learner, data, SCHEMA, None, n).n_leaves for n in (1, 2, 3, 4, None)]
    assert sizes == sorted(sizes)
    assert all(size <= n for size, n in zip(sizes, (1, 2, 3, 4, 4), strict=True))
    two = fit(learner, data, SCHEMA, None, 2)
    assert int(two.predict([35.0])[0]) == 1
    assert np.array_equal(fit(learner, data, SCHEMA, None, None).predict(rows)[0], actions)


def test_stakes_are_what_the_worst_action_costs():
    rows = np.array([[0.0], [1.0], [2.0]])
    teacher = Teacher()
    assert stakes_of(teacher, None, 3) is None
    given = stakes_of(teacher, lambda o: np.stack([o[:, 0], 3 - o[:, 0], 0 * o[:, 0]], axis=1), 3)
    assert given(rows).tolist() == [3.0, 2.0, 2.0]
    teacher.action_values = lambda o: np.tile([1.0, 5.0, 2.0], (len(o), 1))
    assert stakes_of(teacher, None, 3)(rows).tolist() == [4.0, 4.0, 4.0]
    assert weights(np.array([1.0, 3.0])).tolist() == [0.5, 1.5]
    assert weights(np.zeros(3)).tolist() == [1.0, 1.0, 1.0]
    for wrong, got in (
        (lambda o: np.zeros((len(o), 2)), r"shape \(3, 2\)"),
        (lambda o: np.full((len(o), 3), np.nan), "one that is not finite"),
    ):
        words = rf"action_values .* shape \(3, 3\), got {got}"
        with pytest.raises(InvalidArgumentError, match=words):
            stakes_of(teacher, wrong, 3)(rows)
        own = AskedTeacher(eutree.Teacher(teacher, 0, wrong), GuardedEnv(Cellar()))
        with pytest.raises(InvalidArgumentError, match=words):
            own.action_values(rows)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.ones((3, 3)), r"\[N, d\] to values \[N, A\], must be a function, got array"),
        (lambda o: o[:, 3], r"of shape \(\d+, 1\), .* numbers of shape \(\d+, 3\), got IndexError"),
        (lambda o: o[:, 1:], r"numbers of shape \(\d+, 3\), got shape"),
        (lambda o: [["a"] * 3] * len(o), "got ValueError: could not convert"),
    ],
)
def test_values_that_are_none_name_their_argument(values, words):
    """What they raised came through, a fault of eutree on the command line."""
    budget = {"iterations": 1, "episodes": 1, "validation_episodes": 2, "method": "viper"}
    with pytest.raises(InvalidArgumentError, match=f"^action_values.*{words}"):
        distilled(Teacher(), Cellar(), action_values=values, **budget)
    teacher = Teacher()
    teacher.action_values = values
    with pytest.raises(InvalidArgumentError, match=f"^action_values of Teacher.*{words}"):
        distilled(teacher, Cellar(), **budget)
    env, zeros = GuardedEnv(Cellar()), np.zeros((2, 1))
    with pytest.raises(InvalidArgumentError, match=f"^action_values of Teacher.*{words}"):
        AskedTeacher(eutree.Teacher(teacher, 0), env).action_values(zeros)


def test_values_see_the_measured_features_first():
    """Those of the page on distillation: of the first columns, or of a code as one number."""
    seen = []

    def values(observations):
        seen.append(observations.shape[1])
        assert (observations[:, 1] == observations[:, 0] / 2).all()
        return observations[:, :1] * [0.0, 1.0, 2.0]

    env = DerivedObservation(Cellar(), ["half = x0 / 2"])
    budget = {"iterations": 1, "episodes": 1, "validation_episodes": 2, "method": "viper"}
    assert distilled(Teacher(), env, action_values=values, **budget)[1].weighted
    assert seen == [2]


def test_a_tree_teacher_has_the_stakes_of_its_leaves():
    tree = eutree.DecisionTree.single_leaf(1).split(0, 0, 0.5)
    values = np.array([[1.0, 4.0], [2.0, np.nan]])
    statistics = LeafStatistics(np.ones((2, 2)), values, np.zeros((2, 2)))
    teacher = eutree.TreePolicy(tree, np.array([1, 0]), SCHEMA, leaves=statistics)
    # The second leaf's other action was never tried: it counts like the mean leaf.
    assert stakes_of(teacher, None, 2)(np.array([[0.0], [1.0]])).tolist() == [3.0, 3.0]


def test_viper_weights_and_says_so():
    teacher = Teacher()
    budget = {"iterations": 2, "episodes": 2, "validation_episodes": 2, "method": "viper"}
    assert not distilled(teacher, Cellar(), **budget)[1].weighted
    # Nothing is at stake but at the start: one leaf of its action is all that a tree needs.
    tree, report = distilled(
        teacher,
        Cellar(),
        action_values=lambda o: np.where(o == 0.0, [0.0, 1.0, 0.0], 0.0),
        max_leaves=None,
        **budget,
    )
    assert report.weighted
    assert tree.actions.tolist() == [RIGHT]


def test_a_teacher_with_a_memory_is_asked_in_order():
    env = gymnasium.make("MountainCar-v0")
    teacher = late(eutree.experts.push_along, 3)(env)
    demonstrations = eutree.record(env, teacher, episodes=1, seed=2)
    episode = demonstrations.episodes[0]
    assert np.array_equal(actions_on(teacher, episode, GuardedEnv(env)), episode.actions)


def test_what_is_refused():
    env = Cellar()
    cases = {
        "method": ({"method": "daggers"}, UnknownNameError | InvalidArgumentError),
        "learner": ({"learner": "id3"}, UnknownNameError | InvalidArgumentError),
        "iterations": ({"iterations": 0}, InvalidArgumentError),
        "episodes": ({"episodes": 0}, InvalidArgumentError),
        "validation_episodes": ({"validation_episodes": 1}, InvalidArgumentError),
        "max_leaves": ({"max_leaves": 0}, InvalidArgumentError),
    }
    for name, (options, kind) in cases.items():
        with pytest.raises(Exception, match=name) as caught:
            distilled(Teacher(), env, **options)
        assert isinstance(caught.value, kind)
    other = eutree.record(
        gymnasium.make("MountainCar-v0"), eutree.experts.push_along, episodes=1, seed=0
    )
    with pytest.raises(
        InvalidArgumentError, match="demonstrations must have the features and actions of"
    ):
        eutree.distill(Teacher(), env, demonstrations=other)
    nothing = Demonstrations((), shown_until_the_jump().schema)
    with pytest.raises(InvalidArgumentError, match="at least one transition"):
        eutree.distill(Teacher(), env, demonstrations=nothing)


def test_cart_without_scikit_learn_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.tree", None)
    with pytest.raises(MissingExtraError, match=r"eutree\[sklearn\]"):
        distilled(Teacher(), Cellar(), learner="cart", episodes=1, validation_episodes=2)


def test_cart_decides_as_scikit_learn_does_one_step_of_float32_beside_its_thresholds():
    """Its thresholds were taken over as they are, so observations beside them changed sides."""
    from sklearn.tree import DecisionTreeClassifier

    generator = np.random.default_rng(5)
    rows = generator.normal(size=(300, 2)) + 1000.0  # float32 is coarse here
    labels = (rows[:, 0] > rows[:, 1]).astype(np.int64)
    data = Labelled(rows, labels, np.ones(300))
    grown = DecisionTreeClassifier(random_state=0).fit(rows, labels, sample_weight=data.weights)
    policy = fit("cart", data, Schema.anonymous(2, 2), None, None)
    cuts = grown.tree_.threshold[grown.tree_.feature >= 0]
    near = np.array([cuts, np.nextafter(cuts, -np.inf), np.nextafter(cuts, np.inf), cuts + 2e-5])
    grid = np.array([(one, other) for one in near.ravel() for other in near.ravel()[:40]])
    np.testing.assert_array_equal(policy.predict(grid)[0], grown.predict(grid))


@pytest.mark.parametrize("learner", LEARNERS)
def test_what_a_tree_did_before_a_person_took_over_is_not_copied(learner):
    """The weights of driven episodes were those of any other."""
    actions, by_hand = [CLIMB] * 2 + [RIGHT, JUMP], [False] * 2 + [True] * 2
    driven = Episode(
        observations=[[0.0], [0.0], [0.0], [2.0], [-5.0]],
        actions=actions,
        rewards=[0.0] * 4,
        terminated=False,
        truncated=True,
        steps={"by_hand": np.array(by_hand)},
    )
    assert driven.weights.tolist() == [0.0] * 2 + [1.0] * 2
    schema = shown_until_the_jump().schema
    tree, _ = distilled(
        Teacher(), Cellar(), demonstrations=Demonstrations((driven,) * 5, schema),
        method="cloning", learner=learner, validation_episodes=2,
    )  # fmt: skip
    assert CLIMB not in tree.actions
    assert tree.predict(np.array([0.0]))[0] == RIGHT
