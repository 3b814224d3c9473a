"""Structured Text (IEC 61131-3) for programmable logic controllers."""

from eutree.export._blocks import block_roots, control_identifiers
from eutree.export._identifiers import STRUCTURED_TEXT_WORDS, check_identifier, identifiers
from eutree.policies import TreePolicy
from eutree.trees.text import Syntax, condition, labelled, nested, printable
from eutree.wording import counted


def to_structured_text(policy: TreePolicy, *, name: str = "decide") -> str:
    """Return a FUNCTION that takes the features and returns the action's index.

    Thresholds are LREAL constants with as many digits as it takes to read the same double back.
    Tests are ``x <= threshold``: where the controller compares NaN as IEEE 754 says, NaN fails
    every test and takes the ELSE branch, as in the tree. Where actions set quantities there is a
    FUNCTION for each, ``NAME_CONTROL``, which returns an LREAL.

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
    return "\n".join([*lines, *_values(policy, name, inputs)]) + "\n"


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
        feature, threshold = int(tree.feature[node]), float(tree.threshold[node])
        remark = ""
        if schema.features[feature].is_integer:
            remark = f" (* {condition(schema, feature, threshold)} *)"
        return f"IF {inputs[feature]} <= {literal(threshold)} THEN{remark}"

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
    body = nested(tree, syntax, root=root, cut=cut)
    lines = ["    " * level + line for level, line in body]
    return [f"FUNCTION {title} : INT", *_inputs(policy, inputs), *lines, "END_FUNCTION"]


def _inputs(policy: TreePolicy, inputs: list[str]) -> list[str]:
    """Return the declaration of the features."""
    variables = [
        f"    {variable} : LREAL; (* {labelled(feature)} *)"
        for variable, feature in zip(inputs, policy.schema.features, strict=True)
    ]
    return ["VAR_INPUT", *variables, "END_VAR"]


def _values(policy: TreePolicy, name: str, inputs: list[str]) -> list[str]:
    """Return the FUNCTION of each control."""
    schema = policy.schema
    blocks = {f"block{root}" for root in block_roots(policy.tree)}
    names = control_identifiers(schema, reserved=frozenset(blocks))
    # A FUNCTION and a variable in it must not have the same name.
    taken = {variable.casefold() for variable in inputs}
    lines: list[str] = []
    for number, (own, control) in enumerate(zip(names, schema.controls, strict=True)):
        title = f"{name}_{own}"
        while title.casefold() in taken:
            title += "1"
        lines += [
            f"FUNCTION {title} : LREAL (* {printable(control.label)} *)",
            *_inputs(policy, inputs),
            f"CASE {name}({', '.join(inputs)}) OF",
            *(
                f"    {index}: {title} := {literal(levels[number])};"
                for index, levels in enumerate(schema.action_values)
            ),
            "END_CASE;",
            "END_FUNCTION",
        ]
    return lines
