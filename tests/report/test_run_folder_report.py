"""The page of a run, from its folder alone."""

import json

import pytest

from eutree.errors import FormatError, InvalidArgumentError
from eutree.report import report_of_run, run_page
from tests.export.policies import EVASION, policy_of, tree

CONFIG = {"method": {"name": "distilled-dqn"}, "environment": "eutree/Evasion2-v0", "seed": 4}


def raced(race, entrant, value, **more):
    facts = {"stage": "race", "race": race, "entrant": entrant, "origin": "pruned"}
    return {"event": "expansion", "episode": 60, "steps": 900, "return": value, **facts, **more}


@pytest.fixture
def folder(tmp_path):
    taught = [
        {
            "event": "expansion",
            "episode": n,
            "steps": 10 * n,
            "stage": "teacher",
            "return": float(n),
        }
        for n in range(1, 31)
    ]
    end = {"winner": 1, "ahead": 2.5, "error": 0.5, "pairs": 40, "policy": 1}
    known = {"imagined": [1.0, 2.0, 3.0, 4.0, 5.0], "real": [1.0, 3.0, 2.0, 4.0, 5.0],
             "real_episodes": [8, 8, 8, 8, 8]}  # fmt: skip
    events = [*taught, raced(1, 0, 5.0), raced(1, 0, 7.0), raced(1, 1, 9.0, **end, **known)]
    (tmp_path / "config.json").write_text(json.dumps(CONFIG))
    (tmp_path / "events.jsonl").write_text("".join(json.dumps(one) + "\n" for one in events))
    policy_of(tree(5, 3), EVASION).save(tmp_path / "policy.json")
    return tmp_path


def test_teacher_model_and_races_are_told(folder):
    report = report_of_run(folder)
    (teacher,) = report.curves["return of the teacher while it learns"].values()
    assert teacher[0][:2] == (20.0, pytest.approx(10.5))  # the mean of 1 to 20
    assert teacher[-1][:2] == (30.0, pytest.approx(20.5))
    assert report.trust.correlation.value == pytest.approx(0.9)
    assert report.tables["Races"].rows == [
        ("1", "0", "pruned", "2", "6.0", ""),
        ("1", "1", "pruned", "1", "9.0", "is the policy, won, +2.5 (s.e. 0.5, 40 pairs)"),
    ]
    assert report.watched.policy.n_leaves == 5
    page = run_page(report)
    assert "300 of them are its teacher" in page
    assert page.count('class="point"') == 5


def test_a_start_of_one_leaf_is_called_so_as_the_command_does(folder):
    start = {"n_leaves": 1, "mean_return": 1.0, "return_interval": [0.0, 2.0], "worst": 0.0,
             "quantile_05": 0.0, "success_rate": None, "success_interval": None}  # fmt: skip
    facts = {"event": "judgement", "episodes_compared": 40, "return": 8.0, "steps": 900,
             "return_interval": [7.0, 9.0], "learned": {**start, "n_leaves": 5}}  # fmt: skip
    for n_leaves, named in ((1, "a single leaf"), (5, "the tree that it started from")):
        judged = {**facts, "start": {**start, "n_leaves": n_leaves}}
        with (folder / "events.jsonl").open("a") as log:
            log.write(json.dumps(judged) + "\n")
        (verdict,) = report_of_run(folder).verdict
        assert f"against {named}, on 40 episodes" in verdict


def test_the_page_says_how_the_policy_did_at_the_end(folder):
    facts = {"event": "evaluation", "steps": 900, "n_leaves": 9, "mean_length": 20.0}
    early = {**facts, "episode": 20, "success_rate": 0.5, "mean_return": 30.0}
    last = {**facts, "episode": 60, "success_rate": 0.98, "mean_return": 80.02}
    with (folder / "events.jsonl").open("a") as log:
        log.writelines(json.dumps(one) + "\n" for one in (early, last))
    sentence = "At the end 98 % success, mean return 80.02 with 9 leaves."
    counted = f"Seed {CONFIG['seed']}, 900 steps of learning and racing."
    assert report_of_run(folder).notes[:2] == [sentence, counted]
    with (folder / "events.jsonl").open("a") as log:
        log.write(json.dumps({**last, "success_rate": None}) + "\n")
    page = run_page(report_of_run(folder))
    assert "At the end mean return 80.02 with 9 leaves." in page
    assert "Watch it decide" not in page  # no episode is played on it
    assert "The tree</h2>" in page


def test_where_another_tree_is_handed_over_the_last_evaluation_is_of_learning(folder):
    last = {"event": "evaluation", "steps": 900, "episode": 60, "n_leaves": 9, "mean_return": 80.0}
    front = {"event": "front", "steps": 900, "front": [], "picked": 5}
    with (folder / "events.jsonl").open("a") as log:
        log.writelines(json.dumps(one) + "\n" for one in (last, front))
    assert report_of_run(folder).notes[0] == (
        "At the end of learning mean return 80.00 with 9 leaves."
    )


def test_a_run_without_teacher_and_races_has_a_page_too(folder):
    event = {"event": "expansion", "episode": 1, "steps": 10, "n_leaves": 2, "splits": []}
    (folder / "events.jsonl").write_text(json.dumps(event) + "\n")
    report = report_of_run(folder)
    assert not report.curves
    assert report.trust is None
    assert not report.tables


@pytest.mark.parametrize(
    "text", ["{", "[]\n", '{"event": "expansion"}\n', '{"event": "x", "steps": "many"}\n']
)
def test_a_damaged_log_is_named(folder, text):
    (folder / "events.jsonl").write_text(text)
    with pytest.raises(FormatError, match=r"events\.jsonl"):
        report_of_run(folder)


def test_another_folder_is_refused(tmp_path):
    with pytest.raises(InvalidArgumentError, match=r"without config\.json"):
        report_of_run(tmp_path)
