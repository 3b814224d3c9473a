"""Scripts that make figures are run by hand, seldom: their imports must not rot in between."""

import ast
import importlib
from pathlib import Path

import pytest

BENCHMARKS = sorted((Path(__file__).parents[2] / "benchmarks").glob("*.py"))


def missing(source: str) -> list[str]:
    """Return the names that a script imports from our packages and that are not there."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith(("eutree", "tests")):
            module = importlib.import_module(str(node.module))
            for name in (one.name for one in node.names if not hasattr(module, one.name)):
                try:
                    importlib.import_module(f"{node.module}.{name}")
                except ModuleNotFoundError:
                    found.append(f"{node.module}.{name}")
    return found


@pytest.mark.parametrize("script", BENCHMARKS, ids=lambda path: path.stem)
def test_what_a_benchmark_imports_is_there(script: Path) -> None:
    assert missing(script.read_text()) == []


def test_a_name_that_went_is_seen() -> None:
    source = "from eutree.trees import DecisionTree, Forest\nfrom eutree import trees"
    assert missing(source) == ["eutree.trees.Forest"]
