"""Names that a package offers, each imported when it is first asked for (PEP 562)."""

import importlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any


def lazily(
    package: str, homes: Mapping[str, str], modules: Iterable[str] = ()
) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package that offers names of its modules.

    Args:
        package: Its name, as ``__name__``.
        homes: Names that each module offers, with spaces between: ``{"a.b": "One Two"}``.
        modules: Modules that are offered themselves, by their last names.
    """
    whole = {module.rpartition(".")[2]: module for module in modules}
    home_of = {name: module for module, names in homes.items() for name in names.split()}

    def offered(name: str) -> Any:
        if name not in home_of and name not in whole:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = whole.get(name) or home_of[name]
        value: Any = importlib.import_module(home)
        if name not in whole:
            value = getattr(value, name)
        setattr(importlib.import_module(package), name, value)  # asked for once
        return value

    return offered
