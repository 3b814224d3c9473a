"""A Python module that decides like the tree and imports nothing."""

from eutree.export import _code as code
from eutree.policies import TreePolicy
from eutree.trees import text

# An array of single precision or of whole numbers would round thresholds to its own numbers.
_DOUBLES = "observation = [float(value) for value in observation]"


def to_python(policy: TreePolicy, *, name: str = "decide") -> str:
    """Return a Python module with one function: an observation in, the action's index out.

    Where actions set quantities there is a function for each, ``NAME_CONTROL(observation)``, and
    ``VALUES``, the numbers that every action sets. Derived features are computed of those measured,
    which alone are handed in; where one is of a last value the function is to be called once a
    step, with ``NAME_reset()`` before each episode, and the numbers of an action are in ``VALUES``
    alone. Where actions may be masked, ``NAME_allowed(observation, allowed)`` takes the first one
    that is allowed in the order of the leaf, ``ORDERS``.

    Args:
        policy: Policy to export.
        name: Name of the function.
    """
    code.check_identifier("name", name, reserved=code.PYTHON_WORDS)
    schema, measured = policy.schema, policy.schema.measured
    lines = [
        f"# {policy.n_leaves} rules for {measured.n_features} features"
        + (f", for {text.printable(policy.environment.id)}." if policy.environment else "."),
        "# Thresholds are exact; NaN fails every test and so takes the last branch.",
        "",
        *(f"# {line}" for line in text.definitions(policy.tree, schema)),
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
    for root in code.block_roots(policy.tree):
        lines += ["", "", *_function(policy, tree_name, root)]
    if code.exported_features(policy):
        lines += _entry(policy, tree_name, reset=f"{name}_reset")
    if policy.masked:
        lines += code.filled("python_masked", name=name)
    return "\n".join([*lines, *_values(policy, name)]) + "\n"


def _table(title: str, names: list[str]) -> list[str]:
    return [f"{title} = (", *(f"    {name!a}," for name in names), ")"]


def _function(policy: TreePolicy, name: str, root: int) -> list[str]:
    tree, schema = policy.tree, policy.schema

    def test(node: int) -> str:
        number, feature, threshold = test = text.asked(schema, tree, node)
        words = test.condition() if feature.is_integer else text.labelled(feature)
        return f"observation[{number}] <= {threshold!r}:  # {words}"

    def leaf(node: int) -> str:
        if tree.leaf[node] == tree.NO_LEAF:
            return f"return _{name}_{node}(observation)"
        leaf = int(tree.leaf[node])
        action = int(policy.actions[leaf])
        words = text.printable(schema.actions[action])
        return f"return {leaf if policy.masked else action}  # {words}"

    syntax = text.Syntax(
        opening=lambda node: f"if {test(node)}",
        chained=lambda node: f"elif {test(node)}",
        otherwise="else:",
        closing="",
        leaf=leaf,
    )
    is_entry = root == 0 and not text.derived_features(tree, schema)
    heading = [f"def {name if is_entry else f'_{name}_{root}'}(observation):"]
    if is_entry:
        words = "the features in order, newest first" if policy.history else "the features in order"
        result = "number of the leaf" if policy.masked else "index of the action"
        heading.append(f'    """Return the {result}; observation: {words}."""')
        heading += [f"    {_DOUBLES}"] if policy.n_leaves > 1 else []
    return heading + code.block(tree, syntax, root, indent=1)


def _entry(policy: TreePolicy, name: str, *, reset: str) -> list[str]:
    """Return the function that computes the derived features, with those that it needs."""
    operators = code.operations(f"_{name}", repr, "({1} if {0} else {2})", "and", "or")
    names = [f"features[{j}]" for j in range(policy.schema.n_features)]
    computed = [
        f"    features[{j}] = {formula}  # {text.labelled(policy.schema.features[j])}"
        for j, formula in code.formulas(policy, operators, names, "last[{}]".format)
    ]
    return code.called(computed, code.functions("python", f"_{name}")) + code.filled(
        "python_remembers" if code.remembered_features(policy) else "python_derives",
        name=name,
        reset=reset,
        measured=policy.derivation.n_measured,
        derived=len(policy.derivation.formulas),
        doubles=_DOUBLES,
        computed=computed,
    )


def _values(policy: TreePolicy, name: str) -> list[str]:
    """Return a function for each control; where a step may be taken once only, none."""
    lines: list[str] = []
    if code.remembered_features(policy):
        return lines
    names = code.control_identifiers(policy.schema, reserved=frozenset({"allowed"}))
    for number, (control, label) in enumerate(zip(names, policy.schema.controls, strict=True)):
        lines += [
            "",
            "",
            f"def {name}_{control}(observation):",
            f"    return VALUES[{name}(observation)][{number}]  # {text.printable(label.label)}",
        ]
    return lines
