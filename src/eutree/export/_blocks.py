"""Deep trees cut into blocks, because compilers and parsers bound how deep rules may nest.

C99 promises 127 levels of nesting, Python 100 of indentation. A tree that is deeper than
``DEPTH`` becomes several functions: each block's rules end by calling the blocks below it.
"""

import re
import tomllib
import unicodedata
from collections.abc import Iterable, Sequence
from importlib import resources

import numpy as np

from eutree.errors import InvalidArgumentError
from eutree.schema import Schema
from eutree.trees import DecisionTree

# Identifiers longer than this are cut: C99 promises 31 significant characters to the linker.
_LENGTH = 31

_RESERVED = tomllib.loads(
    (resources.files(__package__) / "reserved.toml").read_text(encoding="utf-8")
)
C_WORDS, PYTHON_WORDS, STRUCTURED_TEXT_WORDS = (
    frozenset(_RESERVED[language].split()) for language in ("c", "python", "structured_text")
)


def identifiers(names: Sequence[str], *, reserved: Iterable[str], prefix: str = "x") -> list[str]:
    """Return a distinct identifier for each name, as near to it as ASCII allows.

    Identifiers differ even where upper and lower case count as equal, have no two underscores in
    a row and none at an end, and avoid the ``reserved`` words.

    Args:
        names: The names.
        reserved: Words to avoid, in any case.
        prefix: What to put before a name that is empty or begins with a digit.
    """
    taken = {word.casefold() for word in reserved}
    result = []
    for name in names:
        base = _ascii(name, prefix)
        candidate, number = base, 1
        while candidate.casefold() in taken:
            number += 1
            candidate = f"{base[: _LENGTH - len(str(number)) - 1].rstrip('_')}_{number}"
        taken.add(candidate.casefold())
        result.append(candidate)
    return result


def check_identifier(argument: str, value: str, *, reserved: frozenset[str]) -> str:
    """Return ``value`` if it may name a function, else raise InvalidArgumentError."""
    words = {word.casefold() for word in reserved}
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", value) or value.casefold() in words:
        raise InvalidArgumentError(
            f"{argument} must be an identifier (letters, digits and underscores) that is no "
            f"reserved word, got {value!r}"
        )
    return value


def _ascii(name: str, prefix: str) -> str:
    """Return letters, digits and single underscores that resemble ``name``."""
    decomposed = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode("ascii")
    words = re.sub(r"[^A-Za-z0-9]+", "_", decomposed).strip("_")
    if not words[:1].isalpha():
        words = f"{prefix}_{words}".rstrip("_")
    return words[:_LENGTH].rstrip("_")


DEPTH = 60


def block_roots(tree: DecisionTree) -> list[int]:
    """Return the nodes at which blocks begin, deepest first and the tree's root last.

    A block calls only blocks that come before it in the list, so functions written in this order
    need no declarations.
    """
    depth = np.zeros(tree.n_nodes, dtype=np.int64)
    for node in range(1, tree.n_nodes):
        depth[node] = depth[tree.parent[node]] + 1
    is_inner = tree.feature != tree.NO_FEATURE
    roots = set(np.flatnonzero(is_inner & (depth % DEPTH == 0)).tolist()) | {0}
    return sorted(roots, reverse=True)


def action_identifiers(schema: Schema, *, reserved: tuple[str, ...] = ()) -> list[str]:
    """Return an identifier for each action; signs and points of levels are spelled."""
    names = list(schema.actions)
    if schema.controls:
        names = [_spelled(name) for name in names]
    return identifiers(names, reserved=reserved, prefix="action")


def control_identifiers(schema: Schema, *, reserved: frozenset[str]) -> list[str]:
    """Return an identifier for each control."""
    names = [control.name for control in schema.controls]
    return identifiers(names, reserved=reserved, prefix="control")


def _spelled(name: str) -> str:
    """Return a name with "minus" for the sign of a number and "p" for its point."""
    name = re.sub(r"(?<![\w.])-(?=\d)", "minus ", name)
    return re.sub(r"(?<=\d)\.(?=\d)", "p", name)


ASSUMPTION = (
    "Actions may be masked where it acts; this takes all to be allowed. "
    "The next best ones are in the exports to C and Python."
)
