"""Golden files: whatever a version wrote, every later version reads."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eutree.data import Demonstrations
from eutree.data.journal import recover_episode
from eutree.policies import TreePolicy
from tests.data.strategies import same
from tests.golden import contents

VERSIONS = sorted(path for path in Path(__file__).parent.glob("v*") if path.is_dir())
MADE_BY = re.compile(rb'"made_by": "eutree [^"]*"')


def comparable(data):
    return MADE_BY.sub(b"", data)


def test_there_are_golden_files():
    assert VERSIONS


@pytest.mark.promise(6)
@pytest.mark.parametrize("version", VERSIONS, ids=lambda path: path.name)
def test_golden_files_open(version):
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


@pytest.mark.promise(4)
def test_the_newest_golden_files_are_what_is_written_now(tmp_path):
    """Fails when the bytes change: then count the format's version up and add golden files."""
    newest = VERSIONS[-1]
    contents.policy().save(tmp_path / "policy.json")
    contents.demonstrations().to_csv(tmp_path / "demos.csv")
    contents.demonstrations().to_npz(tmp_path / "demos.npz")
    for name in ("policy.json", "demos.csv", "demos.npz"):
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
