"""Exports read by the tools of others; see docs/exports.md.

blark is in the lock of the tests. The others are large, or have to be built, and are
asked where they are: ``MATIEC`` names a folder with a built matiec (``iec2c`` and ``lib``).
"""

import ctypes
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from eutree.export import to_latex, to_structured_text
from eutree.export.c import probes
from eutree.policies import TreePolicy
from eutree.schema import Control, Feature, Schema
from tests.export.policies import EVASION, NASTY, policy_of, tree
from tests.patience import ENOUGH

CONTROLS = (Control("valve", "%", (0.0, 50.0)),)
BLOCK = Schema((Feature("level"), Feature("integral")), ("shut", "open"), CONTROLS)
NAMES = Schema(tuple(Feature(name, name) for name in NASTY), tuple(NASTY))
POLICIES = {
    "one leaf": policy_of(tree(1, 3), EVASION),
    "30 leaves": policy_of(tree(30, 3, seed=1), EVASION),
    "200 leaves": policy_of(tree(200, 8, seed=2)),
    "any names": policy_of(tree(40, len(NASTY), seed=3), NAMES),
}
each_policy = pytest.mark.parametrize("policy", POLICIES.values(), ids=POLICIES.keys())


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


def test_blark_parses_what_remembers_the_step_before() -> None:
    blark = pytest.importorskip("blark")
    schema = BLOCK.derive(["rise = level - last(level)"])
    content = to_structured_text(policy_of(tree(6, 3), schema))
    assert "FUNCTION_BLOCK decide" in content
    assert blark.parse_source_code(content).exception is None
    assert blark.parse_source_code(content.replace("_index", "")).exception is not None


@pytest.mark.parametrize("name", ["final", "private", "interface", "continue", "jmp", "property"])
def test_blark_parses_names_that_are_words_of_the_language(name: str) -> None:
    blark = pytest.importorskip("blark")
    content = to_structured_text(policy_of(tree(2, 1), Schema((Feature(name),), ("a", "b"))))
    assert blark.parse_source_code(content).exception is None


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
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=ENOUGH)
    assert (tmp_path / "tree.pdf").stat().st_size > 1000
