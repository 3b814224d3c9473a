"""Several processes that write into one folder of demonstrations."""

import multiprocessing

import numpy as np
import pytest

from eutree.data import DemonstrationFolder, Episode
from eutree.errors import InvalidArgumentError
from eutree.schema import Schema

EACH = 25


def write(folder, who, at_once) -> None:
    place = DemonstrationFolder(folder)
    at_once.wait()
    for number in range(EACH):
        seed = who * 1000 + number
        episode = Episode(
            np.full((2, 1), who), [0], [1.0], terminated=True, truncated=False, seed=seed
        )
        if number % 2:
            place.append(episode)
        else:
            place.start_episode([who]).finish(episode)


def test_no_process_overwrites_the_episodes_of_another(tmp_path) -> None:
    """``append`` lost up to half of them, and ``start_episode`` failed now and then."""
    DemonstrationFolder.create(tmp_path / "both", Schema.anonymous(1, 1))
    context = multiprocessing.get_context("spawn")
    at_once = context.Barrier(2)
    both = [context.Process(target=write, args=(tmp_path / "both", k, at_once)) for k in (1, 2)]
    for process in both:
        process.start()
    for process in both:
        process.join()
    assert [process.exitcode for process in both] == [0, 0]
    known = DemonstrationFolder(tmp_path / "both").read_all()
    assert sorted(episode.seed for episode in known.values()) == [
        who * 1000 + number for who in (1, 2) for number in range(EACH)
    ]
    assert not list((tmp_path / "both").glob("*.journal"))


def test_an_episode_that_finished_since_the_numbers_were_read_keeps_its_own(
    tmp_path, monkeypatch
) -> None:
    place = DemonstrationFolder.create(tmp_path / "one", Schema.anonymous(1, 1))
    episode = Episode(np.zeros((2, 1)), [0], [1.0], terminated=True, truncated=False, seed=1)
    numbers = iter([0, 0, 1])
    monkeypatch.setattr(DemonstrationFolder, "next_number", lambda self: next(numbers))
    assert [place.append(episode), place.append(episode)] == [0, 1]


def test_an_episode_that_does_not_fit_leaves_no_trace(tmp_path) -> None:
    place = DemonstrationFolder.create(tmp_path / "one", Schema.anonymous(1, 1))
    wrong = Episode(np.zeros((2, 2)), [0], [1.0], terminated=True, truncated=False)
    for _ in range(2):
        with pytest.raises(InvalidArgumentError, match="observations of 1 features, got 2"):
            place.append(wrong)
    assert [path.name for path in place.path.iterdir()] == ["demonstrations.json"]
