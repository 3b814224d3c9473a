"""The lab is as a stranger to the core: never imported by it, and it imports what is public.

Public is what a package offers in its ``__init__``, a module that lies at the root of the core, and
the modules that ``docs/reference/for-other-packages.md`` lists.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src"
PAGE = ROOT / "docs" / "reference" / "for-other-packages.md"


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__")


@cache
def sources(package: str) -> dict[str, ast.Module]:
    """Return the syntax tree of each module of a package by its name."""
    paths = sorted((SOURCE / package).rglob("*.py"))
    return {name_of(path): ast.parse(path.read_text()) for path in paths}


PACKAGES = {name_of(path) for path in (SOURCE / "eutree").rglob("__init__.py")}
LISTED = set(re.findall(r"^- `(eutree\.[\w.]+)`", PAGE.read_text(), re.MULTILINE))


@cache
def offered_by(package: str) -> set[str]:
    """Return the names in the ``__all__`` of a package of the core; none of what is no package."""
    if package not in PACKAGES - {"eutree"}:
        return set()
    return {
        name
        for node in sources("eutree")[package].body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
        for name in ast.literal_eval(node.value)
    }


def is_public(module: str) -> bool:
    """Return whether other packages may import from a module of the core."""
    if any(part.startswith("_") for part in module.split(".")):
        return False
    return module in PACKAGES | LISTED or module.count(".") == 1


def breaks(tree: ast.Module) -> Iterator[str]:
    """Yield what a module takes of the core that is not public.

    Whole modules and packages are never taken: one could reach through them.
    """
    core = sources("eutree")
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name.split(".")[0] == "eutree")
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "eutree":
            module = node.module or ""
            for name in (alias.name for alias in node.names):
                is_module = f"{module}.{name}" in core and name not in offered_by(module)
                if is_module or name.startswith("_") or name == "*" or not is_public(module):
                    yield f"{module}.{name}"


def words_of(tree: ast.Module) -> Iterator[str]:
    """Yield the strings of a module that are no docstrings."""
    told = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in told:
            yield node.value


def test_the_lab_takes_only_what_is_public() -> None:
    assert {
        module: found
        for module, tree in sources("eutree_lab").items()
        if (found := [*breaks(tree)])
    } == {}


@pytest.mark.parametrize(
    "text",
    [
        "import eutree",
        "import eutree.trees",
        "from eutree import trees",
        "from eutree.learners import u_tree",
        "from eutree.learners.u_tree.learner import UTree",
        "from eutree.learners.u_tree import *",
        "from eutree.trees._kernels import descend",
        "from eutree.learners.u_tree import _kernels_step",
        "from eutree.evaluation import _private",
        "def late():\n    from eutree.training.phases import RunState",
    ],
)
def test_what_is_not_public_is_seen(text: str) -> None:
    assert [*breaks(ast.parse(text))]


def test_what_is_listed_is_there_and_needed() -> None:
    """An entry that the lab does not need is a promise for nothing."""
    taken = {
        node.module
        for tree in sources("eutree_lab").values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
    }
    assert sources("eutree").keys() - PACKAGES >= LISTED
    assert LISTED - taken == set()


def test_the_core_does_not_name_the_lab() -> None:
    """Nor does it load it by a name; ``lint-imports`` sees only what is imported."""
    found = {
        m
        for m, tree in sources("eutree").items()
        for text in words_of(tree)
        if "eutree_lab" in text
    }
    assert found == set()


def test_a_name_in_a_string_is_seen() -> None:
    tree = ast.parse('"""eutree_lab"""\nimport importlib\nimportlib.import_module("eutree_lab")')
    assert [*words_of(tree)] == ["eutree_lab"]
