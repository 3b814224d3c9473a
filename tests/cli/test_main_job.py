"""The main job from the shell: record, fit, learn, evaluate, with the promised JSON keys."""

import filecmp

import pytest

from eutree.evaluation import wilson_interval


def test_record_fit_learn_evaluate(eutree):
    answer = eutree("record", "eutree/Evasion2-v0", "--expert", "gate", "--out", "demos", "--json")
    assert answer.code == 0
    assert answer.json["episodes"] == 15
    answer = eutree("fit", "demos", "--out", "expert.json", "--json")
    assert answer.code == 0
    assert answer.json.keys() >= {
        *("n_leaves", "n_transitions", "training_accuracy", "path"),
        *("person", "played", "choice", "warnings"),
    }
    assert answer.json["person"]["episodes"] == 15
    assert answer.json["person"]["success_rate"] == 1.0
    played = answer.json["played"]
    assert played["episodes"] == 200
    low, high = played["interval"]
    assert 0.9 < low <= played["success_rate"] <= high
    assert answer.json["warnings"] == []
    assert 7 <= answer.json["n_leaves"] <= 13
    assert answer.json["training_accuracy"] > 0.98
    answer = eutree(
        *("learn", "eutree/Evasion2-v0", "--demos", "demos", "--out", "runs/a", "--json"),
        *("--episodes", 20, "--evaluate-every", 10, "--evaluation-episodes", 20),
    )
    assert answer.code == 0
    assert answer.json.keys() >= {"episodes", "steps", "n_leaves", "path", "curve"}
    assert [point["episode"] for point in answer.json["curve"]] == [0, 10, 20]
    keys = {"episode", "success_rate", "mean_return", "n_leaves"}
    assert all(point.keys() >= keys for point in answer.json["curve"])
    answer = eutree("evaluate", "runs/a/policy.json", "--episodes", 50, "--json")
    assert answer.code == 0
    assert answer.json.keys() >= {
        *("episodes", "success_rate", "mean_return"),
        *("return_interval", "success_interval", "n_leaves", "mean_length"),
    }
    low, high = answer.json["return_interval"]
    assert low <= answer.json["mean_return"] <= high
    successes = round(50 * answer.json["success_rate"])
    assert answer.json["success_interval"] == list(wilson_interval(successes, 50))
    # what compress takes, every command takes that wants a policy
    folder = eutree("evaluate", "runs/a", "--episodes", 50, "--json")
    assert folder.json == answer.json
    for command in (["show"], ["export", "--format", "text"], ["diff", "runs/a/policy.json"],
                    ["verify", "--property", "always go when position > 20"],
                    ["why", "--observation", "1,2,3"], ["edit"]):  # fmt: skip
        assert eutree(*command, "runs/a").code in (0, 1), command
        assert "run folder with a policy.json" in eutree(*command, "demos").err


@pytest.mark.promise(13)
@pytest.mark.parametrize("start", ["nothing", "tree", "tree+demos"])
def test_the_same_seed_writes_the_same_bytes(eutree, demonstrations, tmp_path, start):
    for name in ("a", "b"):
        answer = eutree(
            *("learn", "eutree/Evasion2-v0", "--demos", demonstrations, "--out", name),
            *("--start", start, "--episodes", 25, "--seed", 4, "--evaluation-episodes", 10),
        )
        assert answer.code == 0, answer.err
    names = [
        "policy.json",
        "curve.csv",
        "progress.csv",
        "events.jsonl",
        "config.json",
        "checkpoint.npz",
    ]
    _, different, missing = filecmp.cmpfiles(tmp_path / "a", tmp_path / "b", names, shallow=False)
    assert (different, missing) == ([], [])


def test_an_environment_of_others(eutree):
    answer = eutree(
        *("record", "CartPole-v1", "--expert", "fall", "--episodes", 5, "--out", "demos"),
    )
    assert answer.code == 0, answer.err
    answer = eutree(
        *("learn", "CartPole-v1", "--demos", "demos", "--out", "run", "--json"),
        *("--episodes", 6, "--evaluate-every", 3, "--evaluation-episodes", 5),
    )
    assert answer.code == 0, answer.err
    assert answer.json["curve"][-1]["success_rate"] is None


def test_evaluate_in_a_changed_environment(eutree, expert):
    answer = eutree("evaluate", expert, "--env-arg", "opponent_speed=4.2", "--json")
    assert answer.code == 0
    assert answer.json["success_rate"] < 0.8


def test_results_go_to_standard_output_and_messages_to_standard_error(eutree, demonstrations):
    answer = eutree("fit", demonstrations, "--out", "expert.json", "--episodes", 10)
    assert "leaves" in answer.out
    assert "judging 10/10" in answer.err.splitlines()
    assert "leaves" not in answer.err
    answer = eutree("fit", demonstrations, "--out", "expert.json", "--episodes", 0)
    assert answer.err == ""


def test_learn_starts_from_an_edited_policy(eutree, expert):
    answer = eutree("edit", expert, "--lock", "1", "--out", "edited.json")
    assert answer.code == 0, answer.err
    answer = eutree(
        *("learn", "eutree/Evasion2-v0", "--expert", "edited.json", "--out", "run", "--json"),
        *("--preset", "paper", "--episodes", 20, "--evaluation-episodes", 5),
    )
    assert answer.code == 0, answer.err
    assert answer.json["n_leaves"] > 9
