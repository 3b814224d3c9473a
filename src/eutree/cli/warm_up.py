"""``eutree warm-up``: compile everything now, so that no later command waits for it."""

import io
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import click

from eutree.cli._options import count_option, json_option
from eutree.cli._output import Output
from eutree.errors import EutreeError

_TASK = "eutree/Evasion2-v0"
_SHORT = ("--episodes", "40", "--evaluate-every", "40", "--evaluation-episodes", "4")
_NETWORKS = (
    "--method", "distilled-dqn", "--steps", "3000", "--evaluate-every", "1000",
    "--evaluation-episodes", "4", "--set", "teacher.updates_per_step=0.01",
    "--set", "demonstration_updates=1", "--set", "world_model.updates=1",
    "--set", "world_model.more_updates=1",
)  # fmt: skip
# What compiles it: by name, a command to which demonstrations are added; the longest first.
JOBS = {
    "planning": ("learn", _TASK, *_SHORT),
    "fitting": ("fit", "--episodes", "20"),
    "networks": ("learn", _TASK, *_NETWORKS),
    "u-tree": ("learn", _TASK, "--method", "corrected", *_SHORT),
    "paper": ("learn", _TASK, "--method", "paper", *_SHORT),
}


@click.command(name="warm-up", epilog="Example: eutree warm-up")
@count_option("--n-jobs", 2, "Processes that compile at the same time.")
@json_option
def warm_up(n_jobs: int, as_json: bool) -> None:
    """Compile the loops of fitting, planning and learning for this computer.

    What is compiled is kept beside the package, or where NUMBA_CACHE_DIR says.
    """
    from eutree.parallel import Workers

    output = Output(as_json=as_json)
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        record = ("record", _TASK, "--expert", "gate", "--episodes", "5")
        _compiled_by(record, Path(folder) / "demos")
        with output.progress("compiling", len(JOBS)) as progress:
            task = _Job(Path(folder))
            for count, name in enumerate(Workers(n_jobs).as_finished(task, list(JOBS)), 1):
                progress.update(count, name)
    seconds = time.monotonic() - begin
    output.result({"seconds": seconds, "parts": list(JOBS)}, f"compiled in {seconds:.0f} s")


class _Job:
    """Runs one of the commands, in whichever process this is; returns its name."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __call__(self, name: str) -> str:
        verb, *rest = JOBS[name]
        demos = str(self._folder / "demos")
        given = [demos] if verb == "fit" else ["--demos", demos]
        _compiled_by((verb, *rest, *given), self._folder / f"{name}.json")
        return name


def _compiled_by(command: tuple[str, ...], out: Path) -> None:
    """Run a command whose kernels are compiled at their first call.

    Raises:
        EutreeError: It failed.
    """
    from eutree import compiled
    from eutree.cli.main import run

    said, before = io.StringIO(), compiled.AT_ONCE
    compiled.AT_ONCE = True
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(said):
            code = run([*command, "--out", str(out)])
    finally:
        compiled.AT_ONCE = before
    if code:
        lines = said.getvalue().strip().splitlines() or [f"exit code {code}"]
        raise EutreeError(f"{command[0]} could not be compiled: {lines[-1]}")
