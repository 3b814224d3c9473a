"""The largest hostile files that pass the caps stay below 1 GB of memory."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

COMMON = """
import io, struct, sys, zipfile, zlib
from pathlib import Path
import numpy as np
from eutree.data import Demonstrations
from eutree.data.csv_files import MAX_EPISODES, MAX_NUMBERS
from eutree.data.journal import recover_episode
from eutree.errors import FormatError
from eutree.files.arrays import MAX_ARCHIVE
from eutree.files.documents import MAX_DOCUMENT
from eutree.data.journal import MAGIC, MAX_JOURNAL
from eutree.policies import TreePolicy
from tests.files.loaders import GOLDEN, limit_memory
import eutree.data.csv_files, eutree.data.npz_files
path = Path(sys.argv[1])
"""

HOSTILE = {
    "nested lists": """
data = (GOLDEN / "policy.json").read_bytes()
room = MAX_DOCUMENT - len(data) - 100
data = data.replace(b'{"opponent_speed":4.2}', b'{"a":[' + b"[]," * (room // 3) + b"[]]}")
load = TreePolicy.load
""",
    "many nodes": """
data = (GOLDEN / "policy.json").read_bytes()
start, end = data.split(b'"nodes": [')
room = MAX_DOCUMENT - len(data) - 100
data = start + b'"nodes": [' + b"{}," * (room // 3) + end
load = TreePolicy.load
""",
    "many small rows": """
data = b"episode,action,x\\n" + b"0,0,1\\n" * (MAX_NUMBERS // 3)
load = Demonstrations.from_csv
""",
    "many small episodes": """
data = b"episode,action,x\\n" + b"".join(b"%d,0,1\\n" % k for k in range(MAX_EPISODES + 1))
load = Demonstrations.from_csv
""",
    "compressed bytes": """
n = MAX_ARCHIVE // 16 - 100
buffer = io.BytesIO()
np.savez_compressed(buffer, obs=np.zeros((n, 1), "i1"), acts=np.zeros(n, "i1"))
data = buffer.getvalue()
load = Demonstrations.from_npz
""",
    "compressed bytes, too many": """
buffer = io.BytesIO()
np.savez_compressed(buffer, obs=np.zeros((MAX_ARCHIVE // 2, 1), "i1"), acts=np.zeros(9, "i1"))
data = buffer.getvalue()
load = Demonstrations.from_npz
""",
    "small records": """
import msgspec
pack = lambda b: struct.pack("<II", len(b), zlib.crc32(b)) + b
head = (GOLDEN / "running.journal").read_bytes()
head = head[: 16 + struct.unpack_from("<I", head, 8)[0]]
names = {chr(97 + k): [] for k in range(16)}
record = pack(msgspec.msgpack.encode([1, 1.0, [0.0, 0.0], False, False, names]))
data = head + record * ((MAX_JOURNAL - len(head)) // len(record))
load = recover_episode
""",
}

MEASURE = """
path.write_bytes(data)
del data
limit_memory()
try:
    load(path)
except FormatError as error:
    print(error)
print("survived")
"""


@pytest.mark.promise(2)
@pytest.mark.slow
@pytest.mark.usefixtures("proc")  # there is no limit without
@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", HOSTILE)
def test_the_caps_keep_memory_below_1_gb(tmp_path, name):
    done = subprocess.run(
        [sys.executable, "-c", COMMON + HOSTILE[name] + MEASURE, str(tmp_path / "file.npz")],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"src{os.pathsep}."},
        capture_output=True,
        text=True,
    )
    assert done.stdout.endswith("survived\n"), done.stderr[-2000:]
