"""Every method from every start on three tasks, and at the edge: it runs, or says why not.

What is run is tiny: the figures are those of ``eutree reproduce framework``.
"""

import re
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import eutree
from eutree.data import Demonstrations
from eutree.envs.experts import experts_for
from eutree.errors import InvalidArgumentError
from eutree.learners import METHODS
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.learners.planning import PlanningMethod
from eutree.learners.starts import STARTS
from eutree.neural import DoubleDQNSettings
from eutree.policy_search.planner import Planner
from eutree.world_model.ensemble import EnsembleSettings
from eutree_lab.vrd.method import VariableResolutionMethod

TASKS = ("eutree/Evasion2-v0", "MountainCar-v0", "CartPole-v1")
SMALL = {  # methods whose default choices are too much for a test
    "planning": PlanningMethod(
        gathering_episodes=1, planner=Planner(n_episodes=8, n_explorer_episodes=8, n_steps=100)
    ),
    "vrd": VariableResolutionMethod(gathering_episodes=1, first_boxes=4, refinements=1),
    "distilled-dqn": DistilledDQN(
        max_leaves=4,
        demonstration_updates=5,
        teacher=DoubleDQNSettings(hidden=8, batch=8),
        world_model=EnsembleSettings(members=2, hidden=8, batch=8, updates=10, more_updates=5),
    ),
}
NEEDS_DEMONSTRATIONS = "it starts from demos or tree+demos, got "
NEEDS_GOAL = "it needs a goal: a demonstration that reached it"


def small(name: str) -> Any:
    """Return a method that updates after every episode, cheaply."""
    return SMALL.get(name) or METHODS[name](gathering_episodes=1)


def refusal(name: str, start: str, task: str) -> str:
    """Return what the method says of a start that it cannot take, written down by hand; or ""."""
    shows = start in ("demos", "tree+demos")
    if name == "distilled-dqn" and not shows:
        return NEEDS_DEMONSTRATIONS + start
    if name == "parti-game" and (not shows or task == "CartPole-v1"):
        return NEEDS_GOAL
    return ""


@pytest.fixture(scope="module")
def shown() -> dict[str, Demonstrations]:
    """Return two demonstrations of each task."""
    return {
        task: eutree.record(
            gymnasium.make(task), next(iter(experts_for(task).values())), episodes=2, seed=3
        )
        for task in TASKS
    }


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("name", METHODS)
def test_every_method_from_every_start_learns_every_task_or_refuses(name, start, task, shown):
    env = gymnasium.make(task)
    options: dict[str, Any] = {
        "demonstrations": shown[task],
        "method": small(name),
        "start": start,
        "episodes": 2,
        "evaluate_every": 2,
        "evaluation_episodes": 1,
    }
    if start != "tree+demos":  # what follows learning does not know how it began
        options["judge_episodes"] = 0
    expected = refusal(name, start, task)
    if expected:
        with pytest.raises(InvalidArgumentError) as caught:
            eutree.learn(env, **options)
        said = str(caught.value)
        assert said.startswith(f"method {name!r} does not fit this task: {expected}")
        return
    result = eutree.learn(env, **options)
    assert result.start == start
    assert result.episodes == 2
    assert [point.episode for point in result.curve] == [0, 2]
    played = eutree.evaluate(result.policy, env, episodes=1, seed=1)
    assert np.isfinite(played.mean_return)


class Line(gymnasium.Env[Any, Any]):
    """Walk along a line of some features to its end; the first action walks, others stay.

    Args:
        n_features: Features; all are the position.
        n_actions: Actions.
        bound: Bound of each feature, both ways.
    """

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(self, n_features: int = 2, n_actions: int = 2, bound: float = 9.0) -> None:
        self.observation_space = spaces.Box(-bound, bound, (n_features,), dtype=np.float64)
        self.action_space = spaces.Discrete(n_actions)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.at, self.left = float(self.np_random.random()), 20
        return self._observation(), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.at += float(action == 0)
        self.left -= 1
        done = self.at >= 5.0
        cut = self.left == 0 and not done
        return self._observation(), -1.0, done, cut, {"is_success": done}

    def _observation(self) -> Any:
        return np.full(self.observation_space.shape, self.at)


class Walker:
    """Walks, except that it stays once in a while."""

    def __init__(self, n_actions: int) -> None:
        self._n_actions = n_actions

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        at = np.atleast_2d(observation)[:, 0]
        stays = (self._n_actions > 1) & (at % 3.0 < 0.2)
        actions = np.where(stays, 1, 0)
        return (actions if np.ndim(observation) > 1 else int(actions[0])), state


def learned_on(line: dict[str, Any], name: str, **options: Any) -> Any:
    """Learn on a line from the tree and its demonstrations, two episodes."""
    env = Line(**line)
    given: dict[str, Any] = {
        "demonstrations": eutree.record(env, Walker(int(env.action_space.n)), episodes=4, seed=0),
        "method": small(name),
        "start": "tree+demos",
        "episodes": 2,
        "evaluate_every": 2,
        "evaluation_episodes": 1,
    }
    return eutree.learn(env, **(given | options))


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize(
    "line",
    [{"bound": np.inf}, {"n_actions": 1}, {"n_features": 1}],
    ids=["infinite box", "one action", "one feature"],
)
def test_every_method_learns_at_the_edge(line, name):
    result = learned_on(line, name)
    assert result.episodes == 2
    assert np.isfinite(result.policy.tree.threshold[result.policy.tree.feature >= 0]).all()
    assert (
        0 <= result.policy.actions.min() <= result.policy.actions.max() < line.get("n_actions", 2)
    )


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("start", ["tree", "tree+demos", "demos"])
def test_no_method_takes_demonstrations_without_an_episode(start, name):
    env = Line()
    shown = eutree.record(env, Walker(2), episodes=1, seed=0)
    with pytest.raises(InvalidArgumentError, match=r"demonstrations.* at least one"):
        learned_on({}, name, demonstrations=replace(shown, episodes=()), start=start)


@pytest.mark.parametrize("start", ["tree", "tree+demos", "demos"])
def test_a_start_without_the_demonstrations_it_needs_is_refused(start):
    with pytest.raises(InvalidArgumentError, match=re.escape(f"start {start!r} needs demo")):
        learned_on({}, "u-tree", demonstrations=None, start=start)


def test_random_cuts_in_an_infinite_box_need_demonstrations():
    with pytest.raises(InvalidArgumentError, match="'random-tree' needs demonstrations where a"):
        learned_on({"bound": np.inf}, "u-tree", demonstrations=None, start="random-tree")
