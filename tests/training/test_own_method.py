"""A method of one's own, in a distribution of its own: found, run, resumed, run many times.

The distribution is built here from the page that explains it, and installed by unpacking its wheel.
"""

import importlib
import json
import os
import re
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli.main import run
from eutree.errors import FormatError, InvalidArgumentError, RunFolderError, UnknownNameError
from eutree.learners import METHODS, History, Needs, Part, Start, Stored, Update, method, register
from eutree.learners.declared import HISTORY_PART, MASKS_PART, SHOWN_PART, part, prefixed
from eutree.learners.learner import MethodOfParts
from eutree.learners.registry import GROUP, from_document, to_document
from eutree.learners.registry import restored as restored_from
from eutree.trees import DecisionTree
from tests.learners.battery import Case
from tests.patience import ENOUGH
from tests.worlds import Corridor, play

PAGE = Path(__file__).parents[2] / "docs" / "your-own-method.md"
PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "corrected-imitation"
version = "1.0"

[tool.hatch.build.targets.wheel]
only-include = ["corrected_imitation.py", "corrected_imitation_cli.py"]
"""
COMMAND = """
import click

@click.command()
def corrections():
    \"\"\"Say how many corrections there are.\"\"\"
    click.echo("none yet")
"""
TASK = "eutree/Evasion2-v0"
SHORT = {"episodes": 40, "evaluate_every": 20, "evaluation_episodes": 4, "front_steps": 0}
EPISODES = {"selection_episodes": 6, "judging_episodes": 6}


def source():
    """Return the method as the page has it."""
    shown = r"file: corrected_imitation.py -->\n\n```python\n(.*?)```"
    return re.search(shown, PAGE.read_text(), re.DOTALL)[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return a folder in which the distribution is installed."""
    pytest.importorskip("hatchling", reason="the build back end is not installed")
    tree, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    points = re.search(r"```toml\n(.*?)```", PAGE.read_text(), re.DOTALL)[1]
    (tree / "pyproject.toml").write_text(PROJECT + points)
    (tree / "corrected_imitation.py").write_text(source())
    (tree / "corrected_imitation_cli.py").write_text(COMMAND)
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(out)]
    subprocess.run(command, cwd=tree, check=True, capture_output=True)
    (wheel,) = out.iterdir()
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


@pytest.fixture
def installed(site, monkeypatch):
    """Let this process find what is installed there."""
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setattr(METHODS, "_known", {})
    yield site
    for name in ("corrected_imitation", "corrected_imitation_cli"):
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def demos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded") / "demos"
    assert run(["record", TASK, "--expert", "gate", "--episodes", "5", "--out", str(folder)]) == 0
    return folder


def bytes_of(folder):
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != ".lock")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def learned(demos, folder, **options):
    shown = eutree.Demonstrations.load(demos)
    own = options.pop("method", "corrected-imitation")
    return eutree.learn(
        gymnasium.make(TASK), demonstrations=shown, method=own, out=folder, **(SHORT | options)
    )


def elsewhere(site, folder, *line):
    """Run the command line in another process, which knows the distribution; return its output."""
    paths = os.pathsep.join([str(site), *sys.path])
    done = subprocess.run(
        [sys.executable, "-m", "eutree", *map(str, line)], cwd=folder, text=True, timeout=ENOUGH,
        env={**os.environ, "PYTHONPATH": paths}, capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_it_is_found_by_its_entry_point(installed, capsys):
    assert "corrected-imitation" in METHODS
    assert type(method("corrected-imitation")).__name__ == "CorrectedImitation"
    chosen = type(method("corrected-imitation"))(errors=3.0)
    assert from_document(to_document(chosen)) == chosen
    assert run(["learn", "--list-settings", "--method", "corrected-imitation"]) == 0
    assert "gathering_episodes = 20" in capsys.readouterr().out
    assert run(["--help"]) == 0
    assert "Say how many corrections there are." in capsys.readouterr().out
    assert run(["corrections"]) == 0
    assert capsys.readouterr().out == "none yet\n"


def test_without_the_distribution_it_is_unknown(monkeypatch):
    monkeypatch.setattr(METHODS, "_known", {})
    with pytest.raises(UnknownNameError, match="MODULE:CLASS"):
        method("corrected-imitation")
    with pytest.raises(UnknownNameError, match="unknown command 'corrections'"):
        eutree_command("corrections")


def eutree_command(name):
    from eutree.cli.main import eutree as group

    return group.get_command(None, name)


@pytest.mark.parametrize(
    ("line", "fault", "options"),
    [
        ("self.episode.add(step)", "raise KeyError('boom')", ()),
        ("learner = Corrector(problem, start.expert, self)", "raise KeyError('boom')", ()),
        ("self.episode.add(step)", "raise KeyError('boom')", ("--runs", "2", "--n-jobs", "2")),
    ],
)
def test_what_it_raises_names_it(line, fault, options, demos, tmp_path, monkeypatch, capfd):
    """It read "internal error", as if it were eutree's own."""
    (tmp_path / "broken_method.py").write_text(source().replace(line, fault))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    own = "broken_method:CorrectedImitation"
    asked = ["learn", TASK, "--demos", str(demos), "--method", own, "--episodes", "4"]
    try:
        assert run([*asked, "--out", "run", *options]) == 1
        said = f"raised in method 'corrected-imitation' ({own}), KeyError: 'boom' (--debug"
        assert said in capfd.readouterr().err
        with pytest.raises(KeyError) as caught:
            learned(demos, None, method=own)
        assert caught.value.__notes__ == [f"raised in method 'corrected-imitation' ({own})"]
    finally:
        sys.modules.pop("broken_method", None)


def test_a_fault_of_eutree_is_not_laid_to_it(installed, demos, tmp_path, monkeypatch, capsys):
    def fails(*_):
        raise KeyError("boom")

    monkeypatch.setattr("eutree.training.run.Run.policy", fails)
    asked = ["learn", TASK, "--demos", str(demos), "--method", "corrected-imitation"]
    assert run([*asked, "--episodes", "4", "--out", str(tmp_path / "run")]) == 1
    assert "internal error, KeyError: 'boom'" in capsys.readouterr().err


def test_it_is_resumed_by_name_in_another_process(installed, demos, tmp_path):
    learned(demos, tmp_path / "whole")
    steps = iter(range(10_000))
    learned(demos, tmp_path / "parts", stop=lambda: next(steps) > 300)
    assert bytes_of(tmp_path / "parts") != bytes_of(tmp_path / "whole")
    line = ["learn", TASK, "--demos", demos, "--method", "corrected-imitation", "--episodes", 40]
    line += ["--evaluate-every", 20, "--evaluation-episodes", 4, "--front-steps", 0]
    line += ["--out", tmp_path / "parts"]
    elsewhere(installed, tmp_path, *line, "--resume")
    assert bytes_of(tmp_path / "whole") == bytes_of(tmp_path / "parts")


def test_the_configuration_is_checked_when_it_is_resumed(installed, demos, tmp_path):
    learned(demos, tmp_path / "a", episodes=20)
    own = type(method("corrected-imitation"))
    with pytest.raises(RunFolderError, match=r"started with errors 2\.0, .* with 4\.0"):
        learned(demos, tmp_path / "a", method=own(errors=4.0), resume=True)
    with pytest.raises(RunFolderError, match="started with method 'corrected-imitation', so it"):
        learned(demos, tmp_path / "a", method="paper", resume=True)
    config = tmp_path / "a" / "config.json"
    text = config.read_text()
    config.write_text(text.replace('"errors"', '"terrors"'))
    with pytest.raises(FormatError, match="has no choice 'terrors'"):
        learned(demos, tmp_path / "a", resume=True)
    config.write_text(text.replace('"errors":2.0', '"errors":"two"'))
    with pytest.raises(FormatError, match=r"method 'corrected-imitation': .*errors"):
        learned(demos, tmp_path / "a", resume=True)


def test_a_damaged_checkpoint_of_it_is_refused(installed, demos, tmp_path):
    from eutree.files import read_archive, write_archive
    from eutree.training.checkpoint import CheckpointDocument

    learned(demos, tmp_path / "a", episodes=20)
    path = tmp_path / "a" / "checkpoint.npz"
    document, arrays = read_archive(path, CheckpointDocument)
    for sums in (arrays["sums"][:, 1:], arrays["sums"] * np.nan, arrays["sums"][0]):
        write_archive(path, document, {**arrays, "sums": sums})
        with pytest.raises(FormatError, match=r"checkpoint\.npz: sums: "):
            learned(demos, tmp_path / "a", resume=True)


@pytest.mark.parametrize("backend", ["loky", "dask"])
def test_it_runs_many_times_on_every_back_end(installed, demos, tmp_path, backend):
    import joblib

    shown = eutree.Demonstrations.load(demos)
    own = method("corrected-imitation")
    options = {"runs": 2, "demonstrations": shown, "method": own, **SHORT, **EPISODES}
    eutree.learn_runs(TASK, out=tmp_path / "one", n_jobs=1, **options)
    if backend == "dask":
        distributed = pytest.importorskip("distributed", reason="dask is not installed")
        cluster = distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None,
            host="127.0.0.1", protocol="tcp",
        )  # fmt: skip
        with cluster, distributed.Client(cluster), joblib.parallel_config(backend="dask"):
            eutree.learn_runs(TASK, out=tmp_path / "two", n_jobs=None, **options)
    else:
        eutree.learn_runs(TASK, out=tmp_path / "two", n_jobs=2, **options)
    assert bytes_of(tmp_path / "one") == bytes_of(tmp_path / "two")


def test_it_runs_many_times_on_the_command_line(installed, demos, tmp_path, capsys):
    line = ["learn", TASK, "--demos", demos, "--method", "corrected-imitation", "--runs", "2"]
    line += ["--n-jobs", "1", "--episodes", "3", "--evaluation-episodes", "2"]
    assert run([*map(str, line), "--out", str(tmp_path / "many")]) == 0
    assert "The best of 2 runs" in capsys.readouterr().out


def test_its_class_is_named_where_it_is_not_installed(demos, tmp_path, monkeypatch, capsys):
    (tmp_path / "not_installed.py").write_text(source())
    (tmp_path / "broken.py").write_text("raise RuntimeError('no licence')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    line = ["learn", TASK, "--demos", str(demos), "--episodes", "20", "--evaluation-episodes", "2"]
    named = ["--method", "not_installed:CorrectedImitation", "--out", "run"]
    assert run([*line, *named]) == 0
    assert run([*line, *named, "--episodes", "21"]) == 2  # said twice
    assert run([*line, *named, "--resume"]) == 0
    assert run([*line, "--settings", "run/config.json", "--out", "other"]) == 2
    assert "unknown method 'corrected-imitation'" in capsys.readouterr().err
    assert run([*line, "--settings", "run/config.json", *named[:2], "--out", "other"]) == 0
    for name, message in (
        ("broken:Own", "method 'broken:Own' cannot be imported: no licence"),
        ("no_such_module:Own", "No module named 'no_such_module'"),
        ("not_installed:Corrector", "must be a frozen dataclass"),
        ("not_installed:", "cannot be imported"),
    ):
        assert run([*line, "--method", name, "--out", "x"]) == 2
        assert message in capsys.readouterr().err
    sys.modules.pop("not_installed", None)


@dataclass(frozen=True, kw_only=True)
class Idle:
    """A method that does nothing.

    Attributes:
        weights: What JSON cannot hold.
    """

    name: ClassVar[str] = "idle"
    needs: ClassVar[Needs] = Needs()

    gathering_episodes: int = 1
    weights: object = None

    def start(self, problem, start): ...

    def restore(self, problem, start, state): ...

    def declared(self, problem, start): ...


class Imposter(Idle):
    name = "planning"


def test_a_method_is_registered_in_one_process(monkeypatch):
    monkeypatch.setattr(METHODS, "_known", {})
    assert register(Idle) is Idle
    assert isinstance(method("idle"), Idle)
    with pytest.raises(InvalidArgumentError, match="'planning' is one of eutree's"):
        register(Imposter)
    with pytest.raises(InvalidArgumentError, match="must be a frozen dataclass"):
        register(dict)


@dataclass(frozen=True)
class Nameless(Idle):
    name = ""


def test_the_name_of_a_method_is_its_own_however_it_is_given():
    """A run folder of such a method was one of eutree's to all who read it."""
    for own, message in ((Imposter, "'planning' is one of eutree's"), (Nameless, "have a name")):
        with pytest.raises(InvalidArgumentError, match=message):
            eutree.learn(TASK, method=own(), episodes=1)


def test_what_is_no_method_is_refused_before_the_first_step():
    env = gymnasium.make(TASK)
    for own, message in (
        (Idle, r"must be a method with its choices, Idle\(\)"),
        (Idle(weights={1, (2, 3)}.__iter__()), "must have choices that JSON can hold"),
        (Idle(weights=(1, 2)), "must be made by its choices alone"),
        (object(), "must be a frozen dataclass"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            eutree.learn(env, method=own, episodes=1)


def test_entry_points_that_are_wrong_are_named(tmp_path, monkeypatch):
    monkeypatch.setattr(METHODS, "_known", {})
    for number, lines in enumerate((
        "planning = nowhere:Method\ntwice = a:A\nother = tests.training.test_own_method:Idle\n",
        "twice = b:B\ngone = nowhere:Method\n",
    )):  # fmt: skip
        folder = tmp_path / f"wrong{number}-1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: wrong{number}\nVersion: 1.0\n"
        )
        commands = f"[eutree.commands]\ntwice = {'ab'[number]}:{'ab'[number]}\n"
        (folder / "entry_points.txt").write_text(f"[{GROUP}]\n{lines}{commands}")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert type(method("planning")).__name__ == "PlanningMethod"  # ours stay ours
    with pytest.raises(
        InvalidArgumentError, match="command 'twice' is offered by several: a:a, b:b"
    ):
        eutree_command("twice")
    for name, message in (
        ("twice", "offered by several: a:A, b:B"),
        ("gone", "nowhere:Method, cannot be imported"),
        ("other", "must have that name itself, got 'idle'"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            method(name)


@pytest.fixture
def of_the_page(tmp_path, monkeypatch):
    """Return the class of the method that the page shows."""
    (tmp_path / "of_the_page.py").write_text(source())
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(METHODS, "_known", {})
    yield register(importlib.import_module("of_the_page").CorrectedImitation)
    sys.modules.pop("of_the_page", None)


def test_a_run_says_that_a_method_of_ones_own_is_named_again(
    of_the_page, demos, tmp_path, monkeypatch
):
    shown = eutree.Demonstrations.load(demos)
    options = {"demonstrations": shown, "episodes": 1, "evaluation_episodes": 2}
    eutree.learn(TASK, method=of_the_page(), out=tmp_path / "run", **options)
    monkeypatch.setattr(METHODS, "_known", {})
    with pytest.raises(RunFolderError, match="with 'planning'; name its class again, MODULE:CLASS"):
        eutree.learn(TASK, method="planning", out=tmp_path / "run", resume=True, **options)


def test_a_method_without_gathering_episodes_is_refused_where_it_is_found(monkeypatch):
    monkeypatch.setattr(METHODS, "_known", {})

    @dataclass(frozen=True)
    class Short:
        name = "short"
        needs = Needs()

        def start(self, problem, start): ...

        def restore(self, problem, start, state): ...

    message = r"^method 'short' \(.*Short\) lacks gathering_episodes, declared; see docs/your-own"
    with pytest.raises(InvalidArgumentError, match=message):
        register(Short)


def test_a_method_of_parts_still_needs_a_start(monkeypatch):
    monkeypatch.setattr(METHODS, "_known", {})

    @dataclass(frozen=True)
    class Startless(MethodOfParts):
        name = "startless"
        needs = Needs()
        parts = ()

        gathering_episodes: int = 1

    with pytest.raises(InvalidArgumentError, match=r"^method 'startless' \(.*\) lacks start; see"):
        register(Startless)


@pytest.mark.parametrize("name", ["history", "update"])
def test_a_learner_that_lacks_something_is_refused_before_the_first_step(
    name, of_the_page, demos, monkeypatch, tmp_path
):
    kind = type(of_the_page().start(*_beginning()))
    made, restored = of_the_page.start, of_the_page.restore

    def without(learner):
        if name in vars(learner):
            delattr(learner, name)
        else:
            monkeypatch.delattr(kind, name, raising=False)
        return learner

    monkeypatch.setattr(of_the_page, "start", lambda *given: without(made(*given)))
    with pytest.raises(InvalidArgumentError, match=rf"the learner of method .* lacks {name}; see"):
        learned(demos, tmp_path / "run", method=of_the_page())
    assert not (tmp_path / "run").exists()
    monkeypatch.setattr(of_the_page, "start", made)
    monkeypatch.setattr(of_the_page, "restore", lambda *given: without(restored(*given)))
    case = Case.of(of_the_page(), "tree")
    state = made(of_the_page(), case.problem, case.start).state()
    with pytest.raises(InvalidArgumentError, match=rf"lacks {name}; see"):
        restored_from("checkpoint.npz", state, of_the_page(), case.problem, case.start)


def test_a_state_that_could_not_be_read_back_is_never_written(of_the_page, demos, tmp_path):
    """The run went on to its end, and could not be resumed."""
    made = of_the_page.start

    def growing(self, problem, start):
        learner = made(self, problem, start)
        known = learner.state
        more = {"extra": np.zeros(3)}
        learner.state = lambda: known() | (more if len(learner.history.rewards) > 300 else {})
        return learner

    of_the_page.start = growing
    wanted = r"^method 'corrected-imitation' must have a state .* got extra: unexpected array$"
    with pytest.raises(InvalidArgumentError, match=wanted):
        learned(demos, tmp_path / "run", method=of_the_page(), checkpoint_seconds=0)
    of_the_page.start = made
    result = learned(demos, tmp_path / "run", method=of_the_page(), resume=True)
    assert result.episodes == SHORT["episodes"], "it goes on from the last that was whole"


@pytest.mark.parametrize("answer", [None, 1.0, np.bool_(True), 2, -1, "1", np.array([1])])
def test_what_act_returns_must_be_the_number_of_an_action(answer, of_the_page, demos, monkeypatch):
    """It was a bare TypeError, or the environment was blamed for it."""
    kind = type(of_the_page().start(*_beginning()))
    monkeypatch.setattr(kind, "act", lambda self: answer)
    wanted = "what act of the method returns must be an integer from 0 to 1, got " + re.escape(
        repr(answer)
    )
    with pytest.raises(InvalidArgumentError, match=wanted):
        learned(demos, None, method=of_the_page())


def test_figures_may_be_those_of_numpy(of_the_page, demos, tmp_path, monkeypatch):
    """The run ended at its first update: int64 is not JSON serializable."""
    told = {
        "n": np.int64(3),
        "mean": np.float32(0.5),
        "none": np.nan,
        "row": np.arange(2),
        "s": "a",
    }
    kind = type(of_the_page().start(*_beginning()))
    monkeypatch.setattr(kind, "update", lambda self, generator: Update(figures=told))
    learned(demos, tmp_path / "run", method=of_the_page(), episodes=20)
    lines = map(json.loads, (tmp_path / "run" / "events.jsonl").read_text().splitlines())
    found = next(line for line in lines if line["event"] == "expansion")
    assert [found[name] for name in told] == [3, 0.5, None, [0, 1], "a"]


class ByHand:
    """The method of the page, with a state that it writes, reads and declares by itself.

    As the page had it before a state followed from the parts.
    """

    def __init__(self, own) -> None:
        self._own = own

    def __getattr__(self, name):
        return getattr(self.__dict__["_own"], name)

    def start(self, problem, start):
        learner = self._own.start(problem, start)
        learner.state = lambda: {
            "sums": learner.sums.copy(),
            **prefixed("history_", learner.history.state()),
        }
        return learner

    def restore(self, problem, start, state):
        learner = self.start(problem, Start(start.expert))
        learner.sums = state["sums"].copy()
        single = DecisionTree.single_leaf(problem.n_features)
        learner.history = History.from_state(part(state, "history_"), single)
        return learner

    def declared(self, problem, start):
        sums = Stored("f8", (3, start.expert.n_leaves, "A"))
        return problem.declare(Part({"sums": sums}), HISTORY_PART, SHOWN_PART, MASKS_PART)


@pytest.mark.parametrize("start_name", ["tree", "tree+demos"])
def test_a_state_by_hand_is_the_one_that_follows_from_the_parts(start_name, of_the_page):
    declaring = Case.of(of_the_page(), start_name)
    by_hand = Case.of(ByHand(of_the_page()), start_name)
    learners, states = [], []
    for case, other in ((declaring, by_hand), (by_hand, declaring)):
        state = {name: np.array(array) for name, array in case.lived().state().items()}
        again = restored_from("file", state, other.method, other.problem, other.start)
        play(again, Corridor(), seed=50)
        learners.append(again)
        states.append(state)
    states += [learner.state() for learner in learners]
    one, two, three, four = ({k: a.tobytes() for k, a in state.items()} for state in states)
    assert one == two
    assert three == four != one


def _beginning():
    case = Case.of(None, "tree")
    return case.problem, case.start
