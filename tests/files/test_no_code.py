"""A file can never run code: no module can unpickle or evaluate, and loading never does."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "src").rglob("*.py"))

FORBIDDEN_MODULES = {"pickle", "_pickle", "cPickle", "marshal", "shelve", "dill", "cloudpickle"}
FORBIDDEN_CALLS = {"eval", "exec", "compile", "__import__"}
# Files are read and written in eutree.files only; the others open no data file.
MAY_OPEN = {
    "eutree/cli/_output.py": "standard output itself, under another descriptor",
    "eutree/training/run_folder.py": "the lock of a run folder",
    "eutree/cli/main.py": "the null device, for standard output that is closed or broken",
}


def sins(source, *, may_open=False):
    """Return what is forbidden in a module, as text with line numbers."""
    found = []
    for node in ast.walk(ast.parse(source)):
        line = getattr(node, "lineno", 0)
        if isinstance(node, ast.Import):
            names = {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names = {(node.module or "").split(".")[0]}
        else:
            names = set()
        found += [f"{line}: import {name}" for name in names & FORBIDDEN_MODULES]
        if not isinstance(node, ast.Call):
            continue
        called = node.func
        if isinstance(called, ast.Name) and called.id in FORBIDDEN_CALLS:
            found.append(f"{line}: {called.id}()")
        if any(k.arg == "allow_pickle" and getattr(k.value, "value", 1) for k in node.keywords):
            found.append(f"{line}: allow_pickle")
        if not may_open and _opens(called):
            found.append(f"{line}: {ast.unparse(called)}() outside eutree.files")
    return found


def _opens(called):
    if isinstance(called, ast.Name):
        return called.id == "open"
    if not isinstance(called, ast.Attribute):
        return False
    of = ast.unparse(called.value)
    if called.attr in ("load", "save", "savez", "savez_compressed", "memmap", "fromfile"):
        return of in ("np", "numpy", "json", "joblib")
    if called.attr in ("open", "fdopen"):
        return of in ("os", "io") or "path" in of.lower()
    return called.attr in ("write_text", "write_bytes") and of not in (
        "atomic",
        "files",
        "formatter",
    )


@pytest.mark.promise(1)
def test_no_module_can_unpickle_evaluate_or_open_on_its_own():
    found = {}
    for path in SOURCES:
        name = path.relative_to(ROOT / "src").as_posix()
        may_open = name.startswith("eutree/files/") or name in MAY_OPEN
        if bad := sins(path.read_text(), may_open=may_open):
            found[name] = bad
    assert found == {}


@pytest.mark.promise(1)
@pytest.mark.parametrize(
    "source",
    [
        "import pickle",
        "from cloudpickle import loads",
        "eval('1')",
        "exec(x)",
        "np.load(p, allow_pickle=True)",
        "np.load(p, allow_pickle=flag)",
        "open('x', 'w')",
        "Path('x').write_text('y')",
        "path.open()",
    ],
)
def test_the_scan_finds_each_sin(source):
    assert sins(source)


AUDIT = """
import json, sys, tempfile
from pathlib import Path
from eutree.errors import FormatError
from tests.files.loaders import LOADERS, prepare

corpus = sorted(Path("tests/corpus").glob("*/*"))
folder = Path(sys.argv[1])
loaders = {}
for kind in LOADERS:
    (folder / kind).mkdir()
    path, valid, load, _ = prepare(kind, folder / kind)
    path.write_bytes(valid)
    load(path)  # imports whatever is imported lazily
    path.write_bytes(valid[:-9])
    try:
        load(path)
    except FormatError:
        pass
    loaders[kind] = (path, load, valid)

events = []
armed = False
FORBIDDEN = ("exec", "compile", "import", "subprocess.", "socket.", "os.system", "os.exec",
             "os.posix_spawn", "os.spawn", "os.fork", "pickle.", "marshal.", "ctypes.",
             "os.remove", "os.rename", "os.rmdir", "shutil.", "os.chmod")

def hook(event, arguments):
    if not armed:
        return
    if event == "open":
        _, mode, flags = arguments
        writes = isinstance(mode, str) and any(c in mode for c in "wax+") or flags & 3
        if writes:
            events.append(f"open to write {arguments}")
    elif event.startswith(FORBIDDEN):
        events.append(f"{event} {arguments}")

sys.addaudithook(hook)

def watched(load, path):
    global armed
    armed = True
    try:
        load(path)
    except FormatError:
        pass
    finally:
        armed = False

count = 0
for kind, (path, load, valid) in loaders.items():
    for content in [valid, *(p.read_bytes() for p in corpus if p.parent.name == kind)]:
        path.write_bytes(content)
        watched(load, path)
        count += 1
seen = list(events)
events.clear()
import pickle
class Evil:
    def __reduce__(self):
        import os
        return os.system, ("true",)
content = pickle.dumps(Evil())
watched(lambda path: pickle.loads(content), "")
print(json.dumps({"count": count, "events": seen, "control": events}))
"""


@pytest.mark.promise(1)
def test_loading_executes_imports_and_writes_nothing(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", AUDIT, str(tmp_path)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"src{os.pathsep}."},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["count"] > 60
    assert found["events"] == []
    assert any("os.system" in event for event in found["control"])
