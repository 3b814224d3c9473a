"""Folders of demonstrations: exact, atomic, checked; a crash loses at most the step in flight."""

import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

from eutree.data import DemonstrationFolder, Demonstrations, Episode
from eutree.data.files import episode_from_bytes, episode_to_bytes
from eutree.data.journal import EpisodeJournal, recover_episode
from eutree.errors import FileError, FormatError, InvalidArgumentError
from eutree.files.arrays import encode_archive
from eutree.schema import EnvironmentSpec, Schema
from tests.data.journals import journal_of
from tests.data.strategies import demonstrations, episodes, same, three_episodes
from tests.files.faults import Operations, faults_until_success, use_operations


def contents(folder):
    return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


@pytest.mark.promise(4)
@given(demonstrations())
@settings(deadline=None, max_examples=50)
def test_save_load_save_gives_the_same_bytes(demos):
    with tempfile.TemporaryDirectory() as folder:
        first, second = Path(folder) / "first", Path(folder) / "second"
        demos.save(first)
        loaded = Demonstrations.load(first)
        assert same(loaded, demos)
        loaded.save(second)
        assert contents(first) == contents(second)


def test_learners_see_the_kept_episodes_only():
    demos = three_episodes()
    assert [e.ending for e in demos] == ["goal", "time limit"]
    assert len(demos) == 2
    assert demos.n_transitions == 8
    assert demos.observations.shape == (8, 2)
    assert demos.actions.shape == (8,)
    assert len(demos.episodes) == 3


def test_step_records_have_one_row_an_action():
    with pytest.raises(InvalidArgumentError, match=r"steps\['time'\] must have 1 rows.*\(2,\)"):
        Episode(np.zeros((2, 1)), [0], [0.0], True, False, steps={"time": np.zeros(2)})


@pytest.mark.promise(5)
@pytest.mark.parametrize("field", ["observations", "rewards", "extras"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_nothing_infinite_is_written(tmp_path, field, bad):
    demos = three_episodes()
    broken = {
        "observations": np.full((6, 2), bad),
        "rewards": np.full(5, bad),
        "extras": {"delay": bad},
    }[field]
    episode = replace(demos.episodes[1], **{field: broken})
    demos = replace(demos, episodes=(demos.episodes[0], episode))
    with pytest.raises(InvalidArgumentError, match=f"episode 1: {field}"):
        demos.save(tmp_path / "demos")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.promise(7)
@pytest.mark.promise(10)
def test_a_fault_at_every_operation_of_a_save_leaves_nothing_or_all(tmp_path):
    demos, folder = three_episodes(), tmp_path / "demos"

    def check(n, succeeded):
        assert [p.name for p in tmp_path.iterdir()] in ([], ["demos"])
        if folder.exists():
            assert same(Demonstrations.load(folder), demos)
        if folder.exists() and not succeeded:
            for path in folder.iterdir():
                path.unlink()
            folder.rmdir()

    faults_until_success(lambda: demos.save(folder), check)


@pytest.mark.promise(7)
def test_a_fault_at_every_operation_of_an_edit_leaves_the_old_or_the_new_episode(tmp_path):
    demos = three_episodes()
    demos.save(tmp_path / "demos")
    folder = DemonstrationFolder(tmp_path / "demos")
    old, new = demos.episodes[0], replace(demos.episodes[0], kept=False)

    def check(n, succeeded):
        assert len(list(folder.path.iterdir())) == 4
        episode = folder.read(0)
        assert episode.equals(new) if succeeded else episode.equals(old) or episode.equals(new)
        if not succeeded:
            folder.write(0, old)

    faults_until_success(lambda: folder.write(0, new), check)


def test_bad_folders_give_one_clear_line(tmp_path):
    with pytest.raises(FileError, match="no such folder of demonstrations"):
        Demonstrations.load(tmp_path / "none")
    with pytest.raises(FormatError, match=r"holds no demonstrations.*demonstrations\.json"):
        Demonstrations.load(tmp_path)
    three_episodes().save(tmp_path / "demos")
    with pytest.raises(FileError, match="not an empty folder"):
        three_episodes().save(tmp_path / "demos")
    with pytest.raises(InvalidArgumentError, match="has no episode 7"):
        DemonstrationFolder(tmp_path / "demos").read(7)
    (tmp_path / "demos" / "episode-00001.npz").write_bytes(b"PK")
    with pytest.raises(FormatError, match=r"episode-00001\.npz: not a readable archive"):
        Demonstrations.load(tmp_path / "demos")


def test_an_episode_of_another_schema_is_refused(tmp_path):
    three_episodes().save(tmp_path / "demos")
    folder = DemonstrationFolder(tmp_path / "demos")
    other = Episode(np.zeros((2, 3)), [0], [0.0], True, False)
    with pytest.raises(InvalidArgumentError, match="observations of 2 features, got 3"):
        folder.append(other)
    (folder.path / "episode-00003.npz").write_bytes(episode_to_bytes(other))
    with pytest.raises(FormatError, match=r"00003\.npz: must have observations of 2 features"):
        Demonstrations.load(folder.path)
    wrong_action = Episode(np.zeros((2, 2)), [2], [0.0], True, False)
    with pytest.raises(InvalidArgumentError, match=r"actions in 0\.\.1, got 2\.\.2"):
        folder.append(wrong_action)


def test_create_goes_on_only_with_the_same_environment(tmp_path):
    schema, spec = Schema.anonymous(2, 2), EnvironmentSpec("a-v0", {"x": 1})
    folder = DemonstrationFolder.create(tmp_path / "demos", schema, spec, "me")
    assert folder.append(three_episodes().episodes[0]) == 0
    folder = DemonstrationFolder.create(tmp_path / "demos", schema, spec)
    assert folder.expert == "me"
    assert folder.append(three_episodes().episodes[1]) == 1
    with pytest.raises(InvalidArgumentError, match=r"of a-v0\(x=1\), not of a-v0; choose another"):
        DemonstrationFolder.create(tmp_path / "demos", schema, EnvironmentSpec("a-v0"))
    with pytest.raises(InvalidArgumentError, match="other features or actions"):
        DemonstrationFolder.create(tmp_path / "demos", Schema.anonymous(2, 3), spec)


def bad_archives():
    good = three_episodes().episodes[0]
    from eutree.data.files import EpisodeDocument
    from eutree.files.arrays import decode_archive

    document, arrays = decode_archive(episode_to_bytes(good), EpisodeDocument, "x")
    arrays = dict(arrays)

    def but(**changes):
        changed = {**arrays, **changes}
        return {name: array for name, array in changed.items() if array is not None}

    nan = np.full((4, 2), np.nan)
    yield but(actions=None), "actions.npy: missing"
    yield but(actions=arrays["rewards"]), "actions.npy: must hold int64, got float64"
    yield but(extra=np.zeros(1)), "extra.npy: unexpected member"
    yield but(rewards=np.zeros(9)), "as many rewards as actions: 9 != 3"
    yield but(observations=np.zeros((9, 2))), "one more observations than actions"
    yield but(observations=np.zeros(4)), r"observations \[T . 1, d\]"
    yield but(observations=nan), "observations must be finite, got nan"
    yield but(steps_time=np.zeros(9)), r"steps\['time'\] must have 3 rows"
    both = EpisodeDocument(
        **{
            name: getattr(document, name)
            for name in document.__struct_fields__
            if name not in ("format", "version", "made_by", "truncated")
        },
        truncated=True,
    )
    yield encode_archive(arrays, both), "both terminated and truncated"


@pytest.mark.promise(2)
@pytest.mark.parametrize("case", list(bad_archives()))
def test_an_episode_that_breaks_a_rule_is_refused(case):
    from eutree.data.files import EpisodeDocument
    from eutree.files.arrays import decode_archive

    content, message = case
    if isinstance(content, dict):
        good = episode_to_bytes(three_episodes().episodes[0])
        document, _ = decode_archive(good, EpisodeDocument, "x")
        content = encode_archive(content, document)
    with pytest.raises(FormatError, match=message):
        episode_from_bytes(content, "episode.npz")


@pytest.mark.promise(9)
@given(episodes())
@settings(deadline=None)
def test_a_journal_gives_the_episode_back(episode):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "journal"
        journal_of(episode, path).close()
        recovered = recover_episode(path)
        if not len(episode):
            assert recovered is None
            return
        expected = replace(episode, ending="interrupted", is_success=None, kept=True, comment="")
        assert recovered.equals(expected)


@pytest.mark.promise(9)
def test_a_journal_cut_anywhere_loses_at_most_the_step_in_flight(tmp_path):
    path, cut = tmp_path / "journal", tmp_path / "cut"
    episode = three_episodes().episodes[1]
    journal = EpisodeJournal(path, episode.observations[0])
    sizes = []
    for t in range(len(episode)):
        sizes.append(path.stat().st_size)
        journal.append(int(episode.actions[t]), 0.0, episode.observations[t + 1])
    journal.close()
    data = path.read_bytes()
    sizes.append(len(data))
    for end in range(len(data) + 1):
        cut.write_bytes(data[:end])
        recovered = recover_episode(cut)
        whole = sum(size <= end for size in sizes) - 1
        assert (0 if recovered is None else len(recovered)) == max(whole, 0)


@pytest.mark.promise(9)
def test_a_damaged_record_ends_the_episode_there(tmp_path):
    path = tmp_path / "journal"
    episode = three_episodes().episodes[1]
    journal_of(episode, path).close()
    data = bytearray(path.read_bytes())
    data[-20] ^= 1
    path.write_bytes(data)
    recovered = recover_episode(path)
    assert len(recovered) == len(episode) - 1
    assert np.array_equal(recovered.observations, episode.observations[:-1])


@pytest.mark.promise(9)
def test_zeros_that_a_power_cut_leaves_end_the_episode_there(tmp_path):
    """A record of no bytes had the right checksum, and the whole folder could not be read."""
    folder = DemonstrationFolder.create(tmp_path / "demos", Schema.anonymous(1, 4))
    folder.append(Episode([[0.0], [1.0]], [0], [0.0], True, False))
    running = folder.start_episode([0.0])
    running.journal.append(3, 1.0, [1.0])
    running.journal.close()
    path = running.journal.path
    data = path.read_bytes()
    for left, lengths in ((data, [1, 1]), (data[:-9], [1]), (b"", [1])):
        path.write_bytes(left + bytes(4096))
        assert [len(one) for one in Demonstrations.load(folder.path).episodes] == lengths


@pytest.mark.promise(9)
def test_masks_that_are_said_at_some_steps_alone_are_recovered(tmp_path):
    for masked in (0, 1):
        journal = EpisodeJournal(tmp_path / "journal", [0.0])
        for step in range(3):
            said = {"allowed": [True, False]} if step % 2 == masked else {}
            journal.append(0, 1.0, [1.0], steps={"time": 0.5, **said})
        journal.close()
        found = recover_episode(tmp_path / "journal")
        wanted = [[True, step % 2 != masked] for step in range(3)]
        assert found.allowed.tolist() == wanted
        (tmp_path / "journal").unlink()


@pytest.mark.promise(10)
def test_a_full_disk_while_recording_loses_that_step_only(tmp_path):
    class Full(Operations):
        full = False

        def write(self, descriptor, data):
            if self.full:
                os.write(descriptor, data[:5])
                raise OSError(28, "No space left on device")
            return super().write(descriptor, data)

    operations, path = Full(), tmp_path / "journal"
    with use_operations(operations):
        journal = EpisodeJournal(path, [0.0])
        journal.append(1, 0.5, [1.0])
        operations.full = True
        with pytest.raises(FileError, match="disk is full"):
            journal.append(2, 0.5, [2.0])
        operations.full = False
        journal.append(3, 0.5, [3.0])
        journal.close()
    assert recover_episode(path).actions.tolist() == [1, 3]


@pytest.mark.promise(5)
def test_a_journal_takes_no_nan(tmp_path):
    journal = EpisodeJournal(tmp_path / "journal", [0.0])
    for observation, reward in (([math.nan], 0.0), ([0.0], math.inf)):
        with pytest.raises(InvalidArgumentError, match="must be finite"):
            journal.append(0, reward, observation)
    with pytest.raises(InvalidArgumentError, match="must have 1 entries, got 2"):
        journal.append(0, 0.0, [0.0, 1.0])
    journal.close()


def test_a_running_episode_takes_its_number_and_is_not_yet_seen(tmp_path):
    folder = DemonstrationFolder.create(tmp_path / "demos", Schema.anonymous(1, 4))
    running = folder.start_episode([0.0], seed=3)
    running.journal.append(3, 1.0, [1.0])
    assert running.number == 0
    assert folder.append(Episode([[0.0], [1.0]], [0], [0.0], True, False)) == 1
    assert folder.recover() == []
    assert len(Demonstrations.load(folder.path)) == 1
    other = folder.start_episode([5.0])
    other.discard()
    running.finish(Episode([[0.0], [1.0]], [3], [1.0], True, False, seed=3, ending="goal"))
    assert [e.ending for e in Demonstrations.load(folder.path)] == ["goal", ""]
    assert sorted(p.suffix for p in folder.path.iterdir()) == [".json", ".npz", ".npz"]


def test_a_journal_beside_its_finished_episode_is_dropped(tmp_path):
    folder = DemonstrationFolder.create(tmp_path / "demos", Schema.anonymous(1, 4))
    running = folder.start_episode([0.0])
    running.journal.append(3, 1.0, [1.0])
    folder.write(0, Episode([[0.0], [1.0]], [3], [1.0], True, False, ending="goal"))
    running.journal.close()
    assert [e.ending for e in Demonstrations.load(folder.path)] == ["goal"]
    assert folder.recover() == []
    assert sorted(p.name for p in folder.path.iterdir()) == [
        "demonstrations.json",
        "episode-00000.npz",
    ]


RECORDER = """
import sys
import numpy as np
from eutree.data import DemonstrationFolder, Episode
folder = DemonstrationFolder(sys.argv[1])
print("ready", flush=True)
count = 0
while True:
    running = folder.start_episode([float(count)], seed=count)
    observations, actions = [[float(count)]], []
    for t in range(10):
        count += 1
        running.journal.append(count % 2, 1.0, [float(count)], steps={"time": t / 8})
        observations.append([float(count)])
        actions.append(count % 2)
        print(count, flush=True)
    steps = {"time": np.arange(10) / 8}
    running.finish(
        Episode(observations, actions, np.ones(10), True, False, seed=count - 10, steps=steps)
    )
"""


@pytest.mark.promise(9)
@pytest.mark.parametrize(
    "kills", [8, pytest.param(200, marks=[pytest.mark.slow, pytest.mark.timeout(900)])]
)
def test_kill_9_while_recording_loses_at_most_the_step_in_flight(tmp_path, kills):
    rng = np.random.default_rng(0)
    for kill in range(kills):
        folder = DemonstrationFolder.create(tmp_path / str(kill), Schema.anonymous(1, 2))
        process = subprocess.Popen(
            [sys.executable, "-c", RECORDER, str(folder.path)],
            env={**os.environ, "PYTHONPATH": "src"},
            stdout=subprocess.PIPE,
        )
        with process.stdout:
            process.stdout.readline()
            time.sleep(rng.random() * 0.1)
            process.send_signal(signal.SIGKILL)
            process.wait()
            acknowledged = [int(line) for line in process.stdout.read().split()]
        loaded = Demonstrations.load(folder.path)
        steps = sum(map(len, loaded.episodes))
        assert steps in {max(acknowledged, default=0), max(acknowledged, default=0) + 1}
        assert all(len(e) == 10 for e in loaded.episodes[:-1])
        for number, episode in enumerate(loaded.episodes):
            expected = np.arange(len(episode) + 1.0)[:, np.newaxis] + 10 * number
            assert np.array_equal(episode.observations, expected)
            assert episode.seed == 10 * number
        folder.recover()
        again = Demonstrations.load(folder.path)
        assert same(again, loaded)
        assert not list(folder.path.glob("*.journal"))


def test_demonstrations_and_episodes_print_as_one_line():
    """``print(demos)`` wrote 175,000 characters."""
    demos = three_episodes(EnvironmentSpec("eutree/Evasion2-v0"))
    said = repr(demos)
    assert str(demos) == said
    assert said.startswith("<Demonstrations of eutree/Evasion2-v0: 2 episodes (1 discarded), 8 ")
    assert len(said) < 150
    assert repr(demos.episodes[0]).startswith("<Episode: ")
    assert all(len(repr(episode)) < 100 for episode in demos.episodes)
