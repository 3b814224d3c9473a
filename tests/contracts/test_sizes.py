"""No class has over 20 methods, no function over 10 parameters; who may is listed, with a reason.

Properties count as methods, keyword-only arguments as parameters. An exception that is not needed
any more fails too.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src" / "eutree"
MOST_METHODS, MOST_PARAMETERS = 20, 10

# scikit-learn's conventions ask for these methods, or for one argument of ``__init__`` a setting.
LARGE_CLASSES = {
    "c45/estimator.py C45Classifier": "scikit-learn",
}
LONG_SIGNATURES = {
    "c45/estimator.py C45Classifier.__init__": "scikit-learn",
    "training/learn.py learn": "the main job in one call",
}

Function = ast.FunctionDef | ast.AsyncFunctionDef


def definitions() -> Iterator[tuple[str, ast.ClassDef | Function]]:
    """Yield each class and function of the library, with its file and its qualified name."""
    for path in sorted(SOURCE.rglob("*.py")):
        tree = ast.parse(path.read_text())
        yield from named(tree, f"{path.relative_to(SOURCE)} ")


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
    assert large == set(LARGE_CLASSES)


def test_no_function_has_too_many_parameters() -> None:
    long = {
        name
        for name, node in definitions()
        if isinstance(node, Function)
        and len(parameters(node)) > MOST_PARAMETERS
        and not is_command(node)
    }
    assert long == set(LONG_SIGNATURES)


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
