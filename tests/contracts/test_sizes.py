"""No class has over 20 methods, no function over 10 parameters; who has more is listed, and why.

Properties count as methods, keyword-only arguments as parameters. An exception that is not needed
any more fails too. Kernels have at most eight parameters, without exceptions, and a comment for
each sixteenth line.
"""

import ast
import io
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src"
MOST_METHODS, MOST_PARAMETERS = 20, 10
MOST_KERNEL_PARAMETERS = 8  # what is more is state, and goes into a named tuple
COMPILING = {"compiled", "compiled_later", "compiled_uncounted", "inlined"}
LEAST_COMMENTS = 60  # per 1,000 lines of all kernels together

LONG_SIGNATURES = {
    "eutree/training/learn.py learn": "the main job in one call: two more, no further",
}

Function = ast.FunctionDef | ast.AsyncFunctionDef


@cache
def definitions() -> list[tuple[str, ast.ClassDef | Function]]:
    """Return each class and function of the library, with its file and its qualified name."""
    return [
        found
        for path in sorted(SOURCE.rglob("*.py"))
        for found in named(ast.parse(path.read_text()), f"{path.relative_to(SOURCE)} ")
    ]


def named(node: ast.AST, prefix: str) -> Iterator[tuple[str, ast.ClassDef | Function]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ClassDef | Function):
            yield prefix + child.name, child
            yield from named(child, f"{prefix}{child.name}.")
        else:
            yield from named(child, prefix)


def methods(node: ast.ClassDef) -> set[str]:
    """Return the names of a class's methods; a property and its setter are one."""
    return {one.name for one in node.body if isinstance(one, Function)}


def parameters(node: Function) -> list[str]:
    """Return the names of all parameters, but for the object's or the class's own."""
    of = node.args
    variadic = [one for one in (of.vararg, of.kwarg) if one is not None]
    every = [*of.posonlyargs, *of.args, *of.kwonlyargs, *variadic]
    return [one.arg for one in every if one.arg not in ("self", "cls")]


def is_command(node: Function) -> bool:
    """Return whether click calls it: its parameters are the options of a command."""
    return any("command(" in ast.unparse(one) for one in node.decorator_list)


def test_no_class_has_too_many_methods() -> None:
    large = {
        name
        for name, node in definitions()
        if isinstance(node, ast.ClassDef) and len(methods(node)) > MOST_METHODS
    }
    assert large == set()


def test_no_function_has_too_many_parameters() -> None:
    long = {
        name
        for name, node in definitions()
        if isinstance(node, Function)
        and len(parameters(node)) > MOST_PARAMETERS
        and not is_command(node)
    }
    assert long == set(LONG_SIGNATURES)


def is_compiled(node: Function) -> bool:
    return any(ast.unparse(one) in COMPILING for one in node.decorator_list)


def explaining(source: str) -> int:
    """Count the comments that say more than a shape; each line of one counts."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    comments = (one.string for one in tokens if one.type == tokenize.COMMENT)
    return sum(not one.startswith(("# [", "# fmt:", "# type:", "# noqa")) for one in comments)


def test_no_kernel_has_too_many_parameters() -> None:
    kernels = [
        (name, node)
        for name, node in definitions()
        if isinstance(node, Function) and is_compiled(node)
    ]
    assert len(kernels) > 100
    assert not [name for name, node in kernels if len(parameters(node)) > MOST_KERNEL_PARAMETERS]


def test_kernels_are_commented() -> None:
    sources = [path.read_text() for path in sorted(SOURCE.rglob("_kernels*.py"))]
    n_lines = sum(len(source.splitlines()) for source in sources)
    assert 1000 * sum(map(explaining, sources)) / n_lines >= LEAST_COMMENTS


def test_which_comments_explain() -> None:
    text = """
# Why it is so,
# in two lines.
x = y  # [N, d] out
z = "# no comment"  # type: ignore
w = x  # a reason
"""
    assert explaining(text) == 3


def test_what_is_counted() -> None:
    text = """
class A:
    @property
    def x(self): ...
    @x.setter
    def x(self, value): ...
    @staticmethod
    def y(self_not, /, b, *c, d=1, **e): ...
    class B:
        def z(self): ...
@click.command()
def go(a): ...
"""
    found = dict(named(ast.parse(text), ""))
    assert list(found) == ["A", "A.x", "A.y", "A.B", "A.B.z", "go"]
    a, y, go = found["A"], found["A.y"], found["go"]
    assert isinstance(a, ast.ClassDef)
    assert methods(a) == {"x", "y"}
    assert isinstance(y, Function)
    assert parameters(y) == ["self_not", "b", "d", "c", "e"]
    assert not is_command(y)
    assert isinstance(go, Function)
    assert is_command(go)
    assert not is_compiled(go)
