"""Derived features in exported code: the same doubles as the policy computes, in each language.

Every operation that a compiler could fuse, reorder or define otherwise is a function of its own.
"""

import re
from collections.abc import Mapping
from importlib import resources

from eutree.errors import InvalidArgumentError
from eutree.export._c_numbers import hexadecimal
from eutree.formulas import LARGEST_RATIO
from eutree.policies import TreePolicy
from eutree.trees.text import derived_features

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
    found = derived_features(policy.tree, policy.schema)
    if found and not policy.features.is_identity:
        raise InvalidArgumentError(
            "a policy with derived features must have no history to be exported as code: declare "
            "what it remembers, before = last(level)"
        )
    return found


def remembered_features(policy: TreePolicy) -> list[int]:
    """Return the features whose last values exported code has to keep."""
    first, formulas = policy.derivation.n_measured, policy.derivation.formulas
    parts = (part for j in exported_features(policy) for part in formulas[j - first])
    return sorted({part.index for part in parts if part.kind == "last"})


def called(lines: list[str], functions: Functions) -> list[str]:
    """Return the functions that some lines call."""
    names = {match[2] for line in lines for match in _CALL.finditer(line)}
    return [line for name, body in functions.items() if name in names for line in body]


def operations(name: str, choice: str, both: str, either: str) -> dict[str, str]:
    """Return how each operation is written where functions are called ``NAME_ratio(a, b)``.

    Args:
        name: What the functions' names begin with.
        choice: The choice between {1}, where {0} holds, and {2}.
        both: The word for "and".
        either: The word for "or".
    """
    return {
        "+": "({0} + {1})", "-": "({0} - {1})", "*": "({0} * {1})",
        "/": f"{name}_ratio({{0}}, {{1}})", "negative": "(-{0})", "if": choice,
        "min": f"{name}_least({{0}}, {{1}})", "max": f"{name}_most({{0}}, {{1}})",
        "abs": f"{name}_size({{0}})", "and": f"({{0}} {both} {{1}})",
        "or": f"({{0}} {either} {{1}})",
        **{sign: f"({{0}} {sign} {{1}})" for sign in ("<", "<=", ">", ">=")},
    }  # fmt: skip


def functions(language: str, name: str) -> Functions:
    """Return the functions of a language, each with one exit in C, where no product is fused.

    Args:
        language: ``"c"``, ``"python"`` or ``"structured_text"``, of which each has a file.
        name: What their names begin with.
    """
    text = (resources.files(__package__) / f"operations.{language}.txt").read_text(encoding="utf-8")
    before, bound = _WRITTEN[language]
    found = {}
    for part in _BETWEEN.split(text.rstrip("\n")):
        operation = part.partition("NAME_")[2].partition("(")[0].split()[0]
        lines = part.replace("BOUND", bound).replace("NAME", name).split("\n")
        found[operation] = [*before, *(line or "    " for line in lines)]
    return found
