"""``eutree distill``: scripted and learned teachers, what is written and what is printed."""

from eutree.policies import TreePolicy


def test_a_scripted_expert_teaches(eutree, demonstrations):
    line = ["distill", "eutree/Evasion2-v0", "--expert", "gate", "--demos", demonstrations]
    line += ["--max-leaves", "6", "--iterations", "2", "--episodes", "2", "--out", "tree.json"]
    answer = eutree(*line, "--validation-episodes", "10", "--json")
    assert answer.code == 0
    assert answer.json["n_leaves"] == TreePolicy.load("tree.json").n_leaves <= 6
    assert len(answer.json["rounds"]) == 2
    assert answer.json["environment_steps"] > answer.json["labels"]
    words = eutree(*line, "--validation-episodes", "10").out
    assert f"{answer.json['environment_steps']} environment steps in all" in words


def test_a_policy_file_teaches(eutree, expert):
    line = ["distill", "eutree/Evasion2-v0", "--policy", expert, "--method", "cloning"]
    answer = eutree(*line, "--validation-episodes", "5", "--out", "tree.json", "--json")
    assert answer.code == 0
    assert answer.json["agreement"] > 0.9


def test_viper_without_action_values_says_that_nothing_is_weighed(eutree):
    """It was DAgger, and said nothing."""
    line = ["distill", "eutree/Evasion2-v0", "--expert", "gate", "--iterations", "1"]
    line += ["--episodes", "2", "--validation-episodes", "2", "--out", "tree.json", "--method"]
    assert "no action values to weigh by" in eutree(*line, "viper").out
    assert "no action values" not in eutree(*line, "dagger").out
    assert eutree(*line, "viper", "--json").json["weighted"] is False


def test_there_is_one_teacher(eutree, expert):
    line = ["distill", "eutree/Evasion2-v0", "--out", "tree.json"]
    for teachers in ((), ("--expert", "gate", "--policy", expert)):
        answer = eutree(*line, *teachers)
        assert answer.code == 2
        assert "choose one of --expert and --policy" in answer.err
