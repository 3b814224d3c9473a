"""The notebooks run from top to bottom, and hold what a run has shown."""

import importlib.util
import re
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


NUMBER = re.compile(r"(-?0x[0-9a-f.]+p[+-]\d+|-?\d+(?:\.\d+)?(?:e[+-]\d+)?)")
PASSING = re.compile(r" at 0x[0-9a-f]+|/tmp/[^\s'\"]+|[\d.]+ (?:seconds?|minutes?)\b")


def parts(text):
    """Return the words and numbers of a text, whole numbers as int, without what is of one run."""
    words = NUMBER.split(PASSING.sub("...", text))
    words[1::2] = [number(word) for word in words[1::2]]
    return words


def number(word):
    """Return an integer where it counts or names something, else a float.

    Integers of more than six digits are floats in an export's scale.
    """
    if "x" in word:
        return float.fromhex(word)
    return int(word) if word.strip("-").isdecimal() and len(word) < 7 else float(word)


def texts(notebook, found=lambda part: part):
    """Return for each cell the kinds of its outputs, and the parts of what it says.

    Of a figure only the kind: its bytes are those of a version of matplotlib.
    """
    cells = []
    for cell in notebook["cells"]:
        outputs = [o.get("data", {"text/plain": o.get("text")}) for o in cell.get("outputs", [])]
        said = [parts("".join(data["text/plain"])) for data in outputs]
        cells.append([sorted(map(sorted, outputs)), [list(map(found, one)) for one in said]])
    return cells


def about(part):
    """Return what a part may be elsewhere.

    Words and counts follow from the seeds, and are the same on every machine. The last digits of a
    float are not: they depend on the order in which a BLAS and a compiler add.
    """
    return pytest.approx(part, rel=1e-3, abs=1e-40) if isinstance(part, float) else part


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
@pytest.mark.usefixtures("no_figures")
def test_a_notebook_runs_and_holds_its_outputs(path: Path) -> None:
    """They held outputs of an old version for long: only the kinds of outputs were compared."""
    stored, fresh = execute.read(path), execute.execute(path)
    anew = "python docs/notebooks/execute.py writes them anew; does the prose still tell them?"
    for number, (one, other) in enumerate(zip(texts(fresh), texts(stored, about), strict=True)):
        assert one == other, f"cell {number}: {anew}"
    assert [c["source"] for c in fresh["cells"]] == [c["source"] for c in stored["cells"]]


def test_what_is_compared() -> None:
    def same(one: str, other: str) -> bool:
        return parts(one) == list(map(about, parts(other)))

    assert same("x <= 0x1.2p+4: 17.99996 m, 705155800", "x <= 0x1.20001p+4: 18.00 m, 705155801")
    assert same("<A at 0x7f01>, in 3.1 seconds, /tmp/a/b", "<A at 0x7f99>, in 12 seconds, /tmp/c")
    assert not same("success 98.8%", "success 99.2%")
    assert not same("17 leaves", "15 leaves")
    assert not same("go, by leaf 5", "stop, by leaf 5")
    assert not same("-2.0", "2.0")
    assert not same("1231 transitions", "1232 transitions")


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
