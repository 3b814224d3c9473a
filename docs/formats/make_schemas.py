"""Write the JSON schema of every document into this folder, or check that they are current.

python docs/formats/make_schemas.py [--check]
"""

import importlib
import json
import sys
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parents[1] / "src"))

import msgspec  # noqa: E402

from eutree.files.documents import Document  # noqa: E402


def document_types() -> list[type[Document]]:
    """Return every kind of document that some module of the two packages defines."""
    sources = FOLDER.parents[1] / "src"
    for path in sorted(sources.rglob("*.py")):
        if "(Document," in path.read_text():
            parts = path.relative_to(sources).with_suffix("").parts
            importlib.import_module(".".join(parts))
    return sorted(_subclasses(Document), key=lambda kind: kind.FORMAT)


def schema_of(kind: type[Document]) -> dict[str, Any]:
    """Return the JSON schema of one kind, its header made exact."""
    schema = msgspec.json.schema(kind)
    body = schema["$defs"][kind.__name__]
    body["properties"] |= {
        "format": {"const": kind.FORMAT},
        "version": {"const": kind.VERSION},
        "made_by": {"type": "string"},
    }
    body["required"] = ["format", "version", "made_by", *body.get("required", [])]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"{kind.FORMAT}, version {kind.VERSION}",
        **schema,
    }


def file_name(kind: type[Document]) -> str:
    """Return the name of the schema's file."""
    return f"{kind.FORMAT.removeprefix('eutree/').replace('/', '-')}.json"


def texts() -> dict[str, str]:
    """Return what each file must hold."""
    kinds = [
        kind for kind in document_types() if kind.__module__.startswith(("eutree.", "eutree_lab."))
    ]
    return {
        file_name(kind): json.dumps(schema_of(kind), indent=2, sort_keys=True) + "\n"
        for kind in kinds
    }


def stale() -> list[str]:
    """Return the names of files that are missing, outdated, or of no document any more."""
    wanted = texts()
    present = {path.name: path.read_text() for path in FOLDER.glob("*.json")}
    names = wanted.keys() | present.keys()
    return sorted(name for name in names if wanted.get(name) != present.get(name))


def _subclasses(kind: type[Document]) -> list[type[Document]]:
    return [c for child in kind.__subclasses__() for c in (child, *_subclasses(child))]


if __name__ == "__main__":
    if "--check" in sys.argv:
        sys.exit(f"run docs/formats/make_schemas.py; stale: {old}" if (old := stale()) else 0)
    for name, text in texts().items():
        (FOLDER / name).write_text(text)
