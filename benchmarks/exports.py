"""Time and size of exported C: nanoseconds a decision on this machine, bytes on a microcontroller.

Trees of 30 leaves over 8 features, grown on random data; the middle of several trees is shown.
Time: thread CPU time of one million decisions in random order, compiled with gcc -O2, the function
in a translation unit of its own. Beside it, in the same run, the peer: the usual walk over arrays
of nodes in C. Size: text and read-only data of the object file, action names included.

Run: python benchmarks/exports.py [--trees 5] [--leaves 30]
"""

import argparse
import re
import shutil
import statistics
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from eutree.export import to_c
from eutree.export._c_numbers import hexadecimal
from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema
from eutree.trees import DecisionTree

N_FEATURES, N_ROWS, N_ROUNDS = 8, 4096, 250
TARGETS = {
    "cortex-m0": ("-mcpu=cortex-m0", "-mthumb"),
    "cortex-m4": ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"),
}

HARNESS = """\
#define _POSIX_C_SOURCE 199309L
#include <stdint.h>
#include <stdio.h>
#include <time.h>

int decide(const {c_type} *observation);
static {c_type} rows[{n_rows}][{n_features}];

int main(void)
{{
    struct timespec begin, end;
    uint64_t state = 88172645463325252u;
    int round, row, feature, sum = 0;
    for (row = 0; row < {n_rows}; row++) {{
        for (feature = 0; feature < {n_features}; feature++) {{
            state ^= state << 13; state ^= state >> 7; state ^= state << 17;
            rows[row][feature] = ({c_type})((double)(state % 100000) / 50000.0 * {scale} - {scale});
        }}
    }}
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &begin);
    for (round = 0; round < {n_rounds}; round++) {{
        for (row = 0; row < {n_rows}; row++) {{ sum += decide(rows[row]); }}
    }}
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);
    printf("%f %d\\n", ((double)(end.tv_sec - begin.tv_sec) * 1e9
        + (double)(end.tv_nsec - begin.tv_nsec)) / ({n_rounds}.0 * {n_rows}.0), sum);
    return 0;
}}
"""


def grown(n_leaves: int, seed: int) -> TreePolicy:
    """Return a policy whose tree cuts the largest leaf of random data until it has enough."""
    rng = np.random.default_rng(seed)
    data = rng.uniform(-1, 1, size=(20_000, N_FEATURES))
    tree = DecisionTree.single_leaf(N_FEATURES)
    while tree.n_leaves < n_leaves:
        leaves = tree.leaf_index(data)
        largest = int(np.argmax(np.bincount(leaves)))
        feature = int(rng.integers(N_FEATURES))
        values = data[leaves == largest, feature]
        tree = tree.split(largest, feature, float(np.quantile(values, rng.uniform(0.2, 0.8))))
    features = tuple(Feature(f"x{index}", "", -1.0, 1.0) for index in range(N_FEATURES))
    schema = Schema(features, ("left", "stay", "right"))
    return TreePolicy(tree, rng.integers(0, 3, n_leaves), schema)


def table_walk(policy: TreePolicy) -> str:
    """Return the peer: arrays of nodes and a loop, with the same decisions."""
    tree = policy.tree
    inner = tree.feature >= 0
    thresholds = np.where(inner, tree.threshold, 0.0).tolist()
    actions = np.where(inner, 0, policy.actions[tree.leaf]).tolist()
    columns = {
        "signed char feature": tree.feature.tolist(),
        "double threshold": [hexadecimal(value) for value in thresholds],
        "short left": tree.left.tolist(),
        "short right": tree.right.tolist(),
        "short action": actions,
    }
    tables = [
        f"static const {name}[] = {{{', '.join(map(str, values))}}};"
        for name, values in columns.items()
    ]
    return "\n".join(
        [
            *tables,
            "int decide(const double *observation) {",
            "    int node = 0;",
            "    while (feature[node] >= 0) {",
            "        node = (observation[feature[node]] <= threshold[node])",
            "            ? left[node] : right[node];",
            "    }",
            "    return action[node];",
            "}",
        ]
    )


def nanoseconds(source: str, c_type: str, folder: Path) -> tuple[float, int]:
    """Return the time of a decision and the sum of all of them."""
    (folder / "decide.c").write_text(source)
    harness = HARNESS.format(
        c_type=c_type,
        n_rows=N_ROWS,
        n_features=N_FEATURES,
        n_rounds=N_ROUNDS,
        scale=2.0**30 if c_type == "int32_t" else 1.0,
    )
    (folder / "main.c").write_text(harness)
    command = ["gcc", "-std=c99", "-O2", "decide.c", "main.c", "-o", "run"]
    subprocess.run(command, cwd=folder, check=True)
    times = []
    for _ in range(5):
        output = subprocess.run(["./run"], cwd=folder, check=True, capture_output=True, text=True)
        time, total = output.stdout.split()
        times.append(float(time))
    return min(times), int(total)


def size(source: str, flags: tuple[str, ...], folder: Path) -> int:
    """Return the bytes of code and constants on the target."""
    (folder / "decide.c").write_text(source)
    command = ["arm-none-eabi-gcc", "-std=c99", "-O2", *flags, "-c", "decide.c", "-o", "decide.o"]
    subprocess.run(command, cwd=folder, check=True)
    listing = subprocess.run(
        ["arm-none-eabi-size", "decide.o"], cwd=folder, check=True, capture_output=True, text=True
    ).stdout
    match = re.search(r"^\s*(\d+)\s+(\d+)\s+(\d+)", listing, re.MULTILINE)
    assert match
    return int(match[1]) + int(match[2])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trees", type=int, default=5)
    parser.add_argument("--leaves", type=int, default=30)
    arguments = parser.parse_args()
    policies = [grown(arguments.leaves, seed) for seed in range(arguments.trees)]
    has_cross_compiler = shutil.which("arm-none-eabi-gcc") is not None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ratios = []
        for number, c_type in (("double", "double"), ("float", "float"), ("int32", "int32_t")):
            sources = [to_c(policy, number=number) for policy in policies]
            times = []
            for policy, source in zip(policies, sources, strict=True):
                time, total = nanoseconds(source, c_type, folder)
                times.append(time)
                if number == "double":
                    peer, peer_total = nanoseconds(table_walk(policy), c_type, folder)
                    assert peer_total == total
                    ratios.append(time / peer)
            print(
                f"{number}: {statistics.median(times):.1f} ns a decision (worst {max(times):.1f})"
            )
            if has_cross_compiler:
                for target, flags in TARGETS.items():
                    sizes = [size(source, flags, folder) for source in sources]
                    middle = statistics.median(sizes)
                    print(f"  {target}: {middle:.0f} bytes at -O2 (largest {max(sizes)})")
        print(f"double, time against a walk over arrays: {statistics.median(ratios):.2f}")
    if not has_cross_compiler:
        print("sizes are left out: arm-none-eabi-gcc is not installed")


if __name__ == "__main__":
    main()
