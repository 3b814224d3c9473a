"""The page of messages quotes the sources: every warning is there, and nothing that is not said."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "messages.md"
OF_PARTS = {"Did you mean", "unknown environment"}  # made of a kind and a name


def texts(tree: ast.AST) -> str:
    """Return all constant text under a node, one piece after another."""
    found = [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant)]
    return " ".join(part for part in found if isinstance(part, str))


def sources() -> dict[Path, ast.Module]:
    return {p: ast.parse(p.read_text()) for p in sorted((ROOT / "src").rglob("*.py"))}


def quoted() -> list[str]:
    return re.findall(r"^\| `([^`]+)` \|", PAGE.read_text(), re.MULTILINE)


def test_what_the_page_quotes_is_said() -> None:
    said = " ".join(" ".join(p.read_text().split()) for p in (ROOT / "src").rglob("*.py"))
    joined = re.sub(r'" f?"', "", said)  # a sentence goes on in the next line of source
    assert [text for text in quoted() if text not in joined and text not in OF_PARTS] == []
    assert len(quoted()) > 25


def test_every_warning_is_on_the_page() -> None:
    page = quoted()
    missing = []
    for path, tree in sources().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "warnings.warn":
                words = " ".join(texts(node.args[0]).split())
                about = any(text in words for text in page)
                if not about and not isinstance(node.args[0], ast.Name):
                    missing.append((path.name, words))
    assert [one for one in missing if not one[1].startswith(":")] == []
