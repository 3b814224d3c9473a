"""What `import eutree` offers: the same to the interpreter, to type checkers and in the docs."""

import ast
import importlib
import inspect
import re
from pathlib import Path

import pytest

import eutree

ROOT = Path(__file__).parents[2]
INIT = ROOT / "src" / "eutree" / "__init__.py"
PUBLIC = {name: f"{home}:{name}" for home, names in eutree._HOMES.items() for name in names.split()}
PUBLIC |= {module.rpartition(".")[2]: module for module in eutree._MODULES}


def imports_for_type_checkers() -> dict[str, str]:
    """Return the names imported under TYPE_CHECKING, as in the table: module or module:name."""
    tree = ast.parse(INIT.read_text())
    block = next(
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    found = {}
    for node in ast.walk(block):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                name = alias.asname or alias.name
                home = importlib.import_module(node.module)
                is_module = inspect.ismodule(getattr(home, alias.name, home))
                found[name] = f"{node.module}{'.' if is_module else ':'}{alias.name}"
    return found


def test_table_and_type_checkers_agree() -> None:
    assert imports_for_type_checkers() == PUBLIC


def test_all_lists_the_visible_names() -> None:
    assert sorted(eutree.__all__) == sorted(dir(eutree))
    assert not [name for name in eutree.__all__ if name.startswith("_")]


@pytest.mark.parametrize("name", eutree.__all__)
def test_name_loads_and_has_a_docstring(name: str) -> None:
    assert inspect.getdoc(getattr(eutree, name))


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'TreePolicies'"):
        eutree.TreePolicies  # noqa: B018 - the access is what is tested


@pytest.mark.parametrize("name", eutree.__all__)
def test_name_is_in_the_reference(name: str) -> None:
    pages = "".join(path.read_text() for path in (ROOT / "docs" / "reference").glob("*.md"))
    module, _, _ = PUBLIC[name].partition(":")
    assert (
        re.search(rf"auto\w+:: eutree\.{name}$", pages, re.MULTILINE)
        or f"automodule:: {module}\n   :members:" in pages
    )


def test_package_is_marked_as_typed() -> None:
    assert (ROOT / "src" / "eutree" / "py.typed").exists()


def public_callables() -> list[tuple[str, object]]:
    found = []
    for name in eutree.__all__:
        value = getattr(eutree, name)
        members = {name: value}
        if inspect.ismodule(value):
            members = {f"{name}.{n}": getattr(value, n) for n in getattr(value, "__all__", [])}
        for label, member in members.items():
            if inspect.isclass(member):
                found += [
                    (f"{label}.{n}", function)
                    for n, function in vars(member).items()
                    if inspect.isfunction(function) and not n.startswith("_")
                ]
            elif inspect.isfunction(member):
                found.append((label, member))
    return found


def test_public_functions_are_completely_typed() -> None:
    untyped = []
    for label, function in public_callables():
        signature = inspect.signature(function)  # type: ignore[arg-type] - all are callable
        parameters = [p for p in signature.parameters.values() if p.name not in ("self", "cls")]
        if signature.return_annotation is inspect.Signature.empty or any(
            p.annotation is inspect.Parameter.empty for p in parameters
        ):
            untyped.append(label)
    assert untyped == []


def test_what_is_loaded_when_asked_for_is_offered_and_documented() -> None:
    """Sphinx sees of a package what it has loaded: ``docs/conf.py`` asks for the rest first."""
    source = ROOT / "src" / "eutree"
    lazy = {
        path.parent.name
        for path in source.glob("*/__init__.py")
        if "lazily(" in path.read_text(encoding="utf-8")
    }
    for name in lazy:
        package = importlib.import_module(f"eutree.{name}")
        assert all(getattr(package, offered) is not None for offered in package.__all__)
        assert set(package.__all__) <= set(dir(package)), name
    pages = "".join(path.read_text() for path in (ROOT / "docs" / "reference").glob("*.md"))
    shown = {name for name in lazy if f"automodule:: eutree.{name}\n" in pages}
    told = re.search(r"^for _name in \((.*)\):$", (ROOT / "docs" / "conf.py").read_text(), re.M)
    assert told is not None
    assert shown == set(re.findall(r"\w+", told[1]))
