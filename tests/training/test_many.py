"""Many runs as one: the same bytes for any number of processes, and a winner that is judged."""

import json
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli.main import run
from eutree.errors import EutreeError, FormatError, InvalidArgumentError, RunFolderError
from eutree.training.many import folder_of_winner
from tests.little_search import little_search

SHORT = {"episodes": 22, "evaluate_every": 11, "evaluation_episodes": 4, "method": "paper"}
EPISODES = {"selection_episodes": 40, "judging_episodes": 60}


def learned(folder, **options):
    return eutree.learn_runs(
        "eutree/Evasion2-v0", runs=3, out=folder, seed=5, **(SHORT | EPISODES | options)
    )


def bytes_of(folder):
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != ".lock")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    folder = tmp_path_factory.mktemp("alone") / "runs"
    return learned(folder, n_jobs=1), folder


def test_two_processes_write_the_bytes_of_one(alone, tmp_path):
    learned(tmp_path / "two", n_jobs=2)
    assert bytes_of(tmp_path / "two") == bytes_of(alone[1])


def test_each_run_is_what_learn_does_alone(alone, tmp_path):
    found, folder = alone
    env = gymnasium.make("eutree/Evasion2-v0")
    single = eutree.learn(env, seed=6, out=tmp_path / "single", **SHORT)
    assert single.policy == eutree.TreePolicy.load(folder / "runs" / "6" / "policy.json")
    assert bytes_of(tmp_path / "single") == bytes_of(folder / "runs" / "6")
    assert [one.seed for one in found.runs] == [5, 6, 7]
    assert [one.path for one in found.runs] == [folder / "runs" / str(k) for k in (5, 6, 7)]
    assert all((one.path / "checkpoint.npz").exists() for one in found.runs)


def test_the_best_is_chosen_and_judged_on_other_episodes(alone):
    found, folder = alone
    best = found.runs[found.winner]
    most = max(found.runs, key=lambda one: one.selection.mean_return).selection
    reach = most.returns.std(ddof=1) / np.sqrt(most.episodes)
    near = [k for k in found.runs if k.selection.mean_return >= most.mean_return - reach]
    assert best in near
    assert best.n_leaves == min(one.n_leaves for one in near)
    assert eutree.TreePolicy.load(folder / "policy.json") == found.result.policy
    assert eutree.TreePolicy.load(best.path / "policy.json") == found.result.policy
    assert found.judged.episodes == 60
    assert not np.array_equal(found.judged.returns[:40], best.selection.returns)
    rows = (folder / "runs.csv").read_text().splitlines()
    assert len(rows) == 4
    assert [row.split(",")[-1] for row in rows[1:]].index("1") == found.winner


def test_the_winners_folder_is_found(alone, tmp_path):
    found, folder = alone
    assert folder_of_winner(folder) == found.runs[found.winner].path
    assert folder_of_winner(found.runs[0].path) == found.runs[0].path
    (tmp_path / "runs.csv").write_text("seed,winner\n../..,1\n")
    with pytest.raises(FormatError, match="must be 1 for one run"):
        folder_of_winner(tmp_path)


@pytest.mark.promise(2)
@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"runs\.csv: winner: must be 1 for one run"),
        (b"seed,winner\n\xff,1\n", r"runs\.csv: byte 12: must be text in UTF-8"),
        ("seed,winner\n²,1\n".encode(), r"runs\.csv: winner"),
        (b"seed,winner\n1,1\n2,1\n", r"runs\.csv: winner"),
    ],
)
def test_a_damaged_table_of_runs_is_refused(content, message, tmp_path):
    (tmp_path / "runs.csv").write_bytes(content)
    with pytest.raises(FormatError, match=message):
        folder_of_winner(tmp_path)


@pytest.mark.promise(2)
@pytest.mark.parametrize(
    "content", [b"", b"\xff", b"a,b\n", b"episode\n1\n", b'"' * 5, b"x" * 200_000]
)
def test_a_damaged_curve_is_refused(content, alone, tmp_path):
    (tmp_path / "curve.csv").write_bytes(content)
    with pytest.raises(FormatError, match=r"curve\.csv"):
        replace(alone[0].runs[0], path=tmp_path).curve()


def test_all_curves_are_one_frame(alone):
    found, _ = alone
    frame = found.to_pandas()
    assert sorted(set(frame.index.get_level_values("seed"))) == [5, 6, 7]
    best = frame.loc[found.runs[found.winner].seed]
    assert best["mean_return"].tolist() == [point.mean_return for point in found.result.curve]
    assert best.equals(found.result.to_pandas())


def test_runs_go_on(alone):
    with pytest.raises(RunFolderError, match="already holds runs"):
        learned(alone[1])
    before = bytes_of(alone[1])
    again = learned(alone[1], resume=True, n_jobs=1)
    assert again.winner == alone[0].winner
    assert bytes_of(alone[1]) == before


@pytest.mark.parametrize("resume", [False, True])
def test_one_run_and_several_do_not_share_a_folder(alone, tmp_path, resume):
    """Each overwrote the policy of the other, and what was said of how it came about."""
    before = bytes_of(alone[1])
    with pytest.raises(RunFolderError, match="already holds several runs"):
        eutree.learn("eutree/Evasion2-v0", episodes=1, out=alone[1], resume=resume)
    assert bytes_of(alone[1]) == before
    eutree.learn("eutree/Evasion2-v0", episodes=1, evaluation_episodes=2, out=tmp_path)
    before = bytes_of(tmp_path)
    with pytest.raises(RunFolderError, match="already holds a single run"):
        learned(tmp_path, resume=resume, n_jobs=1)
    assert bytes_of(tmp_path) == before


def test_a_mistake_leaves_nothing_that_blocks_the_corrected_command(tmp_path):
    for wrong in ({"method": "no-such"}, {"method": "planning", "start": "sideways"}):
        with pytest.raises(InvalidArgumentError):
            learned(tmp_path, n_jobs=1, **wrong)
        assert not (tmp_path / "runs").exists()
    shown = eutree.record("eutree/Evasion3-v0", eutree.experts.wait_at_crossing, episodes=2, seed=0)
    for number, wrong in enumerate(
        (
            {"demonstrations": shown},  # of another task
            {"start": "tree"},  # of no demonstrations
            {"race_steps": 100},  # with nothing to go by
            {"max_leaves": 1},
            {"monotone": ["nobody in distance"]},
            {"n_jobs": 0},
        )
    ):
        folder = tmp_path / str(number)
        with pytest.raises(EutreeError):
            learned(folder, **({"n_jobs": 1, "method": "planning", "episodes": 0} | wrong))
        assert not folder.exists()
    (tmp_path / "runs").mkdir()  # as earlier releases left it
    assert len(learned(tmp_path, n_jobs=1).runs) == 3


def test_what_is_refused(tmp_path):
    with pytest.raises(InvalidArgumentError, match="runs must be"):
        eutree.learn_runs("x", runs=0, out=tmp_path)
    with pytest.raises(InvalidArgumentError, match="callback must be None"):
        learned(tmp_path / "a", callback=lambda *_: True)


def test_on_the_command_line(tmp_path, capsys):
    out = tmp_path / "many"
    line = ["learn", "eutree/Evasion2-v0", "--runs", "2", "--n-jobs", "1", "--episodes", "3",
            "--evaluation-episodes", "2", "--preset", "paper", "--out", str(out)]  # fmt: skip
    assert run([*line, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [one["seed"] for one in found["runs"]] == [0, 1]
    assert sum(one["winner"] for one in found["runs"]) == 1
    assert found["judged"]["episodes"] == 1000
    assert run(["evaluate", str(out), "--episodes", "5"]) == 0
    small = str(tmp_path / "small.json")
    with little_search():
        assert run(["compress", str(out), "--out", small, "--episodes", "20"]) == 0
    assert eutree.TreePolicy.load(small).environment is not None
    assert run(["compress", str(out), "--imagined", "--max-leaves", "2", "--out", small]) == 0
    capsys.readouterr()
    assert run([*line, "--resume"]) == 0
    assert "The best of 2 runs" in capsys.readouterr().out
    assert run([*line, "--resume", "--offline"]) == 2
