"""Freeze the learners' behaviour: run once, never again; what it wrote stays as it is.

python -m tests.golden.behaviour.make
"""

import hashlib
import json
import sys
from pathlib import Path

from tests.golden.behaviour.cases import CASES, RACED, SEEDS, behaviour, name_of
from tests.golden.behaviour.others import OTHER_SEEDS, OTHERS, other_behaviour

FOLDER = Path(__file__).parent
SUMS = FOLDER / "SHA256SUMS"


def main():
    if SUMS.exists():
        sys.exit(f"{SUMS} exists: this behaviour is frozen")
    for case in (*CASES, *RACED):
        path = FOLDER / name_of(*case)
        if path.exists():
            continue
        seeds = SEEDS if case in CASES else SEEDS[:2]
        write(path, [behaviour(*case, seed) for seed in seeds])
    for name in OTHERS:
        path = FOLDER / f"{name}.json"
        if not path.exists():
            write(path, [other_behaviour(name, seed) for seed in OTHER_SEEDS])
    files = sorted(FOLDER.glob("*.json"))
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
    SUMS.write_text("".join(lines), encoding="utf-8")


def write(path, runs):
    """Write the runs of a case, a line each."""
    lines = ",\n".join(json.dumps(run) for run in runs)
    path.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
