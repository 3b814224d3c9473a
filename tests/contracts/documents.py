"""Finds and runs the code blocks of README.md and the pages in docs/.

Every ``python`` block of a page runs, in order, in one namespace and one empty folder. Every
``console`` block runs there too, line by line: what follows ``$ `` is a command that must succeed.
A comment on the line before a block says what else is meant:

- ``<!-- no-run: reason -->``: only compiled (Python) or left alone (console);
- ``<!-- needs: program -->``: left alone where the program is not installed, except in CI;
- ``<!-- file: name -->``: written to a file of that name in the folder, not run;
- ``<!-- output -->``: what the block before it has printed, to the letter;
- ``<!-- printed -->``: the same when it was last written, not compared, because it changes with
  the learner. ``python -m tests.contracts.documents docs/tutorial.md`` writes both anew.
"""

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from eutree.cli.main import run
from tests import patience
from tests.export.tools import need

ROOT = Path(__file__).parents[2]
FENCE = re.compile(
    r"(?:<!-- (?P<mark>no-run|needs|file|output|printed)(?:: (?P<value>[^>]+))? -->\s*\n)?"
    r"^(?P<indent> *)```(?P<language>[\w{}.-]*)[^\n]*\n(?P<code>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)


class Block(NamedTuple):
    """One fenced block."""

    line: int
    language: str
    code: str
    mark: str = ""
    value: str = ""


def pages() -> list[Path]:
    """Return README.md, CONTRIBUTING.md and every page of the documentation."""
    own = sorted(p for p in (ROOT / "docs").rglob("*.md") if "_build" not in p.parts)
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *own]


def blocks(page: Path) -> list[Block]:
    """Return the blocks of a page, in order."""
    text = page.read_text()
    return [
        Block(
            line=text.count("\n", 0, match.start("code")) + 1,
            language=match["language"],
            code=match["code"],
            mark=match["mark"] or "",
            value=match["value"] or "",
        )
        for match in FENCE.finditer(text)
    ]


def run_block(
    block: Block,
    namespace: dict[str, Any],
    *,
    page: Path,
    folder: Path,
    printed: str = "",
    quickly: bool = False,
) -> str:
    """Run one block; raises what it raises, or AssertionError. Return what it printed."""
    if block.mark == "file":
        (folder / block.value).write_text(block.code)
    elif block.mark == "printed":
        assert printed.strip(), f"{page}:{block.line}"
    elif block.mark == "output":
        assert block.code.strip() == printed.strip(), f"{page}:{block.line}"
    elif block.language == "python":
        padding = "\n" * (block.line - 1)  # so that a traceback names the page's line
        code = compile(padding + block.code, str(page), "exec")
        if block.mark != "no-run":
            with contextlib.redirect_stdout(io.StringIO()) as output:
                exec(code, namespace)
            return output.getvalue()
    elif block.language == "console" and block.mark != "no-run":
        if block.mark == "needs":
            need(block.value)
        lines = [line[2:] for line in block.code.splitlines() if line.startswith("$ ")]
        return "".join(run_command(line, folder, quickly=quickly) for line in lines)
    return ""


# So many episodes show that a line works; the line itself is about what comes of hundreds or
# thousands. What comes before a block that shows what is printed (`output`) is run as it stands.
ENOUGH = {"fit": 20, "learn": 30, "evaluate": 50, "compress": 50, "distill": 2, "show": 3}
RACED = 2000  # steps, of which the same is true


def shortened(words: list[str]) -> list[str]:
    """Return the words of a line of ``eutree`` with no more episodes than show that it works."""
    most = ENOUGH.get(" ".join(words[1:2]))
    if most is None or "--list-settings" in words:
        return words
    if "--episodes" not in words:
        words = [*words, "--episodes", str(most)]
    return _at_most(_at_most(words, "--episodes", most), "--race-steps", RACED)


def _at_most(words: list[str], option: str, most: int) -> list[str]:
    if option not in words:
        return words
    place = words.index(option) + 1
    return [*words[:place], str(min(most, int(words[place]))), *words[place + 1 :]]


def run_command(line: str, folder: Path, *, quickly: bool = False) -> str:
    """Run one command line in ``folder``, the current one; return its standard output.

    ``eutree`` is run in this process, which spares the time of starting another for each line; with
    ``| cat`` behind it, too, which hides its exit code.

    Args:
        line: The command line.
        folder: Where.
        quickly: Play no more episodes than show that the line works.
    """
    words = shlex.split(line, comments=True)
    hides_code = words[-2:] == ["|", "cat"]
    words = words[:-2] if hides_code else words
    if words[0] == "eutree" and not {"|", ">", "<", "&&"} & set(words):
        words = shortened(words) if quickly else words
        output = io.StringIO()
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            code = run(words[1:])
        # No line of a page is refused (2).
        assert code == 0 or (hides_code and code != 2), f"$ {line}\n{output.getvalue()}"
        return output.getvalue()
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    result = subprocess.run(
        ["bash", "-euc", line], cwd=folder, env={**os.environ, "PATH": programs},
        capture_output=True, text=True, timeout=patience.ENOUGH, check=False,
    )  # fmt: skip
    assert result.returncode == 0, f"$ {line}\n{result.stdout}{result.stderr}"
    return result.stdout


def rewrite(page: Path, folder: Path) -> None:
    """Run a page in ``folder`` and write what its blocks print into the page."""
    lines, printed, namespace = page.read_text().splitlines(), "", {"__name__": "__main__"}
    written = []
    for block in blocks(page):
        if block.mark in ("output", "printed"):
            written.append((block, [line.rstrip() for line in printed.strip().splitlines()]))
        elif block.language in ("python", "console") or block.mark == "file":
            printed = run_block(block, namespace, page=page, folder=folder)
    for block, new in reversed(written):
        first = block.line - 1
        lines[first : first + len(block.code.splitlines())] = new
    page.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as work:
        target = Path(sys.argv[1]).resolve()
        os.chdir(work)
        sys.path.insert(0, work)
        rewrite(target, Path(work))
