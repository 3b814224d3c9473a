"""Structured Text (IEC 61131-3) for programmable logic controllers."""

from eutree.display import counted
from eutree.export import _code as code
from eutree.policies import TreePolicy
from eutree.trees import text

_OWN = frozenset({"action_index", "restart", "goes_on"})  # variables of a FUNCTION_BLOCK


def to_structured_text(policy: TreePolicy, *, name: str = "decide") -> str:
    """Return a FUNCTION that takes the features and returns the action's index.

    Thresholds are LREAL constants with as many digits as it takes to read the same double back.
    Tests are ``x <= threshold``: where the controller compares NaN as IEEE 754 says, NaN fails
    every test and takes the ELSE branch, as in the tree. Where actions set quantities there is a
    FUNCTION for each, ``NAME_CONTROL``, which returns an LREAL. Derived features are computed of
    those measured, which alone are inputs. Where one is of a last value, ``NAME`` is a
    FUNCTION_BLOCK with an output ``action_index``, to be called once a step, and an input
    ``restart`` that begins an episode; the functions of the controls then take that index.

    Args:
        policy: Policy to export.
        name: Name of the function.
    """
    code.check_identifier("name", name, reserved=code.STRUCTURED_TEXT_WORDS, single=True)
    schema = policy.schema
    computed = code.exported_features(policy)
    parts = {f"block{root}" for root in code.block_roots(policy.tree)}
    parts |= {"tree", *code.functions("structured_text", name)}  # behind ``NAME_``
    ours = {name, *(f"{name}_{part}" for part in parts)}
    reserved = code.STRUCTURED_TEXT_WORDS | ours | (_OWN if computed else set())
    inputs = code.identifiers(schema.feature_names, reserved=reserved)
    remembered = code.remembered_features(policy)
    kept = code.identifiers(
        [f"last {inputs[j]}" for j in remembered], reserved={*reserved, *inputs}
    )
    measured = inputs[: policy.derivation.n_measured] if schema.derived else inputs
    lines = [
        f"(* A decision tree with {counted(policy.n_leaves, 'leaf')}"
        + (f" for {text.printable(policy.environment.id)}" if policy.environment else "")
        + "; returns the index of the action:",
        *(f"   {index} {text.printable(action)}" for index, action in enumerate(schema.actions)),
        *(f"   {line}" for line in text.definitions(policy.tree, schema)),
        *([f"   {code.ASSUMPTION}"] if policy.masked else []),
        "*)",
    ]
    for root in code.block_roots(policy.tree):
        lines += _function(policy, name, inputs if computed else measured, root)
    if computed:
        lines += _entry(policy, name, inputs, dict(zip(remembered, kept, strict=True)))
    # A FUNCTION and a variable must not have the same name.
    taken = parts | code.behind(name, [*inputs, *kept, *_OWN, *code.STRUCTURED_TEXT_WORDS])
    return "\n".join([*lines, *_values(policy, name, measured, taken)]) + "\n"


def literal(value: float) -> str:
    """Return a finite double as an LREAL constant that reads back as the same double."""
    digits, _, exponent = repr(value).partition("e")
    mantissa = digits if "." in digits else f"{digits}.0"
    return f"{mantissa}E{int(exponent)}" if exponent else mantissa


def _function(policy: TreePolicy, name: str, inputs: list[str], root: int) -> list[str]:
    tree, schema = policy.tree, policy.schema
    title = name if root == 0 else f"{name}_block{root}"
    if root == 0 and text.derived_features(tree, schema):
        title = f"{name}_tree"

    def test(node: int) -> str:
        test = text.asked(schema, tree, node)
        remark = f" (* {test.condition()} *)" if test.feature.is_integer else ""
        return f"IF {inputs[test.number]} <= {literal(test.threshold)} THEN{remark}"

    def leaf(node: int) -> str:
        if tree.leaf[node] == tree.NO_LEAF:
            return f"{title} := {name}_block{node}({', '.join(inputs)});"
        action = int(policy.actions[tree.leaf[node]])
        return f"{title} := {action}; (* {text.printable(schema.actions[action])} *)"

    syntax = text.Syntax(
        opening=test,
        chained=lambda node: f"ELS{test(node)}",
        otherwise="ELSE",
        closing="END_IF;",
        leaf=leaf,
    )
    lines = code.block(tree, syntax, root, indent=0)
    return [f"FUNCTION {title} : INT", *_inputs(policy, inputs), *lines, "END_FUNCTION"]


def _inputs(policy: TreePolicy, inputs: list[str]) -> list[str]:
    variables = [
        f"    {variable} : LREAL; (* {text.labelled(feature)}{text.meaning(feature)} *)"
        for variable, feature in zip(inputs, policy.schema.features, strict=False)
    ]
    return ["VAR_INPUT", *variables, "END_VAR"]


def _entry(policy: TreePolicy, name: str, inputs: list[str], last: dict[int, str]) -> list[str]:
    """Return the FUNCTION, or FUNCTION_BLOCK, that computes the derived features.

    ``last`` is what keeps the last value of each feature that is remembered.
    """
    first, computed = policy.derivation.n_measured, code.exported_features(policy)
    operators = code.operations(name, literal, "SEL({0}, {2}, {1})", "AND", "OR")

    def begin(j: int) -> list[str]:
        keep = f"    {last.get(j)} := {inputs[j]};"
        return ["IF NOT goes_on THEN", keep, "END_IF;"] if j in last else []

    body = [line for j in range(first) for line in begin(j)]
    for j, formula in code.formulas(policy, operators, inputs, last.__getitem__):
        body += [f"{inputs[j]} := {formula};", *begin(j)]
    taken = [one if j < first or j in computed else "0.0" for j, one in enumerate(inputs)]
    own = [
        f"    {inputs[j]} : LREAL; (* {text.labelled(policy.schema.features[j])} *)"
        for j in computed
    ]
    own += [f"    {variable} : LREAL; (* at the step before *)" for variable in last.values()]
    body += [f"{variable} := {inputs[j]};" for j, variable in last.items()]
    return code.called(body, code.functions("structured_text", name)) + code.filled(
        "structured_text_remembers" if last else "structured_text_derives",
        name=name,
        inputs=_inputs(policy, inputs[:first])[1:-1],
        own=own,
        computed=body,
        arguments=", ".join(taken),
    )


def _values(policy: TreePolicy, name: str, inputs: list[str], taken: set[str]) -> list[str]:
    """Return a FUNCTION for each control, called none of what is ``taken`` behind ``NAME_``."""
    schema = policy.schema
    names = code.control_identifiers(schema, reserved=taken)
    lines: list[str] = []
    for number, (own, control) in enumerate(zip(names, schema.controls, strict=True)):
        title = f"{name}_{own}"
        taking, chosen = _inputs(policy, inputs), f"{name}({', '.join(inputs)})"
        if code.remembered_features(policy):
            taking, chosen = ["VAR_INPUT", "    action_index : INT;", "END_VAR"], "action_index"
        lines += [
            f"FUNCTION {title} : LREAL (* {text.printable(control.label)} *)",
            *taking,
            f"CASE {chosen} OF",
            *(
                f"    {index}: {title} := {literal(levels[number])};"
                for index, levels in enumerate(schema.action_values)
            ),
            "END_CASE;",
            "END_FUNCTION",
        ]
    return lines
