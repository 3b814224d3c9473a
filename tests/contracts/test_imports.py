"""What `import eutree` costs: none of the heavy packages, little more than Gymnasium."""

import ast
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import ENOUGH

ROOT = Path(__file__).parents[2]
HEAVY = {
    "PIL",
    "h5py",
    "joblib",
    "matplotlib",
    "minari",
    "numba",
    "onnx",
    "onnxruntime",
    "pygame",
    "rich",
    "scipy",
    "sklearn",
    "tensorboardX",
    "websockets",
}


def run(code: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
        timeout=ENOUGH,
    ).stdout


def test_import_loads_no_heavy_package() -> None:
    heavy = run(f"import sys, eutree; print(sorted({HEAVY!r} & sys.modules.keys()))")
    gymnasium = run(f"import sys, gymnasium; print(sorted({HEAVY!r} & sys.modules.keys()))")
    assert heavy == gymnasium


def test_help_loads_no_heavy_package() -> None:
    code = (
        "import sys\nfrom eutree.cli.main import run\nrun(['--help'])\n"
        "print([m for m in 'numba joblib scipy sklearn matplotlib'.split() if m in sys.modules])"
    )
    assert run(code).splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    "command",
    [
        "['show', POLICY]",
        "['export', POLICY, '--format', 'c']",
        "['diff', POLICY, POLICY]",
        "['zoo']",
    ],
    ids=["show", "export", "diff", "zoo"],
)
def test_commands_that_only_read_a_tree_load_no_compiler(command: str) -> None:
    policy = ROOT / "src/eutree/zoo/trees/MountainCar-v0-4.json"
    code = (
        f"import sys\nfrom eutree.cli.main import run\nPOLICY = {str(policy)!r}\n"
        f"code = run({command})\nprint()\n"
        "print(code, [m for m in 'numba joblib scipy sklearn'.split() if m in sys.modules])"
    )
    assert run(code).splitlines()[-1] == "0 []"


def test_import_loads_little_more_than_gymnasium() -> None:
    """350 modules beside 303: counted, because a time depends on who else uses the machine."""

    def modules(package: str) -> int:
        return int(run(f"import sys, {package}; print(len(sys.modules))"))

    assert modules("eutree") < 1.25 * modules("gymnasium")


def test_what_benchmarks_pages_and_examples_import_is_there() -> None:
    """Nothing else imports them before the day when a figure is renewed."""
    folders = [ROOT / name for name in ("benchmarks", "docs", "examples")]
    missing = set()
    for path in sorted(path for folder in folders for path in folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            module = node.module or "" if isinstance(node, ast.ImportFrom) else ""
            if module.startswith(("eutree.", "eutree_lab.")) and not exists(module):
                missing.add((path.name, module))
    assert missing == set()


def exists(module: str) -> bool:
    """Return whether a module can be imported; a parent that is none has no children."""
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def test_a_missing_module_is_seen() -> None:
    assert exists("eutree.training.learn")
    assert not exists("eutree.training.callbacks")
    assert not exists("eutree.nowhere.at_all")
