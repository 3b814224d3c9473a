"""Exports read by the tools of others; see docs/exports.md.

JPMML and blark are in the lock of the tests. The others are large, or have to be built, and are
asked where they are: ``MATIEC`` names a folder with a built matiec (``iec2c`` and ``lib``).
"""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from eutree.export import to_latex, to_pmml, to_structured_text
from eutree.export._probes import probes
from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from tests.export.policies import EVASION, NASTY, policy_of, tree
from tests.export.tools import need

ENOUGH = 300.0  # seconds
NAMES = Schema(tuple(Feature(name, name) for name in NASTY), tuple(NASTY))
POLICIES = {
    "one leaf": policy_of(tree(1, 3), EVASION),
    "30 leaves": policy_of(tree(30, 3, seed=1), EVASION),
    "200 leaves": policy_of(tree(200, 8, seed=2)),
    "any names": policy_of(tree(40, len(NASTY), seed=3), NAMES),
}
each_policy = pytest.mark.parametrize("policy", POLICIES.values(), ids=POLICIES.keys())


# Java takes over the signals of its process, so it gets one of its own.
JPMML = """
import sys
from pathlib import Path
import jpmml_evaluator, numpy, pandas
for path in map(Path, sys.argv[1:]):
    evaluator = jpmml_evaluator.make_evaluator(str(path)).verify()
    names = path.with_suffix(".names").read_text(encoding="utf-8").split("\\0")
    rows = pandas.DataFrame(numpy.load(path.with_suffix(".npy")), columns=names[:-1])
    found = evaluator.evaluateAll(rows)[names[-1]]
    path.with_suffix(".found").write_text("\\0".join(found), encoding="utf-8")
"""


def test_jpmml_decides_like_the_trees(tmp_path: Path) -> None:
    need("java")
    pytest.importorskip("jpmml_evaluator")
    space, asked = {"p": "http://www.dmg.org/PMML-4_4"}, []
    for number, policy in enumerate(POLICIES.values()):
        path, content = tmp_path / f"{number}.pmml", to_pmml(policy)
        root = ElementTree.fromstring(content.encode())
        names = [field.attrib["name"] for field in root.findall(".//p:DataField", space)]
        scores = [value.attrib["value"] for value in root.findall(".//p:Value", space)]
        rows = probes(policy.tree, n_random=300)
        path.write_text(content, encoding="utf-8")
        path.with_suffix(".names").write_text("\0".join(names), encoding="utf-8")
        np.save(path.with_suffix(".npy"), rows)
        asked.append((path, scores, policy.predict(rows)[0].tolist()))
    paths = [str(path) for path, _, _ in asked]
    subprocess.run([sys.executable, "-c", JPMML, *paths], check=True, timeout=ENOUGH)
    for path, scores, expected in asked:
        found = path.with_suffix(".found").read_text(encoding="utf-8").split("\0")
        assert [scores.index(name) for name in found] == expected


@pytest.mark.slow
@each_policy
def test_matiec_compiles_structured_text_that_decides_like_the_tree(
    policy: TreePolicy, tmp_path: Path
) -> None:
    folder = os.environ.get("MATIEC")
    if folder is None:
        pytest.skip("MATIEC does not name a folder with matiec")
    source = tmp_path / "policy.st"
    source.write_text(to_structured_text(policy), encoding="utf-8")
    command = [f"{folder}/iec2c", "-I", f"{folder}/lib", "-T", str(tmp_path), str(source)]
    subprocess.run(command, check=True, capture_output=True)
    values = ", ".join(f"x[{number}]" for number in range(policy.tree.n_features))
    (tmp_path / "call.c").write_text(
        '#include "POUS.h"\n#include "POUS.c"\n'
        f"int call(const double *x) {{ BOOL eno; return DECIDE(1, &eno, {values}); }}\n"
    )
    library = tmp_path / "call.so"
    compiler = ["gcc", "-O1", "-w", "-shared", "-fPIC", f"-I{folder}/lib/C", "-o", str(library)]
    subprocess.run([*compiler, str(tmp_path / "call.c")], check=True)
    call = ctypes.CDLL(str(library)).call
    rows = probes(policy.tree, n_random=300)
    found = [call(np.ascontiguousarray(row).ctypes.data_as(ctypes.c_void_p)) for row in rows]
    assert found == policy.predict(rows)[0].tolist()


@pytest.mark.parametrize(
    "policy",
    [
        pytest.param(policy, marks=[pytest.mark.slow] if name == "200 leaves" else [], id=name)
        for name, policy in POLICIES.items()
    ],
)
def test_blark_parses_structured_text(policy: TreePolicy) -> None:
    blark = pytest.importorskip("blark")
    content = to_structured_text(policy)
    assert blark.parse_source_code(content).exception is None
    if "THEN" in content:  # the control
        assert blark.parse_source_code(content.replace("THEN", "THN")).exception is not None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["one leaf", "30 leaves"])
def test_latex_typesets_the_picture(name: str, tmp_path: Path) -> None:
    latex = shutil.which("pdflatex")
    if latex is None:
        pytest.skip("pdflatex is not installed")
    picture = to_latex(POLICIES[name])
    opening = r"\documentclass{article}\usepackage[T1]{fontenc}\usepackage{tikz}\begin{document}"
    (tmp_path / "tree.tex").write_text(f"{opening}\n{picture}\\end{{document}}\n")
    command = [latex, "-interaction=nonstopmode", "-halt-on-error", "tree.tex"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=120)
    assert (tmp_path / "tree.pdf").stat().st_size > 1000
