"""Run the command line inside the test's process, in a folder of its own."""

import json
from dataclasses import dataclass

import pytest

from eutree.cli.main import run
from tests.little_search import little_search


@dataclass
class Answer:
    code: int
    out: str
    err: str

    @property
    def json(self):
        return json.loads(self.out)


@pytest.fixture(autouse=True)
def searches_little():
    """Search little in this process: the command line hands on what is found, much or little."""
    with little_search():
        yield


@pytest.fixture
def eutree(capsys, tmp_path, monkeypatch):
    """Return a function that runs a command line and answers with its code and output."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        capsys.readouterr()
        try:
            code = run([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = stop.code
        captured = capsys.readouterr()
        return Answer(code, captured.out, captured.err)

    return call


@pytest.fixture(scope="session")
def demonstrations(tmp_path_factory):
    """Return a folder of demonstrations of 2-Evasion."""
    folder = tmp_path_factory.mktemp("recorded") / "demos"
    line = ["record", "eutree/Evasion2-v0", "--expert", "gate", "--episodes", "8", "--out"]
    assert run([*line, str(folder)]) == 0
    return folder


@pytest.fixture(scope="session")
def expert(demonstrations, tmp_path_factory):
    """Return the file of the expert tree of these demonstrations."""
    path = tmp_path_factory.mktemp("fitted") / "expert.json"
    assert (
        run(["fit", str(demonstrations), "--out", str(path), "--release-8", "--episodes", "0"]) == 0
    )
    return path
