"""Write the golden files of this format version; run once for each version, then never again.

python -m tests.golden.make_golden tests/golden/v2
"""

import sys
from pathlib import Path

from tests.golden.contents import demonstrations, policy, write_journal


def main(folder: Path) -> None:
    folder.mkdir()
    policy().save(folder / "policy.json")
    demonstrations().save(folder / "demonstrations")
    demonstrations().to_csv(folder / "demos.csv")
    demonstrations().to_npz(folder / "demos.npz")
    write_journal(folder / "running.journal")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
