"""Damaged files end in a model or in a FormatError; never a crash, hang or giant allocation."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from eutree.errors import FormatError
from tests.files.loaders import GOLDEN, LOADERS, prepare

ROOT = Path(__file__).parents[2]
CORPUS = Path(__file__).parents[1] / "corpus"
SEED = int(os.environ.get("EUTREE_FUZZ_SEED", "0"))


def run_fuzz(folder, count, *kinds):
    done = subprocess.run(
        [sys.executable, "-m", "tests.files.loaders", str(folder), str(count), str(SEED), *kinds],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"src{os.pathsep}."},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)


@pytest.mark.promise(2)
def test_1_000_mutations_of_each_kind(tmp_path):
    checkpoints = [kind for kind in LOADERS if kind.startswith("checkpoint-")]
    assert len(checkpoints) == 4  # of four methods, each loaded by one and the same loader
    refused = run_fuzz(tmp_path, 250, *checkpoints)
    others = run_fuzz(tmp_path, 1000, *(kind for kind in LOADERS if kind not in checkpoints))
    assert set(refused) | set(others) == set(LOADERS)
    # A journal that is cut or damaged is no error: it ends there.
    assert all(count > 250 for count in others.values()), others
    assert all(count > 62 for count in refused.values()), refused


@pytest.mark.promise(2)
@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("kind", LOADERS)
def test_10_000_mutations(tmp_path, kind):
    assert run_fuzz(tmp_path, 10_000, kind)[kind] > 2500


CONTROLS = {
    "crash": "lambda path: 1 / 0",
    "hang": "lambda path: [None for _ in iter(int, 1)]",
    "allocation": "lambda path: bytearray(2**31)",
}


@pytest.mark.promise(2)
@pytest.mark.parametrize("control", CONTROLS)
def test_the_harness_catches_bad_loaders(tmp_path, control):
    code = (
        "import sys\nfrom pathlib import Path\nfrom tests.files import loaders\n"
        "golden, name, load, damages = loaders.LOADERS['csv']\n"
        "loaders.SECONDS = 0.2\n"
        "calls = []\n"
        f"bad = {CONTROLS[control]}\n"
        "def first_good(path):\n"
        "    calls.append(path)\n"
        "    return load(path) if len(calls) == 1 else bad(path)\n"
        "loaders.LOADERS['csv'] = (golden, name, first_good, damages)\n"
        f"loaders.fuzz('csv', 5, 0, Path({str(tmp_path)!r}))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"src{os.pathsep}."},
        capture_output=True,
        text=True,
    )
    errors = {"crash": "ZeroDivisionError", "hang": "TimeoutError", "allocation": "MemoryError"}
    assert done.returncode == 1
    assert errors[control] in done.stderr


@pytest.mark.promise(2)
@pytest.mark.parametrize(
    "attack", sorted(p.relative_to(CORPUS).as_posix() for p in CORPUS.glob("*/*"))
)
def test_the_attacks_of_the_corpus_are_refused(tmp_path, attack):
    kind = attack.split("/")[0]
    path, _, load, _ = prepare(kind, tmp_path)
    path.write_bytes((CORPUS / attack).read_bytes())
    with pytest.raises(FormatError) as caught:
        load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.promise(2)
def test_every_prefix_of_a_file_is_refused(tmp_path):
    for kind in ("policy", "header", "episode", "npz", "run", "checkpoint-run"):
        (tmp_path / kind).mkdir()
        path, valid, load, _ = prepare(kind, tmp_path / kind)
        whole = len(valid.rstrip()) if path.suffix == ".json" else len(valid)
        for end in range(0, whole, max(7, whole // 300)):
            path.write_bytes(valid[:end])
            with pytest.raises(FormatError):
                load(path)


def test_there_is_a_corpus():
    assert len(list(CORPUS.glob("*/*"))) >= 20
    assert GOLDEN.exists()
