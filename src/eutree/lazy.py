"""Names that a package offers, each imported when it is first asked for (PEP 562)."""

import importlib
from collections.abc import Callable, Mapping
from typing import Any


def lazily(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package that offers names of its modules.

    Args:
        package: Its name, as ``__name__``.
        homes: Modules by name, and what each offers, in words apart: ``{"a.b": "One Two"}``.
    """
    home_of = {name: module for module, names in homes.items() for name in names.split()}

    def offered(name: str) -> Any:
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = home_of[name]
        value = getattr(importlib.import_module(home), name)
        setattr(importlib.import_module(package), name, value)  # asked for once
        return value

    return offered
