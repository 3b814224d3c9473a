"""Codes, and derived features, mean in every command what they mean where they come from."""

import json
from pathlib import Path

import numpy as np

from eutree.cli._policies import seen_in
from eutree.data import Demonstrations
from eutree.policies import TreePolicy

LOG = "episode,action,room,mode\n" + "0,on,15,manual\n0,off,15,auto\n" * 3 + "0,,15,auto\n"


def test_names_give_text_its_codes(eutree, tmp_path):
    (tmp_path / "log.csv").write_text(LOG)
    names = {"actions": ["off", "on"], "kinds": {"mode": ["manual", "off", "auto"]}}
    (tmp_path / "names.json").write_text(json.dumps(names))
    line = ["demos", "import", "log.csv", "--nominal", "mode", "--names", "names.json"]
    assert eutree(*line, "--out", "demos").code == 0
    demos = Demonstrations.load(tmp_path / "demos")
    assert demos.schema.features[1].categories == ("manual", "off", "auto")
    assert demos.observations[:, 1].tolist() == [0, 2, 0, 2, 0, 2]
    assert eutree("fit", "demos", "--episodes", 0, "--out", "tree.json").code == 0
    assert TreePolicy.load(tmp_path / "tree.json").predict([[15, 0], [15, 2]])[0].tolist() == [1, 0]


def test_a_policy_sees_its_own_derived_features_in_any_demonstrations(eutree):
    """Those of another formula were taken by place, and ``compress`` lost decisions."""
    record = ["record", "CartPole-v1", "--expert", "balance", "--episodes", 2, "--seed", 0]
    assert eutree(*record, "--out", "plain").code == 0
    assert eutree(*record, "--derive", "lead = 100 * position", "--out", "other").code == 0
    fit = ["fit", "plain", "--derive", 'lean = angle + 0.2 * "turn rate"', "--episodes", 0]
    assert eutree(*fit, "--out", "tree.json").code == 0
    policy = TreePolicy.load("tree.json")
    rows = [seen_in(Path(demos), policy) for demos in ("plain", "other")]
    np.testing.assert_array_equal(rows[1], rows[0])
    for line in (
        ["why", "tree.json", "--observation", "0,0,0.1,0.1"],
        ["verify", "tree.json", "--property", "no dead leaves"],
        ["compress", "tree.json", "--mode", "lossless", "--out", "small.json"],
    ):
        answers = [eutree(*line, "--demos", demos) for demos in ("plain", "other")]
        assert answers[0].code == answers[1].code
        assert answers[0].out.replace("plain", "other") == answers[1].out
