"""Exported C on every threshold, for every number type, compiled without and with optimisation."""

import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.export import to_c, to_c_header, to_c_test
from eutree.export._c_numbers import (
    Number,
    float_below,
    hexadecimal,
    in_integers,
    largest_integer,
    numbers,
)
from eutree.export.c import meant, stored_probes
from eutree.policies import TreePolicy
from eutree.schema import Control, Feature, Schema
from tests.export.policies import EVASION, NASTY, chain, policy_of, tree
from tests.export.readers import C_FLAGS, c_decide, compiled_c
from tests.export.tools import need

TYPES = {"double": np.float64, "float": np.float32, "int32": np.int32}
finite = st.floats(allow_nan=False, allow_infinity=False)


@pytest.mark.promise(20)
@pytest.mark.parametrize("number", TYPES)
@pytest.mark.parametrize("flags", [("-O0",), ("-O2",)], ids="".join)
def test_decisions_agree_on_every_stored_number(
    number: str, flags: tuple[str, ...], tmp_path: Path
) -> None:
    for n_leaves in (1, 2, 30):
        policy = policy_of(tree(n_leaves, 3, seed=n_leaves), EVASION)
        kind = numbers(policy, number, None)
        stored = stored_probes(policy, kind, n_random=500)
        source = to_c(policy, number=number)
        library = compiled_c(source, tmp_path, flags=flags, stem=f"{number}{n_leaves}")
        with np.errstate(over="ignore"):
            decided = c_decide(library, TYPES[number])(stored.astype(TYPES[number]))
        assert decided == [policy.act(meant(kind, row)) for row in stored]


@pytest.mark.parametrize("number", TYPES)
def test_self_test_passes_and_notices_a_wrong_decision(number: str, tmp_path: Path) -> None:
    policy = policy_of(tree(9, 3, seed=2), EVASION)
    source = to_c(policy, name="evade", number=number, header=True)
    (tmp_path / "evade.h").write_text(to_c_header(policy, name="evade", number=number))
    (tmp_path / "test.c").write_text(to_c_test(policy, name="evade", number=number))
    wrong = source.replace("action = EVADE_GO;", "action = EVADE_STOP;")
    for content, returned in ((source, 0), (wrong, 1)):
        (tmp_path / "evade.c").write_text(content)
        files = ("evade.c", "test.c", "-o", "run")
        subprocess.run([need("gcc"), *C_FLAGS, *files], cwd=tmp_path, check=True)
        result = subprocess.run(["./run"], cwd=tmp_path, capture_output=True, text=True)
        assert result.returncode == returned
        assert re.match(r"\d+ of \d+ decisions agree\n", result.stdout)


@pytest.mark.parametrize("number", TYPES)
def test_a_masked_policy_decides_by_the_orders_of_its_own_leaves(
    number: str, tmp_path: Path
) -> None:
    """Leaves over integers have other numbers than those of the policy."""
    policy = replace(policy_of(tree(30, 3, seed=3), EVASION), masked=True)
    kind = numbers(policy, number, None)
    stored = stored_probes(policy, kind, n_random=500)
    library = compiled_c(to_c(policy, number=number), tmp_path, stem=number)
    with np.errstate(over="ignore"):
        decided = c_decide(library, TYPES[number])(stored.astype(TYPES[number]))
    assert decided == [policy.act(meant(kind, row)) for row in stored]


def test_header_serves_cpp(tmp_path: Path) -> None:
    (tmp_path / "decide.h").write_text(to_c_header(policy_of(tree(3, 3), EVASION)))
    use = "int use(const double *observation) { return decide(observation); }"
    (tmp_path / "use.cpp").write_text(f'#include "decide.h"\nint use(const double *);\n{use}\n')
    command = [need("g++"), "-Wall", "-Wextra", "-Werror", "-pedantic", "-c", "use.cpp"]
    subprocess.run(command, cwd=tmp_path, check=True)


def test_fast_math_is_refused(tmp_path: Path) -> None:
    (tmp_path / "decide.c").write_text(to_c(policy_of(tree(3, 3), EVASION)))
    command = [need("gcc"), "-O2", "-ffast-math", "-c", "decide.c"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode != 0
    assert "NaN must fail every test" in result.stderr


def test_source_keeps_to_the_subset() -> None:
    """One exit and braces everywhere; no loops, jumps, recursion, heap or library calls."""
    source = to_c(policy_of(chain(150, to_the_left=True)))
    code = re.sub(r"/\*.*?\*/", "", source, flags=re.DOTALL)
    assert code.count("return") == len(re.findall(r"^(?:static )?int \w+\(.*\)$", code, re.M))
    assert not re.search(r"\b(for|while|do|goto|switch|malloc|break|continue)\b", code)
    assert not re.search(r"\)\s*\n\s*action", code)
    called = re.findall(r"action = decide_block_(\d+)\(", code)
    defined = re.findall(r"^static int decide_block_(\d+)\(", code, re.M)
    assert sorted(called) == sorted(defined)
    assert called
    for number in called:  # defined before called, so nothing can call itself
        assert code.index(f"static int decide_block_{number}(") < code.index(
            f"action = decide_block_{number}("
        )


def test_comments_and_strings_hold_any_name(tmp_path: Path) -> None:
    schema = Schema(tuple(Feature(name, name) for name in NASTY), NASTY)
    source = to_c(policy_of(tree(80, len(NASTY), seed=1), schema))
    assert not re.search(r"\?\?", source)
    assert not re.search(r"\\$", source, re.MULTILINE)
    compiled_c(source, tmp_path, flags=("-O0", "-Wtrigraphs", "-Wbidi-chars=any"))


@given(finite)
def test_float_below_is_the_largest_float_that_passes(threshold: float) -> None:
    below = np.float32(float_below(threshold))
    if threshold < -float(np.finfo(np.float32).max):
        assert below == -np.inf
        return
    assert float(below) <= threshold
    with np.errstate(over="ignore"):
        above = np.nextafter(below, np.float32(np.inf))
    assert float(above) > threshold


@given(finite, st.floats(1e-9, 1e9))
def test_largest_integer_is_the_largest_that_passes(threshold: float, scale: float) -> None:
    limit = largest_integer(threshold, scale)
    assert -(2**31) - 1 <= limit <= 2**31 - 1
    assert limit < -(2**31) or limit / scale <= threshold
    assert limit == 2**31 - 1 or (limit + 1) / scale > threshold


def test_a_third_is_stored_as_the_division_rounds() -> None:
    """0.3 is below three tenths, but 3 / 10 is 0.3: the stored 3 must pass the test."""
    assert largest_integer(0.3, 10.0) == 3


@given(finite)
def test_hexadecimal_reads_back(value: float) -> None:
    assert float.fromhex(hexadecimal(value)) == value
    assert str(float.fromhex(hexadecimal(value))) == str(value)


def test_tests_that_no_int32_fails_are_left_out() -> None:
    grown = tree(1, 1).split(0, 0, 1e300).split(0, 0, -1e300).split(1, 0, 5.0)
    policy = policy_of(grown)
    scaled, kept = in_integers(policy, (10.0,))
    assert scaled.n_leaves == len(kept) == 1
    assert scaled.act([0.0]) == policy.act([0.0])


def test_default_scale_is_a_power_of_two_that_fits() -> None:
    policy = policy_of(tree(3, 3), EVASION)
    assert numbers(policy, "int32", None).scales == (2.0**25, 2.0**26, 2.0**26)
    assert 30.0 * 2.0**25 < 2**31


def test_scales_may_be_given_by_name() -> None:
    policy = policy_of(tree(3, 3), EVASION)
    assert numbers(policy, "int32", {"position": 1000}).scales[0] == 1000.0
    with pytest.raises(UnknownNameError, match="feature in scale 'positon'"):
        numbers(policy, "int32", {"positon": 1000})


def test_wrong_options_are_refused() -> None:
    policy = policy_of(tree(3, 3))
    with pytest.raises(InvalidArgumentError, match="scale must be given for feature 'x0'"):
        to_c(policy, number="int32")
    with pytest.raises(InvalidArgumentError, match="scale of feature 'x0' must be a number in"):
        to_c(policy, number="int32", scale=0.0)
    with pytest.raises(InvalidArgumentError, match="scale must be left out"):
        to_c(policy, scale=2.0)
    with pytest.raises(UnknownNameError, match="number 'half'"):
        to_c(policy, number="half")  # type: ignore[arg-type] - it is wrong on purpose
    for name in ("", "int", "1st", "a b", "f();int g"):
        with pytest.raises(InvalidArgumentError, match="name must be an identifier"):
            to_c(policy, name=name)


def test_thresholds_at_the_ends_of_int32(tmp_path: Path) -> None:
    grown = tree(1, 1).split(0, 0, float(2**31 - 2)).split(0, 0, float(-(2**31)))
    policy = replace(policy_of(grown), actions=np.array([0, 1, 2]))
    source = to_c(policy, number="int32", scale=1.0)
    assert "<= INT32_MIN" in source
    observations = np.array([[-(2**31)], [-(2**31) + 1], [2**31 - 2], [2**31 - 1]], np.int32)
    decided = c_decide(compiled_c(source, tmp_path), np.int32)(observations)
    assert decided == [0, 2, 2, 1]


@pytest.mark.parametrize("number", ["float", "int32"])
@pytest.mark.parametrize("write", [to_c, to_c_header, to_c_test])
def test_levels_beyond_float_need_doubles(write: Callable[..., str], number: Number) -> None:
    def setting(level: float) -> TreePolicy:
        controls = (Control("valve", "%", (0.0, level)),)
        return policy_of(tree(2, 1), replace(Schema.anonymous(1, 2), controls=controls))

    scale = {"scale": 1.0} if number == "int32" else {}
    wanted = rf"number must be double for levels .*, 1e\+39, got '{number}'"
    with pytest.raises(InvalidArgumentError, match=wanted):
        write(setting(-1e39), number=number, **scale)
    assert write(setting(-1e39), number="double")
    assert write(setting(3.4028235e38), number=number, **scale)  # rounded down to the largest float


@pytest.mark.parametrize("threshold", [3.4028235e38, -3.4028235e38, 1e39])
def test_the_largest_float_is_tested(threshold: float) -> None:
    """Its neighbour is infinity, which is no fault to warn of."""
    policy = policy_of(tree(1, 1).split(0, 0, threshold))
    assert "INFINITY" in to_c_test(policy, number="float")


def test_thresholds_beyond_float(tmp_path: Path) -> None:
    """Only minus infinity is below -1e39 among floats, only infinity above 1e39."""
    grown = tree(1, 1).split(0, 0, 1e39).split(0, 0, -1e39)
    policy = replace(policy_of(grown), actions=np.array([0, 1, 2]))
    library = compiled_c(to_c(policy, number="float"), tmp_path)
    largest = np.finfo(np.float32).max
    observations = np.array([[-np.inf], [-largest], [largest], [np.inf], [np.nan]], np.float32)
    assert c_decide(library, np.float32)(observations) == [0, 2, 2, 1, 1]
