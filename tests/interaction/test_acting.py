"""A policy that is not ours gets the environment's own observation, by SB3's keywords."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree
from eutree.distillation import DistillationSettings
from eutree.envs import experts
from eutree.errors import InvalidArgumentError
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.acting import Actor, as_policy
from eutree.interaction.spaces import decoder, encoder
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.training.teaching import AskedTeacher
from eutree.trees import DecisionTree

SPACES = {
    "discrete": spaces.Discrete(5, start=-2),
    "box": spaces.Box(-1, 1, (3,), np.float32),
    "integers": spaces.Box(-9, 9, (2,), np.int16),
    "several": spaces.MultiDiscrete([3, 2]),
    "bits": spaces.MultiBinary(3),
    "tuple": spaces.Tuple([spaces.Discrete(3), spaces.Box(0, 1, (2,), np.float32)]),
    "dict": spaces.Dict(
        {
            "speed": spaces.Box(0, 9, (1,), np.float64),
            "at": spaces.Dict({"floor": spaces.Discrete(4), "doors": spaces.MultiBinary(2)}),
        }
    ),
}


class Wander(gymnasium.Env[Any, Any]):
    """Five steps of random elements of any space."""

    action_space = spaces.Discrete(2)

    def __init__(self, space: spaces.Space[Any]) -> None:
        self.observation_space = space
        self.shown: list[Any] = []

    def _show(self) -> Any:
        self.shown.append(self.observation_space.sample())
        return self.shown[-1]

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.observation_space.seed(seed)
        self.count = 0
        return self._show(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.count += 1
        return self._show(), 1.0, self.count == 5, False, {}


class Model:
    """Stands for a model of SB3: takes its keywords only, and its own observation space only."""

    def __init__(self, space: spaces.Space[Any]) -> None:
        self.space = space
        self.seen: list[Any] = []

    def predict(
        self, observation: Any, *, state: Any, episode_start: Any, deterministic: bool
    ) -> tuple[Any, Any]:
        assert self.space.contains(observation), observation
        self.seen.append(observation)
        number = 0 if episode_start else state + 1
        assert (state is None) == bool(episode_start)
        return np.array(number % 2), number


def same(one: Any, other: Any) -> bool:
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return all(same(a, b) for a, b in zip(one, other, strict=True))
    one, other = np.asarray(one), np.asarray(other)
    return one.dtype == other.dtype and np.array_equal(one, other)


@pytest.mark.parametrize("name", SPACES)
def test_decoding_is_the_inverse_of_encoding(name: str) -> None:
    space = SPACES[name]
    space.seed(5)
    for _ in range(30):
        sample = space.sample()
        assert same(decoder(space)(encoder(space)(sample)), sample)


@pytest.mark.parametrize("name", SPACES)
def test_record_evaluate_and_distill_give_the_environments_own_observation(name: str) -> None:
    """An SB3 model on a Discrete or Dict space crashed all three: it got the flat vector."""
    env, model = Wander(SPACES[name]), Model(SPACES[name])
    demonstrations = eutree.record(env, model, episodes=2, seed=1)
    decisions = [shown for k, shown in enumerate(env.shown) if k % 6 != 5]  # not the last of each
    assert len(model.seen) == 10
    assert all(same(a, b) for a, b in zip(model.seen, decisions, strict=True))
    assert demonstrations.actions.tolist() == [0, 1, 0, 1, 0] * 2
    assert eutree.evaluate(model, env, episodes=2).mean_return == 5.0
    tree, _ = eutree.distill(
        model, env, DistillationSettings(iterations=2, episodes=1, validation_episodes=2)
    )
    assert eutree.evaluate(tree, env, episodes=2).mean_return == 5.0


class Positions:
    """A tree policy's twin without a flag: sees what a user's own policy sees."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic=True
    ) -> tuple[Any, Any]:
        assert set(observation) == {"at", "speed"}
        return 0, None


def test_trees_rules_and_what_wraps_them_get_features() -> None:
    env = Wander(SPACES["dict"])
    features = GuardedEnv(env).schema.n_features
    tree = TreePolicy(DecisionTree.single_leaf(features), [1], Schema.anonymous(features, 2))
    rule = experts.RulePolicy(lambda o: (o[..., 0] > 5.0).astype(int))
    for policy in (tree, rule):
        for expert in (policy, experts.late(lambda _, p=policy: p, 1)(env)):
            assert eutree.record(env, expert, episodes=1).n_transitions == 5
    clumsy = experts.careless(lambda _: Positions(), 0.5)(env)
    assert eutree.record(env, clumsy, episodes=1).n_transitions == 5


@pytest.mark.parametrize("answer", [0.5, [0, 1], None, "left", np.nan])
def test_what_is_no_action_is_refused(answer: Any) -> None:
    class Wrong:
        def predict(self, observation: Any, **_: Any) -> tuple[Any, Any]:
            return answer, None

    env = GuardedEnv(Wander(SPACES["discrete"]))
    with pytest.raises(InvalidArgumentError, match=r"answer of policy\.predict must be one action"):
        Actor(Wrong(), env).act(env.reset(0))


class OfTwo:
    def __init__(self, one, two): ...

    def predict(self, observation):
        return 0


class Bare:
    """A controller whose `predict` takes the observation alone, and returns the action alone."""

    def predict(self, observation: Any) -> Any:
        return int(observation[0] > 0)


class Keeps:
    """One that takes a state and nothing else, and counts its steps in it."""

    def predict(self, observation: Any, state: Any = None) -> tuple[Any, Any]:
        return int((state or 0) % 2), (state or 0) + 1


def leaning(observation: Any) -> Any:
    return int(observation[0] > 0)


@pytest.mark.parametrize(
    "controller",
    [Bare(), leaning, lambda o: (leaning(o), None), lambda o: np.array([leaning(o)]),
     lambda env: Bare(), lambda _: 1],
)  # fmt: skip
def test_a_function_or_a_plain_predict_will_do(controller: Any) -> None:
    """`evaluate(lambda o: 1, env)` and a `predict` without `state` ended in raw exceptions."""
    env = Wander(SPACES["box"])
    demonstrations = eutree.record(env, controller, episodes=2, seed=1)
    asked = as_policy(controller, env)
    wanted = [Actor(asked, GuardedEnv(env)).act(row) for row in demonstrations.observations]
    assert demonstrations.actions.tolist() == wanted
    assert eutree.evaluate(controller, env, episodes=2).mean_return == 5.0
    assert eutree.play(controller, env).undiscounted_return == 5.0
    short = DistillationSettings(iterations=2, episodes=1, validation_episodes=2)
    eutree.distill(controller, env, short)
    teacher = AskedTeacher(eutree.Teacher(controller, steps=0), GuardedEnv(env))
    assert teacher.predict(demonstrations.observations)[0].tolist() == wanted


def test_a_state_is_kept_for_who_takes_one() -> None:
    assert eutree.play(Keeps(), Wander(SPACES["box"])).actions.tolist() == [0, 1, 0, 1, 0]


def test_a_batch_is_not_for_a_function_of_one_observation() -> None:
    """With as many copies as numbers, `o[0] > 0` of a batch looks like a batch of answers."""
    env = gymnasium.make("eutree/Evasion2-v0")
    size = GuardedEnv(env).schema.n_features
    returns = [
        eutree.evaluate(policy, env, episodes=size).returns.tolist()
        for policy in (lambda o: np.asarray(o[0] > 0).astype(int), Bare())
    ]
    assert returns[0] == returns[1]


def test_a_single_answer_is_no_batch_for_who_takes_a_state() -> None:
    """Its `predict` takes all arguments of a batch; three episodes of three numbers were one."""

    class Full:
        def predict(self, observation: Any, state: Any = None, *_: Any, **__: Any) -> Any:
            return np.asarray(observation[0] > 5).astype(int), state

    env = gymnasium.make("eutree/Evasion2-v0")
    alone = [eutree.play(Full(), env, seed=episode_seed(0, k)) for k in range(3)]
    returns = eutree.evaluate(Full(), env, episodes=3, seed=0).returns
    assert returns.tolist() == [one.undiscounted_return for one in alone]


def test_a_function_may_ask_a_tree() -> None:
    """A tree that is given an environment says what is wrong: that ended the search for a form."""
    tree = eutree.zoo.load("CartPole-v1:4")
    env = gymnasium.make("CartPole-v1")
    both = [eutree.play(one, env, seed=3) for one in (tree, lambda o: tree.predict(o)[0])]
    assert both[0].actions.tolist() == both[1].actions.tolist()
    with pytest.raises(InvalidArgumentError, match="Evasion"):
        eutree.play(experts.wait_at_crossing, env)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda env: eutree.distill(env, Bare()), "env must be a gymnasium.Env, an id"),
        (lambda env: eutree.record(Bare(), env), "env must be a gymnasium.Env, an id"),
        (lambda env: eutree.evaluate(env, Bare()), "environment must be a gymnasium.Env, an id"),
        (lambda env: eutree.play(Bare(), env, seed="x"), "seed must be an integer"),
        (lambda env: eutree.play(env, Bare()), "env must be a gymnasium.Env, an id"),
        (lambda env: eutree.learn(Bare()), "env must be a gymnasium.Env, an id"),
        (lambda env: eutree.learn_runs(env, runs=1, out=Path("none")), "environment must be an id"),
        (lambda env: eutree.fit(env, Bare()), "demonstrations must be Demonstrations"),
        (lambda env: eutree.play(OfTwo, env), "of an environment or of nothing: OfTwo raised"),
        (lambda env: eutree.evaluate(env, env), "controller must have a method predict"),
        (lambda env: eutree.evaluate(3, env), "controller must have a method predict"),
        (lambda env: eutree.evaluate("gate", env), "controller must have a method predict"),
        (lambda env: eutree.evaluate(lambda o: o.speed, env), "for an observation AttributeError"),
        (lambda env: eutree.evaluate(lambda o, p: 1, env), "for an observation TypeError"),
        (lambda env: eutree.evaluate(lambda o: None, env), "<lambda>.env. must have a method"),
    ],
)
def test_what_cannot_act_is_one_clear_line(call: Any, message: str) -> None:
    with pytest.raises(InvalidArgumentError, match=message):
        call(Wander(SPACES["box"]))


class Breaks:
    def predict(self, observation: Any) -> int:
        raise KeyError("boom")


def breaks(observation: Any) -> int:
    """Answer an environment, so that it is taken for a function of an observation."""
    return 0 if isinstance(observation, gymnasium.Env) else observation["boom"]


@pytest.mark.parametrize("controller", [Breaks(), Breaks, breaks], ids=["one", "class", "function"])
@pytest.mark.parametrize("act", [eutree.evaluate, eutree.distill, eutree.record])
def test_what_a_controller_raises_names_it(controller: Any, act: Any) -> None:
    """On the command line it was an internal error of eutree."""
    who = (controller, "CartPole-v1") if act is not eutree.record else ("CartPole-v1", controller)
    with pytest.raises((KeyError, IndexError)) as caught:
        act(*who, **({} if act is eutree.distill else {"episodes": 2}))
    name = "breaks" if controller is breaks else "Breaks"
    assert caught.value.__notes__ == [f"raised in the controller {__name__}:{name}"]


def test_a_mistake_inside_a_function_that_acts_is_its_own() -> None:
    """After a first answer the function is known to take observations: its errors come through."""
    answers = iter([0, 1])
    with pytest.raises(StopIteration):
        eutree.play(lambda o: next(answers) if o[0] > -2 else 0, Wander(SPACES["box"]))


def test_an_environment_may_be_named_by_its_id(tmp_path: Any) -> None:
    """`learn` and `record` refused an id where `evaluate` took one."""
    spec = eutree.EnvironmentSpec("CartPole-v1", {"max_episode_steps": 9})
    open_: set[int] = set()
    gymnasium.register("tests/Closing-v0", lambda: Closing(open_))
    try:
        demos = eutree.record("tests/Closing-v0", Bare(), episodes=2)
        eutree.play(Bare(), "tests/Closing-v0")
        learned = eutree.learn(
            "tests/Closing-v0", demonstrations=demos, method="paper", episodes=1,
            evaluation_episodes=2, out=tmp_path / "run",
        )  # fmt: skip
    finally:
        gymnasium.registry.pop("tests/Closing-v0")
    assert not open_
    assert learned.policy.environment == demos.environment
    assert len(eutree.play(lambda o: int(o[2] > 0), spec, seed=0)) <= 9
    assert eutree.record(spec, lambda o: int(o[2] > 0), episodes=1).environment == spec


class Closing(Wander):
    """Is in a set while it is open."""

    def __init__(self, open_: set[int]) -> None:
        super().__init__(SPACES["box"])
        self.open = open_
        self.open.add(id(self))

    def close(self) -> None:
        self.open.discard(id(self))
