"""Runs that are killed, interrupted or started twice end with the bytes of an undisturbed run."""

import os
import random
import resource
import signal
import subprocess
import sys
import time

import pytest

from eutree.cli.main import run
from eutree.training.listeners import stop_on_signals
from tests.training.processes import (
    COMMAND,
    KILL,
    KILLED,
    STOPPED,
    TORN,
    digests,
    finish,
    identity,
    start,
    wait_for_new,
)

DOMAINS = ("eutree/Evasion2-v0", "eutree/Evasion3-v0")
WAYS = {
    "default": (),
    "paper": ("--preset", "paper"),
    "bounded": ("--max-transitions", 400),
    "paper, bounded": ("--preset", "paper", "--max-transitions", 400),
}
LENGTH = ("--episodes", 60, "--evaluate-every", 10, "--evaluation-episodes", 10, "--front-steps", 0)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a function that gives the command line and the bytes of an undisturbed run."""
    made = {}

    def of(domain, seed, way="default"):
        if (domain, seed, way) not in made:
            folder = tmp_path_factory.mktemp("whole")
            demos = folder / "demos"
            record = ("record", domain, "--expert", "gate", "--episodes", 6, "--out", demos)
            assert run([*map(str, record)]) == 0
            line = ("learn", "--demos", demos, "--seed", seed, *LENGTH, *WAYS[way])
            assert run([*map(str, line), "--out", str(folder / "run")]) == 0
            made[domain, seed, way] = line, digests(folder / "run")
        return made[domain, seed, way]

    return of


def struck(line, folder, blow):
    """Start or resume a run that ``blow`` ends; return its exit code and standard error."""
    options = ("--out", folder, "--resume", "--checkpoint-seconds", 0)
    return finish(start(*line, *options, code=blow + COMMAND))


def go_on(line, folder):
    """Resume a run in this process, to its end."""
    assert run([*map(str, line), "--out", str(folder), "--resume"]) == 0


def kill_and_resume(line, folder, kills, seed):
    """Kill a run at random moments, then let it end."""
    codes = []
    chance = random.Random(seed)
    for number in range(kills):
        # Soon at first: a short run is over after 0.35 s of a fast processor.
        moment = chance.uniform(0.001, 0.6 if number else 0.1)
        code, err = struck(line, folder, KILLED.format(seconds=moment))
        print(f"seed {seed}, kill {number} after {moment:.3f} s: exit code {code}")
        assert code in (KILL, 0), err
        codes.append(code)
    assert KILL in codes, "every run ended before it was killed"
    code, err = finish(start(*line, "--out", folder, "--resume"))
    assert code == 0, err


@pytest.mark.promise(8)
@pytest.mark.promise(13)
def test_kill_9_and_resume_ends_with_the_same_bytes(whole, tmp_path):
    line, wanted = whole(DOMAINS[0], 0)
    kill_and_resume(line, tmp_path / "run", 1, seed=0)
    assert digests(tmp_path / "run") == wanted
    assert not list((tmp_path / "run").glob(".*eutree-tmp"))


@pytest.mark.slow
@pytest.mark.promise(8)
@pytest.mark.parametrize("domain", DOMAINS)
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("seed", range(1, 6))
def test_200_kills_and_resumes_end_with_the_same_bytes(whole, tmp_path, domain, way, seed):
    """Five kills of each of five runs for each domain and way to learn: 200 in all."""
    line, wanted = whole(domain, seed, way)
    kill_and_resume(line, tmp_path / "run", 5, seed=seed)
    assert digests(tmp_path / "run") == wanted


@pytest.mark.promise(8)
def test_the_kill_test_catches_a_writer_that_is_not_atomic(whole, tmp_path, capsys):
    line, _ = whole(DOMAINS[0], 0)
    folder = tmp_path / "run"
    assert struck(line, folder, TORN)[0] == -signal.SIGKILL
    assert run([*map(str, line), "--out", str(folder), "--resume"]) == 2
    assert "checkpoint.npz" in capsys.readouterr().err


@pytest.mark.promise(12)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_saves_and_exits_and_the_run_can_be_resumed(whole, tmp_path, proc, number):
    line, wanted = whole(DOMAINS[0], 0)
    folder = tmp_path / "run"
    process = start(*line, "--out", folder, "--checkpoint-seconds", 0)
    wait_for_new(folder / "checkpoint.npz", None, process)
    time.sleep(random.Random(int(number)).uniform(0, 0.3))
    spent = cpu_seconds(proc, process.pid)
    os.kill(process.pid, number)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    code, err = finish(process)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert code == 128 + number, err
    assert "Traceback" not in err
    assert err.splitlines()[-1].endswith(f"go on with: eutree learn --out {folder} --resume")
    total = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert total - spent < 2.0
    go_on(line, folder)
    assert digests(folder) == wanted


def cpu_seconds(proc, pid):
    """Return the processor time that a process has taken so far."""
    fields = (proc / str(pid) / "stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.promise(12)
def test_a_signal_interrupts_a_long_evaluation(whole, tmp_path):
    line, _ = whole(DOMAINS[0], 0)
    folder = tmp_path / "run"
    place = line.index("--evaluation-episodes") + 1
    line = (*line[:place], 1_000_000, *line[place + 1 :])
    process = start(*line, "--out", folder)
    wait_for_new(folder / "expert.json", None, process)
    os.kill(process.pid, signal.SIGTERM)
    code, err = finish(process)
    assert code == 143, err
    assert err.splitlines()[-1].endswith(f"go on with: eutree learn --out {folder} --resume")


@pytest.mark.promise(12)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_that_escapes_still_exits_with_the_code_of_its_signal(number):
    """Once it came when the command was already on its way out, and SIGTERM ended with 130."""

    def interrupted(asked):
        with stop_on_signals() as stop:
            if asked:
                os.kill(os.getpid(), number)
            assert stop() == asked
            stop.no_more()
            raise KeyboardInterrupt

    with pytest.raises(SystemExit) as caught:
        interrupted(asked=True)
    assert caught.value.code == 128 + number
    with pytest.raises(KeyboardInterrupt):
        interrupted(asked=False)


@pytest.mark.promise(11)
def test_a_second_process_is_refused_and_the_lock_of_a_dead_one_is_taken_over(
    whole, tmp_path, capsys
):
    line, wanted = whole(DOMAINS[0], 0)
    folder = tmp_path / "run"
    first = start(*line, "--out", folder, "--checkpoint-seconds", 0, code=STOPPED + COMMAND)
    _, status = os.waitpid(first.pid, os.WUNTRACED)
    assert os.WIFSTOPPED(status), first.communicate()
    try:
        assert run([*map(str, line), "--out", str(folder), "--resume"]) == 2
        assert f"{folder} is in use by process {first.pid}" in capsys.readouterr().err
    finally:
        os.kill(first.pid, signal.SIGKILL)
    finish(first)
    assert (folder / ".lock").read_text() == f"{first.pid}\n"
    go_on(line, folder)
    assert digests(folder) == wanted


@pytest.mark.slow
@pytest.mark.promise(12)
def test_a_signal_while_racing_saves_and_exits_and_the_run_can_be_resumed(whole, tmp_path, proc):
    """Once racing took 2 to 3.7 s to answer, and what it had run was lost."""
    demos = whole(DOMAINS[0], 0)[0][2]
    line = ("learn", "--demos", demos, "--episodes", 0, "--evaluation-episodes", 4)
    line = (*line, "--race-steps", 1500)
    assert run([*map(str, line), "--out", str(tmp_path / "whole")]) == 0
    folder = tmp_path / "run"
    process = start(*line, "--out", folder, "--checkpoint-seconds", 0)
    wait_for_new(folder / "checkpoint.npz", None, process)
    wait_for_new(folder / "checkpoint.npz", identity(folder / "checkpoint.npz"), process)
    time.sleep(0.5)
    spent = cpu_seconds(proc, process.pid)
    os.kill(process.pid, signal.SIGINT)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    code, err = finish(process)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert code == 130, err
    total = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert total - spent < 2.0
    code, err = finish(start(*line, "--out", folder, "--resume"))
    assert code == 0, err
    assert digests(folder) == digests(tmp_path / "whole")


EARLY_AND_LATE = """
import os, sys

class Late:
    def __del__(self, kill=os.kill, number=os.getpid()):
        kill(number, 2)

class Struck:
    def find_spec(self, name, path=None, target=None):
        if name == "{module}":
            os.kill(os.getpid(), 2)

sys.meta_path.insert(0, Struck())
if not "{module}":
    sys.late = Late()
"""


@pytest.mark.promise(12)
@pytest.mark.parametrize("way", ["module", "script"])
@pytest.mark.parametrize("module", ["gymnasium", ""], ids=["while it begins", "while it ends"])
def test_ctrl_c_at_either_end_of_the_process_is_quiet(way, module, tmp_path):
    (tmp_path / "sitecustomize.py").write_text(EARLY_AND_LATE.format(module=module))
    script = tmp_path / "eutree"
    script.write_text("from eutree.__main__ import main\nmain()\n")
    line = ["-m", "eutree"] if way == "module" else [str(script)]
    places = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    found = subprocess.run(
        [sys.executable, *line, "--version"],
        env=os.environ | {"PYTHONPATH": places},
        capture_output=True,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # behind a shell it is not
    )
    assert found.returncode == (130 if module else 0)  # all is done when it ends
    assert found.stderr == ""


IN_A_TEXT = """
import sys

class Struck:
    def find_spec(self, name, path=None, target=None):
        if name == "eutree.cli.main":
            exec("raise KeyboardInterrupt")

sys.meta_path.insert(0, Struck())
"""


@pytest.mark.promise(12)
def test_ctrl_c_in_a_text_that_is_executed_ends_with_its_code(tmp_path):
    """Python ended by the signal after all: dataclasses and others make functions of texts."""
    (tmp_path / "sitecustomize.py").write_text(IN_A_TEXT)
    places = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    found = subprocess.run(
        [sys.executable, "-m", "eutree", "--version"],
        env=os.environ | {"PYTHONPATH": places},
        capture_output=True,
    )
    assert (found.returncode, found.stderr) == (130, b"")


STRUCK = """
import os, sys
import eutree.__main__ as command

class Struck:
    def find_spec(self, name, path=None, target=None):
        if name == "{module}":
            os.kill(os.getpid(), {number})

sys.meta_path.insert(0, Struck())
sys.argv = ["eutree", "learn", "--help"]
command.main()
"""


@pytest.mark.promise(12)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("module", ["eutree.cli.main", "eutree.cli.learn"])
def test_a_signal_while_the_command_is_imported_ends_with_its_code(number, module):
    """Once SIGTERM ended with the system's own code, as the process of a bug would."""
    code, err = finish(start(code=STRUCK.format(module=module, number=int(number))))
    assert code == 128 + number
    assert "Traceback" not in err
