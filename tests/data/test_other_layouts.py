"""Tables and arrays as other programs rewrite them: nothing is renamed, joined or forgotten."""

import io

import numpy as np
import pytest

from eutree.data import Demonstrations, LogFormat
from eutree.data.csv_files import read_csv
from eutree.errors import FormatError
from eutree.schema import Control, Feature, Schema

STOP_AND_GO = Schema((Feature("x"),), ("stop", "go"))
NAMED = "episode,action,action_name,x\n0,1.0,go,1\n0,0.0,stop,2\n0,,,3\n"
UNNAMED = "episode,action,x\n0,1.0,1\n0,0.0,2\n0,,3\n"


def table(tmp_path, text, **options):
    (tmp_path / "log.csv").write_text(text)
    return Demonstrations.from_csv(tmp_path / "log.csv", **options)


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (NAMED, {}),
        (NAMED, {"schema": STOP_AND_GO}),
        (UNNAMED, {"schema": STOP_AND_GO}),
        (UNNAMED, {"log": LogFormat(actions=("stop", "go"))}),
    ],
)
def test_an_index_with_a_point_is_the_index_where_actions_have_names(tmp_path, text, options):
    demos = table(tmp_path, text, **options)
    assert demos.schema.actions == ("stop", "go")
    assert demos.actions.tolist() == [1, 0]


def test_a_table_that_went_through_pandas_is_the_same(tmp_path):
    pandas = pytest.importorskip("pandas")
    demos = table(tmp_path, NAMED)
    demos.to_csv(tmp_path / "log.csv")
    again = io.StringIO()
    pandas.read_csv(tmp_path / "log.csv").to_csv(again, index=False)
    back = table(tmp_path, again.getvalue())
    assert back.schema == demos.schema
    assert all(a.equals(b) for a, b in zip(back.episodes, demos.episodes, strict=True))


def test_a_level_with_a_point_is_the_level(tmp_path):
    control = Control("valve", "%", (1.0, 0.0, 50.0))
    schema = Schema((Feature("x"),), control.names(), (control,))
    assert table(tmp_path, UNNAMED, schema=schema).actions.tolist() == [0, 1]
    text = UNNAMED.replace("0.0,", "2.0,")  # no level: then all are indices
    assert table(tmp_path, text, schema=schema).actions.tolist() == [1, 2]
    assert table(tmp_path, UNNAMED).schema.actions == ("0.0", "1.0")  # quantities


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("0,0,go,1\n0,0,stop,2\n0,,,3\n", "line 3: 0 must mean 'go', got 'stop'"),
        ("0,a,go,1\n0,b,stop,2\n0,,,3\n", "must be one of go, stop or its index, got 'a'"),
        ("0,0.5,go,1\n0,1.0,stop,2\n0,,,3\n", "must be one of go, stop or its index, got '0.5'"),
    ],
)
def test_names_that_contradict_the_actions_are_refused(tmp_path, rows, said):
    with pytest.raises(FormatError, match=said):
        table(tmp_path, "episode,action,action_name,x\n" + rows)


def test_values_are_held_from_rows_that_are_left_out(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(
        "episode,action,level,temp\n0,on,5,\n0,,,20\n0,off,6,\n0,on,,21\n0,off,7,\n1,,,9\n1,on,1,\n"
        "1,off,2,\n"
    )
    log = LogFormat(missing="hold")
    (first, second), _, filled, left_out = read_csv(path, None, log=log)
    assert first.observations.tolist() == [[5, 20], [6, 20], [6, 21], [7, 21]]
    assert first.actions.tolist() == [0, 1, 0]
    assert second.observations.tolist() == [[1, 9], [2, 9]]
    assert (filled, left_out) == (6, 2)


def test_nothing_is_held_over_a_pause_from_rows_that_are_left_out(tmp_path):
    text = "t,action,x,y\n0,on,,1\n900,on,2,\n901,on,3,4\n902,on,5,6\n"
    log = LogFormat(time="t", episode_gap=60.0, missing="hold")
    (episode,) = table(tmp_path, text, log=log).episodes
    assert episode.observations.tolist() == [[3, 4], [5, 6]]


def test_ends_as_d4rl_names_them_end_the_episodes(tmp_path):
    rows = {"observations": np.arange(6.0)[:, np.newaxis], "actions": [0, 1, 0, 1, 1, 0]}
    rows["rewards"] = np.arange(6.0)
    ends = {"terminals": [0, 0, 1, 0, 0, 0], "timeouts": [0, 0, 0, 0, 0, 1]}
    path = tmp_path / "log.npz"
    np.savez(path, **rows, **ends)
    first, second = Demonstrations.from_npz(path).episodes
    assert first.observations.ravel().tolist() == [0, 1, 2]  # where row 2 led is not known
    assert first.rewards.tolist() == [0, 1]
    assert (first.ending, first.terminated, first.extras) == (
        "terminated", False, {"dropped_action": 0},
    )  # fmt: skip
    assert (second.ending, len(second)) == ("truncated", 2)
    np.savez(path, **rows, **ends, next_observations=rows["observations"] + 1)
    first, second = Demonstrations.from_npz(path).episodes
    assert (len(first), first.terminated, len(second), second.truncated) == (3, True, 3, True)
    dones = np.array(ends["terminals"]) | np.array(ends["timeouts"])
    np.savez(path, **rows, terminals=ends["terminals"], episode_terminals=dones)
    assert [one.ending for one in Demonstrations.from_npz(path).episodes] == [
        "terminated", "truncated",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("known", "lengths"),
    [({}, [2]), ({"terminals": [0, 0, 0]}, [2]), ({"terminals": [0, 1, 0]}, [1])],
)
def test_rows_are_one_episode_but_where_an_end_is_told(tmp_path, known, lengths):
    np.savez(tmp_path / "log.npz", obs=np.arange(3.0), acts=[0, 1, 0], **known)
    episodes = Demonstrations.from_npz(tmp_path / "log.npz").episodes
    assert [len(one) for one in episodes] == lengths


@pytest.mark.parametrize("form", ["csv", "npz"])
def test_an_end_in_place_keeps_what_the_last_action_earned(tmp_path, form):
    """No episode of such a log ended, and a crash cost nothing."""
    ends = {"terminals": [0, 1, 0, 0], "timeouts": [0, 0, 0, 1]}
    rows = np.array([[1.0], [2.0], [3.0], [4.0]])
    actions, rewards = np.array([0, 1, 1, 0]), np.array([1.0, -100.0, 1.0, 1.0])
    path = tmp_path / f"log.{form}"
    if form == "npz":
        flags = {name: np.array(said) for name, said in ends.items()}
        np.savez(path, obs=rows, acts=actions, rews=rewards, **flags)
        first, cut = Demonstrations.from_npz(path, ends_in_place=True).episodes
        (left,) = Demonstrations.from_npz(path).episodes[:1]
    else:
        table = zip("0011", actions, rewards, *ends.values(), rows[:, 0], strict=True)
        lines = ["episode,action,reward,terminated,truncated,x"]
        lines += [",".join(map(str, row)) for row in table]
        path.write_text("\n".join(lines) + "\n")
        log = LogFormat(ends_in_place=True)
        first, cut = Demonstrations.from_csv(path, log=log).episodes
        (left,) = Demonstrations.from_csv(path).episodes[:1]
    assert first.observations.ravel().tolist() == [1.0, 2.0, 2.0]
    assert first.rewards.tolist() == [1.0, -100.0]
    assert (first.terminated, first.truncated, dict(first.extras)) == (True, False, {})
    assert (cut.rewards.tolist(), cut.terminated) == ([1.0], False)  # where that led is not known
    assert cut.extras == left.extras | {"dropped_action": 0} != {}
    assert (left.rewards.tolist(), left.terminated) == ([1.0], False)


def test_an_end_in_place_is_of_logs_without_what_came_after(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,action,terminated,x\n0,1,false,1\n0,0,true,2\n0,,,3\n")
    (episode,) = Demonstrations.from_csv(path, log=LogFormat(ends_in_place=True)).episodes
    assert (episode.observations.ravel().tolist(), episode.terminated) == ([1.0, 2.0, 3.0], True)
