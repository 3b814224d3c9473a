"""One pure function per format: a ``TreePolicy`` in, text or bytes out, the same decisions.

Every format follows the rule of the tree: ``x <= threshold`` goes left, everything else, NaN
included, goes right. No format changes a threshold; where a number type is too narrow to hold one,
it is moved to the next number of that type at which no decision changes.
"""

from eutree.export.c import to_c, to_c_header
from eutree.export.c_test import to_c_test
from eutree.export.latex import to_latex
from eutree.export.onnx import to_onnx
from eutree.export.python import to_python
from eutree.export.registry import FORMATS, ExportFormat, export, to_dot, to_json, to_text
from eutree.export.structured_text import to_structured_text
from eutree.export.svg import to_svg

__all__ = [
    "FORMATS",
    "ExportFormat",
    "export",
    "to_c",
    "to_c_header",
    "to_c_test",
    "to_dot",
    "to_json",
    "to_latex",
    "to_onnx",
    "to_python",
    "to_structured_text",
    "to_svg",
    "to_text",
]
