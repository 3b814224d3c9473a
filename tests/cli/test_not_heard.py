"""What a command was told and did not hear: it is obeyed, or refused in one line."""

import json
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import eutree as library
from eutree.data import DemonstrationFolder, Demonstrations, Episode
from eutree.data.episode import DROPPED
from eutree.errors import InvalidArgumentError
from eutree.interaction.names import Names
from eutree.policies import TreePolicy
from eutree.schema import Feature, Schema

SHORT = ("--episodes", 1, "--evaluation-episodes", 1, "--judge-episodes", 0, "--front-steps", 0)


def names_file(path, **names):
    path.write_text(json.dumps(names))
    return path


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("no-such-env-v9",), "of eutree/Evasion2-v0(n_opponents=2): leave out environment"),
        (("CartPole-v1",), "of eutree/Evasion2-v0(n_opponents=2): leave out environment"),
        (("--env-arg", "a=1"), "nothing is played with --offline: leave out --env-arg"),
        (("--action-grid", "a=1,2"), "nothing is played with --offline: leave out --action-grid"),
        (("--decode",), "nothing is played with --offline: leave out --decode"),
        (("--n-jobs", 2), "nothing is played with --offline: leave out --n-jobs"),
        (("--names", "names.json"), "of their own: leave out --names"),
    ],
)
def test_learning_offline_hears_of_no_environment(eutree, demonstrations, tmp_path, more, said):
    names_file(tmp_path / "names.json", actions=["halt", "drive"])
    line = ("learn", *more, "--demos", demonstrations, "--offline", "--episodes", 1, "--out", "run")
    answer = eutree(*line)
    assert answer.code == 2
    assert said in answer.err
    assert answer.err.count("\n") == 1


def test_learning_offline_takes_the_environment_of_the_demonstrations(eutree, demonstrations):
    line = ("--demos", demonstrations, "--offline", "--episodes", 1, "--out", "run")
    assert eutree("learn", "eutree/Evasion2-v0", *line).code == 0


def numbered(folder):
    """Write demonstrations of CartPole-v1 as Minari makes them: numbers stand for names."""
    demos = library.record(
        gymnasium.make("CartPole-v1"), library.experts.balance, episodes=3, seed=1
    )
    schema = Schema.anonymous(4, 2)
    features = [replace(one, name=f"x{k}") for k, one in enumerate(demos.schema.features)]
    replace(demos, schema=Schema(tuple(features), schema.actions)).save(folder)
    return demos.schema


def test_names_are_given_to_demonstrations_with_numbers(eutree, tmp_path):
    known = numbered(tmp_path / "raw")
    names_file(tmp_path / "names.json", features=known.feature_names, actions=known.actions)
    assert "or kept by demos rename" in eutree("learn", "--demos", "raw", "--out", "a").err
    line = ("--demos", "raw", "--names", "names.json", *SHORT)
    answer = eutree("learn", *line, "--out", "b")
    assert answer.code == 0, answer.err
    line = ("--demos", "raw", "--names", "names.json", "--offline", "--episodes", 1, "--out", "c")
    assert eutree("learn", *line).code == 0
    assert TreePolicy.load(tmp_path / "c" / "policy.json").schema.actions == known.actions
    assert eutree("fit", "raw", "--names", "names.json", "--out", "p.json").code == 0


def folder_of(path, *features):
    schema = Schema(features[:2], ("stop", "go")).derive(features[2:])
    episode = Episode(np.zeros((2, len(features))), [0], [0.0], True, False)
    Demonstrations((episode,), schema).save(path)
    return path


X, LEVEL, BARE = Feature("x", "m"), Feature("level", "m"), Feature("level")


@pytest.mark.parametrize(
    ("one", "other", "fits"),
    [
        ((X, LEVEL), (X, Feature("level", "cm")), False),
        ((X, LEVEL), (X, BARE), True),
        ((X, LEVEL, "d = x - level"), (X, LEVEL, "d = x + level"), False),
        ((X, LEVEL, "d = x - level"), (X, LEVEL, "d = x  -  (level)"), True),
    ],
)
def test_folders_are_merged_where_their_features_mean_the_same(eutree, tmp_path, one, other, fits):
    folders = [folder_of(tmp_path / name, *of) for name, of in (("a", one), ("b", other))]
    answer = eutree("demos", "merge", *folders, "--out", "c")
    assert answer.code == (0 if fits else 2)
    assert fits or "holds demonstrations with other features or actions" in answer.err


@pytest.mark.parametrize(
    ("names", "own"),
    [({"actions": ["go", "stop"]}, "stop, go"), ({"features": ["level [m]", "x"]}, "x, level")],
)
def test_own_names_in_another_order_are_refused(eutree, tmp_path, names, own):
    folder_of(tmp_path / "demos", X, LEVEL)
    assert eutree("fit", "demos", "--out", "p.json").code == 0
    path = names_file(tmp_path / "names.json", **names)
    for line in (
        ("show", "p.json", "--names", path),
        ("edit", "p.json", "--rename", path, "--out", "q.json"),
        ("demos", "rename", "demos", path),
    ):
        answer = eutree(*line)
        assert answer.code == 2
        assert f"names must be in the order of those there, {own}, got" in answer.err
    renamed = Names(features=("y", "x")).of(Schema((X, LEVEL), ("stop", "go")))
    assert renamed.feature_names == ("y", "x")
    with pytest.raises(InvalidArgumentError, match="in the order of those there"):
        Names(actions=("go", "stop")).of(renamed)


def test_a_trimmed_episode_has_no_action_that_leads_nowhere(eutree, tmp_path):
    rows = "episode,action,x\n0,0,1\n0,1,2\n0,1,3\n0,0,4\n"
    (tmp_path / "log.csv").write_text(rows)
    assert eutree("demos", "import", "log.csv", "--out", "demos").code == 0
    assert DROPPED in DemonstrationFolder("demos").read(0).extras
    assert eutree("demos", "trim", "demos", 0, "--steps", 1).code == 0
    assert not DemonstrationFolder("demos").read(0).extras
    assert "is left out" not in eutree("demos", "merge", "demos", "--out", "again").out


def test_a_preset_may_be_named_in_the_settings_too(eutree, tmp_path):
    (tmp_path / "s.toml").write_text('method = "default"\n')
    for more in ((), ("--preset", "default"), ("--method", "default")):
        line = ("learn", "--settings", "s.toml", "--list-settings", *more)
        assert eutree(*line).code == 0, more
    answer = eutree("learn", "--settings", "s.toml", "--list-settings", "--preset", "paper")
    assert "method must be 'paper' as asked, got 'default'" in answer.err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("method = 5", "method must be a name, got 5"),
        ('method = ["a"]', "method must be a name, got ['a']"),
        ("[run]\nexpert = 5", "run: Expected `str | null`, got `int` - at `$.expert`"),
        ("[run]\nderived = 5", "run: Expected `array`, got `int` - at `$.derived`"),
        ("[run]\nderived = [5]", "run: Expected `str`, got `int` - at `$.derived[0]`"),
        ('[run]\nderived = "text"', "run: Expected `array`, got `str` - at `$.derived`"),
        ("[run]\narguments = 5", "run: Expected `object`, got `int` - at `$.arguments`"),
        ('[run]\nrace_share = "x"', "run: Expected `float`, got `str` - at `$.race_share`"),
        ("[run]\nrace_share = nan", "run: Expected `float` >= 0.0 - at `$.race_share`"),
        ("[run]\nrace_share = -3.0", "run: Expected `float` >= 0.0 - at `$.race_share`"),
        ("[run]\nrace_share = 3.0", "run: Expected `float` < 1.0 - at `$.race_share`"),
        ("[run]\ntask = 5", "run: Expected `str`, got `int` - at `$.task`"),
        ("[run]\nshare = 5", "run: Object contains unknown field `share`"),
        ("run = 5", "run: Expected `object`, got `int`"),
    ],
)
def test_settings_of_a_wrong_type_are_refused_in_one_line(eutree, tmp_path, text, said):
    (tmp_path / "s.toml").write_text(text + "\n")
    answer = eutree("learn", "CartPole-v1", "--settings", "s.toml", "--out", "run", *SHORT)
    assert answer.code == 2
    assert answer.err == f"error: s.toml: {said}\n"
