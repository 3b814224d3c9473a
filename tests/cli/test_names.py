"""``--names``: an environment of others speaks of rooms and hours, wherever it is made."""

import json
import sys

import gymnasium
import numpy as np
import pytest

import eutree as library
from eutree.data import DemonstrationFolder, Demonstrations, Episode
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees import DecisionTree

MODULE = """
import gymnasium
import numpy as np
from gymnasium import spaces

class Room(gymnasium.Env):
    observation_space = spaces.Tuple([spaces.Box(0, 40, (1,), np.float64), spaces.Discrete(24)])
    action_space = spaces.Discrete(2)

    def _see(self):
        return np.array([self.room]), self.hour

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.room, self.hour = float(self.np_random.uniform(10, 25)), 0
        return self._see(), {}

    def step(self, action):
        self.room += (2.0 if action else 0.0) - 0.1 * (self.room - 8.0)
        self.hour += 1
        return self._see(), -abs(self.room - 20.0), False, self.hour == 23, {}

gymnasium.register("Chamber-v0", Room)
"""
NAMES = {"features": ["room [°C]", "hour [h]"], "actions": ["off", "on"]}


class Switch:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        room, _ = observation
        return int(room[0] < 20.0), state


@pytest.fixture
def room(tmp_path, monkeypatch):
    (tmp_path / "rooms.py").write_text(MODULE)
    (tmp_path / "names.json").write_text(json.dumps(NAMES))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    import rooms  # noqa: F401

    yield ("--import", "rooms", "--names", "names.json")
    gymnasium.registry.pop("Chamber-v0", None)
    sys.modules.pop("rooms", None)


@pytest.fixture
def recorded(room):
    """Return unnamed demonstrations of the room, in a folder."""
    demos = library.record(gymnasium.make("Chamber-v0"), Switch(), episodes=4, seed=0)
    demos.save("unnamed")
    return demos


def test_unnamed_spaces_have_names_that_can_be_typed(eutree, recorded):
    assert recorded.schema.feature_names == ("x0", "x1")
    assert recorded.schema.actions == ("action_0", "action_1")
    assert eutree("fit", "unnamed", "--out", "expert.json").code == 0
    asked = "never action_1 when x0 >= 39"
    assert "proven" in eutree("verify", "expert.json", "--property", asked).out
    changed = eutree("edit", "expert.json", "--set-action", "0=action_0", "--out", "edited.json",
                     "--episodes", 0)  # fmt: skip
    assert changed.code == 0, changed.err


def test_names_are_given_once_and_travel(eutree, room, recorded):
    recorded.to_csv("log.csv")
    line = ("demos", "import", "log.csv", "--env", "Chamber-v0", "--out", "demos", *room)
    assert eutree(*line).code == 0
    schema = Demonstrations.load("demos").schema
    assert schema.feature_names == ("room", "hour")
    assert [f.unit for f in schema.features] == ["°C", "h"]
    assert schema.actions == ("off", "on")
    assert eutree("fit", "demos", "--out", "expert.json").code == 0
    learned = eutree("learn", "--demos", "demos", "--out", "run", "--episodes", 2,
                     "--evaluate-every", 2, "--evaluation-episodes", 2)  # fmt: skip
    assert learned.code == 0, learned.err
    assert "room <= " in str(TreePolicy.load("run/policy.json"))
    # wherever an environment is made, with names and without
    for names in (room, room[:2]):
        for command in (
            ("evaluate", "run", "--episodes", 2),
            ("show", "run", "--html", "page.html", "--episodes", 1),
            ("edit", "run", "--set-action", "0=on", "--episodes", 2, "--out", "edited.json"),
            ("compress", "run", "--out", "small.json", "--evaluate", "--episodes", 2),
            ("demos", "check", "demos"),
            ("distill", "Chamber-v0", "--policy", "run", "--out", "d.json", "--iterations", 1,
             "--episodes", 2, "--validation-episodes", 2),
        ):  # fmt: skip
            answer = eutree(*command, *names)
            assert answer.code == 0, (command, answer.err)
    own = eutree("distill", "Chamber-v0", "--policy", "run", "--out", "d.json", "--iterations", 1,
                 "--episodes", 2, "--validation-episodes", 2, *room)  # fmt: skip
    assert own.code == 0
    assert TreePolicy.load("d.json").schema.feature_names == ("room", "hour")
    started = eutree("learn", "Chamber-v0", "--out", "new", "--episodes", 2, "--evaluate-every", 2,
                     "--evaluation-episodes", 2, *room)  # fmt: skip
    assert started.code == 0, started.err
    assert TreePolicy.load("new/policy.json").schema.actions == ("off", "on")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('{"features": ["room"]}', "one for each of the 2 features, x0, x1, got 1"),
        ('{"actions": ["a", "b", "c"]}', "one for each of the 2 actions, action_0, action_1"),
        ('{"actions": ["a", "a"]}', "must have distinct actions"),
        ('{"feature": ["room"]}', "unknown field"),
        ('{"features": "room"}', "names.json: features"),
        ("[", "names.json"),
        ("[" * 100_000, "names.json"),
    ],
)
def test_bad_names_are_refused_in_one_line(eutree, room, content, message):
    with open("names.json", "w") as file:
        file.write(content)
    answer = eutree("learn", "Chamber-v0", "--out", "run", "--episodes", 1, *room)
    assert answer.code == 2
    assert message in answer.err
    assert answer.err.count("\n") == 1


def test_names_are_gone_after_the_command(eutree, room):
    line = ("learn", "Chamber-v0", "--out", "run", "--episodes", 1, "--evaluation-episodes", 1)
    assert eutree(*line, *room).code == 0
    assert eutree(*line[:2], "--out", "other", *line[4:], *room[:2]).code == 0
    assert TreePolicy.load("other/policy.json").schema.feature_names == ("x0", "x1")


def test_names_that_an_environment_has_must_be_those_of_a_policy():
    named = Schema.anonymous(2, 2)
    old = Schema(named.features, ("action 0", "action 1"))  # as files up to release 0.1 say
    named.check_same(old, "policy", of="the environment")
    cart = library.record(gymnasium.make("CartPole-v1"), library.experts.balance, episodes=1)
    with pytest.raises(ValueError, match="must have the features and actions of"):
        cart.schema.check_same(Schema.anonymous(4, 2), "policy", of="the environment")
    Schema.anonymous(4, 2).check_same(cart.schema, "policy", of="the environment")
    with pytest.raises(ValueError, match="must have the features and actions of"):
        Schema.anonymous(3, 2).check_same(cart.schema, "policy", of="the environment")


def test_a_folder_with_names_is_continued_without_them(tmp_path):
    unnamed = Schema.anonymous(2, 2)
    named = Schema(unnamed.features, ("off", "on"))
    DemonstrationFolder.create(tmp_path / "a", named)
    assert DemonstrationFolder.create(tmp_path / "a", unnamed).schema == named
    DemonstrationFolder.create(tmp_path / "b", unnamed)
    with pytest.raises(ValueError, match="other features or actions"):
        DemonstrationFolder.create(tmp_path / "b", named)


def unnamed(folder, *, history=0):
    """Write a policy and demonstrations whose features and actions have numbers for names."""
    episode = Episode(np.arange(6.0).reshape(3, 2), [0, 1], [0.0, 1.0], True, False)
    demos = Demonstrations((episode,), Schema.anonymous(2, 2))
    demos.save(folder / "shown")
    tree = DecisionTree.single_leaf(2 * (history + 1)).split(0, 0, 2.0)
    schema = Schema.anonymous(2, 2).with_history(history)
    TreePolicy(tree, np.array([0, 1]), schema, history=history).save(folder / "p.json")


@pytest.mark.parametrize("history", [0, 1])
def test_show_takes_names(eutree, tmp_path, history):
    """They were ignored."""
    unnamed(tmp_path, history=history)
    (tmp_path / "names.json").write_text(json.dumps(NAMES))
    shown = eutree("show", "p.json", "--names", "names.json").out
    assert "room <= 2 °C ?" in shown
    assert "on" in shown
    page = ("show", "p.json", "--names", "names.json", "--html", "p.html", "--episodes", 0)
    assert eutree(*page).code == 0
    assert '"room"' in (tmp_path / "p.html").read_text()


def test_names_are_given_after_recording(eutree, tmp_path):
    unnamed(tmp_path, history=1)
    (tmp_path / "names.json").write_text(json.dumps(NAMES))
    before = DemonstrationFolder(tmp_path / "shown").read(0)
    assert "features: room [°C], hour [h]" in eutree("demos", "rename", "shown", "names.json").out
    renamed = DemonstrationFolder(tmp_path / "shown")
    assert renamed.schema.feature_names == ("room", "hour")
    assert renamed.schema.actions == ("off", "on")
    assert renamed.read(0).observations.tobytes() == before.observations.tobytes()

    line = ("edit", "p.json", "--rename", "names.json")
    assert "--out must name the file" in eutree(*line).err
    said = eutree(*line, "--out", "q.json").out
    assert "named: room [°C], hour [h]; off, on" in said
    policy = TreePolicy.load(tmp_path / "q.json")
    assert policy.schema.feature_names == ("room", "hour", "room, 1 ago", "hour, 1 ago")
    (tmp_path / "few.json").write_text('{"features": ["room"]}')
    for command in (("demos", "rename", "shown", "few.json"),
                    ("edit", "q.json", "--rename", "few.json", "--out", "r.json"),
                    ("show", "q.json", "--names", "few.json")):  # fmt: skip
        answer = eutree(*command)
        assert answer.code == 2
        assert "names must have one for each of the 2 features" in answer.err


def test_the_names_of_an_environment_are_not_exchanged(eutree, tmp_path):
    line = ("record", "CartPole-v1", "--expert", "fall", "--out", "raw", "--names", "swapped.json")
    swapped = ["velocity", "position", "angle", "turn rate"]
    (tmp_path / "swapped.json").write_text(json.dumps({"features": swapped}))
    answer = eutree(*line)
    assert answer.code == 2
    assert "in the order of the environment's own, position, velocity, angle" in answer.err


def test_where_names_are_to_be_given_again_a_message_says_so(eutree, tmp_path):
    german = {"features": ["Ort [m]", "Tempo [m/s]", "Winkel [rad]", "Drehung [rad/s]"]}
    (tmp_path / "german.json").write_text(json.dumps(german))
    assert eutree("record", "CartPole-v1", "--expert", "fall", "--episodes", 2, "--out", "raw",
                  "--names", "german.json").code == 0  # fmt: skip
    answer = eutree("fit", "raw", "--out", "p.json", "--episodes", 2)
    assert answer.code == 2
    assert "names of a file are given here, too, by --names" in answer.err
    assert eutree("fit", "raw", "--out", "p.json", "--episodes", 2, "--names",
                  "german.json").code == 0  # fmt: skip
