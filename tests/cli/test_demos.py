"""``eutree demos``: each command, its JSON, and one line for each mistake."""

import json
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.cli.main import run
from eutree.data import DemonstrationFolder, Demonstrations, Episode
from eutree.errors import InvalidArgumentError
from eutree.interaction.names import kinds_of
from eutree.schema import Feature, Schema
from tests.files.faults import Operations, use_operations


@pytest.fixture(scope="module")
def recorded():
    env = gymnasium.make("eutree/Evasion2-v0")
    return eutree.record(env, eutree.experts.wait_at_crossing, episodes=3, seed=5)


@pytest.fixture
def folder(recorded, tmp_path):
    recorded.save(tmp_path / "demos")
    return str(tmp_path / "demos")


@pytest.fixture
def ask(capsys):
    def ask(*arguments, code=0):
        assert run(["demos", *map(str, arguments), "--json"]) == code
        captured = capsys.readouterr()
        return json.loads(captured.out) if code < 2 else captured.err

    return ask


def test_list_keep_drop_and_trim(folder, ask, capsys):
    listed = ask("list", folder)
    assert [e["episode"] for e in listed["episodes"]] == [0, 1, 2]
    ask("drop", folder, 0, 2, "--comment", "too late")
    listed = ask("list", folder)
    assert [e["kept"] for e in listed["episodes"]] == [False, True, False]
    assert listed["episodes"][0]["comment"] == "too late"
    assert len(Demonstrations.load(folder)) == 1
    ask("keep", folder, 2)
    assert len(Demonstrations.load(folder)) == 2
    assert ask("list", folder)["episodes"][2]["comment"] == ""  # why it was discarded
    ask("keep", folder, 2, "--comment", "good")
    ask("keep", folder, 2)
    assert ask("list", folder)["episodes"][2]["comment"] == "good"  # it was kept already
    ask("trim", folder, 1, "--steps", 4)
    assert ask("list", folder)["episodes"][1]["length"] == 4
    assert run(["demos", "list", folder]) == 0
    out = capsys.readouterr().out
    assert "discarded" in out
    assert "trimmed" in out
    assert ask("check", folder) == {"episodes": 3, "equal": 3, "problems": []}


def test_replay_and_stats(folder, recorded, ask, capsys):
    steps = ask("replay", folder, 1)["steps"]
    assert len(steps) == len(recorded.episodes[1])
    assert steps[0]["action"] in recorded.schema.actions
    stats = ask("stats", folder)
    assert stats["n_transitions"] == recorded.n_transitions
    assert stats["whole_episodes"] == len(recorded)
    low, high = stats["interval"]
    assert low < stats["success_rate"] <= high <= 1.0
    for command in (["replay", folder, "1"], ["stats", folder], ["check", folder]):
        assert run(["demos", *command]) == 0
        assert capsys.readouterr().out.count("\n") >= 1


def test_replay_in_a_window_takes_the_recorded_steps(folder, ask, monkeypatch, recorded):
    from eutree.envs.evasion import EvasionEnv

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    taken, modes, own = [], [], EvasionEnv.step

    def step(env, action):
        taken.append(action)
        modes.append(env.render_mode)
        return own(env, action)

    monkeypatch.setattr(EvasionEnv, "step", step)
    ask("trim", folder, 1, "--steps", 2)
    taken.clear()
    modes.clear()
    assert len(ask("replay", folder, 1, "--window")["steps"]) == 2
    assert taken == recorded.episodes[1].actions[:2].tolist()
    assert modes == ["human", "human"]


def test_stats_count_no_success_of_a_driven_episode(folder, ask, tmp_path):
    opened = DemonstrationFolder(folder)
    one = opened.read(0)
    opened.write(3, replace(one, is_success=False, steps={"by_hand": np.ones(len(one), bool)}))
    page = tmp_path / "demos.html"
    stats = ask("stats", folder, "--html", page)
    assert (stats["whole_episodes"], stats["success_rate"]) == (3, 1.0)
    assert "100&nbsp;% of the episodes succeed" in page.read_text()


def test_stats_of_a_folder_with_an_episode_that_is_cut_altogether(folder, ask):
    opened = DemonstrationFolder(folder)
    for number in (3, 4):
        opened.write(number, opened.read(number - 3))
    one = opened.read(4)
    opened.write(4, one.teaching_in(0, len(one), None))
    stats = ask("stats", folder)
    assert stats["episodes"] == 5
    assert [point["episodes"] for point in stats["learning_curve"]["points"]] == [1, 2, 3]


def test_stats_as_a_page_has_the_same_figures(folder, ask, tmp_path):
    ask("drop", folder, 1)
    page = tmp_path / "demos.html"
    stats = ask("stats", folder, "--html", page)
    text = page.read_text()
    assert stats["path"] == str(page)
    assert stats["advice"] in text
    assert "2 episodes and 1 discarded" in text
    assert stats["learning_curve"] is None  # of two episodes nothing can be said


def test_stats_know_the_learning_curve(ask, tmp_path):
    env = gymnasium.make("eutree/Evasion2-v0")
    demos = eutree.record(env, eutree.experts.wait_at_crossing, episodes=5, seed=5)
    demos.save(tmp_path / "five")
    stats = ask("stats", tmp_path / "five")
    curve = stats["learning_curve"]
    assert [p["episodes"] for p in curve["points"]] == [1, 2, 3, 4]
    assert all(0 <= p["interval"][0] <= p["accuracy"] <= 1 for p in curve["points"])
    assert curve["gain_interval"][0] <= curve["gain_interval"][1]


def test_check_names_the_episode_that_differs(folder, ask):
    opened = DemonstrationFolder(folder)
    episode = opened.read(1)
    observations = episode.observations.copy()
    observations[2, 0] += 1e-12

    opened.write(1, replace(episode, observations=observations))
    found = ask("check", folder, code=1)
    assert (found["episodes"], found["equal"]) == (3, 2)
    assert found["problems"][0]["episode"] == 1
    assert "at step 1: observation was" in found["problems"][0]["problem"]


def test_merge_import_and_export(folder, recorded, ask, tmp_path, monkeypatch):
    ask("merge", folder, folder, "--out", tmp_path / "both")
    assert len(Demonstrations.load(tmp_path / "both")) == 6
    targets = [tmp_path / "demos.csv", tmp_path / "demos.npz"]
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    targets.append("minari:eutree/test-v0")
    for k, target in enumerate(targets):
        ask("export", folder, target)
        out = tmp_path / f"back{k}"
        arguments = [] if k == 2 else ["--env", "eutree/Evasion2-v0"]
        ask("import", target, "--out", out, *arguments)
        back = Demonstrations.load(out)
        assert np.array_equal(back.observations, recorded.observations)
        assert np.array_equal(back.actions, recorded.actions)
        assert back.schema == recorded.schema
        if k != 1:
            assert ask("check", out)["equal"] == 3


def test_merging_says_which_episodes_are_there_twice(folder, eutree, tmp_path):
    once = eutree("demos", "merge", folder, "--out", tmp_path / "once")
    assert "warning" not in once.err
    twice = eutree("demos", "merge", folder, folder, "--out", tmp_path / "twice")
    assert "warning: 3 episodes of these repeat another one, bit for bit" in twice.err
    assert twice.code == 0


def test_a_plants_log_is_imported_by_its_own_columns(ask, tmp_path, capsys):
    """The last action of each episode was dropped without a word, and columns had to be renamed."""
    log, out = tmp_path / "plant.csv", tmp_path / "days"
    log.write_text("day;room;heater;cost\nmon;19;on;-2\nmon;20;off;-1\ntue;18;on;-3\n")
    how = ["--episode-column", "day", "--action-column", "heater", "--reward-column", "cost"]
    arguments = ["import", log, "--out", out, *how, "--delimiter", ";"]
    assert ask(*arguments) == {
        "episodes": 2,
        "n_transitions": 1,
        "dropped_actions": 2,
        "filled_rows": 0,
        "left_out_rows": 0,
        "path": str(out),
    }
    assert Demonstrations.load(out).episodes[0].rewards.tolist() == [-2.0]
    assert run(["demos", *map(str, arguments[:2]), "--out", str(tmp_path / "b"), *how,
                "--delimiter", ";"]) == 0  # fmt: skip
    said = " ".join(capsys.readouterr().out.split())
    assert "2 episodes, 1 transition, written to" in said
    assert "the last action of 2 episodes is left out" in said
    error = ask("import", log, "--out", tmp_path / "c", code=2)
    assert "--episode-column and --action-column" in error
    assert "--time COLUMN, with --episode-gap 1h" in error
    assert run(["demos", "import", "--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert 'Two columns are required: "episode"' in shown
    assert "are for a file .csv" in ask(
        "import", "minari:a/b-v0", "--out", out, "--delimiter", ";", code=2
    )


def test_mistakes_give_one_line_and_code_2(folder, ask, tmp_path):
    DemonstrationFolder.create(tmp_path / "empty", Schema.anonymous(2, 2))
    (tmp_path / "other").mkdir()
    (tmp_path / "x.csv").write_text("episode,action,x\n")
    cases = {
        ("list", tmp_path / "none"): "no such folder of demonstrations",
        ("list", tmp_path / "other"): "holds no demonstrations",
        ("stats", tmp_path / "empty"): "holds no episodes yet; record some",
        ("check", tmp_path / "empty"): "holds no episodes yet",
        ("check", folder, "--env", "eutree/Evasion3-v0"): "not of eutree/Evasion3-v0",
        ("check", folder, "--env", "eutree/Evasoin2-v0"): "Did you mean",
        ("merge", folder, tmp_path / "empty", "--out", tmp_path / "m"): "holds demonstrations of",
        ("merge", folder, "--out", folder): "must be another place than FOLDERS",
        ("drop", folder, 0, 9): "has no episode 9",
        ("trim", folder, 0, "--steps", 9999): "--steps must be less than",
        ("replay", folder, 9): "has no episode 9",
        ("export", folder, "x.parquet"): "must be minari:ID, or a file ending in .csv or .npz",
        ("export", folder, "minari:x"): "end in a version like -v0",
        ("import", "minari:eutree/none-v0", "--out", tmp_path / "m"): "minari download",
        ("import", tmp_path / "none.npz", "--out", tmp_path / "m"): "does not exist",
        ("import", tmp_path / "x.csv", "--out", tmp_path / "m"): "x.csv",
    }
    for arguments, message in cases.items():
        error = ask(*arguments, code=2)
        assert message in error, (arguments, error)
        assert error.count("\n") == 1
    assert len(Demonstrations.load(folder)) == 3
    assert not (tmp_path / "m").exists()


def test_every_command_has_help_with_an_example(capsys):
    names = ("list", "keep", "drop", "trim", "replay", "check")
    for name in (*names, "merge", "stats", "import", "export"):
        assert run(["demos", name, "--help"]) == 0
        assert f"Example: eutree demos {name}" in " ".join(capsys.readouterr().out.split())


@pytest.mark.promise(10)
def test_a_full_disk_is_one_line_and_loses_nothing(folder, ask, recorded):
    import errno
    import os

    class Full(Operations):
        def write(self, descriptor, data):
            os.write(descriptor, data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device")

    with use_operations(Full()):
        error = ask("drop", folder, 1, code=2)
        assert "the disk is full; what was there before is intact" in error
        assert error.count("\n") == 1
        error = ask("export", folder, folder + ".csv", code=2)
        assert "the disk is full" in error
    assert len(Demonstrations.load(folder)) == len(recorded)
    assert not os.path.exists(folder + ".csv")
    assert not any(name.startswith(".") for name in os.listdir(folder))


def test_a_log_is_imported_with_kinds(tmp_path, ask):
    (tmp_path / "log.csv").write_text(
        "episode,action,tariff,door\n0,a,1,open\n0,b,2,shut\n0,,3,open\n"
    )
    (tmp_path / "names.json").write_text('{"kinds": {"tariff": "integer"}}')
    names = ["--names", tmp_path / "names.json", "--nominal", "door"]
    ask("import", tmp_path / "log.csv", *names, "--out", tmp_path / "demos")
    assert kinds_of(Demonstrations.load(tmp_path / "demos").schema) == {
        "tariff": "integer",
        "door": ("open", "shut"),
    }


def test_a_log_of_one_episode_is_imported_and_one_of_one_row_is_not(eutree):
    log = Path("n.csv")
    log.write_text("x,heater\n20,on\n21,on\n22,on\n")
    line = ("demos", "import", "n.csv", "--action-column", "heater", "--out", "d")
    assert "--one-episode" in eutree(*line).err
    assert eutree(*line, "--one-episode").out.startswith("1 episode, 2 transitions")
    fitted = eutree("fit", "d", "--out", "e.json")
    assert "\n1 leaf from 2 steps" in fitted.out
    log.write_text("x,heater\n20,on\n")
    answer = eutree(*line, "--one-episode")
    assert (answer.code, "holds no transition" in answer.err) == (2, True)


def test_export_overwrites_its_own_tables_and_no_log(folder, ask, tmp_path):
    log = tmp_path / "log.csv"
    ask("export", folder, log)
    ask("export", folder, log)  # again, where it was
    log.write_text("time,level,valve\n0,1.5,open\n")
    before = log.read_bytes()
    assert f"TARGET must be no log of another program, got {log}" in ask(
        "export", folder, log, code=2
    )
    assert log.read_bytes() == before
    log.write_text("")
    ask("export", folder, log)
    assert log.read_bytes()


def test_export_says_what_a_table_does_not_hold(folder, ask, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    opened = DemonstrationFolder(folder)
    one = opened.read(1)

    def said(name):
        assert run(["demos", "export", folder, name]) == 0
        return " ".join(capsys.readouterr().err.split())

    table = str(tmp_path / "a.csv")
    assert said(table) == ""
    opened.write(1, one.teaching_in(0, 2, None))
    assert said(table).startswith("warning: the marks of steps cut or flipped are not in the table")
    opened.write(2, replace(one, steps={"by_hand": np.ones(len(one), bool)}))
    both = "the marks of steps that a tree drove and steps cut or flipped are not in the table"
    assert both in said(str(tmp_path / "a.npz"))
    assert said("minari:eutree/marks-v0") == ""
    ask("import", "minari:eutree/marks-v0", "--out", tmp_path / "back")
    assert Demonstrations.load(tmp_path / "back").episodes[1].taught.tolist()[:2] == [-1, -1]
    ask("drop", folder, 1, 2)
    assert said(table) == ""  # nobody learns from these


def test_export_says_which_kinds_and_actions_a_table_loses(tmp_path, monkeypatch, capsys):
    """They were lost in silence, and "ratio (a/b)" came back as a ratio in a/b."""
    monkeypatch.chdir(tmp_path)
    features = (
        Feature("ratio (a/b)"),
        Feature("v [x]"),
        Feature("w [x]", "m"),
        Feature("v", "x"),
        Feature("mode", "", 0, 2, True, ("off", "day", "night")),
    )
    shown = Episode(np.eye(5), np.array([0, 1, 0, 1]), np.ones(4), True, False)
    plain = Schema(features[:4], ("stop", "go"))
    Demonstrations((replace(shown, observations=np.eye(5)[:, :4]),), plain).save("plain")
    Demonstrations((shown,), Schema(features, ("stop", "go", "wait"))).save("kinds")

    assert run(["demos", "export", "plain", "plain.csv"]) == 0
    assert capsys.readouterr().err == ""
    assert Demonstrations.from_csv("plain.csv").schema == plain
    assert run(["demos", "export", "kinds", "kinds.csv"]) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert said == (
        "warning: kinds of features and actions that were never taken are not in the table; demos "
        "import takes them by --names and --actions"
    )
    Path("names.json").write_text(json.dumps({"kinds": {"mode": ["off", "day", "night"]}}))
    options = ["--names", "names.json", "--actions", "stop,go,wait"]
    assert run(["demos", "import", "kinds.csv", "--out", "back", *options]) == 0
    back = Demonstrations.load("back").schema
    assert back.features[4].categories == ("off", "day", "night")
    assert back.actions == ("stop", "go", "wait")


@pytest.mark.parametrize(
    ("missing", "filled", "left_out", "words"),
    [
        ("hold", 2, 1, "; 2 rows with empty cells filled; 1 row with empty cells left out"),
        ("drop", 0, 3, "; 3 rows with empty cells left out"),
        ("0.5", 3, 0, "; 3 rows with empty cells filled"),
    ],
)
def test_import_says_how_many_rows_were_filled_or_left_out(
    missing, filled, left_out, words, ask, tmp_path, capsys
):
    log = tmp_path / "log.csv"
    rows = ("off,,3", "off,1,2", "on,2,3", "on,,NaN", "on,2,null", "off,3,1", "off,3,2")
    log.write_text("\n".join(("action,level,flow", *rows)))
    line = ("import", log, "--one-episode", "--missing", missing, "--out")
    assert run(["demos", *map(str, line), str(tmp_path / "a")]) == 0
    assert words in capsys.readouterr().out
    found = ask(*line, tmp_path / "b")
    assert (found["filled_rows"], found["left_out_rows"]) == (filled, left_out)


def test_one_episode_without_rewards_is_said_to_have_none(ask, tmp_path, capsys):
    """It was said to earn "0 on average", and to be "1 episodes"."""
    log, demos = tmp_path / "log.csv", tmp_path / "days"
    log.write_text("episode,action,level,terminated\n0,a,1,false\n0,b,2,true\n0,,3,\n")
    ask("import", log, "--out", demos)
    figures = ask("stats", demos, "--html", tmp_path / "days.html")
    assert figures["whole_episodes"] == 1
    assert figures["mean_return"] is None
    assert run(["demos", "stats", str(demos)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("1 episode (0 discarded), 2 transitions\nshown: unknown returns in 1 ")
    assert "1 episodes" not in (tmp_path / "days.html").read_text()


def test_a_check_is_made_with_the_arguments_that_are_given(folder, ask):
    assert ask("check", folder, "--env-arg", "noise=0", code=1)["equal"] == 0
    assert ask("check", folder, "--env-arg", "noise=0.02")["equal"] == 3


def test_an_import_derives_features_and_takes_no_arguments_without_an_environment(tmp_path, ask):
    log = tmp_path / "log.csv"
    log.write_text("episode,action,x,y\n0,a,1,2\n0,b,3,5\n")
    ask("import", log, "--derive", "gap = y - x", "--out", tmp_path / "a")
    (episode,) = Demonstrations.load(tmp_path / "a")
    assert episode.observations[:, 2].tolist() == [1.0, 2.0]
    said = ask("import", log, "--env-arg", "foo=1", "--out", tmp_path / "b", code=2)
    assert "arguments need --env, got foo" in said


def test_demonstrations_of_another_task_are_refused(folder, recorded, tmp_path, capsys):
    policy = tmp_path / "policy.json"
    eutree.fit_expert_tree(recorded).save(policy)
    cart_pole = eutree.record("CartPole-v1", lambda o: int(o[2] > 0), episodes=1, seed=0)
    cart_pole.save(tmp_path / "other")
    for command in (
        ["show", str(policy), "--html", str(tmp_path / "a.html"), "--episodes", "0"],
        ["verify", str(policy), "--property", "no dead leaves"],
    ):
        assert run([*command, "--demos", str(tmp_path / "other")]) == 2
        said = capsys.readouterr().err
        assert "of the policy's task eutree/Evasion2-v0 (features, actions: (3, 2))" in said
        assert "got CartPole-v1 (4, 2)" in said
    with pytest.raises(InvalidArgumentError, match="demonstrations must be Demonstrations"):
        eutree.why(eutree.fit_expert_tree(recorded), [0.0, 1.0, 2.0], demonstrations=3)


def test_columns_by_place_have_the_units_of_an_environment_but_names_may_rename(ask, tmp_path):
    """The angle of a pole was taken for the position of the cart, since it came first."""
    log, demos = tmp_path / "log.csv", tmp_path / "demos"
    log.write_text(
        "episode,action,pole [rad],cart [m],v [m/s],w [rad/s]\n0,0,1,2,3,4\n0,1,1,2,3,4\n"
    )
    told = ask("import", log, "--env", "CartPole-v1", "--out", demos, code=2)
    assert "line 1: pole must be in m where position is expected, got a column in rad; if" in told
    names = {"features": ["Winkel [°]", "Ort [cm]", "v", "w"]}
    (tmp_path / "names.json").write_text(json.dumps(names))
    ask("import", log, "--names", tmp_path / "names.json", "--out", demos)
    features = eutree.data.Demonstrations.load(demos).schema.features
    assert [one.unit for one in features[:2]] == ["°", "cm"]


class SometimesBarred(gymnasium.Env):
    """Bars its second action where ``barred`` says so."""

    observation_space = gymnasium.spaces.Box(0.0, 9.0, (1,), np.float64)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, barred: bool = False, render_mode: str | None = None) -> None:
        self.barred, self.render_mode = barred, render_mode

    def info(self) -> dict[str, np.ndarray]:
        return {"action_mask": np.array([1, not self.barred], dtype=np.int8)}

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return np.zeros(1), self.info()

    def step(self, action):
        self.steps += 1
        return np.full(1, float(self.steps)), 1.0, self.steps >= 3, False, self.info()


def test_an_action_that_is_masked_now_is_a_difference(ask, tmp_path, capsys):
    """The command ended with the error of the first one, and said nothing of the others."""
    gymnasium.register("SometimesBarred-v0", SometimesBarred)
    try:
        env = gymnasium.make("SometimesBarred-v0")
        second = eutree.record(env, lambda env: 1, episodes=2, seed=0)
        second.save(tmp_path / "demos")
        line = ["demos", "check", str(tmp_path / "demos"), "--env-arg", "barred=true"]
        assert run(line) == 1
    finally:
        gymnasium.registry.pop("SometimesBarred-v0")
    said = capsys.readouterr().out
    assert "0 of 2 episodes are equal" in said
    assert said.count("action must be one that the environment allows") == 2


def test_folders_whose_features_are_of_another_kind_are_not_merged(tmp_path, capsys):
    whole, real = Feature("x", low=0, high=10, is_integer=True), Feature("x", low=0, high=10)
    for name, feature, value in (("whole", whole, 2.0), ("real", real, 2.5)):
        one = Episode(np.full((3, 1), value), [0, 1], np.ones(2), True, False)
        Demonstrations((one,), Schema((feature,), ("a", "b"))).save(tmp_path / name)
    folders = [str(tmp_path / name) for name in ("whole", "real", "both")]
    assert run(["demos", "merge", *folders[:2], "--out", folders[2]]) == 2
    assert "x" in capsys.readouterr().err
    assert not (tmp_path / "both").exists()


def test_arguments_of_no_environment_are_refused(tmp_path, capsys):
    one = Episode(np.zeros((3, 1)), [0, 1], np.ones(2), True, False)
    Demonstrations((one,), Schema.anonymous(1, 2)).save(tmp_path / "demos")
    line = [
        "fit",
        str(tmp_path / "demos"),
        "--env-arg",
        "foo=1",
        "--episodes",
        "0",
        "--out",
        "x.json",
    ]
    assert run(line) == 2
    assert "names no environment to give foo to" in capsys.readouterr().err
