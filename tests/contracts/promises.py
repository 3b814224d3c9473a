"""The promises of docs/promises.md and the tests that carry their numbers.

Run as a program, it writes the names of the tests into the page:
``python -m tests.contracts.promises``. It prints the promises that have none; with ``--missing`` it
does only that.
"""

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "promises.md"
ROW = re.compile(r"^\| (\d+) \| (.*) \| (.*) \|$", re.MULTILINE)


def marked_tests() -> dict[int, list[str]]:
    """Return the tests that carry ``promise(number)``, as ``path::name``, by number."""
    found: dict[int, list[str]] = defaultdict(list)
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        tree = ast.parse(path.read_text())
        name = path.relative_to(ROOT).as_posix()
        for statement in tree.body:
            if isinstance(statement, ast.Assign) and _is_pytestmark(statement):
                for number in _numbers(statement.value):
                    found[number].append(name)
        for numbers, test in _marked_definitions(tree, ""):
            for number in numbers:
                found[number].append(f"{name}::{test}")
    return dict(found)


def _is_pytestmark(statement: ast.Assign) -> bool:
    return any(isinstance(t, ast.Name) and t.id == "pytestmark" for t in statement.targets)


def _marked_definitions(
    parent: ast.Module | ast.ClassDef, prefix: str
) -> Iterator[tuple[list[int], str]]:
    for node in parent.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            numbers = [n for decorator in node.decorator_list for n in _numbers(decorator)]
            # A TestCase made by a state machine is marked where the machine is.
            yield numbers, prefix + node.name
        if isinstance(node, ast.ClassDef):
            yield from _marked_definitions(node, f"{prefix}{node.name}::")


def _numbers(node: ast.AST) -> list[int]:
    return [
        int(argument.value)
        for call in ast.walk(node)
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr == "promise"
        for argument in call.args
        if isinstance(argument, ast.Constant) and isinstance(argument.value, int)
    ]


def page_rows() -> dict[int, tuple[str, list[str]]]:
    """Return each promise of the page: its text and the tests that it names."""
    return {
        int(number): (text, re.findall(r"`(tests/[^`]+)`", tests))
        for number, text, tests in ROW.findall(PAGE.read_text())
    }


def write_page() -> None:
    """Write the names of the tests into the page."""
    marked = marked_tests()

    def row(match: re.Match[str]) -> str:
        tests = ", ".join(f"`{test}`" for test in marked.get(int(match[1]), [])) or "none yet"
        return f"| {match[1]} | {match[2]} | {tests} |"

    PAGE.write_text(ROW.sub(row, PAGE.read_text()))


if __name__ == "__main__":
    if sys.argv[1:] != ["--missing"]:
        write_page()
    print(", ".join(map(str, sorted(page_rows().keys() - marked_tests().keys()))) or "none")
