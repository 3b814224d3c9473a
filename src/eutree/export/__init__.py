"""One pure function per format: a ``TreePolicy`` in, text or bytes out, the same decisions.

Every format follows the rule of the tree: ``x <= threshold`` goes left, everything else, NaN
included, goes right. No format changes a threshold; where a number type is too narrow to hold one,
it is moved to the next number of that type at which no decision changes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import signature
from types import MappingProxyType
from typing import Any

from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.export._code import ASSUMPTION
from eutree.export.c import to_c, to_c_header, to_c_test
from eutree.export.drawing import to_dot, to_latex
from eutree.export.onnx import to_onnx
from eutree.export.python import to_python
from eutree.export.structured_text import to_structured_text
from eutree.export.svg import to_svg
from eutree.policies import TreePolicy
from eutree.trees.text import definitions, printable, rules
from eutree.validation import check_choice, check_kind

__all__ = [
    "FORMATS", "ExportFormat", "export", "to_c", "to_c_header", "to_c_test", "to_dot", "to_json",
    "to_latex", "to_onnx", "to_python", "to_structured_text", "to_svg", "to_text",
]  # fmt: skip


def to_json(policy: TreePolicy) -> str:
    """Return the document that ``TreePolicy.load`` reads, with the bytes that ``save`` writes."""
    return policy.to_bytes().decode("utf-8")


def to_text(policy: TreePolicy) -> str:
    """Return the policy as nested rules with names and units; thresholds are exact."""
    names = [printable(name) for name in policy.schema.actions]
    leaves = [names[action] for action in policy.actions]
    remark = [f"# {ASSUMPTION}"] if policy.masked else []
    lines = [*remark, rules(policy.tree, policy.schema, leaves, exact=True)]
    return "\n".join([*lines, *definitions(policy.tree, policy.schema)]) + "\n"


@dataclass(frozen=True)
class ExportFormat:
    """One format that a policy can be exported to.

    Attributes:
        name: Its name on the command line.
        suffix: The usual suffix of its files.
        function: Makes the content from a policy and the format's options.
        summary: Its purpose, in a few words.
        binary: Whether the content is bytes rather than text.
        takes_derived: Whether it takes derived features as given, and so keeps no formula.
    """

    name: str
    suffix: str
    function: Callable[..., str | bytes]
    summary: str
    binary: bool = False
    takes_derived: bool = False

    @property
    def options(self) -> tuple[str, ...]:
        """Names of the options that the function takes besides the policy."""
        return tuple(signature(self.function).parameters)[1:]


_ALL = (
    ExportFormat("c", ".c", to_c, "C99 for microcontrollers"),
    ExportFormat("onnx", ".onnx", to_onnx, "ONNX with doubles", binary=True, takes_derived=True),
    ExportFormat("dot", ".dot", to_dot, "Graphviz", takes_derived=True),
    ExportFormat("svg", ".svg", to_svg, "a drawing", takes_derived=True),
    ExportFormat("json", ".json", to_json, "the policy file itself"),
    ExportFormat("text", ".txt", to_text, "nested rules"),
    ExportFormat("python", ".py", to_python, "a module that imports nothing"),
    ExportFormat("st", ".st", to_structured_text, "IEC 61131-3 structured text for PLCs"),
    ExportFormat("latex", ".tex", to_latex, "a TikZ picture", takes_derived=True),
)

FORMATS: Mapping[str, ExportFormat] = MappingProxyType({entry.name: entry for entry in _ALL})


def export(policy: TreePolicy, format: str, **options: Any) -> str | bytes:
    """Return the policy in one of the ``FORMATS``.

    Args:
        policy: Policy to export.
        format: Name of the format.
        options: Arguments of the format's function besides the policy.
    """
    entry = FORMATS[check_choice("format", format, FORMATS)]
    for option in options:
        if not entry.options:
            raise InvalidArgumentError(f"format {format} takes no options, got {option!r}")
        if option not in entry.options:
            raise UnknownNameError(f"option of format {format}", option, entry.options)
    return entry.function(check_kind("policy", policy, TreePolicy), **options)
