"""The published schemas are those of the code, and describe the golden files."""

import importlib.util
import io
import json
import sys
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "tests" / "golden"
SCRIPT = ROOT / "docs" / "formats" / "make_schemas.py"


@pytest.fixture(scope="module")
def make_schemas():
    spec = importlib.util.spec_from_file_location("make_schemas", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.skipif(
    version("msgspec").split(".") < ["0", "22"] or sys.version_info >= (3, 13),
    reason="older msgspec and newer Python word a schema's descriptions otherwise",
)
def test_the_schemas_are_current(make_schemas):
    assert make_schemas.stale() == []


def test_every_document_is_published_and_described(make_schemas):
    page = (SCRIPT.parent / "index.md").read_text()
    for name in make_schemas.texts():
        assert f"({name})" in page, f"docs/formats/index.md must link {name}"


def matches(value, schema, definitions):
    """A small validator of what the schemas use, to keep the project free of one more package."""
    if "$ref" in schema:
        return matches(value, definitions[schema["$ref"].rpartition("/")[2]], definitions)
    if "anyOf" in schema:
        return any(matches(value, s, definitions) for s in schema["anyOf"])
    if "const" in schema:
        return value == schema["const"]
    if "enum" in schema:
        return value in schema["enum"]
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}
    kind = schema.get("type")
    if kind in ("number", "integer"):
        types = (int,) if kind == "integer" else (int, float)
        return (
            isinstance(value, types)
            and not isinstance(value, bool)
            and schema.get("minimum", value) <= value
        )
    if kind is not None and not isinstance(value, kinds[kind]):
        return False
    if kind == "array":
        return all(matches(v, schema.get("items", {}), definitions) for v in value)
    if kind == "object":
        properties = schema.get("properties", {})
        if not set(schema.get("required", ())) <= set(value):
            return False
        if schema.get("additionalProperties") is False and not set(value) <= set(properties):
            return False
        return all(matches(v, properties.get(k, {}), definitions) for k, v in value.items())
    return True


def golden_documents():
    for path in sorted(GOLDEN.glob("v*/**/*")):
        if path.suffix == ".json":
            yield path.name, path.read_bytes()
        elif path.suffix == ".npz" and path.stem.startswith(("episode", "checkpoint")):
            with zipfile.ZipFile(io.BytesIO(path.read_bytes())) as archive:
                yield path.name, archive.read("document.json")


@pytest.mark.promise(6)
@pytest.mark.parametrize(("name", "data"), list(golden_documents()))
def test_golden_files_match_the_schemas(make_schemas, name, data):
    document = json.loads(data)
    file = f"{document['format'].removeprefix('eutree/')}.json"
    schema = json.loads(make_schemas.texts()[file])
    if not schema["title"].endswith(f"version {document['version']}"):
        pytest.skip("a file of an older version; the schemas are those of the present one")
    assert matches(document, schema, schema["$defs"])
    assert not matches({**document, "more": 1}, schema, schema["$defs"])
    for key in document:
        if key in schema["$defs"][schema["$ref"].rpartition("/")[2]]["required"]:
            fewer = {k: v for k, v in document.items() if k != key}
            assert not matches(fewer, schema, schema["$defs"])
