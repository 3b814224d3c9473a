"""One reader per format: from the exported content back to a function that decides.

The readers know nothing of the tree: they read names, thresholds and branches from the content
alone, and look the names up in the schema, so an export that changes a name fails to be read.
"""

import ctypes
import json
import math
import re
import subprocess
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eutree.policies import TreePolicy
from eutree.schema import Schema
from tests.export.structured_text import Program
from tests.export.tools import need

Decide = Callable[[np.ndarray], list[int]]

C_FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")


def compiled_c(
    source: str, directory: Path, *, flags: Sequence[str] = ("-O2",), stem: str = "policy"
) -> ctypes.CDLL:
    path, library = directory / f"{stem}.c", directory / f"{stem}{''.join(flags)}.so"
    path.write_text(source, encoding="utf-8")
    command = [need("gcc"), *C_FLAGS, *flags, "-shared", "-fPIC", str(path), "-o", str(library)]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return ctypes.CDLL(str(library))


def c_decide(library: ctypes.CDLL, dtype: type = np.float64, name: str = "decide") -> Decide:
    function = getattr(library, name)

    def decide(observations: np.ndarray) -> list[int]:
        rows = np.ascontiguousarray(observations, dtype=dtype)
        return [function(row.ctypes.data_as(ctypes.c_void_p)) for row in rows]

    return decide


def read_c(content: str, policy: TreePolicy) -> Decide:
    with tempfile.TemporaryDirectory() as folder:
        library = compiled_c(content, Path(folder))
    table = (ctypes.c_char_p * policy.schema.n_actions).in_dll(library, "decide_actions")
    expected = [name.encode("utf-8", "surrogatepass") for name in policy.schema.actions]
    assert [entry.split(b"\0")[0] for entry in table] == [name.split(b"\0")[0] for name in expected]
    return c_decide(library)


def read_python(content: str, policy: TreePolicy) -> Decide:
    assert "import" not in re.sub(r"#.*|'.*'", "", content)
    module: dict = {}
    exec(compile(content, "policy", "exec"), module)
    assert module["FEATURES"] == policy.schema.feature_names
    assert module["UNITS"] == tuple(feature.unit for feature in policy.schema.features)
    assert module["ACTIONS"] == policy.schema.actions
    return lambda observations: [module["decide"](row) for row in observations.tolist()]


@dataclass
class Node:
    """A node that was read: a test with two branches, or an action."""

    feature: int = -1
    threshold: float = 0.0
    yes: "Node | None" = None
    no: "Node | None" = None
    action: int = -1

    def decide(self, row: Sequence[float]) -> int:
        node = self
        while node.feature >= 0:
            child = node.yes if row[node.feature] <= node.threshold else node.no
            assert child is not None
            node = child
        return node.action


def name_in(words: str) -> str:
    return json.loads(words) if words.startswith('"') else words


def read_label(words: str, schema: Schema) -> Node:
    """Return the node that a label describes: "name <= number unit" (or <), or an action."""
    match = re.fullmatch(r"(.*?) (<=?) (\S+)(?: (.*))?", words)
    if match is None:
        return Node(action=schema.actions.index(name_in(words)))
    feature = schema.feature_names.index(name_in(match[1]))
    assert name_in(match[4] or "") == schema.features[feature].unit or match[4] is None
    number = float(match[3])
    threshold = number if match[2] == "<=" else math.nextafter(number, -math.inf)
    return Node(feature=feature, threshold=threshold)


def decide_by(root: Node) -> Decide:
    return lambda observations: [root.decide(row) for row in observations.tolist()]


def read_text(content: str, policy: TreePolicy) -> Decide:
    lines = content.rstrip("\n").split("\n")

    def block(start: int, level: int) -> tuple[Node, int]:
        line = lines[start]
        assert line.startswith("    " * level)
        words = line[4 * level :]
        if not re.match(r"(else )?if .*:$", words):
            return read_label(words, policy.schema), start + 1
        node = read_label(re.sub(r"^(else )?if ", "", words)[:-1], policy.schema)
        node.yes, after = block(start + 1, level + 1)
        if lines[after] == "    " * level + "else:":
            node.no, after = block(after + 1, level + 1)
        else:
            assert lines[after].startswith("    " * level + "else if ")
            node.no, after = block(after, level)
        return node, after

    root, end = block(0, 0)
    assert end == len(lines)
    return decide_by(root)


def read_graph(labels: dict[str, str], edges: list[tuple[str, str, str]], schema: Schema) -> Decide:
    nodes = {key: read_label(label, schema) for key, label in labels.items()}
    for parent, child, answer in edges:
        assert answer in ("yes", "no")
        assert getattr(nodes[parent], answer) is None
        setattr(nodes[parent], answer, nodes[child])
    assert len(edges) == len(nodes) - 1
    return decide_by(nodes["n0"])


def read_dot(content: str, policy: TreePolicy) -> Decide:
    string = r'"((?:[^"\\]|\\.)*)"'
    labels, edges = {}, []
    for line in content.splitlines()[4:-1]:
        edge = re.fullmatch(rf"    (n\d+) -> (n\d+) \[label={string}\];", line)
        node = re.fullmatch(rf"    (n\d+) \[label={string}(?:, \w+={string})*\];", line)
        if edge:
            edges.append((edge[1], edge[2], edge[3]))
        else:
            assert node, line
            labels[node[1]] = re.sub(r"\\(.)", r"\1", node[2]).replace("&amp;", "&")
    return read_graph(labels, edges, policy.schema)


def read_latex(content: str, policy: TreePolicy) -> Decide:
    from eutree.export.drawing import _SIGNS

    meanings = {value: key for key, value in _SIGNS.items()} | {r"$\leq$": "<="}
    token = re.compile("|".join(re.escape(text) for text in meanings) + r"|[^\\{}$&#%_^~]")
    labels, edges = {}, []
    for line in content.splitlines():
        node = re.fullmatch(r"  \\node\[[\w, =]+\] \((n\d+)\) at \([^)]*\) \{(.*)\};", line)
        edge = re.fullmatch(
            r"  \\draw\[.*?\] \((n\d+)\.east\) -- node\[answer\] \{(\w+)\} \((n\d+)\.west\);", line
        )
        if node:
            tokens = token.findall(node[2])
            assert "".join(tokens) == node[2]
            labels[node[1]] = "".join(meanings.get(text, text) for text in tokens)
        elif edge:
            edges.append((edge[1], edge[3], edge[2]))
    return read_graph(labels, edges, policy.schema)


def read_svg(content: str, policy: TreePolicy) -> Decide:
    root = ElementTree.fromstring(content)
    space = "{http://www.w3.org/2000/svg}"
    known = {"svg", "title", "style", "path", "text", "g", "rect"}
    assert {element.tag.removeprefix(space) for element in root.iter()} <= known
    nodes, children = {}, {}
    for group in root.iter(f"{space}g"):
        key, title = int(group.attrib["data-node"]), group.findtext(f"{space}title") or ""
        if "data-feature" in group.attrib:
            nodes[key] = read_label(title, policy.schema)
            assert nodes[key].feature == int(group.attrib["data-feature"])
            assert repr(nodes[key].threshold) == group.attrib["data-threshold"]
            children[key] = int(group.attrib["data-yes"]), int(group.attrib["data-no"])
        else:
            nodes[key] = read_label(title.partition(": ")[2], policy.schema)
            assert nodes[key].action == int(group.attrib["data-action"])
    for key, (yes, no) in children.items():
        nodes[key].yes, nodes[key].no = nodes[yes], nodes[no]
    return decide_by(nodes[0])


def read_json(content: str, policy: TreePolicy) -> Decide:
    read = TreePolicy.from_bytes(content.encode("utf-8"))
    assert read == policy
    return lambda observations: read.predict(observations)[0].tolist()


def read_st(content: str, policy: TreePolicy) -> Decide:
    program = Program(content)
    return lambda observations: [program.run(program.main, row) for row in observations.tolist()]


def read_onnx(content: bytes, policy: TreePolicy) -> Decide:
    import onnxruntime

    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    metadata = session.get_modelmeta().custom_metadata_map
    assert tuple(json.loads(metadata["features"])) == policy.schema.feature_names
    assert tuple(json.loads(metadata["actions"])) == policy.schema.actions
    return lambda observations: session.run(["action"], {"observation": observations})[0].tolist()


READERS: dict[str, Callable[..., Decide]] = {
    "c": read_c,
    "onnx": read_onnx,
    "dot": read_dot,
    "svg": read_svg,
    "json": read_json,
    "text": read_text,
    "python": read_python,
    "st": read_st,
    "latex": read_latex,
}
