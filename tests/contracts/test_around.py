"""What people expect around a library says the same as the Makefile and the package do."""

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml", reason="PyYAML comes with the tools of the documentation")

ROOT = Path(__file__).parents[2]
MAKEFILE = (ROOT / "Makefile").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def read(name):
    return yaml.safe_load((ROOT / name).read_text())


def recipe(target):
    """Return the commands of a target of the Makefile, in one line each."""
    found = re.search(rf"^{target}:.*\n((?:\t.*\n)+)", MAKEFILE, re.MULTILINE)
    assert found, target
    return found[1].replace("$(PY)", ".venv/bin/python").replace("$(VENV)", ".venv").splitlines()


def test_the_workflow_covers_each_declared_python_and_macos():
    jobs = read(".github/workflows/checks.yml")["jobs"]
    matrix = jobs["python"]["strategy"]["matrix"]
    declared = {
        label.rsplit(" ", 1)[1]
        for label in PROJECT["classifiers"]
        if re.search(r":: 3\.\d+$", label)
    }
    assert set(matrix["python"]) == declared
    assert {extra["os"] for extra in matrix["include"]} == {"macos-latest"}
    steps = [step for job in jobs.values() for step in job["steps"]]
    assert not [step for step in steps if "if" in step], "each step runs on each of them"
    runs = [step["run"] for step in steps if "run" in step]
    assert sorted(runs) == [".ci/run", "make UV= check", "make UV= test"]


def test_each_commit_is_checked_by_the_commands_of_make_check():
    hooks = read(".pre-commit-config.yaml")["repos"][0]["hooks"]
    commands = [line.strip() for line in recipe("check")]
    assert [*(hook["entry"] for hook in hooks), "$(MAKE) docs"] == commands
    assert not [hook["id"] for hook in hooks if hook["pass_filenames"]]
    kinds = {hook["id"]: set(hook.get("types_or", ())) for hook in hooks}
    assert kinds["lint"] == kinds["format"] == {"python", "pyi", "jupyter", "toml"}
    assert "toml" in kinds["types"] & kinds["layers"], "their settings are in pyproject.toml"


def test_read_the_docs_builds_as_make_docs_does():
    jobs = read(".readthedocs.yaml")["build"]["jobs"]
    assert "docs" in jobs["build"]["html"][0]
    assert "-W" in recipe("docs")[0]


@pytest.mark.parametrize("name", ["fault", "wish"])
def test_a_template_asks_for_something(name):
    form = read(f".github/ISSUE_TEMPLATE/{name}.yml")
    required = [part["id"] for part in form["body"] if part.get("validations", {}).get("required")]
    assert form["name"]
    assert form["description"]
    assert required


def test_the_release_checklist_names_commands_that_exist():
    text = (ROOT / "docs" / "releasing.md").read_text()
    for target in re.findall(r"`make ([a-z-]+)", text):
        assert re.search(rf"^(.*\s)?{target}[ :]", MAKEFILE, re.MULTILINE), target
    for path in re.findall(r"`(?:python )?((?:\.ci|docs|tests)/[\w/.]+)", text):
        assert (ROOT / path).exists(), path


def test_the_files_in_which_a_release_raises_the_version_hold_it() -> None:
    text = (ROOT / "docs" / "releasing.md").read_text()
    step = re.search(r"4\. The version, in (.*?)\(a test", text, re.DOTALL)
    assert step
    files = re.findall(r"`([\w./]+)`", step[1])
    assert len(files) == 3
    for file in files:
        lines = (ROOT / file).read_text().splitlines()
        assert [one for one in lines if "version" in one and PROJECT["version"] in one], file


def test_the_tests_that_ci_names_are_there() -> None:
    """A file that is not there ends the run before its first test."""
    script = (ROOT / ".ci" / "run").read_text()
    words = re.findall(r"tests/[\w./{},]+", script)
    line = "printf '%s\\n' " + " ".join(words)
    named = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=True)
    paths = named.stdout.split()
    assert len(paths) > 20
    assert [path for path in paths if not (ROOT / path).exists()] == []
