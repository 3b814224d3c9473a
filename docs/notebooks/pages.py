"""Show notebooks as pages: Markdown cells as they are, code cells with their stored outputs.

A parser of forty lines in place of a package that brings a Jupyter kernel: nothing is run while the
pages are built.
"""

import json
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from myst_parser.parsers.sphinx_ import MystParser


class NotebookParser(MystParser):
    """Reads ``.ipynb`` files by way of Markdown."""

    supported = ("notebook",)

    def parse(self, inputstring: str, document: nodes.document) -> None:
        """Parse a notebook into ``document``."""
        super().parse("\n\n".join(_markdown(json.loads(inputstring))), document)


def _markdown(notebook: dict[str, Any]) -> Iterator[str]:
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            yield source
            continue
        yield f"``````{{code-block}} python\n{source}\n``````"
        for output in cell["outputs"]:
            yield _output(output.get("data", {"text/plain": output.get("text", [])}))


def _output(data: dict[str, list[str]]) -> str:
    for kind in ("text/html", "image/svg+xml"):
        if kind in data:
            content = "".join(data[kind])
            return f'``````{{raw}} html\n<div class="output">{content}</div>\n``````'
    text = "".join(data["text/plain"])
    return f"``````{{code-block}} text\n:class: output\n\n{text}\n``````"
