"""Attack the project and count what breaks: damaged files, kills, and splits of noise.

    python benchmarks/faults.py      # all of it, as a page of Markdown; about ten minutes
    python benchmarks/faults.py --files 8000 --kills 30 --leaves 300 --seed 1

* *Files.* Valid files of every kind are cut, flipped, spliced and rewritten; each must load or be
  refused with ``FormatError``, within 2 seconds and 1 GB (``tests/files/loaders.py``).
* *Kills.* ``eutree learn`` with a race at its end is killed (kill -9) at random moments and
  resumed; the folder must end with the bytes of an undisturbed run.
* *Noise.* Leaves whose returns have nothing to do with the observations are put to the test of
  every preset that splits leaves: by itself, and with returns that are alike within an episode.

What ``compress`` promises of the return is simulated by ``benchmarks/compression_promise.py``.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "src")]

from tests.files.loaders import LOADERS  # noqa: E402
from tests.training.processes import COMMAND, digests, finish, identity, start, wait_for_new  # noqa: E402

from eutree.evaluation.evaluation import wilson_interval  # noqa: E402
from eutree.learners import PRESETS  # noqa: E402
from eutree.learners.u_tree import UTreeMethod  # noqa: E402
from eutree.splitting import LeafSample  # noqa: E402

RACE = ("--episodes", 24, "--evaluate-every", 12, "--evaluation-episodes", 10,
        "--race-steps", 4000)  # fmt: skip
ROWS, EPISODES, FEATURES = 400, 40, 3  # of a leaf of noise


PAGE = """# Attacked: files, kills, noise

What `benchmarks/faults.py` found. Short forms of all of it run in `make test`, each with a control
that it must catch; the long forms of `tests/files` and `tests/training/test_interruptions.py` are
part of `make test-all`.

* Files: {files}.
* Kills: {kills}.
* [What `compress` promises of the return](compression-promise.md) is simulated on its own page.

## Splits of noise

{leaves} leaves of {rows} transitions in {episodes} episodes, {features} continuous features and two
actions. The returns have nothing to do with the observations; *clustered*, both are nearly the same
within an episode. Share of leaves that were split, with Wilson's 95 % interval. The paper's test is
read literally, so its level means little; `corrected` permutes whole episodes.

| preset | nominal | independent | clustered in episodes |
|---|---|---|---|
{table}
"""


def files(count: int, seed: int) -> str:
    """Load damaged files of every kind; a crash, a hang or an allocation ends the benchmark."""
    of_each = -(-count // len(LOADERS))
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [
                sys.executable,
                "-m",
                "tests.files.loaders",
                folder,
                str(of_each),
                str(seed),
                *LOADERS,
            ],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": f"src{os.pathsep}."},
            capture_output=True,
            text=True,
            check=True,
        )
    refused = json.loads(done.stdout)
    total = of_each * len(refused)
    return (
        f"{total:,} damaged files of {len(refused)} kinds: {sum(refused.values()):,} refused with "
        f"place and reason, {total - sum(refused.values()):,} still good; no crash, no hang beyond "
        "2 s, no allocation beyond 1 GB"
    )


def kills(count: int, seed: int) -> str:
    """Kill and resume a run with a race at its end; compare its bytes with an undisturbed one."""
    from eutree.cli.main import run

    chance = random.Random(seed)
    killed = racing = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        demos = ("record", "eutree/Evasion2-v0", "--expert", "gate", "--episodes", 6)
        assert run([*map(str, demos), "--out", str(folder / "demos")]) == 0
        line = ("learn", "--demos", folder / "demos", "--seed", seed, *RACE)
        assert run([*map(str, line), "--out", str(folder / "whole")]) == 0
        wanted = digests(folder / "whole")
        for attempt in range(count):
            place = folder / f"run-{attempt // 5}"
            before = identity(place / "checkpoint.npz")
            options = ("--out", place, "--resume", "--checkpoint-seconds", 0)
            process = start(*line, *options, code=COMMAND)
            wait_for_new(place / "checkpoint.npz", before, process)
            time.sleep(chance.uniform(0.0, 2.5))
            os.kill(process.pid, signal.SIGKILL)
            code, error = finish(process)
            assert code in (-signal.SIGKILL, 0), error
            killed += code == -signal.SIGKILL
            racing += code == -signal.SIGKILL and "race" in events(place)
            if attempt % 5 == 4 or attempt == count - 1:
                code, error = finish(start(*line, "--out", place, "--resume"))
                assert code == 0, error
                assert digests(place) == wanted, f"{place} ended with other bytes"
    return (
        f"{killed} of {count} kills struck while it ran, {racing} of them in the race; every run "
        "ended with the bytes of an undisturbed one"
    )


def events(folder: Path) -> str:
    """Return the names of what a run's checkpoint says has happened."""
    from eutree.files import read_archive
    from eutree.training.checkpoint import CHECKPOINT, MAX_CHECKPOINT, CheckpointDocument

    _, arrays = read_archive(folder / CHECKPOINT, CheckpointDocument, limit=MAX_CHECKPOINT)
    return " ".join(arrays)


def noise(generator: np.random.Generator, *, clustered: bool) -> LeafSample:
    """Return a leaf whose returns have nothing to do with its observations.

    Clustered, observations and returns both are nearly the same within an episode.
    """
    episodes = np.sort(generator.integers(EPISODES, size=ROWS))
    rows, returns = generator.normal(size=(ROWS, FEATURES)), generator.normal(size=ROWS)
    if clustered:
        rows = generator.normal(size=(EPISODES, FEATURES))[episodes] + 0.1 * rows
        returns = generator.normal(size=EPISODES)[episodes] + 0.1 * returns
    return LeafSample(rows, returns, generator.integers(2, size=ROWS), episodes)


def false_splits(leaves: int, seed: int) -> list[str]:
    """Return a row of the table for each preset whose leaves are split by a test."""
    rows = []
    for name, method in PRESETS.items():
        if not isinstance(method, UTreeMethod):
            continue
        cells = []
        for clustered in (False, True):
            generator = np.random.default_rng((seed, int(clustered)))
            found = sum(
                method.cut(noise(generator, clustered=clustered), generator) is not None
                for _ in range(leaves)
            )
            low, high = wilson_interval(found, leaves)
            cells.append(f"{found / leaves:.1%} [{low:.1%}, {high:.1%}]")
        rows.append(f"| `{name}` | {method.significance.alpha:.0%} | {cells[0]} | {cells[1]} |")
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=8000)
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--leaves", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="page to write")
    options = parser.parse_args()
    page = PAGE.format(
        files=files(options.files, options.seed),
        kills=kills(options.kills, options.seed),
        leaves=options.leaves,
        rows=ROWS,
        episodes=EPISODES,
        features=FEATURES,
        table="\n".join(false_splits(options.leaves, options.seed)),
    )
    print(page)
    if options.out is not None:
        options.out.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
