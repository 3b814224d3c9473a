"""What was lived through, looked at by episodes; and DAgger's rounds on it."""

import numpy as np
import pytest

from eutree.data import Episode
from eutree.learners.distilled_dqn.teaching import ROUNDS, DAgger, Experience, Students
from eutree.learners.episode_buffer import FinishedEpisode, store
from eutree.world_model.action_trees import packed


def rows(first: float, n: int) -> np.ndarray:
    return first + np.arange(n + 1.0)[:, np.newaxis]


def lived(first: float, n: int) -> FinishedEpisode:
    return FinishedEpisode(rows(first, n), np.zeros(n, np.int64), np.full(n, 0.5), True)


@pytest.fixture
def experience() -> Experience:
    """Return a demonstration of three steps, and own episodes of two, four and one."""
    shown = Episode(rows(0.0, 3), np.ones(3, np.int64), np.ones(3), False, True)
    experience = Experience(1, [shown])
    for first, n in ((10.0, 2), (20.0, 4), (30.0, 1)):
        store(experience.history, lived(first, n))
    return experience


def test_episodes_are_found_by_their_rows(experience: Experience) -> None:
    assert experience.n_shown == 3
    assert (experience.mean_length, experience.longest) == (2.5, 4)
    assert experience.last() == slice(9, 10)
    assert experience.episode_from(5) == slice(5, 9)
    assert [experience.return_of(experience.episode_from(first)) for first in (0, 5)] == [3.0, 2.0]


@pytest.mark.parametrize(("n_steps", "first"), [(1, 9), (2, 5), (5, 5), (6, 3), (99, 3)])
def test_the_last_steps_are_whole_episodes_and_no_demonstrations(
    experience: Experience, n_steps: int, first: int
) -> None:
    assert experience.first_of_last(n_steps) == first


def test_each_round_of_dagger_labels_what_its_tree_came_to_see(experience: Experience) -> None:
    asked = []

    def values(observations):
        asked.append(len(observations))
        return np.stack([observations[:, 0] - 25.0, 25.0 - observations[:, 0]], axis=1)

    dagger = DAgger(Students(values, 2), experience, 6 * ROUNDS, packed(0))
    dagger.begin(steps=7)
    assert (dagger.labelled_from, asked) == (3, [7])
    assert not dagger.round_is_over(12)
    assert dagger.round_is_over(13)
    store(experience.history, lived(40.0, 6))
    assert dagger.next_round(13) == 13
    assert (asked, dagger.round_from) == ([7, 6], 13)
    tree = dagger.tree
    assert sorted(tree.action[tree.feature < 0].tolist()) == [0, 1]
