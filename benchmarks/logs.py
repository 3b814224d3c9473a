"""What reading a machine's log costs: a table with time stamps, text and empty cells.

Run: python benchmarks/logs.py [--out docs/results/logs.md]

Each reading is a process of its own, of which user and system time and the most memory are taken;
pandas reads the same file beside it, without making episodes of it.
"""

import argparse
import subprocess
import sys
import tempfile
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

ROWS = (10_000, 100_000, 1_000_000)
START = datetime(2026, 3, 1)
COLUMNS = ("time", "mode", "level [m]", "inflow [l/s]", "head", "power [kW]", "pump", "cost")

EUTREE = """
from eutree.data import Demonstrations, LogFormat
log = LogFormat(time="time", episode_gap=3600.0, nominal=("mode",), missing="hold")
read = Demonstrations.from_csv(path, columns={"action": "pump", "reward": "cost"}, log=log)
count = len(read.episodes)
"""
IMPORT = """
from eutree.cli.main import run
line = ["demos", "import", path, "--out", path + ".demos", "--time", "time", "--episode-gap", "1h"]
line += ["--nominal", "mode", "--missing", "hold", "--action-column", "pump"]
assert run([*line, "--reward-column", "cost"]) == 0
count = 0
"""
PANDAS = """
import pandas
count = len(pandas.read_csv(path, parse_dates=["time"]))
"""
MEASURE = """
import resource, sys
path = sys.argv[1]
import numpy
{body}
used = resource.getrusage(resource.RUSAGE_SELF)
print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, count, file=sys.stderr)
"""


def write(path: Path, rows: int) -> None:
    """Write a log of days of 1,000 rows, a tenth of a percent of its cells empty."""
    generator = np.random.default_rng(0)
    numbers = generator.normal(5, 2, size=(rows, 4)).round(3)
    modes = generator.choice(["auto", "hand", "service"], size=rows)
    pumps = generator.choice(["off", "low", "high"], size=rows)
    empty = generator.random((rows, 4)) < 0.001
    empty[0] = False
    with path.open("w") as file:
        file.write(",".join(COLUMNS) + "\n")
        for k in range(rows):
            at = START + timedelta(days=k // 1000, seconds=10 * (k % 1000))
            cells = [
                "" if gone else repr(float(n)) for n, gone in zip(numbers[k], empty[k], strict=True)
            ]
            file.write(f"{at},{modes[k]},{','.join(cells)},{pumps[k]},-1.5\n")


def spent(body: str, path: Path) -> tuple[float, float]:
    """Return seconds of the processor and MiB of memory that a reading takes."""
    program = MEASURE.format(body=body)
    done = subprocess.run(
        [sys.executable, "-c", program, str(path)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    seconds, memory, _ = done.stderr.splitlines()[-1].split()
    return float(seconds), float(memory)


def table() -> str:
    lines = [
        "| rows | MB | read, CPU s | against pandas | MiB | imported to a folder, CPU s | MiB |",
        "|---|---|---|---|---|---|---|",
    ]
    for rows in ROWS:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "log.csv"
            write(path, rows)
            size = path.stat().st_size / 1e6
            ours, peer, whole = (spent(body, path) for body in (EUTREE, PANDAS, IMPORT))
        lines.append(
            f"| {rows:,} | {size:.1f} | {ours[0]:.1f} | {ours[0] / peer[0]:.1f} x | {ours[1]:.0f} "
            f"| {whole[0]:.1f} | {whole[1]:.0f} |"
        )
    return "\n".join(lines)


PAGE = """# What reading a log costs

Made by `python benchmarks/logs.py`. A log of eight columns (a time stamp, a mode in text, four
numbers of which one cell in a thousand is empty, the action's name, a reward), days of 1,000 rows
that a pause divides. Read by `Demonstrations.from_csv` with a `LogFormat`, and imported to a folder
by `eutree demos import`; each in a process of its own, start of Python and imports included. pandas
reads the same file in the same run, and makes no episodes of it.

{table}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/results/logs.md"))
    arguments = parser.parse_args()
    arguments.out.write_text(PAGE.format(table=table()))
    print(arguments.out.read_text())


if __name__ == "__main__":
    main()
