"""No class has over 20 methods, no function over 10 parameters.

Properties count as methods, keyword-only arguments as parameters. A function that ``eutree`` itself
offers is a whole job in one call and may have two more; a command has one for each option. Kernels
have at most eight parameters, and a comment for each sixteenth line.
"""

import ast
import inspect
import io
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import eutree

SOURCE = Path(__file__).parents[2] / "src"
MOST_METHODS, MOST_PARAMETERS, MOST_AT_THE_DOOR, MOST_OPTIONS = 20, 10, 12, 24
MOST_KERNEL_PARAMETERS = 8  # what is more is state, and goes into a named tuple
COMPILING = {"compiled", "compiled_later", "compiled_uncounted", "inlined"}
LEAST_COMMENTS = 60  # per 1,000 lines of all kernels together

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


@cache
def at_the_door() -> set[str]:
    """Return the functions that ``eutree`` itself offers, named as the definitions are."""
    offered = [getattr(eutree, name) for name in eutree.__all__]
    return {
        f"{one.__module__.replace('.', '/')}.py {one.__qualname__}"
        for one in offered
        if inspect.isfunction(one)
    }


def most(name: str, node: Function) -> int:
    """Return how many parameters a function may have."""
    if is_command(node):
        return MOST_OPTIONS
    return MOST_AT_THE_DOOR if name in at_the_door() else MOST_PARAMETERS


def test_no_function_has_too_many_parameters() -> None:
    functions = [(name, node) for name, node in definitions() if isinstance(node, Function)]
    assert [name for name, node in functions if len(parameters(node)) > most(name, node)] == []


def test_who_may_have_more_parameters() -> None:
    found = dict(definitions())
    assert at_the_door() < set(found)
    limits = {
        name: most(name, node)
        for name, node in found.items()
        if isinstance(node, Function) and name.split()[-1] in {"learn", "fit", "grow"}
    }
    assert limits["eutree/training/learn.py learn"] == MOST_AT_THE_DOOR
    assert limits["eutree/cli/learn.py learn"] == MOST_OPTIONS
    assert limits["eutree/c45/growing.py grow"] == MOST_PARAMETERS


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
