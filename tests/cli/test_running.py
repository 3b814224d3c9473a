"""What an environment does to the process while a command runs, and how a run goes on."""

import json
import os
import shlex
from pathlib import Path

import click
import gymnasium
import pytest

from eutree.cli._given import _given, _line
from eutree.cli.learn import _saying_how_to_go_on, learn
from eutree.training.listeners import StopRequest
from tests.interaction.sick import Healthy, WordlessError

LEARN = ("learn", "Strange-v0", "--method", "paper", "--evaluation-episodes", 2, "--episodes", 6,
         "--checkpoint-seconds", 999)  # fmt: skip


@pytest.fixture
def strange():
    """Register an environment under one name for a test."""
    yield lambda kind: gymnasium.register("Strange-v0", kind, max_episode_steps=50)
    gymnasium.registry.pop("Strange-v0")


class Wanders(Healthy):
    """Goes to another folder when it is made, reset, or in a step, and reads there."""

    there, moment = "", ""

    def __init__(self):
        self.go("made")

    def reset(self, *, seed=None, options=None):
        self.go("reset")
        return super().reset(seed=seed)

    def step(self, action):
        if self.moment != "step" or self.count:
            assert Path("here").read_text() == "there"
        self.go("step")
        return super().step(action)

    def go(self, moment):
        if moment == self.moment:
            os.chdir(self.there)


@pytest.mark.parametrize("moment", ["made", "reset", "step"])
def test_relative_paths_stay_where_the_command_began(eutree, strange, tmp_path, moment):
    """``os.chdir`` in ``reset`` lost the whole run."""
    elsewhere = tmp_path / "else"
    elsewhere.mkdir()
    (elsewhere / "here").write_text("there")
    (tmp_path / "here").write_text("there")
    strange(type("There", (Wanders,), {"there": str(elsewhere), "moment": moment}))
    answer = eutree(*LEARN, "--out", "run")
    assert answer.code == 0, answer.err
    assert (tmp_path / "run" / "policy.json").exists()
    assert eutree("evaluate", "run", "--episodes", 3).code == 0
    assert eutree("show", "run", "--html", "page.html").code == 0
    assert (tmp_path / "page.html").exists()
    assert sorted(path.name for path in elsewhere.iterdir()) == ["here"]


def test_commands_say_how_long_a_slow_environment_takes(eutree, strange, monkeypatch):
    """`evaluate` and `compress` were silent for hours."""
    monkeypatch.setattr("eutree.cli._output._SOON", 0.0)
    strange(Healthy)
    play = ["--episodes", 4]
    shown = ("record", "Strange-v0", "--expert", "tests.interaction.sick:moves", "--out", "shown")
    assert eutree(*shown, *play).code == 0
    fitted = eutree("fit", "shown", "--out", "tree.json", *play)
    assert "episodes played: 1 of 16, about 0 minutes are left; --episodes 20" in fitted.err
    played = eutree("evaluate", "tree.json", *play)
    assert "episodes played: 1 of 4, about 0 minutes are left\n" in played.err
    smaller = eutree("compress", "tree.json", "--out", "small.json", *play, "--json")
    assert "steps played: 5 of " in smaller.err
    assert "--mode lossless nothing" in smaller.err
    lossless = ("compress", "tree.json", "--out", "small.json", "--demos", "shown", *play)
    compared = eutree(*lossless, "--mode", "lossless", "--evaluate")
    assert "episodes played: 1 of 8, about 0 minutes are left\n" in compared.err
    monkeypatch.setattr("eutree.cli._output._SOON", 1000.0)
    assert "played" not in eutree("evaluate", "tree.json", *play).err


def failing(error, *, moment, episode):
    """Return an environment that raises at the reset, or at step 2, of an episode."""

    class Fails(Healthy):
        episodes = 0

        def reset(self, *, seed=None, options=None):
            self.episodes += 1
            if moment == "reset" and self.episodes == episode:
                raise error
            return super().reset(seed=seed)

        def step(self, action):
            if moment == "step" and self.episodes == episode and self.count == 2:
                raise error
            return super().step(action)

    return Fails


@pytest.mark.parametrize("moment", ["reset", "step"])
@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (WordlessError(), 2, "raised WordlessError"),
        (GeneratorExit(), 2, "raised GeneratorExit"),
        (KeyboardInterrupt(), 130, "stopped and saved"),
    ],
)
def test_whatever_an_environment_raises_costs_one_episode(
    eutree, strange, tmp_path, error, code, says, moment
):
    strange(failing(error, moment=moment, episode=6))  # two were evaluated, three learned from
    answer = eutree(*LEARN, "--out", "run")
    assert answer.code == code
    assert says in answer.err
    assert "Traceback" not in answer.err
    gymnasium.registry.pop("Strange-v0")
    strange(Healthy)
    resumed = eutree(*LEARN, "--out", "run", "--resume")
    whole = eutree(*LEARN, "--out", "whole")
    assert resumed.code == whole.code == 0
    for name in ("policy.json", "curve.csv"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    lines = (tmp_path / "run" / "progress.csv").read_text().splitlines()
    assert len(lines) >= 2


def test_what_a_signal_breaks_elsewhere_is_an_interruption(tmp_path, capsys):
    """Ctrl-C ended processes that were about to begin, which was an internal error."""
    stop = StopRequest()
    with pytest.raises(RuntimeError), _saying_how_to_go_on(stop, tmp_path):
        raise RuntimeError
    stop.signal = 2
    with pytest.raises(SystemExit) as ended, _saying_how_to_go_on(stop, tmp_path):
        raise RuntimeError
    assert ended.value.code == 130
    assert "stopped before anything was learned" in capsys.readouterr().err


@pytest.fixture
def interrupted(eutree, strange):
    """Interrupt a command in its sixth episode, and let the environment be well again."""

    def run(*line):
        strange(failing(KeyboardInterrupt(), moment="step", episode=6))
        answer = eutree(*line)
        assert answer.code == 130, answer.err
        gymnasium.registry.pop("Strange-v0")
        strange(Healthy)
        return answer.err.splitlines()[-1]

    return run


def test_the_line_that_is_printed_goes_on_whatever_the_path(eutree, interrupted, tmp_path):
    said = interrupted(*LEARN, "--seed", 4, "--out", "my runs/it's $a")
    assert said == (
        "stopped and saved; go on with: eutree learn --out 'my runs/it'\"'\"'s $a' --resume"
    )
    words = shlex.split(said.partition("go on with: ")[2])
    assert eutree(*words[1:]).code == 0
    assert eutree(*LEARN, "--seed", 4, "--out", "whole").code == 0
    for name in ("policy.json", "config.json", "curve.csv"):
        one, other = (tmp_path / folder / name for folder in ("my runs/it's $a", "whole"))
        assert one.read_bytes() == other.read_bytes()


@pytest.fixture
def in_the_first_update(eutree, monkeypatch):
    """Interrupt a command in its first update: nothing of the run is saved."""

    def run(*line):
        def interrupt(self, generator):
            raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr("eutree.learners.u_tree.learner.UTree.update", interrupt)
            answer = eutree(*line)
        assert answer.code == 130, answer.err
        return answer.err.splitlines()[-1]

    return run


def test_what_is_stopped_before_anything_was_learned_begins_again(
    eutree, strange, in_the_first_update, tmp_path
):
    """No line was named, though --resume knew the command; another one there was kept instead."""
    strange(Healthy)
    in_the_first_update(*LEARN, "--seed", 3, "--out", "run")
    said = in_the_first_update(*LEARN, "--seed", 4, "--out", "run")
    assert said == (
        "stopped before anything was learned; begin again with: eutree learn --out run --resume"
    )
    assert eutree("learn", "--out", "run", "--resume").code == 0
    assert eutree(*LEARN, "--seed", 4, "--out", "whole").code == 0
    for name in ("policy.json", "config.json", "curve.csv"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_what_a_run_was_given_is_found_from_another_folder(
    eutree, interrupted, tmp_path, monkeypatch
):
    (tmp_path / "names file.json").write_text('{"features": ["a", "b [m]"]}')
    interrupted(*LEARN, "--names", "names file.json", "--set", "exploration=0.5", "--out", "run")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert eutree("learn", "--out", tmp_path / "run", "--resume", "--episodes", 4).code == 0
    answer = eutree("show", tmp_path / "run", "--json")
    assert answer.json["features"] == ["a", "b"]
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    assert config["method"]["exploration"] == 0.5


def test_what_is_given_again_counts_and_what_differs_is_refused(eutree, interrupted):
    interrupted(*LEARN, "--out", "run")
    answer = eutree("learn", "--out", "run", "--resume", "--seed", 9)
    assert answer.code == 2
    assert "started with seed 0, so it cannot be resumed with 9" in answer.err
    answer = eutree("learn", "--out", "run", "--resume", "--episodes", 4, "--json")
    assert answer.json["episodes"] == 4


def test_a_run_that_is_made_longer_and_interrupted_keeps_its_new_length(
    eutree, interrupted, strange, tmp_path
):
    """The command and the configuration had the old one: the line that is printed ended there."""
    strange(Healthy)
    assert eutree(*LEARN[:-3], 4, "--out", "run").code == 0
    gymnasium.registry.pop("Strange-v0")
    longer = ("learn", "--out", "run", "--resume", "--episodes", 12, "--checkpoint-seconds", 999)
    assert interrupted(*longer).endswith("go on with: eutree learn --out run --resume")
    kept = json.loads((tmp_path / "run" / "command.json").read_text())["arguments"]
    assert kept["episodes"] == ["12"]
    assert kept["environment"] == ["Strange-v0"]
    assert not {"resume", "out", "checkpoint_seconds"} & kept.keys()
    assert eutree("learn", "--out", "run", "--resume", "--json").json["episodes"] == 12
    assert json.loads((tmp_path / "run" / "config.json").read_text())["episodes"] == 12


def test_many_runs_go_on_from_their_folder(eutree, interrupted, tmp_path):
    line = (*LEARN, "--runs", 2, "--n-jobs", 1)
    said = interrupted(*line, "--out", "many")
    assert said.endswith("go on with: eutree learn --out many --resume")
    assert eutree("learn", "--out", "many", "--resume", "--n-jobs", 1).code == 0
    assert eutree(*line, "--out", "whole").code == 0
    assert (tmp_path / "many/runs.csv").read_bytes() == (tmp_path / "whole/runs.csv").read_bytes()


def test_a_folder_without_a_run_is_said_to_be_one(eutree, tmp_path):
    answer = eutree("learn", "--out", "nothing here", "--resume")
    assert answer.code == 2
    assert "must be the folder of a run that is to go on, got nothing here" in answer.err
    assert not (tmp_path / "nothing here").exists()


def test_a_run_that_a_resume_begins_is_said_to_be_new_and_goes_on_by_its_folder(eutree, strange):
    """Its command was not kept, so no later resume found it."""
    strange(Healthy)
    begun = eutree(*LEARN, "--out", "run", "--resume")
    assert begun.code == 0
    assert "run holds no run to go on with: a new one begins" in begun.err
    resumed = eutree("learn", "--out", "run", "--resume")
    assert resumed.code == 0
    assert "a new one begins" not in resumed.err


def test_a_run_begun_elsewhere_asks_for_what_it_was_begun_with(eutree, interrupted, tmp_path):
    interrupted(*LEARN, "--out", "run")
    (tmp_path / "run/command.json").unlink()
    answer = eutree("learn", "--out", "run", "--resume")
    assert answer.code == 2
    assert "run was not begun by this command, so give again all" in answer.err
    assert eutree(*LEARN, "--out", "run", "--resume").code == 0


@pytest.mark.parametrize("name", ["import", "address", "tensorboard", "out"])
def test_no_folder_chooses_what_only_a_user_may(eutree, interrupted, tmp_path, name):
    interrupted(*LEARN, "--out", "run")
    file = tmp_path / "run/command.json"
    text = file.read_text().replace('"episodes"', f'"{name}": ["evil"], "episodes"')
    file.write_text(text)
    answer = eutree("learn", "--out", "run", "--resume")
    assert (answer.code, answer.out) == (2, "")
    assert f"no file may choose '{name}'" in answer.err


@pytest.mark.parametrize("name", ["environment", "method"])
def test_no_folder_chooses_a_module_to_import(eutree, interrupted, tmp_path, name):
    (tmp_path / "evil.py").write_text("raise SystemExit('imported')\n")
    interrupted(*LEARN, "--out", "run")
    file = tmp_path / "run/command.json"
    document = json.loads(file.read_text())
    document["arguments"][name] = ["evil:Own"]
    file.write_text(json.dumps(document))
    answer = eutree("learn", "--out", "run", "--resume")
    assert (answer.code, answer.out) == (2, "")
    assert f"no file may choose '{name}'" in answer.err
    assert "imported" not in answer.err


def test_the_users_own_choices_are_in_the_line(eutree, interrupted, tmp_path):
    (tmp_path / "my_module.py").write_text("")
    said = interrupted(*LEARN, "--import", "my_module", "--out", "run")
    assert said.endswith("go on with: eutree learn --import my_module --out run --resume")
    assert "my_module" not in (tmp_path / "run/command.json").read_text()


def test_options_of_two_values_and_of_none_are_given_again(eutree, interrupted, tmp_path):
    """A run with --return-range could not go on, and --prefer-proven alone was forgotten."""
    more = ("--return-range", -200, 0, "--keep-success")
    interrupted(*LEARN, *more, "--out", "run")
    kept = json.loads((tmp_path / "run/command.json").read_text())["arguments"]
    assert kept["return_range"] == ["-200", "0"]
    line = ["MountainCar-v0", "--prefer-proven", "--out", "run"]
    given = _given(learn, click.Context(learn), line)
    assert given["prefer_proven"] == [""]
    assert _given(learn, click.Context(learn), _line(learn, given)) == given
    assert eutree("learn", "--out", "run", "--resume").code == 0
    assert eutree(*LEARN, *more, "--out", "whole").code == 0
    for name in ("policy.json", "config.json"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


@pytest.mark.parametrize(
    ("line", "said"),
    [("price = nan", "price must be a number"), ("methd = 1", "'methd'")],
)
def test_a_wrong_setting_is_said_to_be_of_its_file(eutree, tmp_path, line, said):
    (tmp_path / "own.toml").write_text(f'method = "planning"\n{line}\n')
    answer = eutree("learn", "CartPole-v1", "--settings", "own.toml", "--list-settings")
    assert answer.code == 2
    assert "own.toml" in answer.err
    assert said in answer.err
