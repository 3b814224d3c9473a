"""Exchange with other tools: rows, npz, CSV, Minari; exact, checked, nothing shifted."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from eutree.data import Demonstrations, Episode
from eutree.data.episode import allowed_in
from eutree.data.log_format import LogFormat
from eutree.errors import FileError, FormatError, InvalidArgumentError
from eutree.interaction import describe
from eutree.schema import EnvironmentSpec, Schema
from tests.data.strategies import demonstrations, same, three_episodes

SPEC = EnvironmentSpec("eutree/Evasion2-v0", {"opponent_speed": 2.5})


def test_rows_become_episodes():
    x = np.arange(6.0)[:, np.newaxis]
    starts = [True, False, False, True, False, False]
    demos = Demonstrations.from_arrays(x, [0, 1, 2, 0, 1, 2], starts=starts)
    assert [e.observations.ravel().tolist() for e in demos] == [[0, 1, 2], [3, 4, 5]]
    assert [e.actions.tolist() for e in demos] == [[0, 1], [0, 1]]
    assert demos.schema == Schema.anonymous(1, 2)
    following = np.array([1, 2, 10, 4, 5, 11.0])[:, np.newaxis]
    demos = Demonstrations.from_arrays(
        x,
        [0, 1, 2, 0, 1, 2],
        starts=starts,
        rewards=np.arange(6),
        next_observations=following,
        terminated=[0, 0, 1, 0, 0, 0],
        truncated=[False] * 5 + [True],
    )
    assert [e.observations.ravel().tolist() for e in demos] == [[0, 1, 2, 10], [3, 4, 5, 11]]
    assert [e.rewards.tolist() for e in demos] == [[0, 1, 2], [3, 4, 5]]
    assert [(e.terminated, e.truncated) for e in demos] == [(True, False), (False, True)]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"actions": [0, 1]}, "actions must have 3 entries, got 2"),
        ({"actions": [0.0, 1.0, 1.5]}, "actions must hold integers"),
        ({"starts": [0, 1, 0]}, "starts must be true in the first row"),
        ({"starts": [1, 0, 2]}, "starts must hold 3 truth values"),
        ({"next_observations": [[1.0], [5.0], [6.0]]}, "one row later .* rows 0 to 2"),
        ({"next_observations": [[1.0]]}, "next_observations must have 3 rows, got 1"),
        ({"terminated": [0, 1, 0]}, "rows 0 to 2 must be one episode, but it ends before"),
        ({"observations": [[1.0], [math.nan], [2.0]]}, "observations must be finite"),
    ],
)
def test_rows_that_contradict_each_other_are_refused(changes, message):
    log = {"observations": [[0.0], [1.0], [2.0]], "actions": [0, 1, 1], "starts": [1, 0, 0]}
    with pytest.raises(InvalidArgumentError, match=message):
        Demonstrations.from_arrays(**log | changes)


@given(demonstrations())
@settings(deadline=None, max_examples=30)
def test_npz_keeps_what_it_has_room_for(tmp_path_factory, demos):
    path = tmp_path_factory.mktemp("npz") / "demos.npz"
    demos.to_npz(path)
    back = Demonstrations.from_npz(path, schema=demos.schema)
    mine = [e for e in demos if len(e)]
    assert len(back) == len(mine)
    for a, b in zip(mine, back, strict=True):
        plain = Episode(a.observations, a.actions, a.rewards, a.terminated, a.truncated)
        assert replace(b, ending="").equals(plain)


def with_rewards(demos):
    """Return whether each episode knows its rewards."""
    return [episode.has_rewards for episode in demos.episodes]


def test_rewards_that_no_source_has_stay_unknown(tmp_path):
    """They became zeros, from which `learn --offline` then learned."""
    path = tmp_path / "log.csv"
    path.write_text("episode,action,x\n0,1,0.5\n0,0,1.5\n0,,2.5\n")
    demos = Demonstrations.from_csv(path)
    assert with_rewards(demos) == [False]
    demos.save(tmp_path / "demos")
    assert same(Demonstrations.load(tmp_path / "demos"), demos)
    demos.to_csv(tmp_path / "again.csv")
    assert with_rewards(Demonstrations.from_csv(tmp_path / "again.csv")) == [False]
    demos.to_npz(tmp_path / "again.npz")
    assert with_rewards(Demonstrations.from_npz(tmp_path / "again.npz")) == [False]
    log = {"observations": [[0.0], [1.0]], "actions": [0, 1], "starts": [1, 0]}
    assert not any(with_rewards(Demonstrations.from_arrays(**log)))
    assert all(with_rewards(Demonstrations.from_arrays(**log, rewards=[0.0, 0.0])))
    path.write_text("episode,action,reward,x\n0,1,2.0,0.5\n0,0,,1.5\n0,,,2.5\n")
    with pytest.raises(FormatError, match="line 3: reward must be there for every action"):
        Demonstrations.from_csv(path)
    unknown = demos.episodes[0]
    with pytest.raises(InvalidArgumentError, match="without rewards must have zeros"):
        replace(unknown, rewards=np.ones(len(unknown)))


def test_npz_of_other_libraries_is_read(tmp_path):
    path = tmp_path / "demos.npz"
    episodes = [three_episodes().episodes[k] for k in (0, 1)]
    obs = np.concatenate([e.observations for e in episodes])
    acts = np.concatenate([e.actions for e in episodes])
    infos = np.array([{}] * len(acts), dtype=object)
    np.savez_compressed(
        path,
        obs=obs,
        acts=acts,
        infos=infos,
        rews=np.concatenate([e.rewards for e in episodes]),
        terminal=np.array([True, False]),
        indices=np.array([3]),
    )
    back = Demonstrations.from_npz(path)
    for mine, theirs in zip(episodes, back, strict=True):
        assert np.array_equal(mine.observations, theirs.observations)
        assert np.array_equal(mine.actions, theirs.actions)
        assert mine.terminated == theirs.terminated
    np.savez(
        path,
        obs=obs[:-1].astype(np.float32),
        actions=np.arange(len(obs) - 1)[:, np.newaxis] % 2,
        episode_starts=np.arange(len(obs) - 1) % 3 == 0,
        episode_returns=np.zeros(2),
    )
    assert [len(e) for e in Demonstrations.from_npz(path)] == [2, 2, 2]  # 9 rows, 3 dropped
    for bad in ([9], [-1], [2**62], [[1]], [1.5]):
        np.savez(path, obs=obs, acts=acts, indices=np.array(bad))
        with pytest.raises(FormatError, match=r"indices|one more row"):
            Demonstrations.from_npz(path)
    np.savez(path, obs=obs)
    with pytest.raises(FormatError, match="acts: missing"):
        Demonstrations.from_npz(path)
    np.savez(path, obs=obs[:-2], acts=acts + 0.5)
    with pytest.raises(FormatError, match="actions must hold integers"):
        Demonstrations.from_npz(path)


@pytest.mark.parametrize("beside", ["truncations", "terminations", "episode_starts"])
def test_npz_knows_of_dones_and_one_kind_of_end_the_other(tmp_path, beside):
    arrays = {"truncations": [0, 0, 0, 1], "terminations": [0, 1, 0, 0]}
    arrays["episode_starts"] = [1, 0, 1, 0]
    rows = np.arange(4.0)[:, np.newaxis]
    path = tmp_path / "demos.npz"
    ends = {"dones": [0, 1, 0, 1], beside: arrays[beside]}
    np.savez(path, obs=rows, acts=[0, 1, 0, 1], next_obs=rows + 1, **ends)
    back = Demonstrations.from_npz(path)
    known = beside != "episode_starts"
    assert [e.terminated for e in back] == [True, not known]
    assert [e.truncated for e in back] == [False, known]


def test_csv_keeps_everything_but_step_records(tmp_path):
    path = tmp_path / "demos.csv"
    demos = three_episodes(SPEC)
    demos.to_csv(path)
    back = Demonstrations.from_csv(path, schema=demos.schema, environment=SPEC)
    for mine, theirs in zip(demos.episodes, back.episodes, strict=True):
        assert theirs.equals(replace(mine, steps={}, extras={}, comment=""))
    assert back.environment == SPEC
    found = Demonstrations.from_csv(path).schema
    assert found.feature_names == demos.schema.feature_names
    assert found.actions == demos.schema.actions
    assert [f.unit for f in found.features] == ["m", ""]
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(e) + 1 for e in demos.episodes)
    assert rows[0]["position [m]"] == repr(float(demos.episodes[0].observations[0, 0]))
    assert rows[3]["action"] == ""


def masked(demos):
    """Return demonstrations of which every second episode was masked."""
    episodes = list(demos.episodes)
    for number in range(0, len(episodes), 2):
        episode = episodes[number]
        allowed = np.eye(demos.schema.n_actions, dtype=bool)[episode.actions]
        allowed[::2] = True
        episodes[number] = replace(episode, steps={"allowed": allowed})
    return replace(demos, episodes=tuple(episodes))


def test_masks_travel_in_tables_and_arrays(tmp_path):
    """They were left out in silence; a tree of what came back named forbidden actions."""
    demos = masked(three_episodes())
    demos.to_csv(tmp_path / "demos.csv")
    back = Demonstrations.from_csv(tmp_path / "demos.csv", schema=demos.schema)
    for mine, theirs in zip(demos.episodes, back.episodes, strict=True):
        assert (mine.allowed is None) == (theirs.allowed is None)
        assert mine.allowed is None or np.array_equal(mine.allowed, theirs.allowed)
    demos.to_npz(tmp_path / "demos.npz")
    arrays = Demonstrations.from_npz(tmp_path / "demos.npz", schema=demos.schema)
    assert np.array_equal(allowed_in(arrays), allowed_in(demos))
    assert not np.load(tmp_path / "demos.npz")["action_masks"].all()


def test_a_log_says_which_actions_were_allowed(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(
        "episode,action,may,x\n0,wait,wait|turn left,1\n0,turn left,turn left,2\n0,go,,3\n0,,,4\n"
    )
    demos = Demonstrations.from_csv(path, columns={"allowed": "may"})
    assert demos.schema.actions == ("wait", "turn left", "go")
    allowed = demos.episodes[0].allowed
    assert allowed.tolist() == [[True, True, False], [False, True, False], [True, True, True]]
    path.write_text("episode,action,allowed,x\n0,1,0 1 3,1\n0,0,0,2\n")
    (episode,) = Demonstrations.from_csv(path)  # what the last action led to is not known
    assert episode.allowed.tolist() == [[True, True, False, True]]
    path.write_text("episode,action,allowed,x\n0,1,0 3,1\n0,,,2\n")
    with pytest.raises(FormatError, match="line 2: allowed must have the action taken, '1': '0 3'"):
        Demonstrations.from_csv(path)


@pytest.mark.parametrize(
    ("actions", "names"),
    [(("x", "y", "z"), ("x", "y", "z")), ((), ("action_0", "action_1", "action_2"))],
)
def test_masks_of_indices_are_read_as_pandas_writes_them(tmp_path, actions, names):
    """The last row has no action, so a column of integers became floats, and was refused."""
    path, log = tmp_path / "log.csv", LogFormat(actions=actions)
    path.write_text("episode,a,action,allowed\n0,1.0,0.0,0 1\n0,2.0,2.0,\n0,3.0,,\n")
    demos = Demonstrations.from_csv(path, log=log)
    assert demos.schema.actions == names
    assert demos.actions.tolist() == [0, 2]
    assert demos.episodes[0].allowed.tolist() == [[True, True, False], [True] * 3]
    path.write_text("episode,a,action,allowed\n0,1,1.0,0.0\n0,2,2.0,\n0,3,,\n")
    with pytest.raises(FormatError, match=r"line 2: allowed must have the action taken, '1\.0'"):
        Demonstrations.from_csv(path, log=log)


def test_masks_of_quantities_are_read_as_pandas_writes_them(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,a,action,allowed\n0,1,0.0,0 40\n0,2,1500.0,1500\n0,3,,NaN\n")
    demos = Demonstrations.from_csv(path)
    assert demos.schema.actions == ("0", "40", "1500")
    assert demos.actions.tolist() == [0, 2]
    assert demos.episodes[0].allowed.tolist() == [[True, True, False], [False, False, True]]


@pytest.mark.parametrize(
    ("masks", "said"),
    [
        ([[1, 1]] * 2, r"action_masks must be of shape \(3, A\), got \(2, 2\)"),
        ([1, 1, 1], r"must be of shape \(3, A\), got \(3,\)"),
        ([[1]] * 3, "must have masks of 2 actions, got shape"),
        (
            [[1, 1], [1, 0], [1, 1]],
            "episode 0 must allow the actions taken, but masks .* in step=1",
        ),
    ],
)
def test_masks_that_contradict_the_log_are_refused(tmp_path, masks, said):
    log = {"obs": np.arange(3.0), "next_obs": np.arange(1.0, 4.0), "acts": [0, 1, 1]}
    np.savez(tmp_path / "log.npz", **log, action_masks=masks)
    with pytest.raises(FormatError, match=said):
        Demonstrations.from_npz(tmp_path / "log.npz")
    np.savez(tmp_path / "log.npz", **log, action_masks=[[1, 1, 1]] * 3)
    assert Demonstrations.from_npz(tmp_path / "log.npz").schema.n_actions == 3


@given(demonstrations())
@settings(deadline=None, max_examples=30)
def test_csv_floats_read_back_to_the_bit(tmp_path_factory, demos):
    names = [f"x{i}" for i in range(demos.schema.n_features)]
    from eutree.schema import Feature

    schema = Schema(tuple(map(Feature, names)), demos.schema.actions)
    demos = replace(demos, schema=schema)
    path = tmp_path_factory.mktemp("csv") / "demos.csv"
    demos.to_csv(path)
    back = Demonstrations.from_csv(path, schema=schema)
    for mine, theirs in zip(demos.episodes, back.episodes, strict=True):
        assert theirs.equals(replace(mine, steps={}, extras={}, comment=""))


BAD_CSV = {
    "": "line 1: the file is empty: the first line must name the columns",
    "episode,x\n": "line 1: there is no column 'action'",
    "episode,action\n": r"no column of a feature in \['episode', 'action'\]",
    "episode,action,x,x\n": "two columns have the same name",
    "episode,action,x\n0,1\n": "line 2: expected 3 values, got 2",
    "episode,action,x\n0,1,nan\n": "line 2: x must be a finite number, got 'nan'",
    "episode,action,x\n0,1,1_0\n": "x must be a finite number",
    "episode,action,x\n0,,1\n0,1,2\n": "line 2: only an episode's last row may have no action",
    "episode,action,action_name,x\n0,99999,far,1\n0,,,2\n": "below 10,000",
    "episode,action,terminated,x\n0,1,1,1\n0,1,,2\n0,,,2\n": "line 3: the episode ended on",
    "episode,action,reward,x\n0,1,inf,1\n0,,,2\n": "reward must be a finite number",
    "episode,action,kept,x\n0,1,maybe,1\n0,,maybe,2\n": "kept must be true or false, got 'maybe'",
    "episode,action,seed,x\n0,1,-1,1\n0,,-1,2\n": "seed must be an integer",
    'episode,action,x\n0,"1,1\n': "unexpected end of data|line 2",
    "episode,action,terminated,truncated,x\n0,1,1,1,1\n0,,,,2\n": "both terminated and truncated",
}


@pytest.mark.promise(2)
@pytest.mark.parametrize("text", BAD_CSV)
def test_a_bad_table_is_refused_with_its_line(tmp_path, text):
    path = tmp_path / "demos.csv"
    path.write_text(text)
    with pytest.raises(FormatError, match=BAD_CSV[text]):
        Demonstrations.from_csv(path)


@pytest.mark.parametrize(
    ("encoding", "said"),
    [
        ("latin-1", "line 3: byte 0xb0 is not UTF-8 text, perhaps Latin-1: save the file as UTF-8"),
        ("utf-16", "line 1: byte 0xff is not UTF-8 text, perhaps UTF-16"),
    ],
)
def test_text_of_another_encoding_is_refused_with_its_line(tmp_path, encoding, said):
    path = tmp_path / "demos.csv"
    path.write_bytes("episode,action,x\n0,a,1\n0,20 °C,2\n".encode(encoding))
    with pytest.raises(FormatError, match=said):
        Demonstrations.from_csv(path)


def test_a_log_with_named_actions_is_read(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,action,speed [m/s],height\na,up,1,2\na,down,2,3\na,up,3,4\nb,up,1,1\n")
    demos = Demonstrations.from_csv(path)
    assert demos.schema.actions == ("up", "down")
    assert [e.actions.tolist() for e in demos] == [[0, 1], []]
    assert demos.schema.features[0].unit == "m/s"
    with pytest.raises(FormatError, match="expected 1 features"):
        Demonstrations.from_csv(path, schema=Schema.anonymous(1, 2))
    named = replace(demos.schema, actions=("x", "y"))
    with pytest.raises(FormatError, match="action: must be one of x, y or its index, got 'up'"):
        Demonstrations.from_csv(path, schema=named)


def test_an_end_may_be_said_on_the_row_behind_the_last_action(tmp_path):
    path = tmp_path / "log.csv"
    head = "episode,state,action,reward,terminated,truncated\n"
    for row, end in (("0,2,,,true,", (True, False)), ("0,2,,,,1", (False, True))):
        path.write_text(f"{head}0,0,2,0,false,0\n0,1,1,1,false,0\n{row}\n")
        (episode,) = Demonstrations.from_csv(path)
        assert (episode.terminated, episode.truncated) == end
        assert len(episode.actions) == 2


PLANT = (
    "day;temperature [°C];heater;cost\n"
    "mon;19.5;on;-2.0\nmon;20.5;off;-1.0\nmon;20.1;on;-2.5\ntue;18.0;on;-3.0\ntue;18.5;off;0\n"
)


def test_a_log_is_read_by_its_own_columns(tmp_path):
    """A plant's log has no columns named episode and action, and separates values by ;."""
    path = tmp_path / "plant.csv"
    path.write_text(PLANT)
    columns = {"episode": "day", "action": "heater", "reward": "cost"}
    demos = Demonstrations.from_csv(path, columns=columns, delimiter=";")
    assert demos.schema.feature_names == ("temperature",)
    assert demos.schema.actions == ("on", "off")
    assert [e.actions.tolist() for e in demos] == [[0, 1], [0]]
    assert [e.rewards.tolist() for e in demos] == [[-2.0, -1.0], [-3.0]]
    assert [e.observations.ravel().tolist() for e in demos] == [[19.5, 20.5, 20.1], [18.0, 18.5]]
    # what was dropped is said and kept: nobody knows what it led to
    assert [e.extras["dropped_action"] for e in demos] == [0, 1]


def test_what_a_table_lacks_is_said_with_the_way_out(tmp_path):
    path = tmp_path / "plant.csv"
    path.write_text(PLANT)
    with pytest.raises(FormatError, match=r"required are 'episode' and 'action'.*--episode-column"):
        Demonstrations.from_csv(path, delimiter=";")
    with pytest.raises(FormatError, match="and what separates the values by --delimiter"):
        Demonstrations.from_csv(path, delimiter=",")
    with pytest.raises(FormatError, match=r"there is no column 'days' in \['day', "):
        Demonstrations.from_csv(path, columns={"episode": "days"}, delimiter=";")
    with pytest.raises(InvalidArgumentError, match=r"unknown columns 'episodes'.*'episode'"):
        Demonstrations.from_csv(path, columns={"episodes": "day"}, delimiter=";")
    with pytest.raises(InvalidArgumentError, match="delimiter must be one character"):
        Demonstrations.from_csv(path, delimiter="::")
    path.write_text("episode,action,day,x\n0,1,2,3\n")
    with pytest.raises(FormatError, match="two columns have the same name: 'episode'"):
        Demonstrations.from_csv(path, columns={"episode": "day"})
    path.write_text('episode,action,x\n0,1,"20,5"\n')
    with pytest.raises(FormatError, match="a finite number, with a decimal point, got '20,5'"):
        Demonstrations.from_csv(path)


def test_rows_say_which_actions_were_dropped():
    log = {"observations": [[0.0], [1.0], [2.0]], "actions": [0, 1, 2], "starts": [1, 0, 0]}
    (episode,) = Demonstrations.from_arrays(**log)
    assert (episode.actions.tolist(), episode.extras) == ([0, 1], {"dropped_action": 2})
    (episode,) = Demonstrations.from_arrays(**log, next_observations=[[1.0], [2.0], [3.0]])
    assert (episode.actions.tolist(), episode.extras) == ([0, 1, 2], {})


minari = pytest.importorskip("minari", reason="needs the extra minari")


@pytest.fixture(autouse=True)
def _minari_folder(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path_factory.mktemp("minari")))


def test_minari_round_trip_is_exact():
    demos = three_episodes(SPEC)
    demos.to_minari("eutree/evasion2/human-v0")
    back = Demonstrations.from_minari("eutree/evasion2/human-v0")
    assert same(back, replace(demos, episodes=demos.kept))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_minari_itself_reads_what_we_write():
    demos = three_episodes()
    demos.to_minari("eutree/test-v3")
    dataset = minari.load_dataset("eutree/test-v3")
    assert dataset.total_episodes == 2
    assert dataset.total_steps == 8
    assert dataset.env_spec is None
    for mine, theirs in zip(demos, dataset.iterate_episodes(), strict=True):
        assert np.array_equal(mine.observations, theirs.observations)
        assert theirs.observations.dtype == np.float64
        assert np.array_equal(mine.actions, theirs.actions)
        assert theirs.terminations[-1] == mine.terminated
        assert theirs.truncations[-1] == mine.truncated
        assert theirs.observations[0] in dataset.observation_space


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_minari_dataset_made_elsewhere_is_read():
    import gymnasium
    from minari.data_collector.episode_buffer import EpisodeBuffer

    buffers = [
        EpisodeBuffer(
            id=k,
            seed=k,
            observations=np.random.default_rng(k).random((4, 4)).astype(np.float32),
            actions=np.array([1, 2, 1]),
            rewards=[1.0] * 3,
            terminations=[False, False, k == 0],
            truncations=[False, False, k == 1],
        )
        for k in range(2)
    ]
    minari.create_dataset_from_buffers(
        "other/set-v1",
        buffers,
        env="CartPole-v1",
        action_space=gymnasium.spaces.Discrete(2, start=1),
    )
    demos = Demonstrations.from_minari("other/set-v1")
    assert demos.environment.id == "CartPole-v1"
    assert [e.actions.tolist() for e in demos] == [[0, 1, 0]] * 2
    assert [(e.terminated, e.truncated, e.seed) for e in demos] == [
        (True, False, 0),
        (False, True, 1),
    ]
    assert demos.schema.n_actions == 2
    assert np.array_equal(demos.episodes[0].observations, buffers[0].observations)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", ["Discrete", "MultiDiscrete", "MultiBinary", "Box", "floats"])
def test_what_the_space_of_a_minari_dataset_says_is_known(name):
    """Whole numbers were quantities, in contrast to those of the environment itself."""
    import gymnasium
    from gymnasium import spaces
    from minari.data_collector.episode_buffer import EpisodeBuffer

    space = {
        "Discrete": spaces.Discrete(5, start=2),
        "MultiDiscrete": spaces.MultiDiscrete([3, 2]),
        "MultiBinary": spaces.MultiBinary(3),
        "Box": spaces.Box(0, 9, (2,), np.int32),
        "floats": spaces.Box(0, 9, (2,), np.float32),
    }[name]
    rows = np.array([space.sample() for _ in range(4)])
    none = [False] * 3
    episode = EpisodeBuffer(
        id=0, observations=rows, actions=np.array([1, 0, 1]), rewards=[1.0] * 3,
        terminations=none, truncations=none,
    )  # fmt: skip
    minari.create_dataset_from_buffers(
        "other/kinds-v0", [episode], observation_space=space, action_space=spaces.Discrete(2)
    )
    env = gymnasium.Env()
    env.observation_space, env.action_space = space, spaces.Discrete(2)
    demos = Demonstrations.from_minari("other/kinds-v0")
    assert demos.schema.features == describe(env).features
    assert demos.episodes[0].observations.tolist() == rows.reshape(4, -1).tolist()


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("spec", "limit", "attribute"),
    [
        (SPEC, 1000, ("opponent_speed", 2.5)),
        (EnvironmentSpec("CartPole-v1", {"sutton_barto_reward": True}), 500, None),
        (EnvironmentSpec("CartPole-v1", {"max_episode_steps": 7}), 7, None),
    ],
)
def test_minari_makes_the_environment_again(spec, limit, attribute):
    """``recover_environment`` failed: the dataset stored no env_spec."""
    replace(three_episodes(), environment=spec).to_minari("eutree/again-v0")
    dataset = minari.load_dataset("eutree/again-v0")
    env = dataset.recover_environment()
    assert env.spec.id == spec.id
    wanted = {k: v for k, v in spec.arguments.items() if k != "max_episode_steps"}
    assert {name: env.spec.kwargs[name] for name in wanted} == wanted
    if attribute is not None:
        assert getattr(env.unwrapped.parameters, attribute[0]) == attribute[1]
    else:
        assert env.spec.max_episode_steps == limit
    assert Demonstrations.from_minari("eutree/again-v0").environment == spec


def test_an_environment_that_is_not_registered_is_said():
    demos = replace(three_episodes(), environment=EnvironmentSpec("nobody/Knows-v0"))
    with pytest.warns(UserWarning, match=r"stores no env_spec: nobody/Knows-v0 is not registered"):
        demos.to_minari("eutree/unknown-v0")
    assert len(Demonstrations.from_minari("eutree/unknown-v0")) == 2


def test_minari_mistakes_give_one_clear_line():
    demos = three_episodes()
    with pytest.raises(InvalidArgumentError, match="end in a version like -v0; got 'human'"):
        demos.to_minari("human")
    with pytest.raises(FileError, match="get it with: minari download eutree/none-v0"):
        Demonstrations.from_minari("eutree/none-v0")
    demos.to_minari("eutree/twice-v0")
    with pytest.raises(FileError, match="cannot write minari:eutree/twice-v0"):
        demos.to_minari("eutree/twice-v0")
    with pytest.raises(InvalidArgumentError, match="no kept episode"):
        replace(demos, episodes=demos.episodes[2:]).to_minari("eutree/none-v0")


def test_what_any_row_says_of_its_episode_is_read(tmp_path):
    """A mark on the rows with actions was lost: only the closing row was looked at."""
    path = tmp_path / "log.csv"
    path.write_text(
        "episode,action,x,kept,seed,ending,is_success\n"
        "0,go,1,false,,,\n0,go,2,false,7,hit,false\n0,,3,,,,\n"
        "1,go,1,false,1,late,\n1,go,1,true,2,home,true\n1,,2,,,,\n"
        "2,go,1,false,,,\n2,go,2,,,,true\n"
    )
    read = Demonstrations.from_csv(path).episodes
    assert [(e.kept, e.seed, e.ending, e.is_success) for e in read] == [
        (False, 7, "hit", False),
        (True, 2, "home", True),
        (False, None, "", True),
    ]
    path.write_text("episode,action,x,kept\n0,go,1,perhaps\n0,,3,\n")
    with pytest.raises(FormatError, match="kept must be true or false, got 'perhaps'"):
        Demonstrations.from_csv(path)
