"""What holds for every tracked file: no host names, no lost lock, small promises about words."""

import ast
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LOCKS = ("run", "test", "build", "oldest", "uv")


def tracked_files() -> list[Path]:
    """Return the tracked text files of the repository, or all files of an unpacked archive."""
    if (ROOT / ".git").exists():
        output = subprocess.run(
            ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
        ).stdout
        return [ROOT / name for name in output.split("\0") if name and (ROOT / name).is_file()]
    return [path for path in ROOT.rglob("*") if path.is_file() and ".venv" not in path.parts]


# Put together here so that this file does not name what it forbids.
REGISTRIES = [
    rb"py" + rb"pi\.org",
    rb"python" + rb"hosted\.org",
    rb"registry\.np" + rb"mjs",
    rb"np" + rb"mjs\.(com|org)",
    rb"conda\.an" + rb"aconda",
    rb"an" + rb"aconda\.org",
    rb"cr" + rb"ates\.io",
    rb"deb\.de" + rb"bian\.org",
    rb"--(extra-)?index" + rb"-url",
    rb"--find" + rb"-links",
]


@pytest.mark.promise(27)
def test_no_tracked_file_names_a_registry() -> None:
    forbidden = re.compile(b"|".join(REGISTRIES), re.IGNORECASE)
    found = [
        f"{path.relative_to(ROOT)}: {match.group().decode()}"
        for path in tracked_files()
        if (match := forbidden.search(path.read_bytes()))
    ]
    assert found == []


def test_no_test_module_imports_another() -> None:
    """What several need stands in a module of its own, so that each runs its own tests alone."""
    found = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in sorted((ROOT / "tests").rglob("*.py")) + sorted(ROOT.glob("benchmarks/*.py"))
        for name in imported_by(path)
        if re.match(r"tests\.(.*\.)?test_", name)
    ]
    assert found == []


def test_what_only_linux_has_is_asked_for_by_the_fixture() -> None:
    """``proc`` skips a test elsewhere; the loaders' limit on memory does without."""
    tests = ROOT / "tests"
    naming = {
        str(path.relative_to(tests))
        for path in tests.rglob("*.py")
        if "/" + "proc" in path.read_text()
    }
    assert naming == {"conftest.py", "files/loaders.py"}


def imported_by(path: Path) -> Iterator[str]:
    """Yield the full name of everything that a file imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            here = path.relative_to(ROOT).with_suffix("").parts[: -node.level or None]
            package = ".".join(here) if node.level else ""
            module = ".".join(filter(None, (package, node.module)))
            yield from (f"{module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize(
    "source",
    [
        "import tests.a.test_b",
        "from tests.a.test_b import c",
        "from tests.a import test_b",
        "from . import test_b",
    ],
)
def test_an_import_of_a_test_module_is_seen(source: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    path = tmp_path / "tests" / "a" / "test_c.py"
    path.parent.mkdir(parents=True)
    path.write_text(source)
    assert any(re.match(r"tests\.(.*\.)?test_b", name) for name in imported_by(path))


@pytest.mark.parametrize("name", LOCKS)
def test_lock_pins_and_hashes_everything(name: str) -> None:
    text = (ROOT / "requirements" / f"{name}.txt").read_text()
    assert "://" not in text
    entries = [entry for entry in re.split(r"\n(?=\S)", text.strip()) if not entry.startswith("#")]
    assert entries
    for entry in entries:
        assert re.match(r"[A-Za-z0-9._-]+(\[[^]]*\])?==\S+", entry), entry.splitlines()[0]
        assert "--hash=sha256:" in entry, entry.splitlines()[0]


def test_locks_agree() -> None:
    def pins(name: str) -> dict[str, set[str]]:
        text = (ROOT / "requirements" / f"{name}.txt").read_text()
        found: dict[str, set[str]] = {}
        for package, version in re.findall(r"^([A-Za-z0-9._-]+)==(\S+)", text, re.MULTILINE):
            found.setdefault(package, set()).add(version)
        return found

    run, test = pins("run"), pins("test")
    assert {name: test.get(name) for name in run} == run


def test_fragments_of_the_changelog_link_from_its_place() -> None:
    for fragment in sorted((ROOT / "changelog.d").glob("*.md")):
        text = fragment.read_text()
        assert text.startswith(("- ", "* ")), fragment.name
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", text):
            assert (ROOT / target).exists(), f"{fragment.name}: there is no {target}"


def test_files_that_pages_name_exist() -> None:
    """A file is named from the root, from the package, or from the page's own folder."""
    pages = [
        ROOT / "README.md",
        *(ROOT / "docs").glob("*.md"),
        *(ROOT / "docs" / "decisions").glob("*.md"),
    ]
    lost = []
    for page in pages:
        prose = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
        for name in re.findall(r"`(?:python )?([\w./-]+/[\w.-]+\.(?:py|sh|md|toml))`", prose):
            roots = ("", "src", "src/eutree", "tests", "docs")
            homes = [page.parent, *(ROOT / root for root in roots)]
            if not any((home / name).exists() for home in homes):
                lost.append(f"{page.relative_to(ROOT)}: {name}")
    assert lost == []
