"""The set-up commands: stamps only after success, no network when nothing changed, clear errors.

A stand-in for uv records what it is asked to do, so nothing is installed here; `.ci/run` does it
for real, with pip and with uv.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import ENOUGH

ROOT = Path(__file__).parents[2]
MAKE = shutil.which("make")
pytestmark = [
    pytest.mark.promise(27),
    pytest.mark.skipif(
        MAKE is None and os.environ.get("EUTREE_REQUIRE_TOOLS") != "1", reason="no make here"
    ),
]

UV = """#!/bin/sh
echo "$@" >> calls
case "$*" in
    venv*) mkdir -p .venv/bin ;;
    *"$FAIL"*) test -z "$FAIL" ;;
esac
"""


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """Return a folder with a space in its name and all that the set-up reads."""
    folder = tmp_path / "a clone"
    shutil.copytree(ROOT / "requirements", folder / "requirements")
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy(ROOT / name, folder / name)
    program(folder / "uv tool", UV)
    return folder


def program(path: Path, text: str) -> None:
    path.write_text(text)
    path.chmod(0o755)


def make(
    folder: Path, *arguments: str, fail: str = "", uv: str | None = None
) -> subprocess.CompletedProcess[str]:
    """Run make in ``folder``; ``fail`` is a word of the stand-in's call that shall fail."""
    assert MAKE is not None
    clean = {key: value for key, value in os.environ.items() if not key.startswith("MAKE")}
    uv = str(folder / "uv tool") if uv is None else uv
    return subprocess.run(
        [MAKE, f"UV={uv}", f"PYTHON={sys.executable}", *arguments],
        cwd=folder,
        env={**clean, "FAIL": fail},
        capture_output=True,
        text=True,
        check=False,
        timeout=ENOUGH,
    )


def calls(folder: Path) -> list[str]:
    path = folder / "calls"
    lines = path.read_text().splitlines() if path.exists() else []
    path.unlink(missing_ok=True)
    return lines


def test_a_second_run_asks_for_nothing(clone: Path) -> None:
    assert make(clone, "install-test").returncode == 0
    first = calls(clone)
    assert first[0].startswith("venv")
    assert sum("--require-hashes" in line for line in first) == 3
    assert make(clone, "install-test").returncode == 0
    assert calls(clone) == []


@pytest.mark.parametrize("part", ["run.txt", "build.txt", "-e .", "test.txt"])
def test_a_failed_install_leaves_no_stamp_and_the_next_one_completes(
    clone: Path, part: str
) -> None:
    assert make(clone, "install-test", fail=part).returncode != 0
    assert not (clone / ".venv" / ".test").exists()
    assert (clone / ".venv" / ".run").exists() == (part == "test.txt")
    assert make(clone, "install-test").returncode == 0
    assert (clone / ".venv" / ".test").exists()


def test_a_changed_lock_is_installed_again(clone: Path) -> None:
    assert make(clone, "install-test").returncode == 0
    calls(clone)
    later = (clone / ".venv" / ".test").stat().st_mtime + 10
    os.utime(clone / "requirements" / "run.txt", (later, later))
    assert make(clone, "install-test").returncode == 0
    assert any("run.txt" in line for line in calls(clone))


def test_a_moved_clone_is_installed_again(clone: Path) -> None:
    assert make(clone, "install-run").returncode == 0
    calls(clone)
    moved = clone.rename(clone.with_name("another place"))
    assert make(moved, "install-run").returncode == 0
    assert calls(moved)[0].startswith("venv")


def test_an_old_python_gives_one_clear_line(clone: Path) -> None:
    old = clone / "python old"
    program(
        old,
        f'#!/bin/sh\nexec "{sys.executable}" -c "import sys; sys.version_info = (3, 10, 0); $2"\n',
    )
    result = make(clone, f"PYTHON={old}", "install-run")
    assert result.returncode != 0
    assert "error: Python 3.11 or newer is needed, found 3.10" in result.stderr
    assert "Traceback" not in result.stderr
    assert calls(clone) == []


def test_a_missing_python_gives_one_clear_line(clone: Path) -> None:
    result = make(clone, "PYTHON=no-such-python", "install-run")
    assert "error: there is no no-such-python" in result.stderr


def test_a_python_without_venv_names_the_ways_round(clone: Path) -> None:
    bare = clone / "python"
    program(
        bare,
        f'#!/bin/sh\ncase "$*" in *ensurepip*) exit 1;; esac\nexec "{sys.executable}" "$@"\n',
    )
    result = make(clone, f"PYTHON={bare}", "install-run", uv="")
    assert result.returncode != 0
    assert "apt-get install python3-venv" in result.stderr
    assert "requirements/uv.txt" in result.stderr


def test_fragments_are_folded_under_the_heading_of_a_release(clone: Path) -> None:
    (clone / "CHANGELOG.md").write_text("# Changelog\n\n## Unreleased\n\n- An old one.\n")
    folder = clone / "changelog.d"
    folder.mkdir()
    (folder / "b.md").write_text("- Second.\n")
    (folder / "a.md").write_text("- First\n  of two lines.\n")
    assert make(clone, "changelog", "RELEASE=0.2.0").returncode == 0
    lines = [line for line in (clone / "CHANGELOG.md").read_text().splitlines() if line]
    assert lines[:2] == ["# Changelog", "## Unreleased"]
    assert re.fullmatch(r"## 0\.2\.0 \(\d{4}-\d\d-\d\d\)", lines[2])
    assert lines[3:] == ["- First", "  of two lines.", "- Second.", "- An old one."]
    assert list(folder.iterdir()) == []
    again = make(clone, "changelog")
    assert again.returncode != 0
    assert "nothing in changelog.d" in again.stderr
