"""What `import eutree` costs: none of the heavy packages, little more than Gymnasium."""

import ast
import importlib.util
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

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


@cache
def loaded(package: str) -> set[str]:
    """Return the modules that a fresh interpreter has loaded with a package."""
    return set(run(f"import sys, {package}; print(*sys.modules)").split())


def test_import_loads_no_heavy_package() -> None:
    assert HEAVY & loaded("eutree") == HEAVY & loaded("gymnasium")


def test_help_loads_no_heavy_package() -> None:
    code = (
        "import sys\nfrom eutree.cli.main import run\nrun(['--help'])\n"
        "print([m for m in 'numba joblib scipy sklearn matplotlib'.split() if m in sys.modules])"
    )
    assert run(code).splitlines()[-1] == "[]"


def test_commands_that_only_read_a_tree_load_no_compiler() -> None:
    policy = str(ROOT / "src/eutree/zoo/trees/MountainCar-v0-4.json")
    reading = [["show", policy], ["export", policy, "--format", "c"], ["diff", policy, policy]]
    code = (
        f"import sys\nfrom eutree.cli.main import run\nfor command in {[*reading, ['zoo']]!r}:\n"
        "    code = run(command)\n    print()\n"
        "    loaded = [m for m in 'numba joblib scipy sklearn'.split() if m in sys.modules]\n"
        "    print('after', command[0], code, loaded)\n"
    )
    after = [line for line in run(code).splitlines() if line.startswith("after ")]
    assert after == [f"after {name} 0 []" for name in ("show", "export", "diff", "zoo")]


def test_import_loads_little_more_than_gymnasium() -> None:
    """350 modules beside 303: counted, because a time depends on who else uses the machine."""
    assert len(loaded("eutree")) < 1.25 * len(loaded("gymnasium"))


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
