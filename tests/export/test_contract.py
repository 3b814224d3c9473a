"""What holds for every format: it can be read back, and then it decides exactly like the tree."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.export import FORMATS, export
from eutree.export.c import probes
from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from tests.export.policies import EVASION, NASTY, chain, policies, policy_of, tree
from tests.export.readers import READERS

# Compilers and sessions start slowly; the text formats are cheap.
EXAMPLES = {"c": 25, "onnx": 25}


def assert_agrees(policy: TreePolicy, format: str, *, n_random: int = 50) -> None:
    observations = probes(policy.tree, n_random=n_random)
    decided = READERS[format](export(policy, format), policy)(observations)
    np.testing.assert_array_equal(decided, policy.predict(observations)[0])


def test_every_format_has_a_reader() -> None:
    assert set(FORMATS) == set(READERS)


@pytest.mark.promise(20)
@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("n_leaves", [1, 2, 9, 40])
def test_decisions_agree(format: str, n_leaves: int) -> None:
    assert_agrees(policy_of(tree(n_leaves, 3, seed=n_leaves), EVASION, statistics=True), format)


@pytest.mark.promise(20)
@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("to_the_left", [True, False])
def test_deep_trees_agree(format: str, to_the_left: bool) -> None:
    assert_agrees(policy_of(chain(200, to_the_left=to_the_left)), format)


@pytest.mark.promise(20)
@pytest.mark.parametrize("format", FORMATS)
def test_any_names_and_thresholds_agree(format: str) -> None:
    @settings(
        max_examples=EXAMPLES.get(format, 60),
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=[HealthCheck.too_slow],
    )
    @given(policies())
    def check(policy: TreePolicy) -> None:
        assert_agrees(policy, format, n_random=5)

    check()


@pytest.mark.parametrize("format", FORMATS)
def test_nasty_names_agree(format: str) -> None:
    features = tuple(Feature(name, NASTY[-1 - index]) for index, name in enumerate(NASTY))
    schema = Schema(features, NASTY)
    assert_agrees(policy_of(tree(60, len(NASTY), seed=3), schema, statistics=True), format)


@pytest.mark.parametrize("format", FORMATS)
def test_half_a_character_is_harmless_or_refused(format: str) -> None:
    policy = policy_of(tree(4, 1), Schema((Feature("\ud800"),), ("\udfff", "go")))
    if format == "json":  # the policy's own file holds text, and this is none
        with pytest.raises(InvalidArgumentError, match="surrogates not allowed"):
            export(policy, format)
    else:
        assert_agrees(policy, format)


@pytest.mark.parametrize("format", FORMATS)
def test_same_policy_same_bytes(format: str) -> None:
    first, second = (policy_of(tree(9, 3), EVASION, statistics=True) for _ in range(2))
    assert export(first, format) == export(second, format)


@pytest.mark.parametrize("format", FORMATS)
def test_content_is_text_or_bytes_as_the_registry_says(format: str) -> None:
    content = export(policy_of(tree(4, 3), EVASION), format)
    assert isinstance(content, bytes if FORMATS[format].binary else str)
    if isinstance(content, str):
        assert content.endswith("\n")
        assert content.encode("utf-8").decode("utf-8") == content


@pytest.mark.parametrize("entry", FORMATS.values(), ids=FORMATS)
def test_entries_describe_themselves(entry: object) -> None:
    assert entry.name in FORMATS
    assert Path(f"policy{entry.suffix}").suffix == entry.suffix
    assert entry.summary


def test_unknown_names_are_refused() -> None:
    policy = policy_of(tree(2, 2))
    with pytest.raises(UnknownNameError, match="unknown format 'C99'"):
        export(policy, "C99")
    with pytest.raises(UnknownNameError, match=r"option of format c 'nmae'.*'name'"):
        export(policy, "c", nmae="x")


def test_a_rounded_threshold_is_noticed() -> None:
    """The control: what other tools do, rounding to float32, must fail these tests."""
    policy = policy_of(tree(9, 3, seed=1), EVASION)
    rounded = policy.tree.threshold.astype(np.float32).astype(np.float64)
    wrong = TreePolicy(
        tree=type(policy.tree)(
            3, policy.tree.feature, rounded, policy.tree.left, policy.tree.right, policy.tree.leaf
        ),
        actions=np.arange(9) % 2,
        schema=policy.schema,
    )
    right = TreePolicy(policy.tree, np.arange(9) % 2, policy.schema)
    observations = probes(policy.tree)
    assert (wrong.predict(observations)[0] != right.predict(observations)[0]).any()


def lines_of(content: str | bytes) -> set[str | bytes]:
    return set(content.splitlines())


@pytest.mark.parametrize("format", FORMATS)
def test_how_a_feature_is_derived_is_in_the_export_unless_it_takes_it_as_given(format: str) -> None:
    """Exports of one tree differ where only the formula of a feature does."""
    contents = [
        export(policy_of(tree(9, 4, seed=1), EVASION.derive([formula])), format)
        for formula in ("near = position - opponent_1", "near = position + opponent_1")
    ]
    assert (contents[0] == contents[1]) == FORMATS[format].takes_derived


@pytest.mark.parametrize("format", FORMATS)
def test_that_actions_may_be_masked_is_said(format: str) -> None:
    """An export of a policy whose actions were masked says so, or takes the mask."""
    policy = policy_of(tree(9, 3, seed=1), EVASION)
    masked = replace(policy, masked=True)
    assert lines_of(export(masked, format)) - lines_of(export(policy, format))


def test_the_page_has_a_row_for_each_format() -> None:
    page = (Path(__file__).parents[2] / "docs" / "exports.md").read_text()
    rows = re.findall(r"^\| `(\w+)` \|.*\| `(\.\w+)` \|$", page, re.MULTILINE)
    assert dict(rows) == {name: entry.suffix for name, entry in FORMATS.items()}
