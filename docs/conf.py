"""Settings of the documentation; `make docs` builds it with warnings as errors."""

import importlib
import inspect
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import click
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import nested_parse_with_titles

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))
sys.path[:0] = [
    str(ROOT / "docs" / name) for name in ("pictures", "notebooks", "results", "reference")
]

# What a package loads when it is asked for (``eutree.lazy``) is on its page, too.
for _name in ("c45", "evaluation", "learners", "recording", "world_model"):
    _package = importlib.import_module(f"eutree.{_name}")
    for _offered in _package.__all__:
        getattr(_package, _offered)

project = "eutree"
author = "the eutree developers"
copyright = "2026, the eutree developers"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
source_suffix = {".md": "markdown", ".ipynb": "notebook"}
exclude_patterns = ["_build"]
nitpicky = True
# References out of eutree have no target here: an inventory of another project's pages would have
# to be fetched while building. Of eutree's own, a class in a signature may be internal.
nitpick_ignore_regex = [
    (r"py:.*", r"(?!eutree).*"),
    (r"py:.*", r"eutree\.(.*\.)?_.*"),
    (r"py:class", r"eutree\.\w+\.\w+\..*"),
]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
math_renderer = "none"

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
python_maximum_signature_line_length = 88
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_attr_annotations = False

html_theme = "furo"
html_title = "eutree"
html_show_sphinx = False
html_copy_source = False
html_static_path = ["static"]
html_css_files = ["pages.css"]


WHOLE = 40  # characters of a word of code that fits on a phone
DATE = re.compile(r"(\d{4}-\d\d-\d\d)")


class Card(SphinxDirective):
    """``{card} module.Class``: the class's docstring, read as a part of this Markdown page.

    Environments describe themselves in Markdown, as Gymnasium's do; autodoc would read it as
    reStructuredText.
    """

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the parsed docstring."""
        module, _, name = self.arguments[0].rpartition(".")
        text = inspect.getdoc(getattr(importlib.import_module(module), name)) or ""
        container = nodes.Element(document=self.state.document)
        nested_parse_with_titles(self.state, StringList(text.splitlines()), container)
        return container.children


class Picture(SphinxDirective):
    """``{picture} flow`` and ``{picture} layers``: drawn while the pages are built."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the drawing, in the page itself so that it has the page's colours."""
        import architecture

        drawings = {"flow": architecture.flow_svg, "layers": architecture.layers_html}
        return [nodes.raw("", drawings[self.arguments[0]](), format="html")]


class ResultsTable(SphinxDirective):
    """``{resultstable}``: each page of figures with what makes it, when, and its commit."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        from provenance import pages

        lines = ["| figures | made by | on | at commit |", "|---|---|---|---|"]
        for name, page in pages().items():
            lines.append(f"| [](./{name}.md) | `{page.command}` | {page.date} | `{page.commit}` |")
        container = nodes.Element(document=self.state.document)
        nested_parse_with_titles(self.state, StringList(lines), container)
        return container.children


class PresetsTable(SphinxDirective):
    """``{presetstable}``: each preset, its method, and what it chooses other than the method."""

    def run(self) -> list[nodes.Node]:
        """Return the table, made of the registry."""
        from eutree.learners.registry import METHODS, PRESETS, choices_of

        lines = ["| preset | method | other than the method's own defaults |", "|---|---|---|"]
        for name, preset in PRESETS.items():
            own = {choice.name: choice.value for choice in choices_of(METHODS[preset.name]())}
            changed = [c for c in choices_of(preset) if own.get(c.name, ...) != c.value]
            said = ", ".join(f"`{c.name}={json.dumps(c.value)}`" for c in changed) or "nothing"
            lines.append(f"| `{name}` | `{preset.name}` | {said} |")
        container = nodes.Element(document=self.state.document)
        nested_parse_with_titles(self.state, StringList(lines), container)
        return container.children


class SettingsTable(SphinxDirective):
    """``{settingstable}``: every choice of every method, its default, and what it does."""

    def run(self) -> list[nodes.Node]:
        """Return a section for each method, made of the registry."""
        from eutree.learners.registry import METHODS, choices_of

        lines = []
        for name, kind in METHODS.items():
            lines += [f"## {name}", "", "| setting | default | what it does |", "|---|---|---|"]
            for one in choices_of(kind()):
                text = " ".join(one.text.split()).replace("|", "\\|")
                lines.append(f"| `{one.name}` | `{json.dumps(one.value)}` | {text} |")
            lines.append("")
        container = nodes.Element(document=self.state.document)
        nested_parse_with_titles(self.state, StringList(lines), container)
        return container.children


class MessagesTable(SphinxDirective):
    """``{messages} FAMILY``: each sentence of a family of refusals, as its source has it."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return a list for each package, folded: the page is for looking up, not for reading."""
        from said import packages

        found = packages(self.arguments[0])
        if sum(map(len, found.values())) <= 40:
            found = {"": sorted({text for texts in found.values() for text in texts})}
        return [node for package, texts in found.items() for node in _folded(package, texts)]


def _folded(package: str, texts: list[str]) -> Iterator[nodes.Node]:
    head = f"<code>{package}</code>: {len(texts)}" if package else f"all {len(texts)}"
    listed = nodes.bullet_list("", classes=["messages"])
    for text in texts:
        listed += nodes.list_item("", nodes.paragraph("", "", nodes.literal("", text)))
    yield nodes.raw("", f"<details><summary>{head}</summary>", format="html")
    yield listed
    yield nodes.raw("", "</details>", format="html")


def say_where_figures_come_from(app: Sphinx, name: str, source: list[str]) -> None:
    """Put command, commit and date of a page of figures below its title."""
    from provenance import Provenance

    if not name.startswith("results/") or name == "results/index":
        return
    page, text = Provenance.of(source[0]), source[0].split("---\n", 2)[2]
    line = f"*Made by `{page.command}` at commit `{page.commit}`, {page.date}.*"
    title, rest = text.lstrip("\n").split("\n", 1)
    source[0] = f"{title}\n\n{line}\n{rest}"


def keep_words_whole(app: Sphinx, doctree: nodes.document) -> None:
    """Mark what a browser would break at a hyphen: options in code, and dates in tables."""
    for code in doctree.findall(nodes.literal):
        if max(map(len, code.astext().split()), default=0) <= WHOLE:
            code["classes"].append("whole")
    for text in list(doctree.findall(nodes.Text)):
        parts = DATE.split(text)
        if len(parts) > 1 and isinstance(text.parent, nodes.paragraph) and _in_table(text):
            kept = (
                nodes.inline("", part, classes=["whole"]) if k % 2 else nodes.Text(part)
                for k, part in enumerate(parts)
                if part
            )
            text.parent.replace(text, list(kept))


def stack_settings(app: Sphinx, doctree: nodes.document) -> None:
    """Mark the tables of settings, whose columns stand one below another on a phone."""
    if app.env.docname == "reference/settings":
        for table in doctree.findall(nodes.table):
            table["classes"].append("settings")


def _in_table(node: nodes.Node) -> bool:
    while node is not None and not isinstance(node, nodes.entry):
        node = node.parent
    return node is not None


class CommandHelp(SphinxDirective):
    """``{commandhelp}``: what ``--help`` prints, for every command of the command line."""

    def run(self) -> list[nodes.Node]:
        """Return a section for each command, with its help."""
        from eutree.cli.main import eutree

        lines = [
            line
            for name, text in _helps(eutree, "eutree")
            for line in (f"## {name}", "", "```text", *text.splitlines(), "```", "")
        ]
        container = nodes.Element(document=self.state.document)
        nested_parse_with_titles(self.state, StringList(lines), container)
        return container.children


def _helps(command: click.Command, name: str) -> Iterator[tuple[str, str]]:
    context = click.Context(command, info_name=name, max_content_width=88, terminal_width=88)
    context.meta["eutree.help_all"] = True
    yield name, command.get_help(context)
    if isinstance(command, click.Group):
        for child in command.list_commands(context):
            if found := command.get_command(context, child):
                yield from _helps(found, f"{name} {child}")


def setup(app: Sphinx) -> None:
    """Add what these pages need beyond Sphinx's own."""
    from pages import NotebookParser

    app.add_source_parser(NotebookParser)
    app.add_directive("card", Card)
    app.add_directive("picture", Picture)
    app.add_directive("commandhelp", CommandHelp)
    app.add_directive("resultstable", ResultsTable)
    app.add_directive("presetstable", PresetsTable)
    app.add_directive("settingstable", SettingsTable)
    app.add_directive("messages", MessagesTable)
    app.connect("source-read", say_where_figures_come_from)
    app.connect("doctree-read", keep_words_whole)
    app.connect("doctree-read", stack_settings)
