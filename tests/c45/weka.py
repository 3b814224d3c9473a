"""Weka's J48 as an outside oracle: find it, write data sets for it, read its trees."""

import atexit
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from eutree.c45 import C45Tree

ROOT = Path(__file__).parents[2]
DRIVER = Path(__file__).parent / "java" / "J48Trees.java"


@dataclass(frozen=True)
class DataSet:
    """A training set: numbers, codes of nominal values (NaN: unknown), classes."""

    observations: NDArray[np.float64]  # [N, d]
    actions: NDArray[np.int64]  # [N]
    n_classes: int
    n_values: tuple[int, ...]  # [d] 0 for a continuous attribute

    def arff(self) -> str:
        """Return the data set in Weka's format."""
        head = ["@relation data"]
        for j, n in enumerate(self.n_values):
            kind = "{" + ",".join(f"v{v}" for v in range(n)) + "}" if n else "numeric"
            head.append(f"@attribute x{j} {kind}")
        head.append("@attribute class {" + ",".join(f"c{c}" for c in range(self.n_classes)) + "}")
        rows = (
            ",".join([*map(_cell, row, self.n_values), f"c{action}"])
            for row, action in zip(self.observations.tolist(), self.actions, strict=True)
        )
        return "\n".join([*head, "@data", *rows, ""])


def _cell(value: float, n_values: int) -> str:
    if value != value:  # NaN
        return "?"
    return f"v{int(value)}" if n_values else repr(value)


@cache
def jar() -> str:
    """Return the path of weka.jar; skip the test where Java or Weka cannot be had."""
    missing = [tool for tool in ("java", "javac") if shutil.which(tool) is None]
    if not missing:
        if path := os.environ.get("EUTREE_WEKA_JAR"):
            return path
        result = subprocess.run([ROOT / ".ci" / "get-weka"], capture_output=True, text=True)
        if result.returncode == 0:
            return result.stdout.strip()
        missing = [f"weka (.ci/get-weka: {result.stderr.strip()[-200:]})"]
    reason = f"comparing with J48 needs {', '.join(missing)}"
    if os.environ.get("EUTREE_REQUIRE_TOOLS") == "1":
        pytest.fail(reason)
    pytest.skip(reason)


@cache
def _driver(jar: str) -> str:
    """Return a folder with the compiled driver, which stays until the process ends."""
    folder = tempfile.mkdtemp(prefix="eutree-weka-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    subprocess.run(["javac", "-nowarn", "-cp", jar, "-d", folder, DRIVER], check=True)
    return folder


def trees(
    sets: list[DataSet], options: str, folder: Path
) -> list[tuple[list[str], NDArray[np.float64]]]:
    """Return J48's tree of each data set: its nodes in preorder and its probabilities [N, A]."""
    classpath = f"{jar()}{os.pathsep}{_driver(jar())}"
    jobs = []
    for number, data in enumerate(sets):
        path = folder / f"{number}.arff"
        path.write_text(data.arff())
        jobs.append(f"{path}\t{options}\n")
    result = subprocess.run(
        # One stage of compiling: for so short a run the second costs more than it saves.
        ["java", "-Xss64m", "-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1", "-cp", classpath,
         "J48Trees"],
        input="".join(jobs),
        capture_output=True,
        text=True,
        check=True,
    )  # fmt: skip
    lines = result.stdout.splitlines()
    assert len(lines) == len(sets), result.stderr
    found = []
    for line, data in zip(lines, sets, strict=True):
        nodes, shares = line.split("|")
        table = np.array(shares.split(), dtype=float).reshape(-1, data.n_classes)
        found.append((nodes.split(), table))
    return found


def preorder(tree: C45Tree) -> list[str]:
    """Return our tree in the form in which the driver prints J48's."""
    nodes = []
    for node, _ in tree.preorder():
        feature = int(tree.feature[node])
        if feature < 0:
            nodes.append("leaf")
        else:
            nominal = tree.n_values[tree.feature[node]] > 0
            # J48 leaves the largest double as the split point of a nominal test.
            point = 1.7976931348623157e308 if nominal else float(tree.threshold[node])
            nodes.append(f"{feature}:{point!r}:{int(tree.n_children[node])}")
    return nodes


def same_structure(ours: list[str], theirs: list[str]) -> bool:
    """Return whether both trees have the same tests in the same places."""

    def key(node: str) -> tuple[object, ...]:
        if node == "leaf":
            return ()
        feature, point, sons = node.split(":")
        return feature, float(point), sons

    return [key(node) for node in ours] == [key(node) for node in theirs]
