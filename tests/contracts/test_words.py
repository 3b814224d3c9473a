"""One word per concept, no module without a noun, few suppressions and each with a reason."""

import ast
import re
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "src").rglob("*.py"))
FORBIDDEN_NAMES = {"obs", "acts", "rews", "done", "dones", "next_obs", "demo_data"}
FOREIGN_WORDS = {"npz_files.py"}  # reads files of others, whose fields have their names
FORBIDDEN_MODULES = {"utils", "util", "common", "helpers", "helper", "misc", "tools"}
# Of 1,000 words of docstrings: "Return what", "somebody", "whoever" and "anew"; and "what" itself.
MOST_VAGUE, MOST_WHAT = 2.0, 2.0
VAGUE = re.compile(r"\b(?:return what|somebody|whoever|anew)\b", re.IGNORECASE)
WHAT = re.compile(r"\bwhat\b", re.IGNORECASE)
# The glossary has challenger, contest and episode for these. A rival is what users name with
# ``--against``; a candidate is a cut, but for a field of the public ``FitReport``.
OTHER_WORDS = re.compile(r"(?i)(?<![a-z])(rival|contender|candidate|heat)(?:s|ry)?(?![a-z])")
OTHER_MEANINGS = {
    *((f"cli/{name}.py", "rival") for name in ("_policies", "compress", "learn", "measuring")),
    *((f"training/{name}.py", "rival") for name in ("learn", "many", "result")),
    *((f"c45/{name}.py", "candidate") for name in ("_kernels", "growing")),
}
SUPPRESSION = re.compile(r"# (noqa|type: ignore)(.*)")
SUPPRESSION_WITH_REASON = re.compile(
    r"# (noqa: [A-Z]+\d+(, ?[A-Z]+\d+)* - |type: ignore\[[\w, -]+\]  # (?!noqa))\S.*"
)


def identifiers(tree: ast.AST) -> Iterator[tuple[str, int]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr, node.lineno


def test_identifiers_use_the_glossary() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in SOURCES
        for name, line in identifiers(ast.parse(path.read_text()))
        if name.strip("_") in FORBIDDEN_NAMES
        and not (name == "done" and {"cli", "experiments"} & set(path.parts))  # units of work
        and path.name not in FOREIGN_WORDS
    ]
    assert found == []


def words_for_trees(path: Path) -> Iterator[tuple[str, str]]:
    """Yield each other word in names, comments and docstrings, with what it stands in."""
    with path.open() as lines:
        for token in tokenize.generate_tokens(lines.readline):
            if token.type in (tokenize.NAME, tokenize.COMMENT) or token.string.startswith('"""'):
                parted = re.sub(r"(?<=[a-z])(?=[A-Z])|\bn_candidates\b", "_", token.string)
                for word in OTHER_WORDS.findall(parted):
                    yield word.lower(), f"{path}:{token.start[0]}: {token.string.strip()}"


def test_trees_that_compete_have_one_word_each() -> None:
    found: dict[tuple[str, str], list[str]] = {}
    for path in SOURCES:
        for word, where in words_for_trees(path):
            found.setdefault(("/".join(path.parts[-2:]), word), []).append(where)
    assert [where for place in found.keys() - OTHER_MEANINGS for where in found[place]] == []
    assert set(found) == OTHER_MEANINGS  # no exception outlives its use


def test_each_class_name_means_one_thing() -> None:
    classes = Counter(
        node.name
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ClassDef)
    )
    assert len(classes) > 400
    assert [name for name, n in classes.items() if n > 1] == []


def test_modules_are_named_after_nouns() -> None:
    names = {
        part for path in SOURCES for part in path.relative_to(ROOT / "src").with_suffix("").parts
    }
    assert {name.strip("_") for name in names} & FORBIDDEN_MODULES == set()


def suppressions() -> list[str]:
    return [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in SOURCES
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        if SUPPRESSION.search(line)
    ]


def test_suppressions_carry_code_and_reason() -> None:
    assert [line for line in suppressions() if not SUPPRESSION_WITH_REASON.search(line)] == []


def test_suppressions_are_few() -> None:
    lines = sum(len(path.read_text().splitlines()) for path in SOURCES)
    assert len(suppressions()) <= 2 + 2 * lines / 1000, suppressions()


def test_files_are_small() -> None:
    """Compiled loops stay in one file a package and may be longer."""
    sizes = {path: len(path.read_text().splitlines()) for path in SOURCES}
    long = {
        str(path.relative_to(ROOT)): size
        for path, size in sizes.items()
        if size > (700 if path.name.startswith("_kernels") else 500)
    }
    assert long == {}


def test_array_fields_say_their_shape() -> None:
    """Fields of dataclasses that are arrays carry ``# [...]`` on their line."""
    arrays = ("Floats", "Integers", "Int32s", "Booleans", "NDArray")
    found = []
    for path in SOURCES:
        text = path.read_text()
        lines = text.splitlines()
        for definition in ast.walk(ast.parse(text)):
            if isinstance(definition, ast.ClassDef):
                found += [
                    f"{path.relative_to(ROOT)}:{field.lineno}: {lines[field.lineno - 1].strip()}"
                    for field in definition.body
                    if isinstance(field, ast.AnnAssign)
                    and ast.unparse(field.annotation).startswith(arrays)
                    and "# [" not in lines[field.lineno - 1]
                ]
    assert found == []


def docstrings(source: str) -> list[str]:
    kinds = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    nodes = (node for node in ast.walk(ast.parse(source)) if isinstance(node, kinds))
    return [ast.get_docstring(node) or "" for node in nodes]


@pytest.mark.parametrize(("pattern", "most"), [(VAGUE, MOST_VAGUE), (WHAT, MOST_WHAT)])
def test_docstrings_name_the_noun(pattern: re.Pattern[str], most: float) -> None:
    texts = [one for path in SOURCES for one in docstrings(path.read_text())]
    words = sum(len(one.split()) for one in texts)
    assert words > 80_000
    assert 1000 * sum(len(pattern.findall(one)) for one in texts) / words <= most


def test_vague_words_are_found_in_any_case_and_in_async_functions() -> None:
    source = 'async def ask():\n    """Return what Somebody said; whoever asks gets it Anew."""\n'
    assert [len(VAGUE.findall(one)) for one in docstrings(source)] == [0, 4]
