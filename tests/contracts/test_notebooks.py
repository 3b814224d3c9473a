"""The notebooks run from top to bottom, and hold what a run has shown."""

import importlib.util
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))

spec = importlib.util.spec_from_file_location("execute", FOLDER / "execute.py")
assert spec is not None
assert spec.loader is not None
execute = importlib.util.module_from_spec(spec)
spec.loader.exec_module(execute)


@pytest.fixture
def no_figures() -> None:
    """Close what another test drew; the first cell would show it."""
    import matplotlib  # here: every process of the tests collects this file, few run it
    from matplotlib import pyplot

    matplotlib.use("agg")
    pyplot.close("all")


def kinds(notebook):
    """Return for each cell which kinds of output it has."""
    outputs = [cell.get("outputs", []) for cell in notebook["cells"]]
    return [[sorted(o.get("data", {"text": 0})) for o in of_cell] for of_cell in outputs]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
@pytest.mark.usefixtures("no_figures")
def test_a_notebook_runs_and_holds_its_outputs(path: Path) -> None:
    stored, fresh = execute.read(path), execute.execute(path)
    assert kinds(fresh) == kinds(stored), "python docs/notebooks/execute.py writes them anew"
    assert [c["source"] for c in fresh["cells"]] == [c["source"] for c in stored["cells"]]


def test_there_are_three_small_ones() -> None:
    assert len(NOTEBOOKS) == 3
    assert max(path.stat().st_size for path in NOTEBOOKS) < 300_000


def test_a_cell_that_fails_fails(tmp_path: Path) -> None:
    cell = {"cell_type": "code", "source": ["1 / 0"]}
    execute.write(tmp_path / "x.ipynb", {"cells": [cell]})
    with pytest.raises(ZeroDivisionError):
        execute.execute(tmp_path / "x.ipynb")


@pytest.mark.usefixtures("no_figures")
def test_a_cell_shows_what_it_prints_its_value_and_its_figures(tmp_path: Path) -> None:
    source = "import matplotlib.pyplot as plt\nplt.plot([1, 2])\nprint('x')\n3 + 4"
    execute.write(tmp_path / "x.ipynb", {"cells": [{"cell_type": "code", "source": [source]}]})
    first, second = (execute.execute(tmp_path / "x.ipynb") for _ in range(2))
    assert first == second
    shown = first["cells"][0]["outputs"]
    assert shown[0]["text"] == ["x\n"]
    assert shown[1]["data"] == {"text/plain": ["7"]}
    assert shown[2]["data"]["image/svg+xml"][0].startswith("<svg")
