"""Of many runs the best that is proven is chosen, and a start that is not does not replace it."""

import json

import numpy as np
import pytest

import eutree
from eutree.cli.main import run
from eutree.compression.episodes import FrontEntry
from eutree.compression.front import Front
from eutree.compression.playing import Outcome
from eutree.errors import InvalidArgumentError
from eutree.proof import Effort, prove
from eutree.schema import EnvironmentSpec
from eutree.training import front as front_of_runs
from eutree.training.evaluations import ProvenFirst
from tests.little_search import little_search
from tests.proof.policies import BAD, GOOD, SWITCH, policy_of

CAR = EnvironmentSpec("MountainCar-v0")
SHOWN = {}  # what has been proven of which tree: all ask for the same
COARSE = Effort(smallest=2.0**-10)  # enough to count the steps of these trees


@pytest.fixture(autouse=True)
def proven_once(monkeypatch):
    def once(policy, plant, asked):
        key = (policy.to_bytes(), asked.text)
        if key not in SHOWN:
            SHOWN[key] = prove(policy, plant, asked, effort=COARSE)
        return SHOWN[key]

    monkeypatch.setattr("eutree.proof.prove", once)


def test_the_first_that_is_proven():
    proven = ProvenFirst(CAR, "arrives within 110 steps")
    trees = [policy_of(one) for one in (BAD, SWITCH, GOOD)]
    number, certificate = proven.first(trees)
    assert number == 2
    assert "within 108 steps" in certificate.sentence
    assert proven.first(trees[:2]) is None


def test_without_a_plant_nothing_can_be_preferred():
    with pytest.raises(InvalidArgumentError, match="prefer_proven needs a plant"):
        ProvenFirst(EnvironmentSpec("LunarLander-v3"), "")
    with pytest.raises(InvalidArgumentError, match="property must be 'arrives"):
        ProvenFirst(CAR, "flies")


def learned(folder, expert, **options):
    return eutree.learn_runs(
        CAR, runs=2, n_jobs=1, out=folder, expert=policy_of(expert), start="tree", episodes=1,
        evaluate_every=1, evaluation_episodes=1, selection_episodes=2, judging_episodes=2,
        front_steps=0, judge_episodes=0, **options,
    )  # fmt: skip


def test_the_certificate_of_many_runs(tmp_path):
    found = learned(tmp_path / "good", GOOD, prefer_proven="")
    assert found.certificate is not None
    assert found.certificate.proven
    assert learned(tmp_path / "plain", GOOD).certificate is None


def test_a_better_run_that_is_refuted_is_not_chosen(tmp_path, monkeypatch):
    """The trees of two runs are replaced before the choice: the better one fails from a start."""
    from eutree.training import many

    real = many.Workers.as_finished

    def replaced(self, task, seeds):
        for finished in real(self, task, seeds):
            tree = BAD if finished.seed == 0 else GOOD
            policy_of(tree).save(finished.path / "policy.json")
            returns = np.full(2, -99.0 if finished.seed == 0 else -101.0)
            selection = many.Evaluation(returns, np.full(2, 100), np.full(2, ""))
            yield many.FinishedRun(finished.seed, finished.path, 5, 200, selection)

    monkeypatch.setattr(many.Workers, "as_finished", replaced)
    assert learned(tmp_path / "a", GOOD).winner == 0
    assert learned(tmp_path / "b", GOOD, prefer_proven="").winner == 1


def test_on_the_command_line(tmp_path, capsys):
    policy_of(GOOD).save(tmp_path / "car.json")
    line = ["learn", "MountainCar-v0", "--expert", str(tmp_path / "car.json"), "--start", "tree",
            "--episodes", "1", "--evaluation-episodes", "1", "--out"]  # fmt: skip
    several = [*line, str(tmp_path / "many"), "--runs", "2", "--n-jobs", "1", "--front-steps", "0"]
    with little_search():
        assert run([*several, "--prefer-proven", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["certificate"]["proven"]
    assert run([*line, str(tmp_path / "one"), "--prefer-proven", "--front-steps", "0"]) == 2
    assert "needs several trees to choose among" in capsys.readouterr().err


def entry(policy, mean_return):
    outcome = Outcome(np.full(4, mean_return), None)
    return FrontEntry.of(policy, outcome)


def of_one_run(tmp_path, monkeypatch, start, **options):
    """A run whose front has the tree that is refuted in front of one that is proven."""
    refuted, proven = policy_of(BAD), policy_of(GOOD)

    def front(*_, **__):
        entries = (entry(refuted, -98.0), entry(proven, -99.0), entry(refuted, -98.0))
        return Front(refuted, entries, None)

    monkeypatch.setattr(front_of_runs, "front_of_run", front)
    return eutree.learn(
        CAR, out=tmp_path / "run", expert=policy_of(start), start="tree", episodes=2,
        evaluate_every=2, evaluation_episodes=1, front_steps=100_000, judge_episodes=8, **options,
    )  # fmt: skip


def test_the_pick_of_a_front_is_the_best_that_is_proven(tmp_path, monkeypatch):
    found = of_one_run(tmp_path, monkeypatch, SWITCH, prefer_proven="arrives within 110 steps")
    assert found.picked.to_bytes() == policy_of(GOOD).to_bytes() == found.policy.to_bytes()
    assert "within 108 steps" in found.certificate.sentence
    assert found.against_start.why == "it alone is proven"


def test_a_pick_that_none_is_proven_of_stays(tmp_path, monkeypatch):
    found = of_one_run(tmp_path, monkeypatch, SWITCH, prefer_proven="arrives within 90 steps")
    assert found.picked.to_bytes() == policy_of(BAD).to_bytes()
    assert found.certificate is None


def test_a_start_that_alone_is_proven_is_handed_over(tmp_path, monkeypatch):
    found = of_one_run(tmp_path, monkeypatch, GOOD, prefer_proven="", max_leaves=5)
    assert found.picked.to_bytes() == policy_of(BAD).to_bytes()  # the other one is too large
    assert found.handed_over == "start"
    assert found.certificate.proven


def test_without_the_wish_nothing_changes(tmp_path, monkeypatch):
    found = of_one_run(tmp_path, monkeypatch, SWITCH)
    assert found.picked.to_bytes() == policy_of(BAD).to_bytes()
    assert found.certificate is None
