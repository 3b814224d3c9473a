"""Results as data frames, for those who have pandas; nothing here needs it otherwise."""

from collections.abc import Mapping
from typing import Any

from eutree.errors import MissingExtraError


def data_frame(columns: Mapping[str, Any], *, index: Mapping[str, Any]) -> Any:
    """Return a ``pandas.DataFrame``.

    Args:
        columns: The columns by name, each of shape [N].
        index: The levels of its index by name, each of shape [N].

    Raises:
        MissingExtraError: pandas is not installed.
    """
    try:
        import pandas  # type: ignore[import-untyped]  # has no types
    except ImportError:
        raise MissingExtraError("pandas", "") from None
    levels = pandas.MultiIndex.from_arrays(list(index.values()), names=list(index))
    if len(index) == 1:
        levels = levels.get_level_values(0)
    return pandas.DataFrame(dict(columns), index=levels)
