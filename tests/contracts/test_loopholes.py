"""What import-linter does not see: names, private modules, facades, and the one threshold rule.

Each rule is a function from the sources to what breaks it; each is also given a source that does.
"""

import ast
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src"
PACKAGES = {
    ".".join(path.parent.relative_to(SOURCE).parts)
    for path in SOURCE.rglob("__init__.py")
    if path.parent.parent != SOURCE
}
Sources = dict[str, ast.Module]


@cache  # every test process reads this file, and one of them needs the trees
def modules() -> Sources:
    """Return the syntax tree of each module by its name."""
    return {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): (
            ast.parse(path.read_text())
        )
        for path in sorted(SOURCE.rglob("*.py"))
    }


# Who may load a module by its name, and what: the root its own public names and the pages that
# notebooks show (nothing below knows them), the command line its commands and the modules of its
# users, Minari's files what only Minari brings.
BY_NAME = {
    "eutree": {"'eutree.report.notebook'"},
    "eutree.lazy": {"home", "package"},
    "eutree.cli.main": {"f'eutree.cli.{home}'"},
    "eutree.cli._policies": {"module"},
    "eutree.cli._options": {"name"},
    "eutree.data.minari_files": {
        "'gymnasium'",
        "'minari'",
        "'minari.serialization'",
        "'minari.data_collector.episode_buffer'",
    },
}
# Asks whether somebody else's package was loaded; whoever has not loaded it cannot have set it up.
ASKS_WHAT_IS_LOADED = {"eutree.parallel": {"'joblib' not in sys.modules"}}
# Middles of other things than two values of a feature; each is as it has to be, see there.
MIDDLES = {
    "eutree.features": "the rule itself",
    "eutree_lab.parti_game.cells": "boxes are halved, whatever lies in them",
    "eutree_lab.vrd.kuhn": "boxes are halved, whatever lies in them",
    "eutree_lab.tasks.puck": "a constant of the task",
    "eutree.evaluation.evaluation": "bisection",
    "eutree.inspection.occurring": "boxes are halved, whatever lies in them",
    "eutree.export.drawing": "places on paper",
    "eutree.export.c": "points to test exports at",
    "eutree.inspection.regions": "a point inside a box, whose sides may be infinite",
    "eutree.proof.intervals": "boxes are halved, whatever lies in them",
    "eutree.policies.sklearn_tree": "where float32 rounds, exactly",
    "eutree.contests.betting": "bisection",
    "eutree.report.chart": "places on paper",
    "eutree.export.svg": "places on paper",
    "eutree.splitting.laws": "a mean of logarithms",
    "eutree.world_model.ensemble": "the middle of a binary feature's two values, seen or not",
}


def imports(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield module and name of each thing that is imported."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                yield node.module, alias.name
        elif isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, ""


def private_of_others(sources: Sources) -> set[tuple[str, str]]:
    """Return who imports a private module of another package, and which."""
    found = set()
    for module, tree in sources.items():
        own = module if module in PACKAGES else module.rpartition(".")[0]
        for origin, name in imports(tree):
            words = f"{origin}.{name}".split(".")
            private = [i for i, word in enumerate(words) if re.match(r"_[a-z]", word)]
            if (
                words[0] in ("eutree", "eutree_lab")
                and private
                and not own.startswith(".".join(words[: private[0]]))
            ):
                found.add((module, f"{origin}.{name}"))
    return found


def by_name(sources: Sources) -> set[tuple[str, str]]:
    """Return who loads a module by a name, and the name as it is written."""
    found = set()
    for module, tree in sources.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and re.search(
                r"(^|\.)(import_module|__import__)$", ast.unparse(node.func)
            ):
                name = ast.unparse(node.args[0])
                if name not in BY_NAME.get(module, set()):
                    found.add((module, name))
    return found


def loaded_modules(sources: Sources) -> set[tuple[str, str]]:
    """Return who looks into ``sys.modules``, and how."""
    found = set()
    for module, tree in sources.items():
        allowed = ASKS_WHAT_IS_LOADED.get(module, set())
        asked = {
            node.comparators[0]
            for node in ast.walk(tree)
            if isinstance(node, ast.Compare) and ast.unparse(node) in allowed
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and ast.unparse(node) == "sys.modules":
                if node not in asked:
                    found.add((module, ast.unparse(node)))
            elif isinstance(node, ast.ImportFrom) and node.module == "sys":
                found |= {(module, a.name) for a in node.names if a.name == "modules"}
    return found


def round_the_facade(sources: Sources) -> set[tuple[str, str]]:
    """Return who takes from a module what its package offers, from outside of the package.

    The root names modules: so each public name loads no more than it needs.
    """
    offered = {
        package: {
            name
            for node in modules()[package].body
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
            for name in ast.literal_eval(node.value)
        }
        for package in PACKAGES
    }
    return {
        (module, f"{origin}.{name}")
        for module, tree in sources.items()
        if module != "eutree"
        for origin, name in imports(tree)
        for package, names in offered.items()
        if origin.startswith(f"{package}.") and name in names
        if not f"{module}.".startswith(f"{package}.")
    }


# A folder a method: what others may have of it is what its front names.
METHODS = (
    "eutree.learners.u_tree",
    "eutree.learners.planning",
    "eutree.learners.distilled_dqn",
    "eutree_lab.history_u_tree",
    "eutree_lab.parti_game",
    "eutree_lab.vqql",
    "eutree_lab.vrd",
)


def inside_a_method(sources: Sources) -> set[tuple[str, str]]:
    """Return who imports from inside of a method's folder, from outside of it, and what."""
    return {
        (module, origin)
        for module, tree in sources.items()
        for origin, name in imports(tree)
        for method in METHODS
        if f"{origin}.{name}".startswith(f"{method}.")
        and (origin != method or f"{method}.{name}" in modules())
        and not f"{module}.".startswith(f"{method}.")
    }


def _numbers(node: ast.AST) -> set[object]:
    return {part.value for part in ast.walk(node) if isinstance(part, ast.Constant)}


def middles(sources: Sources) -> set[tuple[str, str]]:
    """Return who computes the middle of two numbers, and how."""
    half = r"(?:0\.5 \* |\bhalf \* )"
    forms = (
        rf"{half}(?:float)?\(.* \+ .*\)",  # 0.5 * (a + b)
        r"\((?:float\()?.* \+ .*\) / 2(?:\.0)?",  # (a + b) / 2
        r".* / 2(?:\.0)? \+ .* / 2(?:\.0)?",  # a / 2 + b / 2
        rf"{half}.* \+ {half}.*",  # 0.5 * a + 0.5 * b
        rf".* \+ {half}\(.* - .*\)",  # a + 0.5 * (b - a)
        r".* \+ \(.* - .*\) / 2(?:\.0)?",  # a + (b - a) / 2
    )
    return {
        (module, text)
        for module, tree in sources.items()
        if module not in MIDDLES
        for node in ast.walk(tree)
        if isinstance(node, ast.BinOp)
        and {0.5, 2} & _numbers(node)
        # half of n + 1 is a rank
        and not re.search(r"[+-] 1(?:\.0)?\b", re.sub(r"\[[^]]*\]", "", ast.unparse(node)))
        and any(re.fullmatch(form, text := ast.unparse(node)) for form in forms)
    }


RULES: dict[Callable[[Sources], set[tuple[str, str]]], list[str]] = {
    private_of_others: [
        "from eutree.export._code import identifiers",
        "from eutree.world_model import _kernels",
        "import eutree.neural._kernels",
    ],
    by_name: [
        "import importlib\nimportlib.import_module('eutree.report')",
        "from importlib import import_module\nimport_module('eutree.report')",
        "__import__('eutree.report')",
    ],
    loaded_modules: [
        "import sys\nversion = sys.modules['eutree'].__version__",
        "from sys import modules",
        "import sys\nfound = 'joblib' not in sys.modules",
    ],
    inside_a_method: [
        "from eutree.learners.u_tree.learner import UTree",
        "from eutree.learners.u_tree import learner",
        "import eutree_lab.vrd.kuhn",
    ],
    round_the_facade: ["from eutree.trees.tree import DecisionTree"],
    middles: [
        "t = 0.5 * (a + b)",
        "t = (a + b) / 2",
        "t = a / 2 + b / 2",
        "t = 0.5 * a + 0.5 * b",
        "t = a + 0.5 * (b - a)",
        "t = a + (b - a) / 2",
        "t = float(0.5 * (values[i - 1] + values[i]))",
    ],
}


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_sources_keep_the_rule(rule: Callable[[Sources], set[tuple[str, str]]]) -> None:
    assert rule(modules()) == set()


@pytest.mark.parametrize(
    ("rule", "text"),
    [(rule, text) for rule, texts in RULES.items() for text in texts],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_the_rule_sees_who_breaks_it(
    rule: Callable[[Sources], set[tuple[str, str]]], text: str
) -> None:
    assert rule({"eutree.inspection.somewhere": ast.parse(text)})


def test_what_is_excepted_is_there() -> None:
    """An exception that nobody needs any more would hide the next one."""
    without = {module: tree for module, tree in modules().items() if module in MIDDLES}
    needed = {module for module, _ in middles({f"{m} as it is": t for m, t in without.items()})}
    assert {module.removesuffix(" as it is") for module in needed} == set(MIDDLES)
    for module, names in BY_NAME.items():
        text = ast.unparse(modules()[module])
        assert all(f"import_module({name})" in text for name in names), module
