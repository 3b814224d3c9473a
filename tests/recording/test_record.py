"""Recording an episode stores what was sensed, done and received, and how it ended."""

import errno

import numpy as np
import pytest

from eutree.data import DemonstrationFolder, Demonstrations
from eutree.errors import FileError, InvalidArgumentError
from eutree.interaction import episode_seed
from eutree.recording import record
from tests.files.faults import Operations, use_operations
from tests.interaction.sick import Healthy


class Alternate:
    """Acts 0, 1, 0, 1, ... within an episode, by its state."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        step = 0 if state is None else state
        return step % 2, step + 1


def test_an_episode_holds_one_observation_more_than_actions():
    demos = record(Healthy(), Alternate(), episodes=3, seed=7)
    assert len(demos) == 3
    for number, episode in enumerate(demos):
        assert episode.observations.shape == (6, 2)
        assert episode.actions.tolist() == [0, 1, 0, 1, 0]
        assert episode.rewards.tolist() == [0, 1, 0, 1, 0]
        assert (episode.terminated, episode.truncated) == (True, False)
        assert episode.is_success is True
        assert episode.seed == episode_seed(7, number, 1)
        np.testing.assert_array_equal(episode.observations[:, 1], np.arange(6) / 5)


def test_the_same_seed_gives_the_same_episodes_and_another_seed_others():
    first, again, other = (record(Healthy(), Alternate(), episodes=2, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(first.observations, again.observations)
    assert not np.array_equal(first.observations, other.observations)


class Failing(Operations):
    """A disk on which only so many bytes find room."""

    def __init__(self, room):
        self.room = room

    def write(self, descriptor, data):
        self.room -= len(data)
        if self.room < 0:
            raise OSError(errno.ENOSPC, "no space left")
        return super().write(descriptor, data)


def test_each_episode_is_written_when_it_ends(tmp_path):
    seen = []

    def look(number, episode):
        seen.append(DemonstrationFolder(tmp_path / "demos").read_all())
        assert seen[-1][number].equals(episode)

    demos = record(Healthy(), Alternate(), episodes=3, out=tmp_path / "demos", on_episode=look)
    assert [len(episodes) for episodes in seen] == [1, 2, 3]
    demos.save(tmp_path / "saved")
    for path in (tmp_path / "saved").iterdir():
        assert path.read_bytes() == (tmp_path / "demos" / path.name).read_bytes()
    with pytest.raises(FileError, match="it exists and is not an empty folder"):
        record(Healthy(), Alternate(), episodes=1, out=tmp_path / "demos")


@pytest.mark.parametrize("room", [0, 8000])
def test_a_full_disk_ends_a_recording_at_once(tmp_path, room):
    """It was noticed when the last of all episodes was over, and all were lost."""
    ended = []
    with use_operations(Failing(room)), pytest.raises(FileError, match="the disk is full"):
        record(
            Healthy(),
            Alternate(),
            episodes=100,
            out=tmp_path / "demos",
            on_episode=lambda number, _: ended.append(number),
        )
    if not room:
        assert (ended, list(tmp_path.iterdir())) == ([], [])
        return
    kept = Demonstrations.load(tmp_path / "demos")
    assert 0 < len(kept) == len(ended) < 10


def test_a_function_of_the_environment_makes_the_controller():
    def constant(env):
        assert isinstance(env, Healthy)
        return Alternate()

    assert record(Healthy(), constant, episodes=1).expert == "constant"


def test_an_expert_may_make_a_function_of_an_observation():
    def bang_bang(env):
        return lambda observation: int(observation[0] < 0.5)

    made = record(Healthy(), bang_bang, episodes=1)
    assert made.expert == "bang_bang"
    seen = made.episodes[0].observations[:-1, 0]
    np.testing.assert_array_equal(made.episodes[0].actions, seen < 0.5)

    def nothing(env):
        return None

    with pytest.raises(InvalidArgumentError, match=r"^nothing\(env\) must have a method predict"):
        record(Healthy(), nothing, episodes=1)


@pytest.mark.parametrize("controller", [3, lambda env: None])
def test_what_cannot_act_is_refused(controller):
    with pytest.raises(InvalidArgumentError, match="must have a method predict"):
        record(Healthy(), controller, episodes=1)


@pytest.mark.parametrize(("name", "value"), [("episodes", 0), ("episodes", 1.5), ("seed", -1)])
def test_bad_numbers_are_named(name, value):
    with pytest.raises(InvalidArgumentError, match=f"{name} must be an integer"):
        record(Healthy(), Alternate(), **{name: value})


def test_seeds_of_different_uses_differ():
    seeds = {episode_seed(seed, k, s) for seed in range(5) for k in range(20) for s in range(6)}
    assert len(seeds) == 600


def test_a_seed_fits_a_simulator_written_in_cpp():
    """SUMO takes 31 bits: stock sumo-rl failed at its first reset."""
    seeds = [episode_seed(seed, k) for seed in (0, 2**63 - 1) for k in range(200)]
    assert 0 <= min(seeds) <= max(seeds) < 2**31
    assert max(seeds) >= 2**30


def test_half_of_the_seeds_are_those_of_release_2():
    whole = [int(np.random.SeedSequence((7, 0, k)).generate_state(1)[0]) for k in range(200)]
    kept = [seed for seed in whole if seed < 2**31]
    assert 80 < len(kept) < 120
    assert [episode_seed(7, k) for k, seed in enumerate(whole) if seed < 2**31] == kept


def test_a_controller_that_never_acts_leaves_no_folder_behind(tmp_path):
    """The corrected command is to find a folder that it may write."""

    def wrong(observation):
        raise KeyError("temperature")

    with pytest.raises(InvalidArgumentError, match="temperature"):
        record(Healthy(), wrong, episodes=1, out=tmp_path / "demos")
    assert not (tmp_path / "demos").exists()
    record(Healthy(), Alternate(), episodes=1, out=tmp_path / "demos")
