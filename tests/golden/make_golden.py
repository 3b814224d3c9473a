"""Write the golden files of this format version; run once for each version, then never again.

python -m tests.golden.make_golden tests/golden/v3
"""

import sys
from pathlib import Path

from eutree.files import write_document
from tests.golden.contents import (
    METHODS,
    demonstrations,
    experiment_run,
    learn,
    policy,
    write_journal,
)


def main(folder: Path) -> None:
    folder.mkdir()
    policy().save(folder / "policy.json")
    demonstrations().save(folder / "demonstrations")
    demonstrations().to_csv(folder / "demos.csv")
    demonstrations().to_npz(folder / "demos.npz")
    write_journal(folder / "running.journal")
    write_document(folder / "experiment-run.json", experiment_run())
    for name in METHODS:
        learn(name, folder / name, episodes=12, resume=False)
        (folder / name / ".lock").unlink()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
