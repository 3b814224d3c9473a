"""The same command lines write the same bytes in any process, and without compiled code."""

import hashlib

import pytest

from tests.training.processes import finish, start

MAIN_JOB = (
    ("record", "eutree/Evasion2-v0", "--expert", "gate", "--episodes", 4, "--out", "{0}/demos"),
    ("fit", "{0}/demos", "--out", "{0}/expert.json"),
    (
        *("learn", "--demos", "{0}/demos", "--out", "{0}/run", "--preset", "{1}"),
        *("--seed", "{2}", "--episodes", 5, "--evaluation-episodes", 3),
    ),
)


def written(folder, *, preset="default", seed=3, **environment):
    """Run the main job in processes of its own; return the digest of each file it writes."""
    for line in MAIN_JOB:
        arguments = [str(part).format(folder, preset, seed) for part in line]
        code, err = finish(start(*arguments, **environment))
        assert code == 0, err
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in (".lock", "command.json")  # it names the folder
    }


@pytest.mark.slow
@pytest.mark.promise(13)
def test_the_order_of_hashes_does_not_matter(tmp_path):
    first, second, other = (tmp_path / name for name in "abc")
    wanted = written(first, PYTHONHASHSEED="0")
    assert written(second, PYTHONHASHSEED="4242") == wanted
    assert {"expert.json", "run/policy.json", "run/checkpoint.npz"} <= wanted.keys()
    different = written(other, seed=4)  # the control: another seed writes other bytes
    assert different["run/checkpoint.npz"] != wanted["run/checkpoint.npz"]


@pytest.mark.slow
@pytest.mark.promise(15)
@pytest.mark.parametrize("preset", ["paper", "default"])
def test_plain_python_writes_the_bytes_of_compiled_code(tmp_path, preset):
    compiled = written(tmp_path / "a", preset=preset)
    assert written(tmp_path / "b", preset=preset, EUTREE_JIT="0") == compiled
