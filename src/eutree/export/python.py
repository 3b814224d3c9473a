"""A Python module that decides like the tree and imports nothing."""

from eutree.export._code import (
    PYTHON_WORDS,
    block_roots,
    called,
    check_identifier,
    control_identifiers,
    exported_features,
    filled,
    functions,
    operations,
    remembered_features,
)
from eutree.policies import TreePolicy
from eutree.trees.text import (
    Syntax,
    asked,
    definitions,
    derived_features,
    labelled,
    nested,
    printable,
)


def to_python(policy: TreePolicy, *, name: str = "decide") -> str:
    """Return a Python module with one function: an observation in, the action's index out.

    Where actions set quantities there is a function for each, ``NAME_CONTROL(observation)``, and
    ``VALUES``, what every action sets. Derived features are computed of those measured, which alone
    are handed in; where one is of a last value the function is to be called once a step, with
    ``NAME_reset()`` before each episode, and what an action sets is in ``VALUES`` alone. Where
    actions may be masked, ``NAME_allowed(observation, allowed)`` takes the first one that is
    allowed in the order of the leaf, ``ORDERS``.

    Args:
        policy: The policy.
        name: Name of the function.
    """
    check_identifier(
        "name",
        name,
        reserved=PYTHON_WORDS | {"features", "units", "actions", "controls", "values", "orders"},
    )
    schema, measured = policy.schema, policy.schema.measured
    lines = [
        f"# {policy.n_leaves} rules for {measured.n_features} features"
        + (f", for {printable(policy.environment.id)}." if policy.environment else "."),
        "# Thresholds are exact; NaN fails every test and so takes the last branch.",
        "",
        *(f"# {line}" for line in definitions(policy.tree, schema)),
        *_table("FEATURES", [feature.name for feature in measured.features]),
        *_table("UNITS", [feature.unit for feature in measured.features]),
        *_table("ACTIONS", list(schema.actions)),
    ]
    if schema.controls:
        rows = (f"    {levels!r}," for levels in schema.action_values)
        lines += [*_table("CONTROLS", [control.label for control in schema.controls])]
        lines += ["VALUES = (  # of the controls, for each action", *rows, ")"]
    tree_name = f"_{name}_leaf" if policy.masked else name
    if policy.masked:
        orders = (f"    {tuple(order)!r}," for order in policy.orders.tolist())
        lines += ["ORDERS = (  # of the actions, for each leaf", *orders, ")"]
    roots = block_roots(policy.tree)
    for root in roots:
        lines += ["", "", *_function(policy, tree_name, root, frozenset(roots))]
    if exported_features(policy):
        lines += _entry(policy, tree_name, reset=f"{name}_reset")
    if policy.masked:
        lines += filled("python_masked", name=name)
    return "\n".join([*lines, *_values(policy, name)]) + "\n"


def _table(title: str, names: list[str]) -> list[str]:
    """Return a constant tuple of strings."""
    return [f"{title} = (", *(f"    {name!a}," for name in names), ")"]


def _function(policy: TreePolicy, name: str, root: int, cut: frozenset[int]) -> list[str]:
    """Return the function of one block."""
    tree, schema = policy.tree, policy.schema

    def test(node: int) -> str:
        number, feature, threshold = test = asked(schema, tree, node)
        words = test.condition() if feature.is_integer else labelled(feature)
        return f"observation[{number}] <= {threshold!r}:  # {words}"

    def leaf(node: int) -> str:
        if tree.leaf[node] == tree.NO_LEAF:
            return f"return _{name}_{node}(observation)"
        leaf = int(tree.leaf[node])
        action = int(policy.actions[leaf])
        return f"return {leaf if policy.masked else action}  # {printable(schema.actions[action])}"

    syntax = Syntax(
        opening=lambda node: f"if {test(node)}",
        chained=lambda node: f"elif {test(node)}",
        otherwise="else:",
        closing="",
        leaf=leaf,
    )
    is_entry = root == 0 and not derived_features(tree, schema)
    heading = [f"def {name if is_entry else f'_{name}_{root}'}(observation):"]
    if is_entry:
        words = "the features in order, newest first" if policy.history else "the features in order"
        result = "number of the leaf" if policy.masked else "index of the action"
        heading.append(f'    """Return the {result}; observation: {words}."""')
    rules = nested(tree, syntax, root=root, cut=cut)
    return heading + ["    " * (level + 1) + line for level, line in rules]


def _entry(policy: TreePolicy, name: str, *, reset: str) -> list[str]:
    """Return the function that computes the derived features, with those that it needs."""
    first, formulas = policy.derivation.n_measured, policy.derivation.formulas
    operators = operations(f"_{name}", "({1} if {0} else {2})", "and", "or")
    computed = [
        f"    features[{j}] = "
        + formulas[j - first].written(
            operators,
            name=lambda index: f"features[{index}]",
            last=lambda index: f"last[{index}]",
            number=repr,
        )
        + f"  # {labelled(policy.schema.features[j])}"
        for j in exported_features(policy)
    ]
    return called(computed, functions("python", f"_{name}")) + filled(
        "python_remembers" if remembered_features(policy) else "python_derives",
        name=name,
        reset=reset,
        measured=first,
        derived=policy.tree.n_features - first,
        computed=computed,
    )


def _values(policy: TreePolicy, name: str) -> list[str]:
    """Return a function for each control; where a step may be taken once only, none."""
    lines: list[str] = []
    if remembered_features(policy):
        return lines
    names = control_identifiers(policy.schema, reserved=frozenset({"allowed"}))
    for number, (control, label) in enumerate(zip(names, policy.schema.controls, strict=True)):
        lines += [
            "",
            "",
            f"def {name}_{control}(observation):",
            f"    return VALUES[{name}(observation)][{number}]  # {printable(label.label)}",
        ]
    return lines
