"""``--set``, ``--settings``, ``--discount`` and ``--list-settings`` of ``eutree learn``."""

import json
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eutree.cli._options import look_in_this_folder
from eutree.errors import FormatError, InvalidArgumentError

if TYPE_CHECKING:
    from eutree.learners import Method

# What to turn first, by method; the order is that of what was found to matter most.
FIRST = {
    "planning": ("planner.improvement.price", "planner.explorer_share", "gathering_episodes"),
    "u-tree": ("significance.alpha", "splitter.min_leaf", "discount"),
}
_MOST = 2**20  # bytes of a file of settings


def chosen_method(
    name: str | None,
    *,
    offline: bool,
    settings: Path | None,
    changes: tuple[str, ...],
    discount: float | None,
) -> "Method | str | None":
    """Return the method of a name, with what a file and ``--set`` choose otherwise."""
    from eutree.learners import method as method_of
    from eutree.learners.registry import with_choices

    if name == "auto":
        name = None
    elif name is not None and ":" in name:
        look_in_this_folder()
    if settings is None and not changes and discount is None:
        return name
    document = {} if settings is None else dict(_read(settings))
    stored = document.pop("method", document.pop("name", None))
    if isinstance(stored, dict):  # the configuration of a run
        document, stored = dict(stored), stored.get("name")
        document.pop("name", None)
    if name is not None and stored is not None and stored != method_of(name).name:
        raise InvalidArgumentError(f"{settings}: method must be {name!r} as asked, got {stored!r}")
    method = method_of(name or stored or ("corrected" if offline else "default"))
    method = with_choices(method, document)
    method = with_choices(method, dict(_pair(text) for text in changes))
    return method if discount is None else with_choices(method, {"discount": discount})


def listed(method: "Method | str | None", *, offline: bool) -> tuple[dict[str, Any], str]:
    """Return all choices of a method, for ``--json`` and as a text: what to turn first on top."""
    from eutree.learners import method as method_of
    from eutree.learners.registry import choices_of

    if method is None or isinstance(method, str):
        method = method_of(method or ("corrected" if offline else "default"))
    first = FIRST.get(method.name, ())
    known = choices_of(method)
    order = sorted(
        known, key=lambda one: first.index(one.name) if one.name in first else len(first)
    )
    lines = [f"{method.name}: --set NAME=VALUE; turn first what is marked with *"]
    for choice in order:
        mark = "*" if choice.name in first else " "
        lines.append(f"{mark} {choice.name} = {json.dumps(choice.value)}\n      {choice.text}")
    values = {
        "method": method.name,
        "first": list(first),
        "settings": {choice.name: choice.value for choice in known},
    }
    return values, "\n".join(lines)


def _pair(text: str) -> tuple[str, Any]:
    name, separator, value = text.partition("=")
    if not separator or not name:
        raise InvalidArgumentError(f"--set must be KEY=VALUE, got {text!r}")
    try:
        return name, json.loads(value)
    except (ValueError, RecursionError):
        return name, value


def _read(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file, or of the JSON file of a run's configuration."""
    from eutree.files import read_bytes

    data = read_bytes(path, limit=_MOST)
    try:
        if path.suffix == ".json":
            found = json.loads(data)
            if not isinstance(found, dict) or not isinstance(found.get("method"), dict):
                raise FormatError(path, "method", "must be there: the configuration of a run")
            return {"method": found["method"]}
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(path, "document", str(error)) from None
