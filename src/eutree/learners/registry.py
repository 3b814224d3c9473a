"""The methods by name, and how one is written to a file and read back.

A method is found by an entry point: those of the core are listed here; every other one, those of
``eutree_lab`` too, names its class in the group ``eutree.methods`` of its distribution's metadata.
One that is not installed is handed to ``learn`` itself, is named ``module:Class``, or is made known
by ``register``.

A file never decides about imports: it names a method by its name alone, and its choices are read
back by the class of the method that the run was resumed with.
"""

import inspect
import re
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import fields, is_dataclass, replace
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import msgspec

from eutree.errors import EutreeError, FormatError, InvalidArgumentError, UnknownNameError, shown
from eutree.learners.declared import State, taken
from eutree.learners.learner import Learner, Method, Needs, Problem, Start, check_has_all
from eutree.validation import check_offered

_HOMES = MappingProxyType({
    "default": "eutree.learners.planning:DEFAULT",
    "paper": "eutree.learners.u_tree:PAPER",
    "paper-d": "eutree.learners.u_tree:PAPER_D",
    "corrected": "eutree.learners.u_tree:CORRECTED",
})  # fmt: skip


class Presets(Mapping[str, Method]):
    """The presets by name; the method of each is imported when it is asked for."""

    def __getitem__(self, name: str) -> Method:
        return cast(Method, EntryPoint(name, _HOMES[name], "").load())

    def __iter__(self) -> Iterator[str]:
        return iter(_HOMES)

    def __len__(self) -> int:
        return len(_HOMES)


PRESETS = Presets()


GROUP = "eutree.methods"
_HINT = (
    "One of your own is named MODULE:CLASS, or found by an entry point of its package "
    "(docs/your-own-method.md)."
)
_OURS = MappingProxyType({
    "planning": "eutree.learners.planning:PlanningMethod",
    "u-tree": "eutree.learners.u_tree:UTreeMethod",
    "distilled-dqn": "eutree.learners.distilled_dqn:DistilledDQN",
})  # fmt: skip


class Methods(Mapping[str, type[Method]]):
    """The classes of all methods by name; each is imported when it is first asked for."""

    def __init__(self) -> None:
        self._known: dict[str, type[Method]] = {}

    def __getitem__(self, name: str) -> type[Method]:
        if name not in self._known:
            # Another distribution cannot take the place of ours.
            ours = [EntryPoint(name, _OURS[name], GROUP)] if name in _OURS else []
            found = ours or list(entry_points(group=GROUP, name=name))
            if not found:
                raise KeyError(name)
            self._known[name] = _loaded(name, found)
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        others = {*self._known, *(point.name for point in entry_points(group=GROUP))}
        yield from _OURS
        yield from sorted(others - _OURS.keys())

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def add(self, kind: type[Method]) -> None:
        """Make a method known in this process; see ``register``."""
        self._known[checked(kind).name] = kind


METHODS = Methods()


def register(kind: type[Method]) -> type[Method]:
    """Make a method known by its name in this process; usable as a decorator of its class.

    Raises:
        InvalidArgumentError: The class is none of a method, or has the name of one of eutree's.
    """
    METHODS.add(kind)
    return kind


def method(name: str) -> Method:
    """Return a method by its own name, that of a preset, or that of its class: ``module:Class``.

    Raises:
        UnknownNameError: There is no such method or preset.
        InvalidArgumentError: The class cannot be imported, or is none of a method.
    """
    if name in PRESETS:
        return PRESETS[name]
    if ":" not in name:
        return _installed(name)()
    return checked(check_offered("method", [EntryPoint(name, name, GROUP)]))()


def checked(kind: Any) -> type[Method]:
    """Return the class of a method if it is one.

    Raises:
        InvalidArgumentError: It is no frozen dataclass with all that a method has, or has the
            name of one of eutree's.
    """
    params = getattr(kind, "__dataclass_params__", None)
    is_frozen = isinstance(kind, type) and params is not None and params.frozen
    if is_frozen:
        check_has_all(kind, Method, kind, besides=kind.__dataclass_fields__)
    if not is_frozen or not isinstance(kind.needs, Needs) or not isinstance(kind.name, str):
        raise InvalidArgumentError(
            "a method must be a frozen dataclass with name, needs, start, restore and declared "
            f"(docs/your-own-method.md), got {shown(kind)}"
        )
    if not kind.name:
        raise InvalidArgumentError(f"a method must have a name, got an empty one of {shown(kind)}")
    is_ours = kind.__module__.partition(".")[0] == "eutree"
    if not is_ours and (kind.name in _OURS or kind.name in PRESETS):
        raise InvalidArgumentError(f"method {kind.name!r} is one of eutree's; name yours otherwise")
    return cast(type[Method], kind)


def to_document(chosen: Method) -> dict[str, Any]:
    """Return a method in JSON's types: its name and all its choices.

    Raises:
        InvalidArgumentError: A choice is nothing that a file can hold.
    """
    try:
        named = {field.name: getattr(chosen, field.name) for field in fields(cast(Any, chosen))}
        choices: dict[str, Any] = msgspec.to_builtins(named)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidArgumentError(
            f"method {chosen.name!r} must have choices that JSON can hold: {error}"
        ) from None
    return {"name": chosen.name, **choices}


def checked_document(chosen: Method) -> dict[str, Any]:
    """Return ``to_document`` of a method that comes back from it as it was.

    Raises:
        InvalidArgumentError: It is none, or a run with it could not be resumed.
    """
    document = to_document(checked_method(chosen))
    encoded = msgspec.json.encode(document)
    again = from_document(msgspec.json.decode(encoded), kind=type(chosen))
    if to_document(again) != document:
        raise InvalidArgumentError(
            f"method {chosen.name!r} must be made by its choices alone, got {shown(chosen)}, "
            f"which is read back from its file as {shown(again)}"
        )
    return document


def from_document(document: Mapping[str, Any], *, kind: type[Method] | None = None) -> Method:
    """Return the method that ``to_document`` wrote; a choice that is missing has its default.

    ``kind`` is its class, where that is known already.

    Raises:
        InvalidArgumentError: The document is of no known method, or a choice is not one of its.
    """
    choices = dict(document)
    name = choices.pop("name", "")
    if kind is None:
        kind = _installed(name)
    choices = _without_deleted(kind, choices)
    unknown = sorted(choices.keys() - {field.name for field in fields(cast(Any, kind))})
    if unknown:
        raise InvalidArgumentError(f"method {kind.name!r} has no choice {unknown[0]!r}")
    try:
        return cast(Method, _filled(msgspec.convert(choices, kind)))
    except (msgspec.ValidationError, ValueError) as error:
        raise InvalidArgumentError(f"method {kind.name!r}: {error}") from None


def _without_deleted(kind: type[Method], choices: dict[str, Any]) -> dict[str, Any]:
    """Return the choices of an older file without those that are no more.

    A class may have ``deleted``: choices of earlier releases, and the value of each at which the
    method learns as it does now.
    """
    choices = deepcopy(choices)
    for choice, usual in getattr(kind, "deleted", {}).items():
        *outer, last = choice.split(".")
        part: Any = choices
        for key in outer:
            part = part.get(key) if isinstance(part, dict) else None
        if not isinstance(part, dict) or last not in part:
            continue
        if (was := part.pop(last)) != usual:
            raise InvalidArgumentError(
                f"method {kind.name!r} has the choice {choice!r} no more, which was {shown(was)}: "
                "go on with the release that made the file, or begin a new run"
            )
    return choices


def _filled(chosen: Any) -> Any:
    """Return a method or a part of one with its defaults among its attributes.

    msgspec leaves them to the class, and does not see them there when it writes.
    """
    parts = {field.name: getattr(chosen, field.name) for field in fields(chosen) if field.init}
    return replace(
        chosen, **{name: _filled(part) for name, part in parts.items() if is_dataclass(part)}
    )


def checked_method(chosen: Any) -> Method:
    """Return a method if it is one; see ``checked``."""
    if isinstance(chosen, type):
        raise InvalidArgumentError(
            f"method must be a method with its choices, {chosen.__name__}(), got the class"
        )
    checked(type(chosen))
    return cast(Method, chosen)


def _installed(name: str) -> type[Method]:
    try:
        return METHODS[name]
    except KeyError:
        raise UnknownNameError("method", name, {*METHODS, *PRESETS}, hint=_HINT) from None


def _loaded(name: str, found: list[EntryPoint]) -> type[Method]:
    """Return the class that an entry point names, under which it must be known itself."""
    offered, value = check_offered("method", found), found[0].value
    try:
        kind = checked(offered)
    except EutreeError as error:
        raise InvalidArgumentError(f"method {name!r}, {value}: {error}") from None
    if kind.name != name:
        raise InvalidArgumentError(
            f"method {name!r}, {value}, must have that name itself, got {kind.name!r}"
        )
    return kind


def state_of(learner: Learner, method: Method, problem: Problem, start: Start) -> State:
    """Return the state of a learner, from which ``restored`` makes it again.

    Raises:
        InvalidArgumentError: It is not as the method declares it.
    """
    state = learner.state()
    try:
        taken("", state, method.declared(problem, start))
    except FormatError as error:
        raise InvalidArgumentError(
            f"method {method.name!r} must have a state as it declares it, got {error.place}: "
            f"{error.reason}"
        ) from None
    return state


def restored(
    path: str | Path, state: State, method: Method, problem: Problem, start: Start
) -> Learner:
    """Return the learner of a stored state.

    Raises:
        FormatError: The state is not as the method declares it, or no learner comes of it.
    """
    trusted = taken(path, state, method.declared(problem, start))
    try:
        learner = method.restore(problem, start, trusted)
    except FormatError:
        raise
    except (EutreeError, ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise FormatError(path, "state", f"no learner comes of it: {error}") from error
    check_has_all(learner, Learner, type(method))
    return learner


# A choice of a part is written with dots, ``planner.improvement.price``; its last name is enough
# where no other choice ends in it.

# What msgspec says: Expected `float | null`, got `str` - at `$.planner.improvement.price`
_MISTAKEN = re.compile(r"Expected `(?P<kinds>[^`]*)`, got `\w+` - at `\$\.(?P<path>[\w.]+)`")
_KINDS = {"float": "a number", "int": "a whole number", "bool": "true or false", "str": "a word"}
_ATTRIBUTE = re.compile(r"^    (\w+): ", re.MULTILINE)


class Choice(NamedTuple):
    """A choice of a method."""

    name: str  # its name, with dots
    value: Any  # the choice, in JSON's types
    text: str  # its purpose, as the docstring of its class says


def choices_of(method: Method) -> list[Choice]:
    """Return all choices of a method, in the order of its fields."""
    document = to_document(method)
    return list(_choices("", method, {k: v for k, v in document.items() if k != "name"}))


def with_choices(method: Method, changes: Mapping[str, Any]) -> Method:
    """Return a method with other choices, by name, or as whole parts in nested mappings.

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
    """Return the error of a value in the words of a user, where it is of another kind."""
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
    """Return the text on each attribute in the docstrings of a class and its bases."""
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
    found = [path for path in known if name == path] or [p for p in known if p.endswith(f".{name}")]
    if not found:
        last = {path.rpartition(".")[2] for path in known}  # which are enough
        near = known if "." in name else [*last, *known]
        hint = f"All: eutree learn --list-settings --method {method.name}."
        raise UnknownNameError(f"choice of method {method.name!r}", name, near, hint=hint)
    if len(found) > 1:
        raise InvalidArgumentError(
            f"choice {name!r} of method {method.name!r} must be one of {', '.join(found)}"
        )
    return found[0].split(".")
