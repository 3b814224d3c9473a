"""The choices of a method by name: read, changed, described.

A choice of a part is written with dots, ``planner.improvement.price``; its last name is enough
where no other choice ends in it.
"""

import inspect
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from eutree.errors import InvalidArgumentError, UnknownNameError, shown
from eutree.learners.learner import Method
from eutree.learners.registry import from_document, to_document

# What msgspec says: Expected `float | null`, got `str` - at `$.planner.improvement.price`
_MISTAKEN = re.compile(r"Expected `(?P<kinds>[^`]*)`, got `\w+` - at `\$\.(?P<path>[\w.]+)`")
_KINDS = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "str": "a word",
    "null": "null",
}
_ATTRIBUTE = re.compile(r"^    (\w+): ", re.MULTILINE)


class Choice(NamedTuple):
    """A choice of a method.

    Attributes:
        name: Its name, with dots.
        value: What is chosen, in JSON's types.
        text: What it is for, as the docstring of its class says.
    """

    name: str
    value: Any
    text: str


def choices_of(method: Method) -> list[Choice]:
    """Return all choices of a method, in the order of its fields."""
    document = to_document(method)
    return list(_choices("", method, {k: v for k, v in document.items() if k != "name"}))


def with_choices(method: Method, changes: Mapping[str, Any]) -> Method:
    """Return a method with other choices.

    Args:
        method: The method.
        changes: Values by name, or whole parts as nested mappings.

    Raises:
        UnknownNameError: The method has no such choice.
        InvalidArgumentError: A name is that of several choices, or a value is not one of its.
    """
    given = list(_flat(changes))
    kinds = [pair for pair in given if pair[0].rpartition(".")[2] == "type"]
    if kinds and len(kinds) < len(given):  # first of all: a kind brings its own choices
        method = with_choices(method, dict(kinds))
        given = [pair for pair in given if pair not in kinds]
    document = to_document(method)
    for name, value in given:
        place, *parts = reversed(_path(name, document, method))
        part = document
        for step in reversed(parts):
            part = part[step]
        part[place] = value
    try:
        return from_document(document, kind=type(method))
    except InvalidArgumentError as error:
        raise _in_words(error, document) from None


def _in_words(error: InvalidArgumentError, document: Mapping[str, Any]) -> InvalidArgumentError:
    """Return what is wrong with a value in the words of a user, where it is of another kind."""
    found = _MISTAKEN.search(str(error))
    if found is None:
        return error
    value: Any = document
    for step in found["path"].split("."):
        value = value[step]
    kinds = [_KINDS.get(kind.strip(), kind.strip()) for kind in found["kinds"].split("|")]
    name = found["path"].rpartition(".")[2]
    return InvalidArgumentError(f"{name} must be {' or '.join(kinds)}, got {shown(value)}")


def _choices(prefix: str, part: Any, document: Mapping[str, Any]) -> Iterator[Choice]:
    """Yield the choices of a part, a dataclass or a tagged struct, and of its parts."""
    texts = _texts(type(part))
    for name, value in document.items():
        if isinstance(value, dict):
            yield from _choices(f"{prefix}{name}.", getattr(part, name), value)
        else:
            yield Choice(prefix + name, value, texts.get(name, ""))


def _texts(kind: type) -> dict[str, str]:
    """Return what the docstrings of a class and its bases say of each attribute."""
    found = {"type": "Which of its kinds."}
    for one in reversed(kind.__mro__):
        _, _, attributes = inspect.cleandoc(one.__doc__ or "").partition("Attributes:\n")
        pieces = _ATTRIBUTE.split(attributes)
        for name, piece in zip(pieces[1::2], pieces[2::2], strict=True):
            found[name] = " ".join(piece.split())
    return found


def _flat(changes: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in changes.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def _path(name: str, document: Mapping[str, Any], method: Method) -> list[str]:
    """Return the way to a choice that is named in full or by its last names."""
    known = [path for path, _ in _flat(document) if path != "name"]
    found = [path for path in known if path == name] or [
        path for path in known if path.endswith(f".{name}")
    ]
    if not found:
        last = {path.rpartition(".")[2] for path in known}  # which are enough
        near = known if "." in name else [*last, *known]
        raise UnknownNameError(f"choice of method {method.name!r}", name, near)
    if len(found) > 1:
        raise InvalidArgumentError(
            f"choice {name!r} of method {method.name!r} must be one of {', '.join(found)}"
        )
    return found[0].split(".")
