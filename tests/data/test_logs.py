"""Logs as machines write them: what is read, and what is asked for in one line."""

import re
import time

import numpy as np
import pytest

from eutree.data import Demonstrations, LogFormat
from eutree.data.csv_files import read_csv
from eutree.data.log_format import label, seconds_of
from eutree.errors import FormatError, InvalidArgumentError
from eutree.policies import TreePolicy
from eutree.schema import Control, Feature, Schema, combined_actions
from eutree.trees import DecisionTree

PLANT = (
    "time;line;mode;level (m);inflow [l/s];pump\n"
    "2026-03-01 08:00:00;A;auto;1,50;3;off\n"
    "2026-03-01 08:00:10;A;auto;1,55;;off\n"
    "2026-03-01 08:00:20;A;hand;1,70;4;low\n"
    "2026-03-01 09:30:00;A;auto;0,90;2;off\n"
    "2026-03-01 09:30:10;A;service;1,00;2;high\n"
    "2026-03-01 09:30:20;A;auto;1,10;1;off\n"
)
READ = {"time": "time", "drop": ("line",), "nominal": ("mode",), "episode_gap": 3600.0}


@pytest.fixture
def plant(tmp_path):
    path = tmp_path / "plant.csv"
    path.write_text(PLANT)
    return path


def read(path, **changes):
    log = LogFormat(**(READ | {"missing": "hold"} | changes))
    return Demonstrations.from_csv(path, columns={"action": "pump"}, log=log)


def test_a_machines_log_is_read_as_it_is(plant):
    demos = read(plant, actions=("off", "low", "high"))
    assert demos.schema.feature_names == (
        "mode is auto",
        "mode is hand",
        "mode is service",
        "level",
        "inflow",
    )
    assert [f.unit for f in demos.schema.features] == ["", "", "", "m", "l/s"]
    assert demos.schema.groups == {"mode": (0, 1, 2)}
    assert demos.schema.actions == ("off", "low", "high")
    first, second = demos.episodes
    assert first.observations.tolist() == [
        [1, 0, 0, 1.5, 3],
        [1, 0, 0, 1.55, 3],
        [0, 1, 0, 1.7, 4],
    ]
    assert second.observations[:, 0].tolist() == [1, 0, 1]
    assert first.actions.tolist() == [0, 0]
    assert second.actions.tolist() == [0, 2]
    assert [e.extras["dropped_action"] for e in demos] == [1, 0]


def test_of_two_categories_one_feature_is_enough(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,action,door\n0,a,shut\n0,b,open\n0,,open\n")
    demos = Demonstrations.from_csv(path, log=LogFormat(nominal=("door",)))
    (door,) = demos.schema.features
    assert (door.name, door.categories, door.is_flag) == ("door", ("open", "shut"), True)
    tree = DecisionTree.single_leaf(1).split(0, 0, 0.5)
    assert str(TreePolicy(tree, [0, 1], demos.schema)).startswith("if door is open:")
    assert demos.observations.tolist() == [[1.0], [0.0]]


def test_rows_with_holes_end_an_episode_or_are_filled(plant):
    left_out = read(plant, missing="drop")
    assert [len(e.observations) for e in left_out.episodes] == [1, 1, 3]
    filled = read(plant, missing="-1")
    assert filled.episodes[0].observations[1, 4] == -1.0


@pytest.mark.parametrize("cell", ["NaN", "nan", "null", "N/A"])
def test_what_machines_write_for_no_value_is_an_empty_cell(plant, cell):
    wanted = read(plant)
    plant.write_text(PLANT.replace("1,55;;off", f"1,55;{cell};off"))
    assert read(plant).observations.tolist() == wanted.observations.tolist()
    with pytest.raises(FormatError, match="an empty cell is filled by --missing hold"):
        read(plant, missing="")


def test_nothing_is_held_over_a_pause_or_before_the_first(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,action,x,y\n0,a,,1\n1,a,2,1\n2,b,,1\n500,a,,1\n501,b,3,1\n502,a,4,1\n")
    log = LogFormat(time="t", episode_gap=60.0, missing="hold")
    demos = Demonstrations.from_csv(path, log=log)
    assert [e.observations[:, 0].tolist() for e in demos.episodes] == [[2.0, 2.0], [3.0, 4.0]]


def test_a_row_that_is_filled_is_counted_once(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,action,x\n0,on,1\n0,,\n0,,3\n0,,\n")
    log = LogFormat(missing="hold")
    (episode,), _, filled, left_out = read_csv(path, None, log=log)
    assert episode.observations.ravel().tolist() == [1.0, 1.0, 3.0, 3.0]
    assert (filled, left_out) == (3, 0)


def test_an_action_that_is_logged_when_it_changes_is_held(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,action,x\n0,on,1\n1,,2\n2,off,3\n3,,4\n4,,5\n")
    demos = Demonstrations.from_csv(path, log=LogFormat(time="t", missing="hold"))
    assert demos.schema.actions == ("on", "off")
    assert demos.episodes[0].actions.tolist() == [0, 0, 1, 1]


def test_each_episode_of_several_machines_has_its_own_time(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("m,t,action,x\na,0,u,1\nb,0,u,2\na,9,u,3\nb,5,u,4\na,8000,u,5\nb,10,u,6\n")
    log = LogFormat(time="t", episode_gap=100.0)
    demos = Demonstrations.from_csv(path, columns={"episode": "m"}, log=log)
    assert [e.observations.ravel().tolist() for e in demos.episodes] == [[1, 3], [2, 4, 6], [5]]


@pytest.mark.parametrize(
    ("log", "row"),
    [
        (LogFormat(missing="drop"), "a,2,u,,7,won,true"),
        (LogFormat(time="t", episode_gap=60.0), ""),
    ],
    ids=["an empty cell", "a pause"],
)
def test_an_episode_in_two_parts_began_once_and_ended_once(tmp_path, log, row):
    """Each part had the seed and the success of the whole."""
    path = tmp_path / "log.csv"
    rows = ["episode,t,action,x,seed,ending,is_success", "a,0,u,1,7,won,true", "a,1,u,2,7,won,true"]
    rows += [row] * bool(row) + ["a,500,u,3,7,won,true", "a,501,u,4,7,won,true"]
    path.write_text("\n".join(rows) + "\n")
    first, last = Demonstrations.from_csv(path, log=log).episodes
    assert (first.seed, first.ending, first.is_success) == (7, "", None)
    assert (last.seed, last.ending, last.is_success) == (None, "won", True)


def test_an_episode_without_its_first_row_does_not_begin_where_its_seed_does(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,action,x,seed\na,u,,7\na,u,2,7\na,u,3,7\nb,u,1,8\nb,u,2,8\n")
    demos = Demonstrations.from_csv(path, log=LogFormat(missing="drop"))
    assert [e.seed for e in demos.episodes] == [None, 8]


def test_pauses_alone_part_episodes_of_which_each_says_its_own(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,action,x,seed\n0,u,1,7\n1,u,2,7\n500,u,3,8\n501,u,4,8\n")
    log = LogFormat(time="t", episode_gap=60.0)
    assert [e.seed for e in Demonstrations.from_csv(path, log=log).episodes] == [7, 8]


def test_levels_of_a_quantity_are_in_their_order(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,action,x\n0,2.5,1\n0,-1.0,2\n0,0.0,3\n0,,4\n")
    assert Demonstrations.from_csv(path).schema.actions == ("-1.0", "0.0", "2.5")


@pytest.mark.parametrize(
    ("written", "actions", "numbers"),
    [
        (("1500", "0", "1500"), ("0", "1500"), [1, 0, 1]),  # watts
        (("22", "20", "21"), ("20", "21", "22"), [2, 0, 1]),  # degrees
        (("250000", "0", "0"), ("0", "250000"), [1, 0, 0]),  # pascals
        (("2", "100", "1"), ("1", "2", "100"), [1, 2, 0]),  # a name that is an index, too
        (("3", "0", "3"), ("action_0", "action_1", "action_2", "action_3"), [3, 0, 3]),
        (("17", "0", "0"), tuple(f"action_{k}" for k in range(18)), [17, 0, 0]),
    ],
)
def test_whole_numbers_far_apart_are_quantities(tmp_path, written, actions, numbers):
    path = tmp_path / "log.csv"
    rows = "".join(f"0,{action},{k}\n" for k, action in enumerate(written))
    path.write_text(f"episode,action,x\n{rows}0,,9\n")
    shown = Demonstrations.from_csv(path)
    assert shown.schema.actions == actions
    assert shown.episodes[0].actions.tolist() == numbers


@pytest.mark.parametrize(
    ("written", "actions"),
    [
        (("off", "2", "2", "1", "1", "off"), ("off", "2", "1")),  # a fan's speeds
        (("1", "off", "1", "off", "on", "on"), ("1", "off", "on")),
    ],
)
def test_words_among_numbers_are_names_all_of_them(tmp_path, written, actions):
    """A 2 was taken for the action with that index, whose name was 1."""
    path = tmp_path / "log.csv"
    rows = "".join(f"0,{action},{k}\n" for k, action in enumerate(written))
    path.write_text(f"episode,action,x\n{rows}0,,9\n")
    shown = Demonstrations.from_csv(path)
    again = Demonstrations.from_csv(path, schema=shown.schema)
    for demos in (shown, again):
        assert demos.schema.actions == actions
        assert [actions[k] for k in demos.episodes[0].actions] == list(written)


def test_quantities_are_the_same_however_they_are_written(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t;x;pump\n0;1;1,5\n1;2;0,75 \n2;3; 0\n3;4;0,0\n4;5;1.50\n5;6;\n")
    changes = {"time": "t", "drop": (), "nominal": (), "episode_gap": None, "missing": ""}
    demos = read(path, **changes)
    assert list(map(float, demos.schema.actions)) == [0.0, 0.75, 1.5]
    assert demos.actions.tolist() == [2, 1, 0, 0, 2]
    assert read(path, **changes, actions=("0", "0.75", "1.5")).actions.tolist() == [2, 1, 0, 0, 2]


@pytest.mark.parametrize("cell", ["", "NaN", "null"])
def test_an_action_that_a_machine_did_not_write_is_none(tmp_path, cell):
    path = tmp_path / "log.csv"
    path.write_text(f"t,x,pump\n0,1,{cell}\n1,2,1.0\n2,3,{cell}\n3,4,0.0\n4,5,{cell}\n")
    changes = {"time": "t", "drop": (), "nominal": (), "episode_gap": None}
    demos = read(path, **changes)
    assert demos.schema.actions == ("0.0", "1.0")
    assert demos.actions.tolist() == [1, 1, 0]
    with pytest.raises(FormatError, match=r"line 2: only an .* no action; by --missing hold the o"):
        read(path, **changes, missing="")
    path.write_text("t,x,pump\n0,1,null\n1,2,halb\n2,3,null\n")
    assert read(path, **changes, actions=("null", "halb")).actions.tolist() == [0, 1]


@pytest.mark.parametrize("first", ["NA", "up", "4"])
def test_a_cell_means_the_same_in_every_row(tmp_path, first):
    """``NA`` was nothing in the first rows and an action once another name was known."""
    path = tmp_path / "log.csv"
    rows = f"1,{first}", "2,NA", "3,left", "4,NA", "5,4", "6,left"
    path.write_text("\n".join(("a,action", *rows)))
    log = LogFormat(one_episode=True, missing="hold")
    demos = Demonstrations.from_csv(path, log=log)
    taken = [demos.schema.actions[action] for action in demos.actions]
    assert taken == [first, "NA", "left", "NA", "4"]


def test_names_of_actions_are_told_apart_by_more_than_a_blank(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,x,pump\n0,1,low\n1,2,low \n2,3, off\n3,4,off\n")
    changes = {"time": "t", "drop": (), "nominal": (), "episode_gap": None, "missing": ""}
    assert read(path, **changes).schema.actions == ("low", "off")


@pytest.mark.parametrize("time", ["t", ""])
def test_the_numbers_of_rows_that_pandas_writes_are_no_feature(tmp_path, time):
    path = tmp_path / "log.csv"
    path.write_text(",t,x,pump\n0,5,1,off\n1,6,2,on\n2,7,3,off\n")
    drop = () if time else ("t",)
    log = LogFormat(time=time, drop=drop, one_episode=not time)
    demos = Demonstrations.from_csv(path, columns={"action": "pump"}, log=log)
    assert demos.schema.feature_names == ("x",)


def test_indices_with_names_beside_them_stay_indices(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,action,action_name,x\n0,40,far,1\n0,0,near,2\n0,,,3\n")
    shown = Demonstrations.from_csv(path)
    assert len(shown.schema.actions) == 41
    assert shown.episodes[0].actions.tolist() == [40, 0]


def test_a_log_may_be_one_episode_without_a_time(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("heater,x\non,1\noff,2\noff,3\n")
    own = {"columns": {"action": "heater"}}
    with pytest.raises(FormatError, match=r"nothing marks the episodes, .*, or --one-episode"):
        Demonstrations.from_csv(path, **own)
    demos = Demonstrations.from_csv(path, **own, log=LogFormat(one_episode=True))
    assert [e.observations.ravel().tolist() for e in demos.episodes] == [[1, 2, 3]]
    with pytest.raises(FormatError, match=r"no column 'row' in \['heater', 'x'\]"):
        Demonstrations.from_csv(path, **own, log=LogFormat(time="row"))
    path.write_text("episode,action,x\n0,on,1\n")
    with pytest.raises(FormatError, match="one_episode is for a table without"):
        Demonstrations.from_csv(path, log=LogFormat(one_episode=True))


@pytest.mark.parametrize("mark", [",", ";", "\t", "|"])
def test_what_separates_the_values_is_seen(tmp_path, mark):
    path = tmp_path / "log.csv"
    path.write_text("episode,action,x\n0,0,1\n0,,2\n".replace(",", mark))
    assert Demonstrations.from_csv(path).observations.tolist() == [[1.0]]


def test_marks_in_quotes_separate_nothing(tmp_path):
    """Its commas were the most, and the error did not say so."""
    path = tmp_path / "log.csv"
    path.write_text('"speed, m/s";"level, m";action\n1;2;a\n3;4;b\n')
    demos = Demonstrations.from_csv(path, log=LogFormat(one_episode=True))
    assert demos.schema.feature_names == ("speed, m/s", "level, m")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"missing": ""}, r"line 3: inflow \[l/s\] must be a finite number, got ''; an empty cell"),
        ({"nominal": ()}, "line 2: mode must be a finite number, got 'auto'; text is a choice"),
        ({"drop": ()}, "line 2: line must be a finite number, got 'A'; text is a choice"),
        ({"drop": ("lines",)}, "line 1: there is no column 'lines'"),
        ({"time": "stamp"}, "line 1: there is no column 'stamp'"),
        ({"time": "inflow [l/s]", "drop": ("line", "time")}, "must be a time, seconds, or as"),
        ({"time": "", "episode_gap": None, "drop": ("line", "time")}, "nothing marks the episodes"),
        ({"actions": ("off", "on")}, "action: must be one of off, on or its index, got 'low'"),
    ],
)
def test_what_is_not_known_is_asked_for_by_its_column(plant, changes, said):
    with pytest.raises(FormatError, match=said):
        read(plant, **changes)


def test_a_time_that_is_none_or_goes_back_is_said(tmp_path, plant):
    with pytest.raises(FormatError, match="time must be a time, %d"):
        read(plant, time_format="%d.%m.%Y")
    german = tmp_path / "german.csv"
    german.write_text("t;action;x\n01.03.2026;a;1\n02.03.2026;a;2\n")
    hinted = {"log": LogFormat(time="x")}
    with pytest.raises(FormatError, match="name the time by --time 't'"):
        Demonstrations.from_csv(german, **hinted)
    log = LogFormat(time="t", time_format="%d.%m.%Y")
    assert len(Demonstrations.from_csv(german, log=log)) == 1
    german.write_text("t;action;x\n5;a;1\n4;a;2\n")
    with pytest.raises(FormatError, match="line 3: t goes back, to '4': sort the rows, or name"):
        Demonstrations.from_csv(german, log=LogFormat(time="t"))
    german.write_text("episode;t;action;x\nnight;5;a;1\nday;3;a;2\nnight;4;a;2\n")
    with pytest.raises(FormatError, match=r"line 4: .*: sort the rows of episode night$"):
        Demonstrations.from_csv(german, log=LogFormat(time="t"))


@pytest.mark.parametrize("day", ["2026-03-29", "2026-10-25"])  # clocks change in Europe
@pytest.mark.parametrize("zone", ["UTC", "CET-1CEST,M3.5.0,M10.5.0/3"])
@pytest.mark.parametrize("form", ["", "%Y-%m-%d %H:%M"])
def test_a_log_has_the_same_episodes_in_every_zone(tmp_path, monkeypatch, day, zone, form):
    rows = [
        f"{day} {hour:02}:{minute},{hour},{minute}\n" for hour in (1, 2, 3) for minute in (10, 40)
    ]
    path = tmp_path / "log.csv"
    path.write_text("time,level,action\n" + "".join(rows))
    with monkeypatch.context() as context:
        context.setenv("TZ", zone)
        time.tzset()
        log = LogFormat(time="time", time_format=form, episode_gap=3600)
        found = Demonstrations.from_csv(path, log=log)
    time.tzset()
    assert len(found.episodes) == 1


def test_spans_and_units_are_read():
    assert [seconds_of(text) for text in ("90", "90s", "15min", "1 h", "2d")] == [
        90,
        90,
        900,
        3600,
        172800,
    ]
    assert label("level (m)") == "level [m]"
    assert label("f(x)") == "f(x)"
    with pytest.raises(InvalidArgumentError, match="--episode-gap must be a span as 90s"):
        seconds_of("soon")


@pytest.mark.parametrize(
    ("log", "said"),
    [
        ({"missing": "mean"}, "missing must be hold, drop or a number, got 'mean'"),
        ({"episode_gap": 5.0}, "time must name the column"),
        ({"time": "t", "episode_gap": -1.0}, "episode_gap must be"),
    ],
)
def test_a_format_that_means_nothing_is_refused(log, said):
    with pytest.raises(InvalidArgumentError, match=said):
        LogFormat(**log)


def test_too_many_categories_are_no_choice(tmp_path):
    path = tmp_path / "log.csv"
    rows = "".join(f"0,a,batch-{k}\n" for k in range(101))
    path.write_text(f"episode,action,batch\n{rows}")
    with pytest.raises(FormatError, match="line 102: batch has more than 100 categories; leave"):
        Demonstrations.from_csv(path, log=LogFormat(nominal=("batch",)))


def test_a_log_makes_the_round_trip(plant, tmp_path):
    demos = read(plant)
    demos.to_csv(tmp_path / "again.csv")
    again = Demonstrations.from_csv(tmp_path / "again.csv")
    assert again.schema.feature_names == demos.schema.feature_names
    assert np.array_equal(again.observations, demos.observations)
    assert [e.actions.tolist() for e in again] == [e.actions.tolist() for e in demos]


@pytest.mark.parametrize("stamp", ["01.03.2026 06:00:00", "3/14/2026 6:00 PM", "1.3.26 06:00"])
def test_a_time_of_another_form_is_read_as_the_message_says(tmp_path, stamp):
    path = tmp_path / "log.csv"
    path.write_text(f"when,level,action\n{stamp},1,on\n{stamp},2,off\n")
    with pytest.raises(FormatError, match="another form is told by --time-format") as failure:
        Demonstrations.from_csv(path, log=LogFormat(time="when"))
    form = str(failure.value).split("--time-format '")[1].split("'")[0]
    log = LogFormat(time="when", time_format=form)
    assert len(Demonstrations.from_csv(path, log=log)) == 1


def table(tmp_path, *lines, log=None, **options):
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    return Demonstrations.from_csv(path, log=log, **options)


def test_the_row_behind_the_last_action_holds_nothing(tmp_path):
    rows = "episode,action,reward,terminated,x", "0,on,1,,1", "0,,2,,2", "0,,,true,3"
    (episode,) = table(tmp_path, *rows, log=LogFormat(missing="hold"))
    assert episode.observations.ravel().tolist() == [1.0, 2.0, 3.0]
    assert episode.actions.tolist() == [0, 0]
    assert episode.rewards.tolist() == [1.0, 2.0]
    assert episode.terminated
    assert not episode.extras


TASK = Schema((Feature("level", "m"), Feature("speed", "m/s"), Feature("x")), ("stop", "go"))


def test_columns_are_those_of_the_features_in_whatever_order(tmp_path):
    rows = "episode,action,x,level [m],speed", "0,go,1,2,3", "0,,4,5,6"
    demos = table(tmp_path, *rows, schema=TASK)
    assert demos.episodes[0].observations.tolist() == [[2.0, 3.0, 1.0], [5.0, 6.0, 4.0]]
    assert demos.episodes[0].actions.tolist() == [1]
    named = table(tmp_path, "episode,action,a [m],b,c [kg]", "0,go,1,2,3", "0,,4,5,6", schema=TASK)
    assert named.episodes[0].observations[0].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("head", "first", "said"),
    [
        ("action,x,b,c", "go,1,2,3", "columns must have the names of the features, level, speed"),
        ("action,level [km],b,c", "go,1,2,3", "level must be in m, got a column in km"),
        (
            "action,height [cm],b,c",
            "go,1,2,3",
            "height must be in m where level is expected, got a column in cm; if it is that, name "
            "it 'level [m]'",
        ),
        ("action,a,b", "go,1,2", "expected 3 features, got columns"),
        ("action,action_name,a,b,c", "0,go,1,2,3", "0 must mean 'stop', got 'go'"),
    ],
)
def test_columns_of_another_task_are_refused(tmp_path, head, first, said):
    with pytest.raises(FormatError, match=re.escape(said)):
        table(tmp_path, f"episode,{head}", f"0,{first}", f"0,{first}", schema=TASK)


def test_steps_that_do_not_grow_are_two_episodes_under_one_name(tmp_path):
    rows = "episode,step,action,x", "0,0,a,1", "0,3,a,2", "0,0,b,3"
    assert len(table(tmp_path, *rows[:-1]).episodes) == 1
    with pytest.raises(FormatError, match="line 4: step must grow within an episode, got 0 after"):
        table(tmp_path, *rows)


def test_columns_with_names_that_we_know_may_be_left_out(tmp_path):
    rows = "episode,action,heater,reward,x", "0,7,on,1,2", "0,8,off,1,3"
    own = {"columns": {"action": "heater"}}
    with pytest.raises(FormatError, match=r"same name: 'action' \(leave out the other by --drop\)"):
        table(tmp_path, *rows, **own)
    demos = table(tmp_path, *rows, log=LogFormat(drop=("action", "reward")), **own)
    assert demos.schema.feature_names == ("x",)
    assert demos.schema.actions == ("on", "off")
    assert not demos.episodes[0].has_rewards
    with pytest.raises(FormatError, match="nominal must be a column of a feature, got 'reward'"):
        table(tmp_path, *rows, log=LogFormat(nominal=("reward",), drop=("action",)), **own)


def test_the_time_is_a_column_of_its_own(tmp_path):
    rows = "day,action,x", "1,a,2", "2,b,3"
    log = LogFormat(time="day", drop=("day",))
    assert table(tmp_path, *rows, log=log).schema.feature_names == ("x",)
    with pytest.raises(FormatError, match="time must be a column of its own, got 'day'"):
        table(tmp_path, *rows, log=LogFormat(time="day"), columns={"episode": "day"})


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"one_episode": True, "time": "t", "episode_gap": 9.0}, "one_episode has no gap"),
        ({"actions": ("on", "", "off")}, "actions must be names"),
    ],
)
def test_formats_that_contradict_themselves_are_refused(options, said):
    with pytest.raises(InvalidArgumentError, match=said):
        LogFormat(**options)


def test_quantities_are_levels_of_the_grid(tmp_path):
    controls = (Control("torque", "N m", (-2.0, 0.0, 2.0)),)
    schema = Schema((Feature("x"),), combined_actions(controls), controls)
    demos = table(tmp_path, "episode,action,x", "0,-2.0,1", "0,2,2", "0,,3", schema=schema)
    assert demos.episodes[0].actions.tolist() == [0, 2]
