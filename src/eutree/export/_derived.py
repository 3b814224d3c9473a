"""Derived features in exported code: the same doubles as the policy computes, in each language.

Every operation that a compiler could fuse, reorder or define otherwise is a function of its own.
"""

import re
from collections.abc import Mapping

from eutree.errors import InvalidArgumentError
from eutree.export._c_numbers import hexadecimal
from eutree.formulas import LARGEST_RATIO
from eutree.policies import TreePolicy
from eutree.trees.text import derived_features

Functions = Mapping[str, list[str]]  # of each operation that needs one: the lines of its function
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


def c_functions(name: str) -> Functions:
    """Return the functions in C, each with one exit; no compiler fuses a stored product."""
    bound = hexadecimal(LARGEST_RATIO)

    def function(
        operation: str, body: list[str], arguments: str = "double a, double b"
    ) -> list[str]:
        title = f"static double {name}_{operation}({arguments})"
        return ["", title, "{", *(f"    {line}" for line in body), "}"]

    return {
        "times": function("times", ["volatile double product = a * b;", "", "return product;"]),
        "ratio": function(
            "ratio",
            [
                "double quotient = a;",
                "",
                "if (b != 0.0) {",
                "    quotient = a / b;",
                "} else if (a > 0.0) {",
                f"    quotient = {bound};",
                "} else if (a < 0.0) {",
                f"    quotient = -{bound};",
                "} else {",
                "    /* 0 / 0 is 0 */",
                "}",
                f"if (quotient > {bound}) {{",
                f"    quotient = {bound};",
                "}",
                f"if (quotient < -{bound}) {{",
                f"    quotient = -{bound};",
                "}",
                "return quotient;",
            ],
        ),
        "least": function("least", ["return (b < a) ? b : a;"]),
        "most": function("most", ["return (b > a) ? b : a;"]),
        "size": function("size", ["return (a < 0.0) ? -a : a;"], "double a"),
    }


def python_functions(name: str) -> Functions:
    """Return the functions in Python."""
    bound = repr(LARGEST_RATIO)
    bodies = {
        "ratio(a, b)": [
            "if b == 0.0:",
            f"    return {bound} if a > 0.0 else -{bound} if a < 0.0 else a",
            "quotient = a / b",
            f"quotient = {bound} if quotient > {bound} else quotient",
            f"return -{bound} if quotient < -{bound} else quotient",
        ],
        "least(a, b)": ["return b if b < a else a"],
        "most(a, b)": ["return b if b > a else a"],
        "size(a)": ["return -a if a < 0.0 else a"],
    }
    return {
        title.partition("(")[0]: ["", "", f"def {name}_{title}:", *(f"    {line}" for line in body)]
        for title, body in bodies.items()
    }


def structured_text_functions(name: str) -> Functions:
    """Return the functions in structured text."""
    bound = f"{LARGEST_RATIO:.1f}"

    def function(operation: str, body: list[str], inputs: str = "a, b : LREAL;") -> list[str]:
        title = f"{name}_{operation}"
        lines = (line.replace("RESULT", title) for line in body)
        head = [f"FUNCTION {title} : LREAL", "VAR_INPUT", f"    {inputs}", "END_VAR"]
        return [*head, *lines, "END_FUNCTION"]

    def chosen(test: str) -> list[str]:
        return ["RESULT := a;", f"IF {test} THEN", "    RESULT := b;", "END_IF;"]

    return {
        "ratio": function(
            "ratio",
            [
                "RESULT := a;",
                "IF b <> 0.0 THEN",
                "    RESULT := a / b;",
                "ELSIF a > 0.0 THEN",
                f"    RESULT := {bound};",
                "ELSIF a < 0.0 THEN",
                f"    RESULT := -{bound};",
                "END_IF;",
                f"IF RESULT > {bound} THEN",
                f"    RESULT := {bound};",
                f"ELSIF RESULT < -{bound} THEN",
                f"    RESULT := -{bound};",
                "END_IF;",
            ],
        ),
        "least": function("least", chosen("b < a")),
        "most": function("most", chosen("b > a")),
        "size": function(
            "size",
            ["RESULT := a;", "IF a < 0.0 THEN", "    RESULT := -a;", "END_IF;"],
            "a : LREAL;",
        ),
    }
