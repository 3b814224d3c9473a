"""Runs on a cluster give the same bytes as runs one after the other: Dask and Ray, on loopback."""

import os
import socket
import subprocess
import sys
import time

import pytest

from eutree.experiments.experiment import SMOKE

LINE = ["reproduce", "expert", "--smoke", "--preset", "paper"]
LEARNING = ["reproduce", "table-2", "--smoke", "--preset", "paper"]


FRAMEWORK = ["reproduce", "framework", "--smoke", "--method", "density-tree"]
MEASURED = ("seconds.json", "framework.md")  # CPU seconds, and the tables that hold them


def files_of(path):
    return {
        p.name: p.read_bytes()
        for p in sorted(path.rglob("*"))
        if p.is_file() and p.name not in MEASURED
    }


def eutree(*arguments):
    """Run the command line in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run(
        [sys.executable, "-m", "eutree", *map(str, arguments)],
        check=True, env=environment, timeout=240, capture_output=True,
    )  # fmt: skip


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


@pytest.fixture
def dask_cluster():
    """Start a scheduler and two worker processes on loopback; return the scheduler's address."""
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    commands = [
        [*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"],
        *[
            [*dask, "worker", address, "--host", "127.0.0.1", "--nthreads", "1", "--no-dashboard"]
            for _ in range(2)
        ],
    ]
    processes = [subprocess.Popen(command, **quiet) for command in commands]
    time.sleep(0.5)
    try:
        yield address
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            process.wait(timeout=30)


def test_a_dask_cluster_gives_the_same_bytes(tmp_path, dask_cluster):
    for line in (LINE, LEARNING, FRAMEWORK):
        eutree(*line, "--out", tmp_path / "one")
        eutree(
            *line, "--out", tmp_path / "dask", "--backend", "dask", "--address", dask_cluster,
            "--n-jobs", "-1",
        )  # fmt: skip
    assert files_of(tmp_path / "one") == files_of(tmp_path / "dask")
    assert len(list((tmp_path / "dask" / "runs").iterdir())) >= 2 * SMOKE.runs


@pytest.mark.slow
def test_a_ray_instance_gives_the_same_bytes(tmp_path):
    pytest.importorskip("ray", reason="ray is not installed")
    for line in (LINE, FRAMEWORK):
        eutree(*line, "--out", tmp_path / "one")
        eutree(*line, "--out", tmp_path / "ray", "--backend", "ray", "--n-jobs", "2")
    assert files_of(tmp_path / "one") == files_of(tmp_path / "ray")
