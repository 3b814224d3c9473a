"""The whole main job, on the paper's domain and on a task of others."""

import json
import re
from types import SimpleNamespace

import pytest

from eutree.cli.main import run
from eutree.evaluation import CurvePoint
from eutree.experiments import demo
from eutree.experiments.demo import DemoSettings, run_demo
from eutree.policies import TreePolicy
from eutree.schema import EnvironmentSpec

FILES = [
    *("expert.json", "small.json", "small.c", "small.svg", "report.html", "demonstrations"),
    *("runs/eu-tree/policy.json", "runs/eu-tree/curve.csv", "runs/c-u-tree/policy.json"),
]


def quick(environment, **changes):
    return DemoSettings(
        environment=EnvironmentSpec(environment),
        runs=2,
        episodes=20,
        evaluate_every=10,
        evaluation_episodes=5,
        final_episodes=20,
        **changes,
    )


@pytest.mark.parametrize("environment", ["eutree/Evasion2-v0", "CartPole-v1"])
def test_the_demo_makes_all_its_files_and_a_self_contained_report(tmp_path, environment):
    said = []
    result = run_demo(
        quick(environment), tmp_path / "out", say=said.append, follow=lambda label, state: None
    )
    for name in FILES:
        assert (tmp_path / "out" / name).exists(), name
    page = result.report.read_text()
    assert not re.search(r"(src|href)=[\"']?(https?:)?//", page)
    for name in ("Expert tree", "C. U-Tree", "EU-Tree, compressed"):
        assert name in page
    assert result.compression.agreement == 1.0
    small = TreePolicy.load(tmp_path / "out" / "small.json")
    assert small.n_leaves == result.compression.n_leaves_after
    assert any("expert tree of" in text for text in said)
    header, rows = demo.table_rows(result.policies, result.evaluations)
    assert header[:3] == ["Policy", "Leaves", "Return"]
    assert rows[0][1] == str(result.policies[rows[0][0]].n_leaves)
    assert set(result.evaluations) == set(result.policies)


def test_a_demo_replaces_an_earlier_demo_and_nothing_else(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = ["demo", "CartPole-v1", "--episodes", "3", "--runs", "2", "--json"]
    for _ in range(2):
        assert run(line) == 0
        answer = json.loads(capsys.readouterr().out)
        assert answer["report"] == "demo-report/report.html"
        assert next(row["Policy"] for row in answer["policies"]) == "Expert tree"
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    assert run([*line, "--out", "mine"]) == 2
    assert "not empty" in capsys.readouterr().err
    assert (tmp_path / "mine" / "thesis.txt").read_text() == "years of work"


def test_the_expert_tree_is_the_paper_s(tmp_path):
    """7 to 13 leaves and at least 95 % of 1,000 fresh episodes, on average over 15 seeds."""
    import gymnasium
    import numpy as np

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


def test_intervals_end_where_the_measure_does():
    def run_of(success_rate, n_leaves):
        point = CurvePoint(0, 0, success_rate, 0.5, n_leaves)
        return SimpleNamespace(curve=(point,))

    runs = [run_of(1.0, 1), run_of(1.0, 1), run_of(0.4, 40)]
    ends = {name: demo._series(runs, measure)[0][2:] for name, measure in demo.MEASURES.items()}
    assert ends["success rate"][1] == 1.0
    assert ends["leaves"][0] == 1.0
    assert ends["leaves"][1] > 40
    assert ends["return"] == (0.5, 0.5)
