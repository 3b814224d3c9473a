"""Demonstrations, evaluations and learning curves as data frames."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from eutree.data import Demonstrations
from eutree.errors import InvalidArgumentError, MissingExtraError
from eutree.evaluation import CurvePoint, Evaluation
from eutree.evaluation.curves import curve_to_pandas, curves_to_pandas
from eutree.schema import Feature, Schema
from tests.data.strategies import three_episodes
from tests.frames import Frame, Table


def test_a_row_for_each_transition_of_the_kept_episodes():
    pytest.importorskip("pandas")
    demos = three_episodes()
    frame = demos.to_pandas()
    assert frame.index.names == ["episode", "step"]
    assert list(frame.columns) == [*demos.schema.feature_names, "action", "reward"]
    np.testing.assert_array_equal(frame[list(demos.schema.feature_names)], demos.observations)
    assert [demos.schema.actions.index(name) for name in frame["action"]] == demos.actions.tolist()
    for number, episode in enumerate(demos.episodes):
        assert (number in frame.index.get_level_values("episode")) == episode.kept
        if episode.kept:
            assert frame.loc[number]["reward"].tolist() == episode.rewards.tolist()
            assert frame.loc[number].index.tolist() == list(range(len(episode)))
    assert len(replace(demos, episodes=()).to_pandas()) == 0


def test_unknown_rewards_are_not_zero():
    pytest.importorskip("pandas")
    demos = three_episodes()
    silent = [replace(e, rewards=e.rewards * 0, has_rewards=False) for e in demos.episodes]
    assert replace(demos, episodes=tuple(silent)).to_pandas()["reward"].isna().all()


def test_a_feature_called_action_is_refused():
    demos = three_episodes()
    names = ["action", *demos.schema.feature_names[1:]]
    schema = Schema(tuple(map(Feature, names)), demos.schema.actions)
    with pytest.raises(InvalidArgumentError, match="must not be named action or reward"):
        replace(demos, schema=schema).to_pandas()


def test_a_row_for_each_episode_of_an_evaluation():
    pytest.importorskip("pandas")
    values = {"returns": [1.0, 2.5], "lengths": [3, 4], "endings": ["goal", "crash"]}
    frame = Evaluation(**values, successes=[True, False]).to_pandas()
    assert frame["return"].mean() == 1.75
    assert frame["ending"].tolist() == ["goal", "crash"]
    assert frame["success"].tolist() == [True, False]
    assert frame.index.name == "episode"
    assert "success" not in Evaluation(**values).to_pandas()


def test_a_row_for_each_frozen_evaluation_of_a_run():
    pandas = pytest.importorskip("pandas")
    points = (CurvePoint(0, 0, None, -3.5, 1), CurvePoint(20, 410, 0.25, 1.5, 4))
    frame = curve_to_pandas(points)
    assert frame.index.name == "episode"
    assert frame.loc[20].to_dict() == {
        "steps": 410, "success_rate": 0.25, "mean_return": 1.5, "n_leaves": 4,
    }  # fmt: skip
    assert pandas.isna(frame.loc[0, "success_rate"])
    assert frame["n_leaves"].dtype == np.int64
    both = curves_to_pandas({5: points, 6: points[:1]})
    assert both.index.names == ["seed", "episode"]
    assert both.loc[(5, 20), "mean_return"] == 1.5
    assert len(both) == 3
    assert len(curve_to_pandas(())) == 0


def test_without_pandas_it_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        MissingExtraError, match="pandas is not installed; get it with: pip install"
    ):
        three_episodes().to_pandas()


LEVELS = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0]])  # level, speed
TANK = Schema((Feature("level", "m"), Feature("speed")), ("off", "on"))


def read(observations, **options):
    """Return the observations of demonstrations of a log, and their schema."""
    made = Demonstrations.from_arrays(observations, [0, 1, 1], starts=[1, 0, 0], **options)
    (episode,) = made
    return episode.observations.tolist(), made.schema


def frames(rows, columns):
    """Yield a frame with some columns, of stand-ins and of the libraries that are there."""
    yield Frame(rows, columns)
    yield Table(rows, columns)
    for library, kind in (("pandas", "DataFrame"), ("polars", "DataFrame"), ("pyarrow", "table")):
        try:
            make = getattr(__import__(library), kind)
        except ImportError:
            continue
        yield make({name: rows[:, k] for k, name in enumerate(columns)})


def test_a_log_in_a_frame_is_read_by_its_names():
    """Columns were taken by place, and the tree was of other features than its rules said."""
    for frame in frames(LEVELS[:, ::-1], ["speed", "level"]):
        assert read(frame, schema=TANK) == (LEVELS.tolist(), TANK)
        after = LEVELS + np.array([1.0, 10.0])
        for following in frames(after[:, ::-1], ["speed", "level"]):
            rows, schema = read(frame, schema=TANK, next_observations=following)
            assert (rows, schema) == ([*LEVELS.tolist(), [4.0, 40.0]], TANK)
    for frame in frames(LEVELS, ["depth", "speed"]):
        for log in ({"observations": frame}, {"observations": LEVELS, "next_observations": frame}):
            with pytest.raises(
                InvalidArgumentError, match=r"observations must have the columns \['level', 'speed"
            ):
                read(**log, schema=TANK)
    for frame in frames(LEVELS, ["a", "b"]):  # which names nothing that is known
        assert read(frame, schema=TANK)[0] == LEVELS.tolist()


def test_a_log_in_a_frame_names_the_features():
    for frame in frames(LEVELS[:, ::-1], ["speed [m/s]", "level"]):
        rows, schema = read(frame)
        assert rows == LEVELS[:, ::-1].tolist()
        assert schema.feature_names == ("speed [m/s]", "level")
        assert schema.actions == ("action_0", "action_1")
        for following in frames(LEVELS + np.array([1.0, 10.0]), ["level", "speed [m/s]"]):
            assert read(frame, next_observations=following)[0][-1] == [40.0, 4.0]
    assert read(Frame(LEVELS, [0, 1]))[1].feature_names == ("x0", "x1")  # numbers, no names
    with pytest.raises(InvalidArgumentError, match=r"distinct features, got \['a', 'a'\]"):
        read(Frame(LEVELS, ["a", "a"]))
