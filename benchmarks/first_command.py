"""What the first command after an installation costs: from an empty cache of compiled kernels.

    python benchmarks/first_command.py [src ...]

Each command runs twice, in processes of its own: with NUMBA_CACHE_DIR at an empty folder, and again
with what is there now. CPU seconds (user and system) of all its processes are printed, and after
how many seconds of the clock it says a first word on standard error. Name the ``src`` folders of
two checkouts to compare them. ``warm-up`` is left out where a checkout has none.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).parents[1] / "src"
TASK = "eutree/Evasion2-v0"
COMMANDS = {
    "fit": ("fit", "demos"),
    "learn": ("learn", TASK, "--demos", "demos", "--episodes", "60"),
    "warm-up": ("warm-up",),
}


def run(source: Path, cache: Path, folder: Path, *line: str) -> tuple[float, float]:
    """Return CPU seconds of a command, and seconds of the clock until its first word."""
    environment = {**os.environ, "PYTHONPATH": str(source), "NUMBA_CACHE_DIR": str(cache)}
    environment.pop("EUTREE_JIT", None)
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    with subprocess.Popen(
        [sys.executable, "-m", "eutree", *line], cwd=folder, env=environment, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stderr is not None
        process.stderr.readline()
        heard = time.monotonic() - begin
        said = process.stderr.read()
    if process.returncode:
        raise SystemExit(said)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, heard


def main() -> None:
    sources = [Path(name).resolve() for name in sys.argv[1:]] or [HERE]
    print("| source | command | CPU s, nothing kept | first word, s | CPU s, again |")
    print("|---|---|---|---|---|")
    for source in sources:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            recorded = ("record", TASK, "--expert", "gate", "--episodes", "8", "--out", "demos")
            run(source, folder / "cache", folder, *recorded)
            for command, line in COMMANDS.items():
                main = (source / "eutree/cli/main.py").read_text()
                if command == "warm-up" and f'"{command}"' not in main:
                    continue
                cache = folder / f"cache-{command}"
                cache.mkdir()
                outs = [
                    () if command == "warm-up" else ("--out", f"{command}{k}.json") for k in "12"
                ]
                cold, heard = run(source, cache, folder, *line, *outs[0])
                warm, _ = run(source, cache, folder, *line, *outs[1])
                row = f"{cold:.1f} | {heard:.1f} | {warm:.1f}"
                print(f"| {source} | {command} | {row} |", flush=True)


if __name__ == "__main__":
    main()
