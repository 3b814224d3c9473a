"""Runs on a cluster give the same bytes as runs one after the other: Dask and Ray, on loopback."""

import json
import os
import subprocess
import sys
import time

import gymnasium
import joblib
import numpy as np
import pytest

import eutree
from eutree.cli.main import run
from eutree.compression import RealEpisodes
from eutree.distillation import DistillationSettings
from eutree_lab.framework import runs as framework
from eutree_lab.paper.experiment import SMOKE
from tests.little_search import little_search
from tests.patience import ENOUGH

LEARNING = ["reproduce", "table-2", "--smoke", "--preset", "paper"]


FRAMEWORK = ["reproduce", "framework", "--smoke", "--method", "density-tree"]
MEASURED = ("seconds.json", "framework.md")  # CPU seconds, and the tables that hold them


def files_of(path):
    return {
        p.name: p.read_bytes()
        for p in sorted(path.rglob("*"))
        if p.is_file() and p.name not in MEASURED
    }


def here(*arguments):
    """Run the command line in this process."""
    assert run([*map(str, arguments)]) == 0


def command(*arguments):
    """Run the command line in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run(
        [sys.executable, "-m", "eutree", *map(str, arguments)],
        check=True, env=environment, timeout=ENOUGH, capture_output=True,
    )  # fmt: skip


def address_in(path, patience=ENOUGH):
    """Wait for what a scheduler writes of itself; return its address."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        try:
            return json.loads(path.read_text())["address"]
        except (FileNotFoundError, ValueError):  # not yet, or not wholly
            time.sleep(0.05)
    raise TimeoutError(f"there is no {path} after {patience} s")


@pytest.fixture(scope="module")
def dask_cluster(tmp_path_factory):
    """Start a scheduler and two worker processes on loopback; return the scheduler's address."""
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    said = tmp_path_factory.mktemp("dask") / "scheduler.json"  # the scheduler chooses its port
    there = ["--scheduler-file", str(said)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    environment["DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED"] = "False"  # each samples itself
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    alone = ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
    commands = [
        [*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", *there],
        *[[*dask, "worker", "--host", "127.0.0.1", *alone, *there] for _ in range(2)],
    ]
    processes = [subprocess.Popen(command, **quiet) for command in commands]
    try:
        yield address_in(said)
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:  # a worker that waits for a scheduler that has gone
                process.kill()
                process.wait()


def test_a_dask_cluster_gives_the_same_bytes(tmp_path, dask_cluster, monkeypatch):
    one = {"evasion": framework.TASKS["evasion"]}  # what is divided is the same for each
    monkeypatch.setattr(framework, "TASKS", one)
    for way, line in ((command, LEARNING), (here, FRAMEWORK)):
        here(*line, "--out", tmp_path / "one", "--n-jobs", "1")
        way(
            *line, "--out", tmp_path / "dask", "--backend", "dask", "--address", dask_cluster,
            "--n-jobs", "-1",
        )  # fmt: skip
    assert files_of(tmp_path / "one") == files_of(tmp_path / "dask")
    assert len(list((tmp_path / "dask" / "runs").iterdir())) >= 2 * SMOKE.runs


class Leaning:
    """Pushes to where the pole leans."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.int64(np.asarray(observation).reshape(-1)[2] > 0), None


@little_search()
def everything(folder):
    """Return what comes of all that can be divided, but for the runs of ``reproduce``."""
    task, teacher = "CartPole-v1", Leaning()
    demos = eutree.record(gymnasium.make(task), teacher, episodes=4, seed=1)
    expert = eutree.fit_expert_tree(demos)
    runs = eutree.learn_runs(
        "eutree/Evasion2-v0", runs=2, out=folder, n_jobs=None, method="paper", episodes=3,
        evaluation_episodes=2, selection_episodes=6, judging_episodes=6,
    )  # fmt: skip
    return (
        eutree.evaluate(expert, task, episodes=12).returns.tolist(),
        eutree.compress(
            expert, demos.observations, env=RealEpisodes(task, margin=50.0, episodes=32)
        ),
        eutree.distill(
            teacher, task, DistillationSettings(iterations=2, episodes=2, validation_episodes=4)
        ),
        runs.judged.returns.tolist(),
        {name: data for name, data in files_of(folder).items() if name != ".lock"},
    )


def test_all_that_is_divided_is_the_same_on_a_dask_cluster(tmp_path, dask_cluster):
    distributed = pytest.importorskip("distributed")
    alone = everything(tmp_path / "alone")
    with distributed.Client(dask_cluster) as client, joblib.parallel_config(backend="dask"):
        there = everything(tmp_path / "there")
        tasks = client.run_on_scheduler(lambda dask_scheduler: dask_scheduler.transition_counter)
    assert there == alone
    assert tasks > 20  # the cluster did it


def test_a_cluster_that_is_not_there_is_a_clear_error(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("eutree.cli.parts.PATIENCE", 0.5)
    line = ["distill", "CartPole-v1", "--expert", "balance", "--out", str(tmp_path / "a.json")]
    assert run([*line, "--address", "tcp://127.0.0.1:9"]) == 2
    assert "--backend dask or ray" in capsys.readouterr().err
    for address in ("tcp://127.0.0.1:9", str(tmp_path / "scheduler.json")):
        assert run([*line, "--backend", "dask", "--address", address]) == 2
        assert "--address must be that of a running scheduler" in capsys.readouterr().err
    for address in ("127.0.0.1:9", "ray://127.0.0.1:99999"):
        assert run([*line, "--backend", "ray", "--address", address]) == 2
        assert "--address must be that of a running Ray cluster" in capsys.readouterr().err


@pytest.mark.parametrize(("backend", "package"), [("dask", "distributed"), ("ray", "ray")])
def test_a_package_that_is_not_there_is_a_clear_error(
    tmp_path, capsys, monkeypatch, backend, package
):
    monkeypatch.setitem(sys.modules, package, None)
    line = ["reproduce", "expert", "--smoke", "--out", str(tmp_path / "results")]
    assert run([*line, "--backend", backend, "--address", "auto"]) == 2
    assert f"{package} is not installed; get it with: pip install" in capsys.readouterr().err


def listening(proc, session):
    """Return where the processes of a session listen, as the kernel writes addresses."""
    inodes = {}
    for table in ("tcp", "tcp6"):
        for line in (proc / "net" / table).read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A":
                inodes[f"socket:[{fields[9]}]"] = fields[1]
    found = set()
    for process in proc.glob("[0-9]*"):
        try:
            if int((process / "stat").read_text().rpartition(")")[2].split()[3]) == session:
                links = [os.readlink(link) for link in (process / "fd").iterdir()]
                found |= {inodes[link] for link in links if link in inodes}
        except OSError:
            continue  # it has ended
    return found


def heard(proc, *arguments):
    """Run Python in a session of its own; return where anything in it ever listened.

    Its standard input ends once something has been heard, for what waits for that.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, *map(str, arguments)], env=environment, start_new_session=True,
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    found, seen = set(), 0
    while process.poll() is None:
        found |= listening(proc, process.pid)
        if found:
            process.stdin.close()
        seen += 1
        time.sleep(0.15)
    assert process.returncode == 0, process.stderr.read()
    process.stderr.close()
    process.stdin.close()
    assert seen > 5 or found
    return found


EACH_BACKEND = """
import sys
from eutree.cli.main import run
for backend in ("dask", "ray", "loky"):
    assert run([*sys.argv[2:], "--backend", backend, "--out", f"{sys.argv[1]}/{backend}"]) == 0
"""


def test_nothing_listens_where_no_address_is_given(tmp_path, proc):
    """Dask's dashboard did, on all addresses; its scheduler ran what any client sent."""
    line = ["learn", "eutree/Evasion2-v0", "--runs", 2, "--n-jobs", 2, "--episodes", 2]
    line += ["--evaluation-episodes", 2, "--preset", "paper"]
    assert heard(proc, "-c", EACH_BACKEND, tmp_path, *line) == set()
    for backend in ("dask", "ray", "loky"):
        assert (tmp_path / backend / "policy.json").exists()


def test_what_listens_is_heard(proc):
    program = "import socket, sys; s = socket.create_server(('127.0.0.1', 0)); sys.stdin.read()"
    assert len(heard(proc, "-c", program)) == 1


@pytest.mark.slow
def test_a_ray_instance_gives_the_same_bytes(tmp_path):
    ray = pytest.importorskip("ray", reason="ray is not installed")
    from eutree.cli.parts import cluster

    alone = everything(tmp_path / "alone")
    own = ray.init(num_cpus=2, include_dashboard=False, _node_ip_address="127.0.0.1")
    try:
        with cluster("ray", own.address_info["gcs_address"]):
            assert everything(tmp_path / "there") == alone
    finally:
        ray.shutdown()
