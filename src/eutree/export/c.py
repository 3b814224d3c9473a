"""C99 for microcontrollers: no heap, no library calls, no recursion, one exit per function.

A policy becomes up to three files: the source with the entry point ``int NAME(const double
*observation)``, a header with the names of the actions, and a program that tests the source on
every threshold. Where actions set quantities there is a function for each, ``double
NAME_CONTROL(const double *observation)``, and a table of the numbers that every action sets. Where
actions may be masked, ``int NAME_allowed(const double *observation, const unsigned char *allowed)``
takes the first one that is allowed in the order of the leaf.

Derived features are computed in doubles of the measured ones, which alone are handed in. Of a last
value the source keeps a static copy: ``NAME_reset()`` begins an episode, and the entry point is to
be called once a step; the numbers of the action are then in the table alone.
"""

import math
import re

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.display import counted
from eutree.export import _code as code
from eutree.export._c_numbers import Number, Numbers, Scale, hexadecimal, in_integers, numbers
from eutree.policies import TreePolicy
from eutree.trees import DecisionTree, text
from eutree.trees.boxes import node_boxes
from eutree.validation import check_integer, check_seed

_SAFE = re.compile(r"[A-Za-z0-9 _.,:;()\[\]{}<>=+*/%&|^~!#'@$-]")
_NO_FAST_MATH = [
    "#if defined(__FINITE_MATH_ONLY__) && (__FINITE_MATH_ONLY__ > 0)",
    '#error "NaN must fail every test: compile without -ffast-math and -ffinite-math-only"',
    "#endif",
]
_DOUBLES = [  # sums on the x87 keep 80 bits, which stored once more are rounded twice
    "#include <float.h>",
    "#if (defined(FLT_EVAL_METHOD) && ((FLT_EVAL_METHOD < 0) || (FLT_EVAL_METHOD == 2))) \\",
    "    || (defined(__FLT_EVAL_METHOD__) "  # the compiler's own, before C99
    "&& ((__FLT_EVAL_METHOD__ < 0) || (__FLT_EVAL_METHOD__ == 2)))",
    '#error "doubles must be computed as doubles: compile for SSE2, not for the x87"',
    "#endif",
]


def to_c(
    policy: TreePolicy,
    *,
    name: str = "decide",
    number: Number = "double",
    scale: Scale = None,
    header: bool = False,
) -> str:
    """Return C99 source that decides exactly like the policy.

    Args:
        policy: Policy to export.
        name: Name of the entry point.
        number: Type of the observation's entries. "float" and "int32" round the thresholds so
            that the decisions agree on every number which that type can represent.
        scale: For "int32": integers per unit, one number for all features or one for each name;
            if left out, the largest power of two that fits the feature's bounds.
        header: Whether to include ``NAME.h`` (see ``to_c_header``) rather than repeat it.
    """
    code.check_identifier("name", name, reserved=code.C_WORDS)
    kind = numbers(policy, number, scale)
    declarations = [f'#include "{name}.h"'] if header else _declarations(policy, name, kind)
    computed = code.exported_features(policy)
    guard = [] if number == "int32" and not computed else ["", *_NO_FAST_MATH]
    guard += ["", *_DOUBLES] if computed else []
    lines = [*_heading(policy, kind), *declarations, *guard]
    table = [f"    {_string(action)}" for action in policy.schema.actions]
    size = f"{policy.schema.n_actions}"
    lines += ["", f"const char *const {name}_actions[{size}] = {{", ",\n".join(table), "};"]
    shown, orders = policy, policy.orders
    if number == "int32" and not computed:
        shown, kept = in_integers(policy, kind.scales)
        orders = orders[kept]
    of_tree = Numbers("double") if computed else kind
    for root in code.block_roots(shown.tree):
        lines += ["", *_function(shown, name, of_tree, root)]
    if computed:
        lines += _entry(policy, name, kind)
    lines += [*_masked(policy, orders, name, kind), *_values(policy, name, kind)]
    return "\n".join(lines) + "\n"


def to_c_header(
    policy: TreePolicy, *, name: str = "decide", number: Number = "double", scale: Scale = None
) -> str:
    """Return the header ``NAME.h``: the entry point, an enumeration of the actions, their names."""
    code.check_identifier("name", name, reserved=code.C_WORDS)
    kind = numbers(policy, number, scale)
    declarations = _declarations(policy, name, kind, for_cpp=True)
    heading, guard = _heading(policy, kind), f"{name.upper()}_H"
    lines = code.filled("c_header", heading=heading, guard=guard, declarations=declarations)
    return "\n".join(lines) + "\n"


def function_name(stem: str) -> str:
    """Return the name of an entry point for a file of that name, without its suffix."""
    return code.identifiers([stem], reserved=code.C_WORDS, prefix="decide")[0]


def _heading(policy: TreePolicy, kind: Numbers) -> list[str]:
    """Return the comment at the top: inputs, outputs, and conditions."""
    made_for = f" for {text.printable(policy.environment.id)}" if policy.environment else ""
    title = f"A decision tree with {counted(policy.n_leaves, 'leaf')}{made_for}."
    lines = [title, "", "Observation:"]
    for index, feature in enumerate(policy.schema.measured.features):
        bounds = f", {feature.low!r} to {feature.high!r}"
        scale = f", times {kind.scales[index]!r}, as an integer" if kind.scales else ""
        lines.append(f"  [{index}] {text.labelled(feature)}{bounds}{scale}{text.meaning(feature)}")
    lines += [f"  {line}" for line in text.definitions(policy.tree, policy.schema)]
    lines += ["", "Action:"]
    lines += [f"  {k} {text.printable(name)}" for k, name in enumerate(policy.schema.actions)]
    if policy.masked:
        lines += [
            "",
            "Where actions are masked ask NAME_allowed, with a 1 for each that is allowed.",
        ]
    if policy.masked and policy.schema.controls:
        lines.append("It is the row of NAME_values then: functions of single values hear no masks.")
    if kind.number == "int32":
        lines += ["", "Saturate what does not fit into 32 bits; do not let it wrap around."]
    else:
        lines += ["", "Every test is x <= threshold, so NaN fails it and takes the else branch."]
    return ["/*", *(f" * {line}".rstrip() for line in lines), " */"]


def _declarations(
    policy: TreePolicy, name: str, kind: Numbers, *, for_cpp: bool = False
) -> list[str]:
    """Return the prototype, the enumeration of the actions and the table of their names."""
    members = [f"    {member} = {index}" for index, member in enumerate(_enumerators(policy, name))]
    lines = ["#include <stdint.h>", ""] if kind.number == "int32" else []
    lines += ["enum {", ",\n".join(members), "};", ""]
    if for_cpp:
        lines += ["#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
    lines += [
        f"extern const char *const {name}_actions[{policy.schema.n_actions}];",
        f"int {name}(const {kind.c_type} *observation);",
    ]
    if code.remembered_features(policy):
        lines.append(f"void {name}_reset(void); /* an episode begins */")
    if policy.masked:
        lines.append(f"{_allowed_title(name, kind)};")
    if policy.schema.controls:
        titles = ", ".join(text.printable(control.label) for control in policy.schema.controls)
        lines += [
            "",
            f"/* What each action sets: {titles}. */",
            f"extern {_table(policy, name, kind)};",
        ]
        lines += [f"{title};" for title in _value_titles(policy, name, kind)]
    if for_cpp:
        lines += ["", "#ifdef __cplusplus", "}", "#endif"]
    return lines


def _enumerators(policy: TreePolicy, name: str) -> list[str]:
    found = code.action_identifiers(policy.schema, reserved={"h", *code.behind(name, code.C_WORDS)})
    return [f"{name}_{action}".upper() for action in found]


def _function(policy: TreePolicy, name: str, kind: Numbers, root: int) -> list[str]:
    tree, constants = policy.tree, _enumerators(policy, name)

    def test(node: int) -> str:
        remark = ""
        if kind.number != "int32":
            remark = f" /* {text.asked(policy.schema, tree, node).condition()} */"
        return f"if ({kind.test(tree, node)}) {{{remark}"

    def leaf(node: int) -> str:
        if tree.leaf[node] == tree.NO_LEAF:
            return f"action = {name}_block_{node}(observation);"
        if policy.masked:
            return f"action = {tree.leaf[node]};"
        return f"action = {constants[policy.actions[tree.leaf[node]]]};"

    syntax = text.Syntax(
        opening=test,
        chained=lambda node: f"}} else {test(node)}",
        otherwise="} else {",
        closing="}",
        leaf=leaf,
    )
    title = f"int {name}" if root == 0 else f"static int {name}_block_{root}"
    if root == 0 and text.derived_features(tree, policy.schema):
        title = f"static int {name}_tree"
    elif policy.masked and root == 0:
        title = f"static int {name}_leaf"
    return [
        f"{title}(const {kind.c_type} *observation)",
        "{",
        "    int action;",
        "",
        *(["    (void)observation;"] if policy.n_leaves == 1 else []),
        *code.block(tree, syntax, root, indent=1),
        "    return action;",
        "}",
    ]


def _entry(policy: TreePolicy, name: str, kind: Numbers) -> list[str]:
    """Return the entry point that computes the derived features, with the functions it needs."""
    first, remembered = policy.derivation.n_measured, code.remembered_features(policy)
    operators = code.operations(name, hexadecimal, "({0} ? {1} : {2})", "&&", "||")
    operators["*"] = f"{name}_times({{0}}, {{1}})".format
    features = policy.schema.features
    names = [f"features[{j}]" for j in range(len(features))]
    lines = [f"    features[{j}] = {kind.measured(j)};" for j in range(first)]
    computed = [
        f"    features[{j}] = {formula}; /* {text.printable(features[j].name)} */"
        for j, formula in code.formulas(policy, operators, names, "last[{}]".format)
    ]
    needed = code.called(computed, code.functions("c", name))
    kept = [f"    {name}_last[{j}] = features[{j}];" for j in remembered]
    entry = f"static int {name}_leaf" if policy.masked else f"int {name}"
    return needed + code.filled(
        "c_remembers" if remembered else "c_derives",
        name=name,
        title=f"{entry}(const {kind.c_type} *observation)",
        size=policy.tree.n_features,
        computed=[*lines, *computed, *kept],
    )


def _allowed_title(name: str, kind: Numbers) -> str:
    return f"int {name}_allowed(const {kind.c_type} *observation, const unsigned char *allowed)"


def _masked(policy: TreePolicy, orders: Integers, name: str, kind: Numbers) -> list[str]:
    """Return the orders of the actions in the leaves, [L, A], and the functions that go by them."""
    if not policy.masked:
        return []
    n_actions = policy.schema.n_actions
    rows = [f"    {{{', '.join(map(str, order))}}}" for order in orders.tolist()]
    return code.filled(
        "c_masked",
        name=name,
        type=kind.c_type,
        title=_allowed_title(name, kind),
        n_leaves=len(orders),
        n_actions=n_actions,
        last=n_actions - 1,
        rows=",\n".join(rows),
    )


def _values(policy: TreePolicy, name: str, kind: Numbers) -> list[str]:
    """Return the table of the numbers that actions set, and a function for each control."""
    schema = policy.schema
    if not schema.controls:
        return []
    last = schema.n_actions - 1
    rows = [
        f"    {{{', '.join(_level(kind, level) for level in levels)}}}{',' * (number < last)}"
        f" /* {text.printable(action)} */"
        for number, (levels, action) in enumerate(
            zip(schema.action_values, schema.actions, strict=True)
        )
    ]
    lines = ["", f"{_table(policy, name, kind)} = {{", *rows, "};"]
    for number, title in enumerate(_value_titles(policy, name, kind)):
        value = f"{name}_values[{name}(observation)][{number}]"
        lines += ["", title, "{", f"    return {value};", "}"]
    return lines


def _table(policy: TreePolicy, name: str, kind: Numbers) -> str:
    schema = policy.schema
    return f"const {_level_type(kind)} {name}_values[{schema.n_actions}][{len(schema.controls)}]"


def _value_titles(policy: TreePolicy, name: str, kind: Numbers) -> list[str]:
    """Return the first line of the function of each control; a step may be taken once only."""
    if code.remembered_features(policy):
        return []
    blocks = {f"block_{root}" for root in code.block_roots(policy.tree)}
    own = {"actions", "values", "h", "test", "tree", "leaf", "orders", "allowed"}
    own |= {member.removeprefix(f"{name}_") for member in _enumerators(policy, name)}
    own |= code.behind(name, code.C_WORDS)
    names = code.control_identifiers(
        policy.schema, reserved=own | blocks | {*code.functions("c", name)}
    )
    argument = f"const {kind.c_type} *observation"
    return [f"{_level_type(kind)} {name}_{control}({argument})" for control in names]


def _level_type(kind: Numbers) -> str:
    """Return the type of a level: observations in integers say nothing of the levels."""
    return "double" if kind.number == "double" else "float"


def _level(kind: Numbers, level: float) -> str:
    if kind.number == "double":
        return hexadecimal(level)
    return f"{hexadecimal(float(np.float32(level)))}F"


def _string(text: str) -> str:
    """Return a string constant that holds ``text`` in UTF-8 under every compiler."""
    units = text.encode("utf-8", "surrogatepass")
    signs = (chr(unit) if _SAFE.fullmatch(chr(unit)) else f"\\{unit:03o}" for unit in units)
    return f'"{"".join(signs)}"'


EXTREMES = (math.nan, math.inf, -math.inf, -0.0, 0.0, 5e-324, -5e-324, 1.8e308 / 2, -1.8e308 / 2)


def probes(tree: DecisionTree, *, n_random: int = 0, seed: int = 0) -> Floats:
    """Return observations, shape [N, d], that exercise every test of ``tree``.

    For each inner node: a point of its box with the tested feature on the threshold, one ulp to
    either side, and on each extreme (NaN, infinities, signed zeros, subnormals, huge numbers).
    """
    rng = np.random.default_rng(seed)
    low, high = node_boxes(tree)
    rows = [np.full(tree.n_features, value) for value in EXTREMES]
    for node in np.flatnonzero(tree.feature != tree.NO_FEATURE):
        threshold = float(tree.threshold[node])
        inside = _inside(low[node], high[node])
        beside = [math.nextafter(threshold, side) for side in (-math.inf, math.inf)]
        for value in (threshold, *beside, *EXTREMES):
            rows.append(inside.copy())
            rows[-1][tree.feature[node]] = value
    finite = tree.threshold[np.isfinite(tree.threshold)]
    spread = (finite.min() - 1.0, finite.max() + 1.0) if finite.size else (-1.0, 1.0)
    middle, half = spread[0] / 2 + spread[1] / 2, spread[1] / 2 - spread[0] / 2
    random = middle + half * rng.uniform(-1.0, 1.0, size=(n_random, tree.n_features))
    return np.concatenate([np.array(rows), random])


def _inside(low: Floats, high: Floats) -> Floats:
    """Return a point of a box, which may be unbounded."""
    with np.errstate(over="ignore"):
        below = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - 2.0, -1.0))
        above = np.where(np.isfinite(high), high, below + 2.0)
        middle = below / 2 + above / 2
    return np.where((middle > below) & (middle <= above), middle, above)


_INT32 = np.iinfo(np.int32)


def to_c_test(
    policy: TreePolicy,
    *,
    name: str = "decide",
    number: Number = "double",
    scale: Scale = None,
    n_random: int = 100,
    seed: int = 0,
) -> str:
    """Return a ``main`` that runs the exported function on the policy's own decisions.

    It includes ``NAME.h``, so compile it with the source and the header. It prints how many
    decisions agree and returns 0 if all of them do.

    Args:
        policy: Policy that the source was made of.
        name: Name of the entry point, as given to ``to_c``.
        number: Type of the observation's entries, as given to ``to_c``.
        scale: Scale of each feature, as given to ``to_c``.
        n_random: Number of random observations besides those on and around the thresholds.
        seed: Seed of the random observations.
    """
    code.check_identifier("name", name, reserved=code.C_WORDS)
    kind = numbers(policy, number, scale)
    n_random = check_integer("n_random", n_random)
    stored = stored_probes(policy, kind, n_random=n_random, seed=check_seed(seed))
    actions = _decided(policy, [meant(kind, row) for row in stored])
    rows = [f"    {{{', '.join(map(kind.constant, row))}}}" for row in stored.tolist()]
    size, width = stored.shape
    lines = code.filled(
        "c_test",
        name=name,
        type=kind.c_type,
        size=size,
        width=width,
        rows=",\n".join(rows),
        actions=_wrapped([str(action) for action in actions]),
    )
    return "\n".join(lines) + "\n"


def _decided(policy: TreePolicy, rows: list[list[float]]) -> list[int]:
    state, actions = None, []
    for row in rows:
        if policy.schema.derived:
            action, state = policy.predict(row, state)
            actions.append(int(action))
        else:
            actions.append(policy.act(row))
    return actions


def stored_probes(policy: TreePolicy, kind: Numbers, *, n_random: int = 0, seed: int = 0) -> Floats:
    """Return observations as the number type stores them, on and around each threshold."""
    exact = probes(policy.tree, n_random=n_random, seed=seed)
    if policy.schema.derived:
        exact = exact[:, : policy.derivation.n_measured]
    if kind.number == "double":
        return exact
    if kind.number == "float":
        with np.errstate(over="ignore"):
            near = exact.astype(np.float32)
            ulps = [np.nextafter(near, np.float32(side)) for side in (-np.inf, np.inf)]
        return np.unique(np.concatenate([near, *ulps]), axis=0).astype(np.float64)
    if policy.schema.derived:
        with np.errstate(over="ignore"):
            exact = exact * np.array(kind.scales)
    else:
        exact = probes(in_integers(policy, kind.scales)[0].tree, n_random=n_random, seed=seed)
    whole = np.nan_to_num(np.rint(exact), nan=0.0, posinf=_INT32.max, neginf=_INT32.min)
    sides = np.concatenate([whole - 1.0, whole, whole + 1.0]).clip(_INT32.min, _INT32.max)
    return np.unique(sides + 0.0, axis=0)


def meant(kind: Numbers, stored: Floats) -> list[float]:
    """Return the observation that stored numbers stand for."""
    return [kind.value(float(value), feature) for feature, value in enumerate(stored)]


def _wrapped(items: list[str], *, per_line: int = 24) -> str:
    """Return the items separated by commas, a fixed number a line."""
    lines = [items[start : start + per_line] for start in range(0, len(items), per_line)]
    return ",\n".join(f"    {', '.join(line)}" for line in lines)
