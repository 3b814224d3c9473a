"""Exported code computes derived features to the last bit, and remembers what it has to."""

import ctypes
import platform
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from eutree.errors import InvalidArgumentError
from eutree.export import to_c, to_c_header, to_c_test, to_python, to_structured_text
from eutree.export._c_numbers import numbers
from eutree.policies import TreePolicy
from eutree.schema import Control, Feature, Schema
from eutree.trees import DecisionTree
from tests.export.readers import C_FLAGS, c_decide, compiled_c
from tests.export.tools import need

ROAD = Schema(
    (Feature("gap", "m", -50.0, 50.0), Feature("speed", "m/s", -9.0, 9.0), Feature("turn rate")),
    ("wait", "go", "stop"),
)
PLAIN = [
    "time = gap / speed",
    'mixed = gap * speed + 0.1 * "turn rate"',
    "near = min(gap, time, 3)",
    'far = max(abs(gap), -"turn rate")',
    'chosen = near if speed < 1 and gap >= -1 or "turn rate" > 0.5 else mixed - far',
    "unused = gap + 1",
]
LAST = [*PLAIN, "fall = gap - last(gap)", "jerk = fall - last(fall)"]
TYPES = {"double": np.float64, "float": np.float32, "int32": np.int32}


def deciding(declared, seed=0, n_leaves=40, schema=ROAD):
    """Return a policy that asks for each derived feature, with thresholds that rounding misses."""
    schema = schema.derive(declared)
    rng = np.random.default_rng(seed)
    tree = DecisionTree.single_leaf(schema.n_features)
    names = [name for name in schema.feature_names if name != "unused"]
    while tree.n_leaves < n_leaves:
        feature = schema.feature_names.index(names[tree.n_leaves % len(names)])
        threshold = float(rng.normal(scale=3))
        tree = tree.split(int(rng.integers(tree.n_leaves)), feature, threshold)
    actions = rng.integers(schema.n_actions, size=tree.n_leaves)
    return TreePolicy(tree, actions, schema)


def measured(n=400, seed=1):
    rng = np.random.default_rng(seed)
    rows = rng.normal(scale=5, size=(n, 3))
    special = [np.nan, np.inf, -np.inf, 0.0, -0.0, 5e-324, 1e308, -1e308, 1.0]
    rows[::7] = rng.choice(special, size=rows[::7].shape)
    return rows


def decided(policy, rows):
    """Return the policy's own actions at the steps of one episode."""
    state, actions = None, []
    for row in rows:
        action, state = policy.predict(row, state)
        actions.append(int(action))
    return actions


@pytest.mark.promise(20)
@pytest.mark.parametrize("declared", [PLAIN, LAST], ids=["plain", "last"])
@pytest.mark.parametrize("number", TYPES)
def test_c_decides_as_the_policy(declared, number, tmp_path: Path):
    scale = {"gap": 1000.0, "speed": 3.0, "turn rate": 0.25} if number == "int32" else None
    for seed in range(4):
        policy = deciding(declared, seed)
        kind = numbers(policy, number, scale)
        source = to_c(policy, number=number, scale=scale)
        rows = measured(seed=seed)
        if number == "int32":
            rows = np.rint(np.nan_to_num(rows).clip(-1e6, 1e6) * 50)
        with np.errstate(over="ignore"):
            stored = rows.astype(TYPES[number])
        meant = [[kind.value(float(x), j) for j, x in enumerate(row)] for row in stored]
        expected = decided(policy, meant)
        assert len(set(expected)) == 3
        backwards = decided(policy, meant[::-1]) if declared is LAST else None
        for flags in ("-O0", "-O2", "-O2 -mfma -ffp-contract=fast"):
            library = compiled_c(source, tmp_path, flags=flags.split(), stem=f"p{seed}{number}")
            assert c_decide(library, TYPES[number])(stored) == expected, flags
            if declared is LAST:
                library.decide_reset()
                assert c_decide(library, TYPES[number])(stored[::-1]) == backwards, flags


def test_a_fused_product_would_be_noticed(tmp_path: Path):
    """The control: the same source with plain products must fail where they are fused."""
    wrong = 0
    for seed in range(4):
        policy = deciding(["mixed = gap * gap - speed * speed"], seed, n_leaves=2)
        rows = np.random.default_rng(seed).normal(size=(4000, 1)).repeat(2, axis=1)
        rows = np.column_stack([rows, rows[:, 0]])
        tree = DecisionTree.single_leaf(4).split(0, 3, -1e-300).split(1, 3, 0.0)
        policy = TreePolicy(tree, np.array([0, 1, 2]), policy.schema)
        assert set(decided(policy, rows)) == {1}
        right = to_c(policy)
        plain = right.replace("volatile double product", "double product")
        flags = ("-O2", "-mfma", "-ffp-contract=fast")
        ok = c_decide(compiled_c(right, tmp_path, flags=flags, stem=f"r{seed}"))(rows)
        assert set(ok) == {1}
        wrong += set(c_decide(compiled_c(plain, tmp_path, flags=flags, stem=f"w{seed}"))(rows)) != {
            1
        }
    assert wrong == 4


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="has no x87")
@pytest.mark.parametrize("number", TYPES)
def test_c_refuses_to_keep_sums_in_80_bits(number, tmp_path: Path):
    """7 of 3,000 decisions on a sum of tenths were others; what is only compared is exact."""
    derived, plain = deciding(["sum = gap + speed"]), deciding([])
    scale = 50.0 if number == "int32" else None
    for flags in ("-mfpmath=387 -O0", "-mfpmath=387 -O2 -std=gnu89", "-mfpmath=sse+387 -O2"):
        path = tmp_path / "derived.c"
        path.write_text(to_c(derived, number=number, scale=scale))
        build = [need("gcc"), *C_FLAGS, *flags.split(), "-c", str(path), "-o", f"{path}.o"]
        said = subprocess.run(build, capture_output=True, text=True)
        assert said.returncode != 0
        assert "doubles must be computed as doubles" in said.stderr
        options = {"flags": flags.split(), "stem": f"plain{number}"}
        library = compiled_c(to_c(plain, number=number, scale=scale), tmp_path, **options)
        if number == "double":
            assert c_decide(library)(measured()) == decided(plain, measured())


@pytest.mark.parametrize("declared", [PLAIN, LAST], ids=["plain", "last"])
@pytest.mark.parametrize("number", TYPES)
def test_the_program_that_tests_c_passes(declared, number, tmp_path: Path):
    policy = deciding(declared)
    options = {"name": "drive", "number": number}
    if number == "int32":
        options["scale"] = 100.0
    (tmp_path / "drive.h").write_text(to_c_header(policy, **options))
    (tmp_path / "drive.c").write_text(to_c(policy, header=True, **options))
    (tmp_path / "test.c").write_text(to_c_test(policy, **options))
    build = [need("gcc"), *C_FLAGS, "drive.c", "test.c", "-o", "run"]
    subprocess.run(build, cwd=tmp_path, check=True)
    result = subprocess.run(["./run"], cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout


@pytest.mark.promise(20)
@pytest.mark.parametrize("declared", [PLAIN, LAST], ids=["plain", "last"])
def test_python_decides_as_the_policy(declared):
    for seed in range(4):
        policy = deciding(declared, seed)
        module: dict = {}
        exec(compile(to_python(policy), "policy", "exec"), module)
        assert module["FEATURES"] == ROAD.feature_names
        rows = measured(seed=seed)
        assert [module["decide"](row) for row in rows.tolist()] == decided(policy, rows)
        if declared is LAST:
            module["decide_reset"]()
            again = [module["decide"](row) for row in rows[::-1].tolist()]
            assert again == decided(policy, rows[::-1])


@pytest.mark.promise(20)
@pytest.mark.parametrize("kind", [np.float32, np.uint8, np.int64])
@pytest.mark.parametrize("declared", [[], PLAIN, LAST], ids=["none", "plain", "last"])
def test_python_takes_arrays_of_any_numbers(declared, kind):
    """Single precision would round 0.1 up to itself, and small whole numbers wrap around."""
    schema = ROAD.derive([*declared, "less = gap - speed"]) if declared else ROAD
    last = schema.n_features - 1
    tree = DecisionTree.single_leaf(last + 1).split(0, 0, 0.1).split(1, last, 0.1)
    policy = TreePolicy(tree, np.array([0, 1, 2]), schema)
    module: dict = {}
    exec(compile(to_python(policy), "policy", "exec"), module)
    rows = np.array([[0.1, 0.0, 0.0], [3, 5, 0], [5, 3, 0], [0.2, 0.1, 0]]).astype(kind)
    assert [module["decide"](row) for row in rows] == decided(policy, rows)


def test_what_is_not_asked_for_is_not_computed():
    source = to_c(deciding(PLAIN))
    assert "unused" not in source
    assert "where time [s] = gap / speed" in source


def run_structured_text(source):
    """Return what a source in structured text defines, read line by line as Python."""
    code, indentation, section = [], 0, ""
    text = re.sub(r"\(\*.*?\*\)", "", source, flags=re.DOTALL)
    for raw in text.splitlines():
        line = raw.strip()
        for old, new in (("<>", "!="), (" AND ", " and "), (" OR ", " or "), (":=", "="),
                         ("NOT ", "not "), ("FALSE", "False"), ("TRUE", "True")):  # fmt: skip
            line = line.replace(old, new)
        line = line.rstrip(";")
        if match := re.match(r"FUNCTION(_BLOCK)? (\w+)", line):
            title, inputs, block, variables, section = match[2], [], match[1], [], ""
        elif line in ("VAR", "VAR_INPUT", "VAR_OUTPUT"):
            section = line
        elif line == "END_VAR":
            section = ""
        elif section:
            names = re.findall(r"\w+", line.split(":")[0])
            (inputs if section == "VAR_INPUT" else variables).extend(names)
        elif line in ("END_FUNCTION", "END_FUNCTION_BLOCK"):
            result = "action_index" if block else title + "_"
            kept = f"    global {', '.join(variables)}\n" if block else ""
            body = "\n".join(re.sub(rf"\b{title}\b(?!\()", title + "_", one) for one in code)
            defined = f"def {title}({', '.join(inputs)}):\n{kept}{body}\n    return {result}\n"
            exec(defined, space := globals().setdefault("_st", {}))
            space |= dict.fromkeys(variables, 0) if block else {}
            code, indentation = [], 0
        elif match := re.match(r"(IF|ELSIF) (.*) THEN$", line):
            indentation -= match[1] == "ELSIF"
            word = {"IF": "if", "ELSIF": "elif"}[match[1]]
            code.append("    " * (indentation + 1) + f"{word} {match[2]}:")
            indentation += 1
        elif line == "ELSE":
            code.append("    " * indentation + "else:")
        elif line == "END_IF":
            indentation -= 1
        elif line:
            code.append("    " * (indentation + 1) + line)
    return globals().pop("_st")


@pytest.mark.promise(20)
@pytest.mark.parametrize("declared", [PLAIN, LAST], ids=["plain", "last"])
def test_structured_text_decides_as_the_policy(declared):
    for seed in range(4):
        policy = deciding(declared, seed)
        space = run_structured_text(to_structured_text(policy))
        space["SEL"] = lambda chosen, no, yes: yes if chosen else no
        rows = measured(seed=seed)
        more = (False,) if declared is LAST else ()
        assert [space["decide"](*row, *more) for row in rows.tolist()] == decided(policy, rows)
        if declared is LAST:
            starts = [True] + [False] * (len(rows) - 1)
            again = [space["decide"](*row, start)
                     for row, start in zip(rows[::-1].tolist(), starts, strict=True)]  # fmt: skip
            assert again == decided(policy, rows[::-1])


def test_what_actions_set_is_not_asked_twice_in_a_step(tmp_path: Path):
    controls = (Control("valve", "%", (0.0, 50.0, 100.0)),)
    schema = Schema(ROAD.features, ("shut", "half", "open"), controls)
    once = to_c(deciding(LAST, schema=schema))
    assert "decide_valve(" not in once
    assert "decide_valves" not in once
    library = compiled_c(once, tmp_path)
    table = (ctypes.c_double * 3).in_dll(library, "decide_values")
    assert list(table) == [0.0, 50.0, 100.0]
    assert "decide_valve(" in to_c(deciding(PLAIN, schema=schema))
    assert "def decide_valve(" not in to_python(deciding(LAST, schema=schema))
    assert "action_index : INT;\nEND_VAR\nCASE action_index OF" in (
        to_structured_text(deciding(LAST, schema=schema))
    )


def test_an_episode_begins_when_it_is_said(tmp_path: Path):
    schema = Schema((Feature("level"),), ("wait", "go")).derive(["rise = level - last(level)"])
    policy = TreePolicy(DecisionTree.single_leaf(2).split(0, 1, 0.5), np.array([0, 1]), schema)
    library, rows = compiled_c(to_c(policy), tmp_path), np.array([[1.0], [2.0], [2.0], [5.0]])
    decide = c_decide(library)
    assert decide(rows[:3]) == decided(policy, rows[:3]) == [0, 1, 0]
    assert decide(rows[3:]) == [1]
    library.decide_reset()
    assert decide(rows[:1]) == [0]


@pytest.mark.parametrize("export", [to_c, to_python, to_structured_text])
def test_a_history_besides_is_refused(export):
    schema = ROAD.derive(["fall = gap - last(gap)"]).with_history(1)
    tree = DecisionTree.single_leaf(schema.n_features).split(0, 3, 0.5)
    policy = TreePolicy(tree, np.array([0, 1]), schema, history=1)
    with pytest.raises(InvalidArgumentError, match="no history to be exported"):
        export(policy)


def test_no_variable_of_structured_text_hides_a_function():
    """`decide_ratio(decide_tree, decide_ratio)` called a variable."""
    schema = Schema((Feature("decide tree"), Feature("decide ratio")), ("off", "on"))
    schema = schema.derive(['q = "decide tree" / "decide ratio"'])
    policy = TreePolicy(DecisionTree.single_leaf(3).split(0, 2, 1.0), np.array([0, 1]), schema)
    source = to_structured_text(policy)
    functions = set(re.findall(r"FUNCTION (\w+)", source))
    variables = set(re.findall(r"^\s+(\w+) : LREAL", source, re.MULTILINE))
    assert {"decide", "decide_tree", "decide_ratio"} <= functions
    assert not functions & variables


@pytest.mark.parametrize("name", ["last", "LAST"])
def test_no_last_value_of_structured_text_hides_a_function(name):
    """`last_ratio(tree, ratio - last_tree) + last_ratio` called a variable, and so did a valve."""
    names = ("tree", "Ratio", "block0", "valve", "last valve")
    controls = (Control("valve", "%", (0.0, 100.0)),)
    schema = Schema(tuple(map(Feature, names)), ("shut", "open"), controls)
    quotient = "d = tree / (Ratio - last(tree)) + last(Ratio) - last(block0)"
    schema = schema.derive([quotient, "e = valve - last(valve)"])
    tree = DecisionTree.single_leaf(7).split(0, 5, 0.5).split(1, 6, 0.0)
    policy = TreePolicy(tree, np.array([0, 1, 0]), schema)
    source = to_structured_text(policy, name=name)
    functions = re.findall(r"^FUNCTION(?:_BLOCK)? (\w+)", source, re.MULTILINE)
    variables = {one.casefold() for one in re.findall(r"^    (\w+) : ", source, re.MULTILINE)}
    assert {"last", "last_tree", "last_ratio"} < {one.casefold() for one in functions}
    assert len({one.casefold() for one in functions}) == len(functions)
    assert not variables & {one.casefold() for one in functions}
    rows = np.random.default_rng(0).normal(size=(200, 5))
    space = run_structured_text(source.partition("CASE")[0].rpartition("FUNCTION")[0])
    assert [space[name](*row, False) for row in rows.tolist()] == decided(policy, rows)


def test_what_no_test_asks_for_is_no_input_of_structured_text():
    controls = (Control("valve", "%", (0.0, 50.0, 100.0)),)
    schema = Schema(ROAD.features, ("shut", "half", "open"), controls).derive(LAST)
    tree = DecisionTree.single_leaf(schema.n_features).split(0, 1, 0.5).split(1, 0, 2.0)
    policy = TreePolicy(tree, np.array([0, 1, 2]), schema)
    source = to_structured_text(policy)
    space = run_structured_text(source.partition("FUNCTION decide_valve")[0])
    rows = measured()
    assert [space["decide"](*row) for row in rows.tolist()] == decided(policy, rows)
    assert source.count(" : LREAL; (*") == 2 * 3  # of the decision, and of the valve
    assert "far" not in source


def test_with_a_past_nothing_is_exported_even_where_no_test_asks_for_what_is_derived():
    """Code would read places that its inputs do not have."""
    schema = Schema.anonymous(2, 2).derive(["gap = x0 - x1"]).with_history(1)
    tree = DecisionTree.single_leaf(schema.n_features).split(0, 4, 0.5)
    policy = TreePolicy(tree, np.array([0, 1]), schema, history=1)
    for export in (to_c, to_python, to_structured_text):
        with pytest.raises(InvalidArgumentError, match="must have no history"):
            export(policy)
