"""Finds and runs the code blocks of README.md and the pages in docs/.

Every ``python`` block of a page runs, in order, in one namespace and one empty folder. Every
``console`` block runs there too, line by line: what follows ``$ `` is a command that must succeed.
A block behind ``<!-- no-run: reason -->`` is only compiled (Python) or left alone (console).
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
FENCE = re.compile(
    r"(?P<marker><!-- no-run: [^>]+ -->\s*\n)?^(?P<indent> *)```(?P<language>python|console|sh)\n"
    r"(?P<code>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)


class Block(NamedTuple):
    """One fenced block of code."""

    line: int
    language: str
    code: str
    runs: bool


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
            runs=not match["marker"],
        )
        for match in FENCE.finditer(text)
    ]


def run_block(block: Block, namespace: dict[str, Any], *, page: Path, folder: Path) -> None:
    """Run one block; raises what it raises, or CalledProcessError."""
    if block.language == "python":
        padding = "\n" * (block.line - 1)  # so that a traceback names the page's line
        code = compile(padding + block.code, str(page), "exec")
        if block.runs:
            exec(code, namespace)
    elif block.language == "console" and block.runs:
        for line in block.code.splitlines():
            if line.startswith("$ "):
                run_command(line[2:], folder)


def run_command(line: str, folder: Path) -> str:
    """Run one command line; ``eutree`` is this source tree's. Return its standard output."""
    eutree = f"{shlex.quote(sys.executable)} -m eutree"
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "NO_COLOR": "1"}
    result = subprocess.run(
        ["bash", "-euc", f'eutree() {{ {eutree} "$@"; }}\n{line}'],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, f"$ {line}\n{result.stdout}{result.stderr}"
    return result.stdout
