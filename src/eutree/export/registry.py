"""The formats by name: what the command line offers and what the contract tests run over."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import signature
from types import MappingProxyType
from typing import Any

from eutree.errors import UnknownNameError
from eutree.export._blocks import ASSUMPTION
from eutree.export.c import to_c
from eutree.export.drawing import branches, fills, words_of_leaf, words_of_test
from eutree.export.latex import to_latex
from eutree.export.onnx import to_onnx
from eutree.export.python import to_python
from eutree.export.structured_text import to_structured_text
from eutree.export.svg import to_svg
from eutree.policies import TreePolicy
from eutree.trees.text import definitions, printable, rules
from eutree.validation import check_choice


def to_json(policy: TreePolicy) -> str:
    """Return the document that ``TreePolicy.load`` reads, byte for byte what ``save`` writes."""
    return policy.to_bytes().decode("utf-8")


def to_text(policy: TreePolicy) -> str:
    """Return the policy as nested rules with names and units; thresholds are exact."""
    names = [printable(name) for name in policy.schema.actions]
    leaves = [names[action] for action in policy.actions]
    remark = [f"# {ASSUMPTION}"] if policy.masked else []
    lines = [*remark, rules(policy.tree, policy.schema, leaves, exact=True)]
    return "\n".join([*lines, *definitions(policy.tree, policy.schema)]) + "\n"


def to_dot(policy: TreePolicy) -> str:
    """Return the tree as a Graphviz digraph, root at the left, leaves coloured by action."""
    tree, colours = policy.tree, fills(policy.schema)
    lines = [
        *([f"// {ASSUMPTION}"] if policy.masked else []),
        "digraph policy {",
        '    graph [rankdir="LR", ordering="out", nodesep="0.15"];',
        '    node [fontname="Helvetica", fontsize="11", shape="box", '
        'style="rounded,filled", fillcolor="#ffffff", color="#8a94a0"];',
        '    edge [fontname="Helvetica", fontsize="9", color="#8a94a0", arrowhead="none"];',
    ]
    for node in tree.preorder():
        if tree.feature[node] != tree.NO_FEATURE:
            lines.append(f"    n{node} [label={_string(words_of_test(policy, node))}];")
            continue
        colour = colours[int(policy.actions[tree.leaf[node]])]
        label = _string(words_of_leaf(policy, node))
        lines.append(f'    n{node} [label={label}, fillcolor="{colour}", color="{colour}"];')
    lines += [
        f'    n{parent} -> n{child} [label="{answer}"];'
        for parent, child, answer in branches(policy)
    ]
    return "\n".join([*lines, "}"]) + "\n"


def _string(text: str) -> str:
    r"""Return a DOT string; a backslash would begin an escape and ``&`` an entity."""
    escaped = text.replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


@dataclass(frozen=True)
class ExportFormat:
    """One format that a policy can be exported to.

    Attributes:
        name: Its name on the command line.
        suffix: The usual suffix of its files.
        function: Makes the content from a policy and the format's options.
        summary: What it is for, in a few words.
        binary: Whether the content is bytes rather than text.
    """

    name: str
    suffix: str
    function: Callable[..., str | bytes]
    summary: str
    binary: bool = False

    @property
    def options(self) -> tuple[str, ...]:
        """Names of the options that the function takes besides the policy."""
        return tuple(signature(self.function).parameters)[1:]


_ALL = (
    ExportFormat("c", ".c", to_c, "C99 for microcontrollers"),
    ExportFormat("onnx", ".onnx", to_onnx, "ONNX with doubles", binary=True),
    ExportFormat("dot", ".dot", to_dot, "Graphviz"),
    ExportFormat("svg", ".svg", to_svg, "a drawing"),
    ExportFormat("json", ".json", to_json, "the policy file itself"),
    ExportFormat("text", ".txt", to_text, "nested rules"),
    ExportFormat("python", ".py", to_python, "a module that imports nothing"),
    ExportFormat("st", ".st", to_structured_text, "IEC 61131-3 structured text for PLCs"),
    ExportFormat("latex", ".tex", to_latex, "a TikZ picture"),
)

FORMATS: Mapping[str, ExportFormat] = MappingProxyType({entry.name: entry for entry in _ALL})


def export(policy: TreePolicy, format: str, **options: Any) -> str | bytes:
    """Return the policy in one of the ``FORMATS``.

    Args:
        policy: The policy.
        format: Name of the format.
        options: What the format's function takes besides the policy.
    """
    entry = FORMATS[check_choice("format", format, FORMATS)]
    for option in options:
        if option not in entry.options:
            raise UnknownNameError(f"option of format {format}", option, entry.options)
    return entry.function(policy, **options)
