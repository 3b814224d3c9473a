"""The package as it is released: what the wheel holds, that it runs alone, that all agree on it."""

import configparser
import email
import hashlib
import importlib.metadata
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import eutree
from tests.patience import ENOUGH

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def build(folder: Path, kind: str) -> Path:
    """Return the wheel or the sdist, built with the pinned back end."""
    pytest.importorskip("hatchling", reason="the build back end is not installed")
    command = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (made,) = folder.iterdir()
    return made


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("wheel"), "wheel")


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder that holds what the wheel does: a pure wheel is installed by unpacking."""
    folder = tmp_path_factory.mktemp("installed")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


def test_all_agree_on_the_version() -> None:
    assert PROJECT["version"] == eutree.__version__
    citation = re.search(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert citation is not None
    assert citation[1] == eutree.__version__


def test_the_wheel_holds_the_package_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    sources = {
        path.relative_to(ROOT / "src").as_posix()
        for path in (ROOT / "src").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    information = f"eutree-{eutree.__version__}.dist-info/"
    assert {name for name in names if not name.startswith(information)} == sources
    own = {name.removeprefix(information) for name in names if name.startswith(information)}
    assert own == {"METADATA", "WHEEL", "RECORD", "entry_points.txt", "licenses/LICENSE"}
    for needed in ("py.typed", "recording/browser/page.html", "report/assets/policy.html"):
        assert f"eutree/{needed}" in names


def test_the_metadata_is_what_an_index_shows(installed: Path) -> None:
    (folder,) = installed.glob("*.dist-info")
    metadata = email.message_from_string((folder / "METADATA").read_text())
    assert metadata["Version"] == eutree.__version__
    assert metadata["License-Expression"] == "MIT"
    assert metadata["Requires-Python"] == ">=3.11"
    assert set(metadata.get_all("Provides-Extra", [])) == set(PROJECT["optional-dependencies"])
    assert "small, readable decision trees" in metadata.get_payload()
    offered = configparser.ConfigParser(delimiters="=")
    offered.optionxform = str  # type: ignore[assignment] - names are kept as they are
    offered.read(folder / "entry_points.txt")
    groups = {"console_scripts": PROJECT["scripts"], **PROJECT["entry-points"]}
    assert {group: dict(offered[group]) for group in offered.sections()} == groups


def test_what_is_installed_offers_what_the_sources_do() -> None:
    """An entry point is of the metadata that was installed, not of the sources beside it."""
    found = importlib.metadata.distribution("eutree").entry_points
    groups = {"console_scripts": PROJECT["scripts"], **PROJECT["entry-points"]}
    named = {(group, name, value) for group, of in groups.items() for name, value in of.items()}
    assert {(p.group, p.name, p.value) for p in found} == named, "run: make install-test"


def test_the_wheel_works_without_the_sources(installed: Path, tmp_path: Path) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    environment |= {"PYTHONPATH": str(installed), "EUTREE_JIT": "0"}
    program = (
        "import eutree, sys; from eutree.cli.main import run\n"
        f"assert eutree.__file__.startswith({str(installed)!r})\n"
        "for line in ('record eutree/Evasion2-v0 --expert gate --episodes 3 --out demos',\n"
        "             'fit demos --out expert.json --episodes 5',\n"
        "             'show expert.json --html tree.html',\n"
        "             'export expert.json --out expert.py',\n"
        "             'learn eutree/MazeA-v0 --method density-tree --episodes 2 --out run',\n"
        "             'reproduce --list'):\n"
        "    assert run(line.split()) == 0, line\n"
    )
    subprocess.run(
        [sys.executable, "-W", "error::ImportWarning", "-c", program],
        cwd=tmp_path, env=environment, check=True, timeout=ENOUGH,
    )  # fmt: skip
    assert "<svg" in (tmp_path / "tree.html").read_text()


def test_the_same_sources_give_the_same_bytes(wheel: Path, tmp_path: Path) -> None:
    again = build(tmp_path, "wheel")
    first, second = (hashlib.sha256(path.read_bytes()).hexdigest() for path in (wheel, again))
    assert first == second


def test_the_sdist_can_build_and_test_itself(tmp_path: Path) -> None:
    import tarfile

    with tarfile.open(build(tmp_path, "sdist")) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"pyproject.toml", "README.md", "LICENSE", "Makefile", "requirements/run.txt"} <= names
    assert {"src/eutree/py.typed", "tests/contracts/test_package.py"} <= names
    assert not {name for name in names if name.startswith((".git/", ".venv", "runs/"))}
