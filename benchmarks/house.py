"""Measure the source as a house: its weight, what a job loads, and two walks through it.

Run: python benchmarks/house.py [--source src] [--packages eutree eutree_lab]
     python benchmarks/house.py --source OLDER/src --packages eutree   # git archive of a commit

Lines are those of the files; code lines have neither blanks, comments nor docstrings. A walk counts
the files, and the packages they are in, in which a function is entered: between two steps of the
environment while ``planning`` gathers, between an episode's last step and the first of the next,
and while demonstrations become a tree in ``fit``. Of many the middle one is told; compiled code
enters no file.
"""

import argparse
import ast
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from statistics import median

import numpy as np

ROOT = Path(__file__).parents[1]
JOBS = {
    "learn": "import eutree; eutree.learn; from eutree.learners import PRESETS",
    "compress": "import eutree; eutree.compress",
    "export": "import eutree; eutree.export.FORMATS",
    "show": "import eutree.cli.show, eutree.report",
}
WALKS = """
import json, sys
import gymnasium, eutree
stack, found, ended = set(), {"step": [], "end": []}, [None]
def follow(frame, event, argument):
    if event == "call" and "/eutree" in frame.f_code.co_filename:
        stack.add(frame.f_code.co_filename.split("/src/")[-1])
class Watched(gymnasium.Wrapper):
    def step(self, action):
        sys.setprofile(None)
        if ended[0] is not None:
            found["end" if ended[0] else "step"].append(sorted(stack))
        told = self.env.step(action)
        ended[0] = told[2] or told[3]
        stack.clear()
        sys.setprofile(follow)
        return told
plain = gymnasium.make("eutree/Evasion2-v0")
shown = eutree.record(plain, eutree.experts.wait_at_crossing, episodes=15, seed=0)
options = {"method": "planning", "episodes": 40, "seed": 0, "evaluation_episodes": 1}
eutree.learn(Watched(plain), demonstrations=shown, **options)
sys.setprofile(None)
stack.clear()
sys.setprofile(follow)
eutree.fit(shown, plain)
sys.setprofile(None)
found = {"step": found["step"][:400], "end": found["end"][:20], "fit": [sorted(stack)]}
print(json.dumps(found))
"""


def trees(source: Path, packages: Iterable[str]) -> list[tuple[str, ast.Module]]:
    """Return the text and the syntax of each module."""
    files = (path for name in packages for path in sorted((source / name).rglob("*.py")))
    return [(text, ast.parse(text)) for text in (path.read_text() for path in files)]


def docstrings(tree: ast.Module) -> list[ast.Constant]:
    """Return all docstrings of a module."""
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    firsts = (node.body[0] for node in ast.walk(tree) if isinstance(node, kinds) and node.body)
    values = (first.value for first in firsts if isinstance(first, ast.Expr))
    return [v for v in values if isinstance(v, ast.Constant) and isinstance(v.value, str)]


def length(node: ast.AST) -> int:
    """Return the lines of a node."""
    return (node.end_lineno or 0) - node.lineno + 1  # type: ignore[attr-defined]


def weight(modules: list[tuple[str, ast.Module]]) -> dict[str, str]:
    """Return the rows of the table of weight."""
    lines = [len(text.splitlines()) for text, _ in modules]
    words, comments, blank, documented = 0, 0, 0, 0
    whats, bodies, parameters, methods = 0, [], [], []
    for text, tree in modules:
        comments += len(re.findall(r"(?m)^\s*#", text))
        blank += sum(not line.strip() for line in text.splitlines())
        for one in docstrings(tree):
            documented += length(one)
            words += len(one.value.split())
            whats += len(
                re.findall(r"\bReturn what\b|\b(somebody|whoever|anew)\b", one.value, re.IGNORECASE)
            )
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                own = [
                    one
                    for one in node.body
                    if not isinstance(getattr(one, "value", 0), ast.Constant)
                ]
                bodies.append((own[-1].end_lineno or 0) - own[0].lineno + 1 if own else 0)
                given = node.args
                parameters.append(len(given.posonlyargs + given.args + given.kwonlyargs))
            elif isinstance(node, ast.ClassDef):
                methods.append(sum(isinstance(one, ast.FunctionDef) for one in node.body))
    code = sum(lines) - comments - blank - documented
    low, high = np.percentile(bodies, [50, 90]).astype(int)
    return {
        "lines / code lines": f"{sum(lines):,} / {code:,}",
        "modules; under 40 / under 70 lines": (
            f"{len(lines)}; {sum(n < 40 for n in lines)} / {sum(n < 70 for n in lines)}"
        ),
        "body median / p90 / max": f"{low} / {high} / {max(bodies)}",
        "functions with > 5 / > 10 parameters": (
            f"{sum(n > 5 for n in parameters)} / {sum(n > 10 for n in parameters)}"
        ),
        "classes; with > 12 methods; most": (
            f"{len(methods)}; {sum(n > 12 for n in methods)}; {max(methods)}"
        ),
        "comments per 1,000 code lines": f"{1000 * comments / code:.0f}",
        '"Return what", "somebody", "whoever", "anew" per 1,000 docstring words': (
            f"{1000 * whats / words:.1f}"
        ),
    }


def answer(source: Path, code: str) -> str:
    """Return the last line that a fresh interpreter prints with this source."""
    known = os.environ | {"PYTHONPATH": str(source.resolve())}
    done = subprocess.run(
        [sys.executable, "-c", code], env=known, capture_output=True, text=True, check=False
    )
    sys.stderr.write(done.stderr)
    return done.stdout.splitlines()[-1] if done.returncode == 0 else ""


def loads(source: Path) -> dict[str, str]:
    """Return how many of our modules each job loads."""
    count = "\nimport sys; print(sum(m.partition('.')[0][:6] == 'eutree' for m in sys.modules))"
    return {
        f"modules that `{job}` loads": answer(source, code + count) or "-"
        for job, code in JOBS.items()
    }


def walks(source: Path) -> dict[str, str]:
    """Return the files and packages that the middle walk of each kind enters."""
    found = json.loads(answer(source, WALKS) or "{}")
    told = {"step": "an observation's step", "end": "an episode's end", "fit": "`fit`"}
    return {f"files (packages) of {told[kind]}": middle(sets) for kind, sets in found.items()}


def middle(sets: list[list[str]]) -> str:
    """Return the files and packages of the set whose size is in the middle."""
    files = int(median(len(one) for one in sets))
    rooms = median(len({str(Path(name).parent) for name in one}) for one in sets)
    return f"{files} ({rooms:.0f})"


def main() -> None:
    """Print the table."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--source", type=Path, default=ROOT / "src")
    asked.add_argument("--packages", nargs="+", default=["eutree", "eutree_lab"])
    given = asked.parse_args()
    rows = weight(trees(given.source, given.packages))
    for name, value in (rows | loads(given.source) | walks(given.source)).items():
        print(f"| {name} | {value} |")


if __name__ == "__main__":
    main()
