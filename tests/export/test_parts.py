"""The parts that exports share: identifiers, blocks of deep trees, layout, probes, options."""

import builtins
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError, MissingExtraError
from eutree.export import (
    to_c,
    to_c_test,
    to_latex,
    to_onnx,
    to_python,
    to_structured_text,
    to_svg,
)
from eutree.export._code import (
    C_WORDS,
    DEPTH,
    PYTHON_WORDS,
    STRUCTURED_TEXT_WORDS,
    block_roots,
    identifiers,
)
from eutree.export.c import function_name, node_boxes, probes
from eutree.export.drawing import FILLS, layout
from eutree.export.structured_text import literal
from eutree.schema import Control, Feature, Schema
from tests.export.policies import EVASION, NASTY, chain, policy_of, tree


@given(st.lists(st.one_of(st.sampled_from(NASTY), st.text(max_size=50)), unique=True))
def test_identifiers_are_distinct_and_legal(names: list[str]) -> None:
    for words in (C_WORDS, PYTHON_WORDS, STRUCTURED_TEXT_WORDS):
        found = identifiers(names, reserved=words)
        folded = [name.casefold() for name in found]
        assert len(set(folded)) == len(names)
        assert not set(folded) & {word.casefold() for word in words}
        for name in found:
            assert re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name)
            assert len(name) <= 31


def test_identifiers_resemble_names() -> None:
    names = ["opponent_1", "pole angle", "Größe", "x", "X", "1st", "速度"]
    expected = ["opponent_1", "pole_angle", "Groe", "x", "X_2", "f_1st", "f"]
    assert identifiers(names, reserved=(), prefix="f") == expected


@pytest.mark.parametrize("to_the_left", [True, False])
def test_blocks_are_never_deeper_than_allowed(to_the_left: bool) -> None:
    grown = chain(400, to_the_left=to_the_left)
    roots = block_roots(grown)
    assert roots[-1] == 0
    assert roots == sorted(roots, reverse=True)
    for leaf in range(grown.n_leaves):
        since_root = 0
        for node in grown.path(leaf):
            since_root = 0 if node in roots else since_root + 1
            assert since_root <= DEPTH


@given(st.integers(1, 40), st.integers(0, 100))
def test_layout_keeps_nodes_apart_and_branches_in_order(n_leaves: int, seed: int) -> None:
    grown = tree(n_leaves, 3, seed=seed)
    places = layout(grown)
    assert len(set(zip(places.row, places.column, strict=True))) == grown.n_nodes
    leaves = places.row[grown.node_of_leaf]
    np.testing.assert_array_equal(np.sort(leaves), np.arange(n_leaves))
    for node in np.flatnonzero(grown.feature >= 0):
        yes, no = grown.left[node], grown.right[node]
        assert places.row[yes] < places.row[node] < places.row[no]
        assert places.column[yes] == places.column[no] == places.column[node] + 1


@given(st.integers(1, 30), st.integers(0, 100))
def test_probes_reach_every_test_on_both_sides(n_leaves: int, seed: int) -> None:
    grown = tree(n_leaves, 2, seed=seed)
    low, high = node_boxes(grown)
    reachable = np.flatnonzero((low < high).all(axis=1) & (grown.feature < 0))
    reached = set(grown.leaf_index(probes(grown)).tolist())
    assert set(grown.leaf[reachable].tolist()) <= reached | _without_room(grown, low, high)


def _without_room(grown: object, low: np.ndarray, high: np.ndarray) -> set[int]:
    """Return leaves whose box is too thin for a point between its ends."""
    thin = (np.nextafter(low, np.inf) >= high).any(axis=1) & (grown.feature < 0)
    return set(grown.leaf[thin].tolist())


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_structured_text_constants_read_back(value: float) -> None:
    text = literal(value)
    assert re.fullmatch(r"-?\d+\.\d+(E-?\d+)?", text)
    assert float(text) == value
    assert str(float(text)) == str(value)


def test_latex_nodes_have_room_for_their_words() -> None:
    """Columns of a fixed width let long thresholds run into the next column."""
    names = tuple(Feature(name) for name in ("x", "y" * 40))
    policy = policy_of(tree(12, 2, seed=1), Schema(names, ("a", "b")))
    found = re.findall(r"\(n(\d+)\) at \(([\d.]+),[-\d.]+\) \{(.*)\};", to_latex(policy))
    left = {int(node): float(x) for node, x, _ in found}
    assert len(left) == policy.tree.n_nodes
    for node, _, words in found:
        child = policy.tree.left[int(node)]
        if child >= 0:
            assert left[child] - left[int(node)] > 0.12 * len(words)


def test_latex_document_holds_the_picture() -> None:
    policy = policy_of(tree(4, 3), EVASION)
    document = to_latex(policy, document=True)
    assert to_latex(policy).strip() in document
    assert document.startswith("\\documentclass")
    assert document.count("\\begin") == document.count("\\end")


def test_embedded_drawing_has_no_style_of_its_own() -> None:
    policy = policy_of(tree(4, 3), EVASION)
    assert "<style>" in to_svg(policy)
    assert "style" not in to_svg(policy, standalone=False)


def luminance(colour: str) -> float:
    channels = [int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_words_on_leaves_can_be_read() -> None:
    ink = luminance("#10161d")
    for colour in FILLS:
        assert (luminance(colour) + 0.05) / (ink + 0.05) >= 7.0


def test_missing_onnx_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(MissingExtraError, match=r"onnx is not installed.*eutree\[onnx\]"):
        to_onnx(policy_of(tree(2, 2)))


@pytest.mark.parametrize(
    "name",
    ["log", "remove", "printf", "abs", "stdin", "NULL", "time", "actions", "row", "size_t", "FILE",
     "fpos_t", "double_t", "float_t", "ptrdiff_t", "wchar_t", "va_list", "intmax_t", "uint8_t",
     "SEEK_SET", "SIZE_MAX", "sqrtf", "powl", "vsscanf", "isless", "offsetof", "gamma"],
)  # fmt: skip
def test_no_function_of_c_has_a_name_of_its_library_or_of_the_self_test(name):
    policy = policy_of(tree(2, 1))
    with pytest.raises(InvalidArgumentError, match="no reserved word"):
        to_c(policy, name=name)
    assert function_name(name).casefold() != name.casefold()


def test_no_function_of_python_hides_one_that_it_calls():
    """A masked policy called `next` asked itself for its leaf."""
    policy = replace(policy_of(tree(4, 3), EVASION), masked=True)
    with pytest.raises(InvalidArgumentError, match="no reserved word"):
        to_python(policy, name="next")
    called = set(re.findall(r"\b(\w+)\(", to_python(policy))) & set(dir(builtins))
    for name in called:
        with pytest.raises(InvalidArgumentError, match="no reserved word"):
            to_python(policy, name=name)
    assert "next" in called


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"name": 5}, "name must be a str"),
        ({"n_random": -1}, "n_random must be an integer >= 0"),
        ({"seed": -1}, "seed must be an integer from 0"),
    ],
)
def test_odd_arguments_are_refused(wrong, said):
    with pytest.raises(InvalidArgumentError, match=said):
        to_c_test(policy_of(tree(2, 1)), **wrong)


def test_no_identifier_is_a_function_block_of_controllers():
    """The names that matiec 6bb2c33 refuses: its library and that of the standard."""
    blocks = (
        "TP TON TOF CTU CTD CTUD SR RS RTC SEMA R_TRIG F_TRIG PID INTEGRAL DERIVATIVE RAMP "
        "HYSTERESIS"
    )
    names = [*blocks.split(), *blocks.lower().split()]
    found = identifiers(names, reserved=STRUCTURED_TEXT_WORDS)
    assert not {name.casefold() for name in found} & {name.casefold() for name in names}


def setting(features: list[str], controls: list[str]) -> Schema:
    levels = [Control(name, "", (0.0, 1.0)) for name in controls]
    names = tuple("/".join("ab"[k >> j & 1] for j in range(len(levels)))
                  for k in range(2 ** len(levels)))  # fmt: skip
    return Schema(tuple(map(Feature, features)), names, tuple(levels))


@pytest.mark.parametrize(
    ("name", "features", "controls"),
    [
        ("decide", ["decide a", "x"], ["a", "a1"]),
        ("end", ["x"], ["if"]),
        ("real_to", ["x"], ["int"]),
        ("decide", ["x"], ["Tree", "tree", "block0"]),
    ],
)
def test_functions_of_structured_text_have_names_of_their_own(name, features, controls):
    source = to_structured_text(
        policy_of(tree(2, len(features)), setting(features, controls)), name=name
    )
    functions = re.findall(r"^function (\w+)", source.casefold(), re.MULTILINE)
    variables = re.findall(r"^\s+(\w+) : lreal", source.casefold(), re.MULTILINE)
    assert len(set(functions)) == len(functions) == 1 + len(controls)
    assert not set(functions) & {*STRUCTURED_TEXT_WORDS, *variables}


@pytest.mark.parametrize("name", ["my__f", "f_", "end_if", "int_to_real"])
def test_no_function_of_structured_text_has_an_illegal_name(name):
    """Of underscores the standard allows one between two letters or digits."""
    policy = policy_of(tree(2, 1))
    with pytest.raises(InvalidArgumentError, match=r"an identifier .*single underscores"):
        to_structured_text(policy, name=name)
    assert to_structured_text(policy, name="my_f_1")


def test_no_identifier_is_a_standard_function_of_structured_text():
    """Names that matiec refuses, and function blocks of the standard."""
    words = (
        "int_to_real lreal_to_int time_to_real udint_to_bcd string_to_int date_and_time_to_date "
        "add_time multime sub_tod_time concat_date_tod ctu_dint ctd_dint ctud_ulint real_trunc_int"
    )
    assert not set(words.split()) - STRUCTURED_TEXT_WORDS


@pytest.mark.parametrize(
    ("name", "number", "joined"),
    [
        ("DBL", "double", "MAX"),
        ("flt", "double", "min"),
        ("int32", "int32", "max"),
        ("int32", "int32", "t"),
        ("UINT8", "int32", "t"),
    ],
)
def test_no_joined_name_of_c_is_one_of_its_library(name, number, joined):
    """`DBL_MAX` in the enumeration of the actions was the largest double."""
    options = {"name": name, "number": number, "scale": 1.0 if number == "int32" else None}
    schemas = [setting(["x"], [joined]), Schema((Feature("x"),), ("a", joined))]
    for schema in schemas:
        source = to_c(policy_of(tree(2, 1), schema), **options)
        found = re.findall(rf"\b{name}_\w+\b", source, re.IGNORECASE)
        folded = {one.casefold() for one in found} - {"int32_t"}  # the type of an observation
        assert not folded & C_WORDS
        assert f"{name}_{joined}_2".casefold() in folded


@pytest.mark.parametrize(
    "name",
    ["clog", "csin", "cabs", "creal", "conj", "cimag", "ctan", "csqrt", "carg", "cexp", "cpow",
     "cacos", "catanhl", "cprojf", "imaxabs", "imaxdiv", "iswalpha", "iswdigit", "towlower",
     "towupper", "wcslen", "wmemcpy", "btowc", "mbrtowc", "feraiseexcept"],
)  # fmt: skip
def test_no_function_of_c_has_a_name_that_the_compiler_knows(name):
    with pytest.raises(InvalidArgumentError, match="no reserved word"):
        to_c(policy_of(tree(2, 1)), name=name)
