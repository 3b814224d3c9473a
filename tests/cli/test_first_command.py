"""The first command after an installation: it says that it compiles, and compiles little."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "eutree"


PATIENT = """
import sys
from eutree import compiled
from eutree.cli.main import run
compiled.PATIENCE = 10.0  # a kernel of a small fit takes half a second here, twice that on others
raise SystemExit(run(sys.argv[1:]))
"""


def first(folder, cache, *line, jit=None):
    """Run a command with an empty cache of kernels; return its output and what it said."""
    environment = {**os.environ, "PYTHONPATH": str(SOURCE.parent), "NUMBA_CACHE_DIR": str(cache)}
    environment |= {"EUTREE_JIT": jit} if jit else {}
    if jit is None:
        environment.pop("EUTREE_JIT", None)
    done = subprocess.run(
        [sys.executable, "-c", PATIENT, *map(str, line)], cwd=folder, env=environment,
        capture_output=True, text=True, timeout=400, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def test_a_small_fit_compiles_nothing_and_gives_the_same_bytes(demonstrations, tmp_path):
    """It took 17 seconds, 15 of them in silence for machine code that was used for a second."""
    cache = tmp_path / "cache"
    cache.mkdir()
    _, said = first(tmp_path, cache, "fit", demonstrations, "--out", "a.json", "--episodes", 20)
    assert "compiling" not in said
    assert not list(cache.rglob("*.nbc"))
    first(tmp_path, cache, "fit", demonstrations, "--out", "b.json", "--episodes", 20, jit="0")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


PROGRAM = """
import sys, time
from eutree import compiled
from eutree.cli._output import said_what_is_compiled
compiled.PATIENCE, compiled.LARGE = float(sys.argv[1]), int(sys.argv[2])
import numpy as np
from eutree.trees import DecisionTree
tree = DecisionTree.single_leaf(2).split(0, 1, 0.5)
rows = np.random.default_rng(0).random((100, 2))
with said_what_is_compiled():
    for _ in range(3):
        found = tree.leaf_index(rows).tolist()
from eutree.trees import _kernels
print(found == (rows[:, 1] > 0.5).tolist(), len(_kernels.locate.overloads))
"""


@pytest.mark.parametrize(
    ("patience", "large", "compiled"), [(1e9, 10**9, 0), (0.0, 10**9, 1), (1e9, 10, 1)]
)
def test_a_kernel_is_compiled_once_it_takes_long_or_gets_much(patience, large, compiled, tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(SOURCE.parent), "NUMBA_CACHE_DIR": str(tmp_path)}
    environment.pop("EUTREE_JIT", None)
    for kept in (False, True):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, str(patience), str(large)], env=environment,
            capture_output=True, text=True, timeout=200, check=True,
        )  # fmt: skip
        assert done.stdout.split() == ["True", str(compiled)]
        # What is kept from before is used, without a word.
        assert ("compiling for this computer" in done.stderr) == (compiled and not kept)


WARM_UP = """
from eutree.cli import included
from eutree.cli.main import run
included.JOBS = {"fitting": included.JOBS["fitting"]}  # the others take minutes
raise SystemExit(run(["warm-up", "--n-jobs", "1", "--json"]))
"""


@pytest.mark.slow
def test_after_warm_up_nothing_is_compiled(demonstrations, tmp_path):
    cache = tmp_path / "cache"
    environment = {**os.environ, "PYTHONPATH": str(SOURCE.parent), "NUMBA_CACHE_DIR": str(cache)}
    environment.pop("EUTREE_JIT", None)
    done = subprocess.run(
        [sys.executable, "-c", WARM_UP], env=environment, check=True,
        capture_output=True, text=True, timeout=800,
    )  # fmt: skip
    assert json.loads(done.stdout)["parts"] == ["fitting"]
    assert "compiling 1/1 fitting" in done.stderr
    kept = set(cache.rglob("*.nbc"))
    assert kept
    _, said = first(tmp_path, cache, "fit", demonstrations, "--out", "a.json", jit="1")
    assert "compiling" not in said
    assert set(cache.rglob("*.nbc")) == kept
