"""Parts of exported code: identifiers, blocks, derived features, templates.

C99 promises 127 levels of nesting, Python 100 of indentation. A tree that is deeper than
``DEPTH`` becomes several functions: each block's rules end by calling the blocks below it.

Derived features are the same doubles as the policy computes, in each language. Every operation
that a compiler could fuse, reorder or define otherwise is a function of its own.
"""

import re
import tomllib
import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import resources
from string import Template

import numpy as np

from eutree.errors import InvalidArgumentError
from eutree.export._c_numbers import hexadecimal
from eutree.formulas import LARGEST_RATIO
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree
from eutree.trees.text import Syntax, derived_features, nested
from eutree.trees.tree import depths
from eutree.validation import check_kind

# Identifiers longer than this are cut: C99 promises 31 significant characters to the linker.
_LENGTH = 31


def template(name: str) -> str:
    """Return the text of a file in ``templates``."""
    return (resources.files(__package__) / "templates" / name).read_text(encoding="utf-8")


_RESERVED = tomllib.loads(template("reserved.toml"))
C_WORDS, PYTHON_WORDS, STRUCTURED_TEXT_WORDS = (
    frozenset(_RESERVED[language].split()) for language in ("c", "python", "structured_text")
)
_TYPES = _RESERVED["conversions"].split()
STRUCTURED_TEXT_WORDS |= {f"{one}_to_{other}" for one in _TYPES for other in _TYPES}


def identifiers(names: Sequence[str], *, reserved: Iterable[str], prefix: str = "x") -> list[str]:
    """Return a distinct identifier for each name, as near to it as ASCII allows.

    Identifiers differ even where upper and lower case count as equal, have no two underscores in
    a row and none at an end, and avoid the ``reserved`` words in any case. ``prefix`` stands before
    a name that would be empty or begin with a digit.
    """
    taken = {word.casefold() for word in reserved}
    result = []
    for name in names:
        base = _ascii(name, prefix)
        short, number = base, 1
        while short.casefold() in taken:
            number += 1
            short = f"{base[: _LENGTH - len(str(number)) - 1].rstrip('_')}_{number}"
        taken.add(short.casefold())
        result.append(short)
    return result


def behind(name: str, words: Iterable[str]) -> set[str]:
    """Return what would make one of some words if it followed ``NAME_``, in any case."""
    start = f"{name}_".casefold()
    return {word[len(start) :] for word in map(str.casefold, words) if word.startswith(start)}


def check_identifier(
    argument: str, value: str, *, reserved: frozenset[str], single: bool = False
) -> str:
    """Return ``value`` if it may name a function, else raise InvalidArgumentError.

    ``single`` allows underscores only alone and between others, as structured text does.
    """
    words = {word.casefold() for word in reserved}
    check_kind(argument, value, str)
    pattern = r"[A-Za-z](_?[A-Za-z0-9])*" if single else r"[A-Za-z]\w*"
    if not re.fullmatch(pattern, value, re.ASCII) or value.casefold() in words:
        raise InvalidArgumentError(
            f"{argument} must be an identifier (letters, digits and "
            f"{'single underscores between them' if single else 'underscores'}) that is no "
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
    is_inner = tree.feature != tree.NO_FEATURE
    roots = set(np.flatnonzero(is_inner & (depths(tree.parent) % DEPTH == 0)).tolist()) | {0}
    return sorted(roots, reverse=True)


def action_identifiers(schema: Schema, *, reserved: Iterable[str] = ()) -> list[str]:
    """Return an identifier for each action; signs and points of levels are spelled."""
    names = list(schema.actions)
    if schema.controls:
        names = [_spelled(name) for name in names]
    return identifiers(names, reserved=reserved, prefix="action")


def control_identifiers(schema: Schema, *, reserved: Iterable[str]) -> list[str]:
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


Functions = Mapping[str, list[str]]  # of each operation that needs one: the lines of its function
_WRITTEN = {  # lines before each function, and the largest quotient
    "c": ([""], hexadecimal(LARGEST_RATIO)),
    "python": (["", ""], repr(LARGEST_RATIO)),
    "structured_text": ([], f"{LARGEST_RATIO:.1f}"),
}
_BETWEEN = re.compile(r"\n\n+(?=static|def|FUNCTION)")
_CALL = re.compile(r"(\w+)_(ratio|times|least|most|size)\(")


def exported_features(policy: TreePolicy) -> list[int]:
    """Return the derived features that exported code has to compute, in order.

    Raises:
        InvalidArgumentError: The policy has derived features and remembers the past besides.
    """
    if policy.schema.derived and not policy.features.is_identity:
        raise InvalidArgumentError(
            "a policy with derived features must have no history to be exported as code: declare "
            "what it remembers, before = last(level)"
        )
    return derived_features(policy.tree, policy.schema)


def remembered_features(policy: TreePolicy) -> list[int]:
    """Return the features whose last values exported code has to keep."""
    first, formulas = policy.derivation.n_measured, policy.derivation.formulas
    parts = (part for j in exported_features(policy) for part in formulas[j - first])
    return sorted({part.index for part in parts if part.kind == "last"})


def formulas(
    policy: TreePolicy,
    write: Mapping[str, Callable[..., str]],
    names: Sequence[str],
    last: Callable[[int], str],
) -> list[tuple[int, str]]:
    """Return the derived features that exported code has to compute, and how.

    ``write`` comes from ``operations``; ``names`` are the features as they are written, ``last``
    says how the last value of one is.
    """
    first, found = policy.derivation.n_measured, policy.derivation.formulas
    return [(j, found[j - first].compute(names, last, write)) for j in exported_features(policy)]


def block(tree: DecisionTree, syntax: Syntax, root: int, *, indent: int) -> list[str]:
    """Return the lines of a block, in which those below it are leaves."""
    lines = nested(tree, syntax, root=root, cut=frozenset(block_roots(tree)))
    return ["    " * (level + indent) + line for level, line in lines]


def called(lines: list[str], functions: Functions) -> list[str]:
    """Return the functions that some lines call."""
    names = {match[2] for line in lines for match in _CALL.finditer(line)}
    return [line for name, body in functions.items() if name in names for line in body]


def operations(
    name: str, number: Callable[[float], str], choice: str, both: str, either: str
) -> dict[str, Callable[..., str]]:
    """Return how each operation is written where functions are called ``NAME_ratio(a, b)``.

    ``number`` writes a number; ``choice`` is between {1}, where {0} holds, and {2}; ``both`` and
    ``either`` are the words for "and" and "or".
    """
    write = {
        "+": "({0} + {1})", "-": "({0} - {1})", "*": "({0} * {1})",
        "/": f"{name}_ratio({{0}}, {{1}})", "negative": "(-{0})", "if": choice,
        "min": f"{name}_least({{0}}, {{1}})", "max": f"{name}_most({{0}}, {{1}})",
        "abs": f"{name}_size({{0}})", "and": f"({{0}} {both} {{1}})",
        "or": f"({{0}} {either} {{1}})",
        **{sign: f"({{0}} {sign} {{1}})" for sign in ("<", "<=", ">", ">=")},
    }  # fmt: skip
    return {"number": number, **{kind: template.format for kind, template in write.items()}}


def functions(language: str, name: str) -> Functions:
    """Return the functions of a language, of which each has a file; ``name`` begins their names.

    In C each has one exit, and no product is fused.
    """
    text = template(f"operations.{language}.txt")
    before, bound = _WRITTEN[language]
    found = {}
    for part in _BETWEEN.split(text.rstrip("\n")):
        operation = part.partition("NAME_")[2].partition("(")[0].split()[0]
        lines = part.replace("BOUND", bound).replace("NAME", name).split("\n")
        found[operation] = [*before, *(line or "    " for line in lines)]
    return found


def filled(name: str, /, **values: object) -> list[str]:
    """Return the lines of a template, ``$name`` and the like filled in; lists line by line."""
    fields = {
        field: "\n".join(value) if isinstance(value, list) else value
        for field, value in values.items()
    }
    return Template(template(f"{name}.txt")).substitute(fields).removesuffix("\n").split("\n")
