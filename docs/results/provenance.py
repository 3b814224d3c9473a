"""Where the figures of docs/results come from, and which of them are older than their sources.

Every page there begins with four lines between two rules: the command that makes its figures, the
commit and the date of the code that it ran on, and the files that decide them.

    python docs/results/provenance.py           # list the pages that are older than their sources
    python docs/results/provenance.py --renew   # run their commands (hours, for some)
    python docs/results/provenance.py --stamp PAGE   # after its command was run by hand

A page whose sources have changed since its commit is not wrong, but nobody has looked. Scripts
write pages without the lines; ``--renew`` and ``--stamp`` put them back, of the present commit, and
wrap the prose.
"""

import argparse
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from wrapping import wrapped

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path("docs/results")
RULE = "---"


@dataclass(frozen=True)
class Provenance:
    """Where the figures of a page come from.

    Attributes:
        command: What makes them, run in the root of the repository; several are joined by " && ".
        commit: The commit of the code that it ran on.
        date: The day, as 2026-11-22.
        sources: Files and folders that decide the figures, from the root of the repository.
    """

    command: str
    commit: str
    date: str
    sources: tuple[str, ...]

    def __str__(self) -> str:
        """Return the lines that a page begins with."""
        lines = [
            RULE,
            f"command: {self.command}",
            f"commit: {self.commit}",
            f"date: {self.date}",
            f"sources: {' '.join(self.sources)}",
            RULE,
        ]
        return "\n".join(lines) + "\n"

    def now(self, root: Path = ROOT) -> "Provenance":
        """Return that of the same figures, made by the present commit, today."""
        commit = _git(root, "rev-parse", "--short", "HEAD").strip()
        return replace(self, commit=commit, date=datetime.now(UTC).date().isoformat())

    @classmethod
    def of(cls, text: str) -> "Provenance":
        """Return that of a page's text.

        Raises:
            ValueError: The page does not begin with the four lines, or has them twice.
        """
        head, *rest = text.split(f"{RULE}\n", 2)
        if head or len(rest) != 2:
            raise ValueError(f"a page of figures must begin with {RULE!r}, got {text[:40]!r}")
        if rest[1].lstrip("\n").startswith(RULE):
            raise ValueError("a page of figures must say once where it comes from, got it twice")
        entries = dict(line.split(": ", 1) for line in rest[0].splitlines())
        if list(entries) != ["command", "commit", "date", "sources"]:
            raise ValueError(f"must give command, commit, date and sources, got {list(entries)}")
        return cls(
            entries["command"],
            entries["commit"],
            entries["date"],
            tuple(entries["sources"].split()),
        )

    def in_history(self, root: Path = ROOT) -> bool:
        """Return whether its commit is HEAD or before it."""
        command = ["git", "merge-base", "--is-ancestor", self.commit, "HEAD"]
        return subprocess.run(command, cwd=root, capture_output=True).returncode == 0

    def changes(self, root: Path = ROOT) -> list[str]:
        """Return the commits since then that changed a source, newest first, a line each.

        A commit that the history does not hold (rebased away, or a shallow clone) leaves the age
        unknown; the page is then listed with that one line.
        """
        if not self.in_history(root):
            return [f"unknown: {self.commit} is not in the history of HEAD"]
        log = _git(root, "log", "--oneline", f"{self.commit}..HEAD", "--", *self.sources)
        return log.splitlines()


def pages(root: Path = ROOT) -> dict[str, Provenance]:
    """Return the provenance of each page of figures, by the page's name."""
    found = sorted((root / FOLDER).glob("*.md"))
    return {path.stem: Provenance.of(path.read_text()) for path in found if path.stem != "index"}


def outdated(root: Path = ROOT) -> dict[str, list[str]]:
    """Return the pages that are older than their sources, each with the commits since."""
    since = {name: page.changes(root) for name, page in pages(root).items()}
    return {name: changes for name, changes in since.items() if changes}


def renew(names: Sequence[str], root: Path = ROOT) -> None:
    """Run the commands of pages; a page that its command has written anew gets the present date."""
    known = pages(root)
    for name in names:
        path = root / FOLDER / f"{name}.md"
        before = path.read_bytes()
        for command in known[name].command.split(" && "):
            print(f"{name}: {command}", flush=True)
            subprocess.run(shlex.split(command), cwd=root, check=True)
        if path.read_bytes() != before:
            stamp(name, root)


def stamp(name: str, root: Path = ROOT) -> None:
    """Begin a page with the present commit and date; command and sources as they were committed."""
    path = root / FOLDER / f"{name}.md"
    committed = _git(root, "show", f"HEAD:{(FOLDER / path.name).as_posix()}")
    text = path.read_text(encoding="utf-8")
    if text.startswith(RULE):
        text = text.split(f"{RULE}\n", 2)[2].lstrip("\n")
    text = f"{Provenance.of(committed).now(root)}\n{wrapped(text)}"
    path.write_text(text, encoding="utf-8")


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, check=True, text=True)
    return done.stdout


def main() -> None:
    """List what is outdated, or renew it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--renew", action="store_true")
    parser.add_argument("--stamp", action="store_true")
    parser.add_argument("page", nargs="*", help="pages; by default all outdated ones")
    options = parser.parse_args()
    if not (ROOT / ".git").exists():
        sys.exit("not a git checkout: the ages of the figures are not known")
    if options.stamp:
        for name in options.page:
            stamp(name)
        return
    found = outdated()
    for name, changes in found.items():
        print(f"docs/results/{name}.md: {len(changes)} commits since, the last {changes[0]}")
    print(f"{len(found)} of {len(pages())} pages of figures are older than their sources")
    if options.renew:
        renew(options.page or list(found))


if __name__ == "__main__":
    main()
