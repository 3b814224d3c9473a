"""Experts and rivals of the user's own, by name: ``--expert``, ``--teacher``, ``--against``."""

import json
import textwrap

import numpy as np
import pytest

from eutree.data import Demonstrations
from eutree.errors import InvalidArgumentError
from eutree.evaluation import against, evaluate
from eutree.interaction.acting import as_policy

PLAN = """
    import numpy as np

    class Fall:
        def predict(self, observation):
            return int(observation[2] + observation[3] > 0)

    class Balance:
        def __init__(self, env):
            self.n = env.action_space.n

        def predict(self, observation, state=None, **more):
            return np.int64(observation[2] > 0) % self.n, state

    def push(observation):
        return 1

    made = Fall()
    number = 3
"""


@pytest.fixture
def plan(tmp_path):
    """Return a name that no other test has imported, of a module with controllers."""
    name = "plan_" + tmp_path.name.replace("-", "_")
    (tmp_path / f"{name}.py").write_text(textwrap.dedent(PLAN))
    return name


@pytest.mark.parametrize("name", ["Fall", "Balance", "push", "made"])
def test_an_expert_of_ones_own_is_recorded(eutree, plan, name):
    line = ["record", "CartPole-v1", "--expert", f"{plan}:{name}", "--episodes", "2"]
    answer = eutree(*line, "--out", "demos")
    assert answer.code == 0, answer.err
    demonstrations = Demonstrations.load("demos")
    observations = np.concatenate([one.observations[:-1] for one in demonstrations])
    actions = np.concatenate([one.actions for one in demonstrations])
    rule = {"push": np.ones(len(actions)), "Balance": observations[:, 2] > 0}
    fall = observations[:, 2] + observations[:, 3] > 0
    assert (actions == rule.get(name, fall)).all()


def test_a_careless_one_errs_now_and_then(eutree, plan):
    line = ["record", "CartPole-v1", "--expert", f"{plan}.py:push", "--careless", "0.5"]
    answer = eutree(*line, "--episodes", "5", "--out", "demos")
    assert answer.code == 0, answer.err
    actions = np.concatenate([one.actions for one in Demonstrations.load("demos")])
    assert 0 < (actions == 0).mean() < 0.5
    assert Demonstrations.load("demos").expert == "careless(push, 0.5)"


def test_it_teaches_a_tree(eutree, plan):
    line = ["distill", "CartPole-v1", "--expert", f"{plan}:Fall", "--max-leaves", "4"]
    line += ["--iterations", "2", "--episodes", "3", "--validation-episodes", "5"]
    answer = eutree(*line, "--out", "tree.json", "--json")
    assert answer.code == 0, answer.err
    assert answer.json["mean_return"] > 100


@pytest.mark.filterwarnings("ignore:.*Using the latest versioned environment:UserWarning")
def test_a_task_without_its_version_has_the_experts_of_the_latest(eutree):
    """None were known, though Gymnasium made the latest."""
    line = ("record", "eutree/Evasion2", "--expert", "gate", "--episodes", "1", "--json")
    answer = eutree(*line, "--out", "demos")
    assert answer.json["episodes"] == 1, answer.err
    assert Demonstrations.load("demos").environment.id == "eutree/Evasion2-v0"


def test_it_teaches_a_learner(eutree, plan, tmp_path):
    eutree("record", "CartPole-v1", "--expert", "fall", "--episodes", "3", "--out", "demos")
    line = ["learn", "--demos", "demos", "--method", "distilled-dqn", "--teacher", f"{plan}:Fall"]
    answer = eutree(*line, "--episodes", "10", "--out", "run", "--json")
    assert answer.code == 0, answer.err
    assert answer.json["environment_steps"]["declared"] == 0
    kept = json.loads((tmp_path / "run" / "command.json").read_text())
    assert "teacher" not in kept["arguments"], "no file may choose what is imported"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("{plan}:Nothing", "has no 'Nothing'"),
        ("{plan}.py", "name what decides in it"),
        ("no_such_module_of_mine:Rule", "cannot import"),
        ("missing.py:Rule", "there is no file missing.py"),
        ("{plan}:number", "a controller must have a method predict"),
        ("nobody", "MODULE:NAME"),
        ("1 2:Rule", "must be MODULE:NAME"),
    ],
)
def test_a_name_that_means_nothing_is_said(eutree, plan, name, said):
    line = ["record", "CartPole-v1", "--expert", name.format(plan=plan), "--out", "demos"]
    answer = eutree(*line)
    assert answer.code == 2
    assert said in answer.err
    assert answer.err.count("\n") == 1


def test_a_policy_meets_another_in_the_same_episodes(eutree, plan):
    line = ["distill", "CartPole-v1", "--expert", "fall", "--max-leaves", "4", "--episodes", "2"]
    eutree(*line, "--iterations", "1", "--validation-episodes", "3", "--out", "tree.json")
    line = ["evaluate", "tree.json", "CartPole-v1", "--episodes", "30"]
    answer = eutree(*line, "--against", f"{plan}:push", "--json")
    assert answer.code == 0, answer.err
    found = answer.json["against"]
    assert found["name"] == f"{plan}:push"
    assert found["episodes_compared"] == found["better"] == 30
    assert found["mean_return"] < 12
    assert found["return"] == pytest.approx(answer.json["mean_return"] - found["mean_return"])
    low, high = found["return_interval"]
    assert 0 < low < found["return"] < high
    assert found["condition"] == "", "CartPole's returns are known: 1 to 500"
    words = eutree(*line, "--against", "tree.json").out
    assert "+0.00" in words
    assert "better in 0 of 30 episodes, worse in 0" in words


def test_learning_and_compressing_end_with_the_rival(eutree, plan, demonstrations):
    rival = "gate"
    line = ["learn", "--demos", demonstrations, "--episodes", "5", "--out", "run", "--json"]
    answer = eutree(*line, "--against", rival)
    assert answer.code == 0, answer.err
    assert answer.json["against"]["episodes_compared"] == 100
    low, high = answer.json["against"]["success_interval"]
    assert -1 <= low <= answer.json["against"]["success"] <= high <= 1
    line = ["compress", "run", "--mode", "merge", "--episodes", "20", "--out", "small.json"]
    answer = eutree(*line, "--against", rival)
    assert answer.code == 0, answer.err
    assert "against gate: better in" in answer.out
    begun = eutree("learn", "--demos", demonstrations, "--against", "nobody", "--out", "other")
    assert begun.code == 2, "said before anything is learned"


def test_evaluations_of_other_episodes_are_not_compared():
    few, many = (evaluate(lambda _: 1, "CartPole-v1", episodes=n) for n in (2, 3))
    with pytest.raises(InvalidArgumentError, match="same 2 episodes, got 3"):
        against(few, many)


def test_a_class_is_made_of_nothing_where_it_wants_nothing():
    class Rule:
        def predict(self, observation):
            return 1

    assert isinstance(as_policy(Rule, None), Rule)
