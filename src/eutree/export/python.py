"""A Python module that decides like the tree and imports nothing."""

from eutree.export._blocks import block_roots, control_identifiers
from eutree.export._identifiers import PYTHON_WORDS, check_identifier
from eutree.policies import TreePolicy
from eutree.trees.text import Syntax, condition, labelled, nested, printable


def to_python(policy: TreePolicy, *, name: str = "decide") -> str:
    """Return a Python module with one function: an observation in, the action's index out.

    Where actions set quantities there is a function for each, ``NAME_CONTROL(observation)``, and
    ``VALUES``, what every action sets.

    Args:
        policy: The policy.
        name: Name of the function.
    """
    check_identifier(
        "name", name, reserved=PYTHON_WORDS | {"features", "units", "actions", "controls", "values"}
    )
    schema = policy.schema
    lines = [
        f"# {policy.n_leaves} rules for {schema.n_features} features"
        + (f", for {printable(policy.environment.id)}." if policy.environment else "."),
        "# Thresholds are exact; NaN fails every test and so takes the last branch.",
        "",
        *_table("FEATURES", [feature.name for feature in schema.features]),
        *_table("UNITS", [feature.unit for feature in schema.features]),
        *_table("ACTIONS", list(schema.actions)),
    ]
    if schema.controls:
        rows = (f"    {levels!r}," for levels in schema.action_values)
        lines += [*_table("CONTROLS", [control.label for control in schema.controls])]
        lines += ["VALUES = (  # of the controls, for each action", *rows, ")"]
    roots = block_roots(policy.tree)
    for root in roots:
        lines += ["", "", *_function(policy, name, root, frozenset(roots))]
    return "\n".join([*lines, *_values(policy, name)]) + "\n"


def _table(title: str, names: list[str]) -> list[str]:
    """Return a constant tuple of strings."""
    return [f"{title} = (", *(f"    {name!a}," for name in names), ")"]


def _function(policy: TreePolicy, name: str, root: int, cut: frozenset[int]) -> list[str]:
    """Return the function of one block."""
    tree, schema = policy.tree, policy.schema

    def test(node: int) -> str:
        feature, threshold = int(tree.feature[node]), float(tree.threshold[node])
        one = schema.features[feature]
        words = condition(schema, feature, threshold) if one.is_integer else labelled(one)
        return f"observation[{feature}] <= {threshold!r}:  # {words}"

    def leaf(node: int) -> str:
        if tree.leaf[node] == tree.NO_LEAF:
            return f"return _{name}_{node}(observation)"
        action = int(policy.actions[tree.leaf[node]])
        return f"return {action}  # {printable(schema.actions[action])}"

    syntax = Syntax(
        opening=lambda node: f"if {test(node)}",
        chained=lambda node: f"elif {test(node)}",
        otherwise="else:",
        closing="",
        leaf=leaf,
    )
    heading = [f"def {name if root == 0 else f'_{name}_{root}'}(observation):"]
    if root == 0:
        words = "the features in order, newest first" if policy.history else "the features in order"
        heading.append(f'    """Return the index of the action; observation: {words}."""')
    rules = nested(tree, syntax, root=root, cut=cut)
    return heading + ["    " * (level + 1) + line for level, line in rules]


def _values(policy: TreePolicy, name: str) -> list[str]:
    """Return a function for each control."""
    lines: list[str] = []
    names = control_identifiers(policy.schema, reserved=frozenset())
    for number, (control, label) in enumerate(zip(names, policy.schema.controls, strict=True)):
        lines += [
            "",
            "",
            f"def {name}_{control}(observation):",
            f"    return VALUES[{name}(observation)][{number}]  # {printable(label.label)}",
        ]
    return lines
