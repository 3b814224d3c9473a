"""Measure the source as a house: its weight, what a job loads, and two walks through it.

Run: python benchmarks/house.py [--source src] [--packages eutree eutree_lab] [--weight]
     python benchmarks/house.py --source OLDER/src --packages eutree   # git archive of a commit

Lines are those of the files; code lines hold something else than comments and docstrings. Comments
are those that are neither shapes nor suppressions; parameters are counted without ``self``. With
``--weight`` nothing is run: the rows of weight alone, beside the figures of four other packages,
which were measured once, with the same counts, and not by this script. A walk counts
the files, and the packages they are in, in which a function is entered: between two steps of the
environment while ``planning`` gathers, between an episode's last step and the first of the next,
and while demonstrations become a tree in ``fit``. Of many the middle one is told; compiled code
enters no file.
"""

import argparse
import ast
import io
import json
import os
import re
import subprocess
import sys
import tokenize
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
METHODS = {"eutree": "distilled-dqn", "eutree_lab": "vrd"}  # one method of each, with a folder
# Stable-Baselines3, d3rlpy, cleanrl and imitation as they were at the time of 2eb9a72.
OTHERS = {
    "lines / code lines": (
        "15,664 / 8,650", "23,987 / 16,492", "13,042 / 10,587", "16,955 / 9,726"
    ),
    "modules; under 40 / under 70 lines": (
        "64; 16 / 19", "125; 28 / 36", "37; 0 / 0", "78; 14 / 19"
    ),
    "body median / p90 / max": ("4 / 33 / 126", "3 / 21 / 134", "7 / 21 / 58", "5 / 30 / 142"),
    "functions with > 5 / > 10 parameters": ("63 / 22", "81 / 24", "13 / 0", "46 / 9"),
    "classes; with > 12 methods; most": ("120; 9", "317; 13", "118; 0", "108; 4"),
    "comments per 1,000 code lines": ("117", "27", "74", "91"),
    '"what" per 1,000 docstring words': ("0.0", "0.0", "0.0", "0.3"),
    "one method: files, lines": ("DQN 3, 595", "DQN 2, 371", "DQN 1, 248", "DAgger 1, 694"),
}  # fmt: skip
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


def code_and_comments(text: str, tree: ast.Module) -> tuple[int, int]:
    """Return the lines that hold code, and the comments that are no shapes and suppress nothing."""
    held, comments = set(), 0
    nothing = (
        tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER
    )  # fmt: skip
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            comments += not re.match(r"# (\[|noqa|type: ignore)", token.string)
        elif token.type not in nothing:
            held |= set(range(token.start[0], token.end[0] + 1))
    for one in docstrings(tree):
        held -= set(range(one.lineno, (one.end_lineno or 0) + 1))
    return len(held), comments


def weight(modules: list[tuple[str, ast.Module]]) -> dict[str, str]:
    """Return the rows of the table of weight."""
    lines = [len(text.splitlines()) for text, _ in modules]
    words, comments, code, whats, house = 0, 0, 0, 0, 0
    bodies, parameters, methods = [], [], []
    for text, tree in modules:
        held, said = code_and_comments(text, tree)
        code, comments = code + held, comments + said
        for one in docstrings(tree):
            words += len(one.value.split())
            whats += len(re.findall(r"\bwhat\b", one.value, re.IGNORECASE))
            house += len(
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
                given = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
                parameters.append(sum(one.arg not in ("self", "cls") for one in given))
            elif isinstance(node, ast.ClassDef):
                methods.append(sum(isinstance(one, ast.FunctionDef) for one in node.body))
    low, high = np.percentile(bodies, [50, 90]).round().astype(int)
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
        '"what" per 1,000 docstring words': f"{1000 * whats / words:.1f}",
        '"Return what", "somebody", "whoever", "anew" per 1,000 docstring words': (
            f"{1000 * house / words:.1f}"
        ),
    }


def one_method(source: Path, packages: Iterable[str]) -> dict[str, str]:
    """Return the files and lines of a method that has a folder."""
    said = []
    for package in packages:
        name = METHODS[package]
        files = sorted((source / package).rglob(f"{name.replace('-', '_')}/*.py"))
        lines = sum(len(path.read_text().splitlines()) for path in files)
        said += [f"{name} {len(files)}, {lines:,}"] * bool(files)
    return {"one method: files, lines": "; ".join(said)}


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
    asked.add_argument("--weight", action="store_true", help="run nothing")
    given = asked.parse_args()
    rows = weight(trees(given.source, given.packages)) | one_method(given.source, given.packages)
    rows = {name: [value, *OTHERS.get(name, ("",) * 4)] for name, value in rows.items()}
    if not given.weight:
        measured = loads(given.source) | walks(given.source)
        rows |= {name: [value] for name, value in measured.items()}
    for name, values in rows.items():
        print(f"| {name} | {' | '.join(values)} |")


if __name__ == "__main__":
    main()
