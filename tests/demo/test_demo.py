"""The whole main job, on the paper's domain and on a task of others."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from eutree.cli.main import run
from eutree.demo import run_demo, table_rows
from eutree.demo.page import DemoResult, DemoSettings, Story, story_of
from eutree.evaluation import Evaluation
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec
from eutree.training.handover import judged
from tests.export.policies import EVASION, policy_of, tree
from tests.little_search import little_search

FILES = [
    *("expert.json", "small.json", "small.c", "small.svg", "report.html", "demonstrations"),
    *("learned/policy.json", "learned/runs.csv", "learned/runs/0/curve.csv"),
]
FEW = Story(
    learning={"episodes": 10, "evaluate_every": 5, "evaluation_episodes": 5}, final_episodes=20
)
FASTER = replace(FEW, change={"opponent_speed": 4.2}, changed="they are faster", plays=True)


def quick(environment, story):
    short = {"max_episode_steps": 60} if environment == "CartPole-v1" else {}
    spec = EnvironmentSpec(environment, short)
    return DemoSettings(environment=spec, story=story, runs=2, n_jobs=1)


@little_search()
@pytest.mark.parametrize(
    ("environment", "story"), [("eutree/Evasion2-v0", FASTER), ("CartPole-v1", FEW)]
)
def test_the_demo_makes_all_its_files_and_a_self_contained_report(tmp_path, environment, story):
    said, finished = [], []
    result = run_demo(
        quick(environment, story),
        tmp_path / "out",
        say=said.append,
        follow=lambda count, run: finished.append(run.seed),
    )
    for name in FILES:
        assert (tmp_path / "out" / name).exists(), name
    page = result.report.read_text()
    assert not re.search(r"(src|href)=[\"']?(https?:)?//", page)
    for name in ("Expert tree", "Compressed tree", "run 1", "Before, from the same start"):
        assert name in page
    assert "worst; 5 % quantile" in page
    assert ("Smaller trees" in page) == bool(result.compression.front) == story.plays
    small = TreePolicy.load(tmp_path / "out" / "small.json")
    assert small.n_leaves == result.compression.n_leaves_after
    assert any("the tree that was shown has" in text for text in said)
    assert finished == [0, 1]
    header, rows = table_rows(result)
    assert header[:3] == ["Policy", "Leaves", "Return"]
    assert [row[0] for row in rows] == ["Expert tree", "Learned tree", "Compressed tree"]
    assert rows[0][1] == str(result.policies["Expert tree"].n_leaves)
    assert (result.at_home is None) == (not story.change)
    assert small.environment.arguments.get("opponent_speed") == story.change.get("opponent_speed")


def evaluation(returns, successes=None):
    size = len(returns)
    return Evaluation(np.array(returns), np.ones(size), np.array(["goal"] * size), successes)


def facts(before, after, *, successes=(None, None)):
    policies = {"Expert tree": policy_of(tree(9, 3), EVASION)}
    policies["Compressed tree"] = policy_of(tree(4, 3), EVASION)
    one, two = evaluation(before, successes[0]), evaluation(after, successes[1])
    nothing = SimpleNamespace()
    return DemoResult(
        settings=quick("eutree/Evasion2-v0", FASTER),
        folder=Path("demo"),
        demonstrations=nothing,
        policies=policies,
        evaluations={"Expert tree": one, "Compressed tree": two},
        at_home=None,
        judgement=judged(one, two, challengers=0),
        runs=nothing,
        compression=nothing,
        played=nothing,
        changes=nothing,
        source="",
    )


def test_the_verdict_says_better_only_where_the_interval_does():
    noise = np.linspace(-30, 30, 40) + 50
    better = facts(noise, noise + 20).verdict
    assert better == (
        "The tree that was shown earns 50 once they are faster. "
        "Learning mends it: with 4 leaves it earns 70."
    )
    assert "Learning harms it" in facts(noise, noise - 20).verdict
    assert "40 episodes cannot tell apart" in facts(noise, noise[::-1] + 5).verdict
    assert "cannot tell apart" in facts(noise, noise).verdict


def test_the_verdict_names_the_figure_that_changed():
    """It said "Learning mends it" at 59 % before and 59 % after."""
    noise, share = np.linspace(-3, 3, 500) + 50, np.arange(500) % 100
    mostly, always = share < 59, share < 97
    often = (share + 30) % 100 < 60  # other episodes
    more = facts(noise, noise + 20, successes=(mostly, mostly)).verdict
    assert more == (
        "The tree that was shown succeeds in 59 % of all episodes once they are faster. "
        "Learning makes it earn more, 70 in place of 50: with 4 leaves it succeeds in 59 % of all "
        "episodes. Whether it succeeds more often, 500 episodes cannot tell."
    )
    assert (
        "earn less, 30 in place of 50"
        in facts(noise, noise - 20, successes=(mostly, always)).verdict
    )
    assert "Learning mends it" in facts(noise, noise + 20, successes=(mostly, always)).verdict
    assert "Learning mends it" in facts(noise, noise, successes=(mostly, always)).verdict
    assert "Learning harms it" in facts(noise, noise, successes=(always, mostly)).verdict
    assert "cannot tell apart" in facts(noise, noise, successes=(mostly, often)).verdict


def test_every_story_is_of_an_environment_with_a_demonstrator():
    from eutree.demo.page import _STORIES
    from eutree.envs.experts import EXPERTS

    assert set(_STORIES) <= set(EXPERTS)
    assert story_of("eutree:eutree/Evasion2-v0").change == {"opponent_speed": 4.2}
    assert story_of("MountainCar-v0").change == {}


def test_a_demo_replaces_an_earlier_demo_and_nothing_else(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    few = replace(FEW, learning=dict(FEW.learning) | {"race_steps": 0})
    monkeypatch.setattr("eutree.demo.story_of", lambda environment: few)
    line = [
        "demo",
        "eutree/Evasion2-v0",
        "--episodes",
        "3",
        "--runs",
        "2",
        "--n-jobs",
        "1",
        "--json",
    ]
    for _ in range(2):
        assert run(line) == 0
        answer = json.loads(capsys.readouterr().out)
        assert answer["report"] == "demo-report/report.html"
        assert next(row["Policy"] for row in answer["policies"]) == "Expert tree"
        assert [entry["seed"] for entry in answer["runs"]] == [0, 1]
        assert sum(entry["winner"] for entry in answer["runs"]) == 1
        assert answer["verdict"].startswith("The tree that was shown")
    assert run([*line, "--env-arg", "gravity=1"]) == 2
    capsys.readouterr()
    assert (tmp_path / "demo-report" / "report.html").exists()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    assert run([*line, "--out", "mine"]) == 2
    assert "not empty" in capsys.readouterr().err
    assert (tmp_path / "mine" / "thesis.txt").read_text() == "years of work"


def test_the_expert_tree_is_the_paper_s(tmp_path):
    """7 to 13 leaves and at least 95 % of 1,000 fresh episodes, on average over 15 seeds."""
    import gymnasium

    import eutree

    env = gymnasium.make("eutree/Evasion2-v0")
    leaves, success = [], []
    for seed in range(15):
        demos = eutree.record(env, eutree.experts.wait_at_crossing, episodes=15, seed=seed)
        expert = eutree.fit_expert_tree(demos)
        leaves.append(expert.n_leaves)
        success.append(eutree.evaluate(expert, env, episodes=1000, seed=seed).success_rate)
    assert 7 <= np.mean(leaves) <= 13
    assert np.mean(success) >= 0.95
