"""Golden files: whatever a version wrote, every later version reads."""

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from eutree.data import Demonstrations
from eutree.data.journal import recover_episode
from eutree.files import read_arrays, read_document, write_document
from eutree.policies import TreePolicy
from eutree.training.checkpoint import restore_checkpoint, stored_observations, write_checkpoint
from eutree.training.run_folder import ConfigDocument
from eutree_lab.paper.runs import RunRecord
from tests.data.strategies import same
from tests.files.loaders import unstarted
from tests.golden import contents
from tests.golden.versions import VERSIONS

MADE_BY = re.compile(rb'"made_by": "eutree [^"]*"')


def comparable(data):
    return MADE_BY.sub(b"", data)


def test_there_are_golden_files():
    assert VERSIONS


@pytest.mark.promise(6)
@pytest.mark.parametrize("version", VERSIONS, ids=lambda path: path.name)
def test_golden_files_open(version):
    record = read_document(version / "experiment-run.json", RunRecord)
    mine = contents.experiment_run()
    assert (record.spec, record.curve, record.final) == (mine.spec, mine.curve, mine.final)
    assert TreePolicy.load(version / "policy.json") == contents.policy()
    demos = contents.demonstrations()
    assert same(Demonstrations.load(version / "demonstrations"), demos)
    recovered = recover_episode(version / "running.journal")
    expected = replace(demos.episodes[1], ending="interrupted", is_success=None)
    assert recovered.equals(expected)
    from_csv = Demonstrations.from_csv(version / "demos.csv", schema=demos.schema)
    assert [e.ending for e in from_csv.episodes] == [e.ending for e in demos.episodes]
    assert np.array_equal(from_csv.observations, demos.observations)
    from_npz = Demonstrations.from_npz(version / "demos.npz", schema=demos.schema)
    assert np.array_equal(from_npz.observations, demos.observations)
    assert np.array_equal(from_npz.actions, demos.actions)


@pytest.mark.promise(6)
@pytest.mark.parametrize("name", contents.METHODS)
@pytest.mark.parametrize("version", VERSIONS, ids=lambda path: path.name)
def test_golden_runs_open(version, name, tmp_path):
    """The learner of an old checkpoint is the one whose policy stands beside it."""
    folder = version / name
    policy = TreePolicy.load(folder / "policy.json")
    assert read_document(folder / "config.json", ConfigDocument).seed == 7
    run = unstarted(contents.METHODS[name])
    restore_checkpoint(folder / "checkpoint.npz", run)
    problem = replace(run.beginning.problem, schema=policy.schema, environment=policy.environment)
    mine = run.learner.decisions().policy(problem)
    assert replace(mine, leaves=policy.leaves) == policy
    assert (mine.leaves is None) == (policy.leaves is None)
    known = () if policy.leaves is None else ("visits", "values", "deviations")
    for field in known:  # numpy may sum in another order elsewhere
        stored = getattr(policy.leaves, field)
        np.testing.assert_allclose(getattr(mine.leaves, field), stored, rtol=1e-9)
    assert (run.episode, len(run.curve)) == (12, 3)
    assert len(stored_observations(folder)) == run.learner.history.size
    write_checkpoint(tmp_path / "checkpoint.npz", run)
    if version == VERSIONS[-1]:  # else: the format has changed; count its version up
        mine, golden = (read_arrays(at / "checkpoint.npz") for at in (tmp_path, folder))
        assert mine.keys() == golden.keys()
        assert all(mine[key].tobytes() == golden[key].tobytes() for key in mine)


@pytest.mark.promise(6)
@pytest.mark.promise(8)
@pytest.mark.parametrize("name", ["run", "run-bounded"])
@pytest.mark.parametrize("version", VERSIONS, ids=lambda path: path.name)
def test_golden_runs_go_on(version, name, tmp_path):
    shutil.copytree(version / name, tmp_path / "run")
    result = contents.learn(name, tmp_path / "run", episodes=14, resume=True)
    assert [point.episode for point in result.curve] == [0, 10, 12, 14]
    assert TreePolicy.load(tmp_path / "run" / "policy.json") == result.policy


@pytest.mark.promise(4)
def test_the_newest_golden_files_are_what_is_written_now(tmp_path):
    """Fails when the bytes change: then count the format's version up and add golden files."""
    newest = VERSIONS[-1]
    contents.policy().save(tmp_path / "policy.json")
    contents.demonstrations().to_csv(tmp_path / "demos.csv")
    contents.demonstrations().to_npz(tmp_path / "demos.npz")
    write_document(tmp_path / "experiment-run.json", contents.experiment_run())
    for name in ("policy.json", "demos.csv", "demos.npz", "experiment-run.json"):
        assert comparable((tmp_path / name).read_bytes()) == comparable(
            (newest / name).read_bytes()
        ), name
    contents.demonstrations().save(tmp_path / "demos")
    for path in (tmp_path / "demos").iterdir():
        mine, golden = path.read_bytes(), (newest / "demonstrations" / path.name).read_bytes()
        if path.suffix == ".json":
            assert comparable(mine) == comparable(golden)
        else:  # the made_by inside has a checksum
            assert len(mine) == len(golden)
