"""Structured Text (IEC 61131-3) for programmable logic controllers."""

from eutree.export._blocks import block_roots
from eutree.export._identifiers import STRUCTURED_TEXT_WORDS, check_identifier, identifiers
from eutree.policies import TreePolicy
from eutree.trees.text import Syntax, labelled, nested, printable
from eutree.wording import counted


def to_structured_text(policy: TreePolicy, *, name: str = "decide") -> str:
    """Return a FUNCTION that takes the features and returns the action's index.

    Thresholds are LREAL constants with as many digits as it takes to read the same double back.
    Tests are ``x <= threshold``: where the controller compares NaN as IEEE 754 says, NaN fails
    every test and takes the ELSE branch, as in the tree.

    Args:
        policy: The policy.
        name: Name of the function.
    """
    check_identifier("name", name, reserved=STRUCTURED_TEXT_WORDS)
    schema = policy.schema
    reserved = STRUCTURED_TEXT_WORDS | {name.casefold()}
    inputs = identifiers(schema.feature_names, reserved=reserved)
    lines = [
        f"(* A decision tree with {counted(policy.n_leaves, 'leaf')}"
        + (f" for {printable(policy.environment.id)}" if policy.environment else "")
        + "; returns the index of the action:",
        *(f"   {index} {printable(action)}" for index, action in enumerate(schema.actions)),
        "*)",
    ]
    roots = block_roots(policy.tree)
    for root in roots:
        lines += _function(policy, name, inputs, root, frozenset(roots))
    return "\n".join(lines) + "\n"


def literal(value: float) -> str:
    """Return a finite double as an LREAL constant that reads back as the same double."""
    digits, _, exponent = repr(value).partition("e")
    mantissa = digits if "." in digits else f"{digits}.0"
    return f"{mantissa}E{int(exponent)}" if exponent else mantissa


def _function(
    policy: TreePolicy, name: str, inputs: list[str], root: int, cut: frozenset[int]
) -> list[str]:
    """Return the FUNCTION of one block of the tree."""
    tree, schema = policy.tree, policy.schema
    title = name if root == 0 else f"{name}_block{root}"

    def test(node: int) -> str:
        threshold = literal(float(tree.threshold[node]))
        return f"IF {inputs[tree.feature[node]]} <= {threshold} THEN"

    def leaf(node: int) -> str:
        if tree.leaf[node] == tree.NO_LEAF:
            return f"{title} := {name}_block{node}({', '.join(inputs)});"
        action = int(policy.actions[tree.leaf[node]])
        return f"{title} := {action}; (* {printable(schema.actions[action])} *)"

    syntax = Syntax(
        opening=test,
        chained=lambda node: f"ELS{test(node)}",
        otherwise="ELSE",
        closing="END_IF;",
        leaf=leaf,
    )
    variables = [
        f"    {variable} : LREAL; (* {labelled(feature)} *)"
        for variable, feature in zip(inputs, schema.features, strict=True)
    ]
    body = nested(tree, syntax, root=root, cut=cut)
    return [
        f"FUNCTION {title} : INT",
        "VAR_INPUT",
        *variables,
        "END_VAR",
        *("    " * level + line for level, line in body),
        "END_FUNCTION",
    ]
