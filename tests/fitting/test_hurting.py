"""Which seconds hurt: planted ones are found, none are found where none were planted."""

from dataclasses import replace

import numpy as np
import pytest

import eutree
from eutree.data import Demonstrations, Episode
from eutree.data.demonstrations import lessons, taught_in
from eutree.data.episode import CUT
from eutree.errors import InvalidArgumentError
from eutree.evaluation import Evaluation
from eutree.fitting import hurting
from eutree.fitting.hurting import Segment, accepted, find_hurting, restored
from tests.fitting.door import Careful, Corridor

WAIT, WALK = 0, 1
FAST = {"episodes": 600, "judged": 100, "seed": 1}


@pytest.fixture(scope="module")
def shown():
    return eutree.record(Corridor(), Careful(), episodes=12, seed=3)


def in_haste(episode):
    """Return the episode as if walking on had been shown where the door is shut, but not quite."""
    place, gap = episode.observations[:-1].T
    haste = (place == 4) & (gap > 0.2) & (gap < 0.7)
    return replace(episode, actions=np.where(haste, WALK, episode.actions))


@pytest.fixture(scope="module")
def spoilt(shown):
    return replace(shown, episodes=tuple(map(in_haste, shown.episodes)))


@pytest.fixture(scope="module")
def found(spoilt):
    return find_hurting(spoilt, Corridor(), **FAST)


def test_what_was_planted_is_found_and_the_tree_is_better_without_it(found, spoilt, shown):
    changed = [one for one in found.hurts if one.after is not None]
    assert changed
    for one in changed:
        assert one.what in ("cut", "flip")
        assert one.after.success_rate > one.before.success_rate
        for part in one.segments:
            episode = spoilt.episodes[part.episode]
            assert set(episode.actions[part.start : part.stop].tolist()) == {part.action}
    planted = spoilt.actions != shown.actions
    touched = taught_in(found.edited) != spoilt.actions
    assert planted[touched].mean() > 0.5
    before, after = (
        eutree.evaluate(tree, Corridor(), episodes=300, seed=99).success_rate
        for tree in (found.before, found.after)
    )
    assert after > before + 0.2


def test_what_was_done_stays_and_can_be_restored(found, spoilt):
    assert (found.edited.actions == spoilt.actions).all()
    assert found.edited.digest != spoilt.digest
    assert restored(found.edited).digest == spoilt.digest
    for mine, given in zip(restored(found.edited).episodes, spoilt.episodes, strict=True):
        assert mine.equals(given)


def test_the_same_seed_finds_the_same_and_every_episode_is_told(spoilt, found):
    told = []
    again = find_hurting(
        spoilt, Corridor(), **FAST, on_progress=lambda *progress: told.append(progress)
    )
    assert [one.segments for one in again.hurts] == [one.segments for one in found.hurts]
    assert str(again) == str(found)
    assert again.after.to_bytes() == found.after.to_bytes()
    stages = {stage for stage, _, _ in told}
    assert {"choosing", "halving", "judging"} <= stages
    assert all(count <= most for _, count, most in told)


def test_where_nothing_hurts_nothing_is_cut(shown):
    found = find_hurting(shown, Corridor(), **FAST)
    assert [one.what for one in found.hurts if one.after is not None] == []
    assert (taught_in(found.edited) == shown.actions).all()
    assert "no segment was shown" in str(found) or "show again" in str(found)


class TestEdits:
    """Cuts and flips, beside what was done."""

    SEEN = np.column_stack([np.arange(5.0), np.zeros(5)])

    def demos(self, *actions, **fields):
        episodes = [
            Episode(self.SEEN, np.array(row), np.zeros(4), True, False, **fields) for row in actions
        ]
        return Demonstrations(tuple(episodes), eutree.interaction.describe(Corridor()))

    def test_cut_steps_teach_nothing_and_flipped_ones_the_other_action(self):
        shown = self.demos((1, 1, 0, 0), (1, 1, 1, 0))
        cut, flip = Segment(0, 2, 4, None, 0, None), Segment(1, 3, 4, None, 0, 1)
        edited = accepted(shown, (cut, flip))
        assert taught_in(edited).tolist() == [1, 1, CUT, CUT, 1, 1, 1, 1]
        assert lessons(edited)[1].tolist() == [1] * 6
        assert edited.actions.tolist() == shown.actions.tolist()
        assert eutree.fit_expert_tree(edited).actions.tolist() == [WALK]
        assert eutree.fit_expert_tree(edited, weights=np.ones(8)).actions.tolist() == [WALK]

    def test_a_discarded_episode_keeps_its_place(self):
        shown = self.demos((1, 1, 0, 0), (1, 1, 1, 0))
        first, second = shown.episodes
        shown = replace(shown, episodes=(replace(first, kept=False), second))
        edited = accepted(shown, [Segment(1, 0, 1, None, 1, None)])
        assert taught_in(edited).tolist() == [CUT, 1, 1, 0]
        assert edited.episodes[0].equals(shown.episodes[0])

    def test_they_are_stored_and_read_back(self, tmp_path):
        edited = accepted(self.demos((1, 1, 0, 0)), [Segment(0, 1, 3, None, 1, None)])
        edited.save(tmp_path / "demos")
        read = Demonstrations.load(tmp_path / "demos")
        assert taught_in(read).tolist() == [1, CUT, CUT, 0]
        assert read.digest == edited.digest

    def test_nothing_left_is_refused(self):
        shown = self.demos((1, 1, 0, 0))
        edited = accepted(shown, [Segment(0, 0, 4, None, 1, None)])
        with pytest.raises(InvalidArgumentError, match="cut altogether"):
            eutree.fit_expert_tree(edited)

    def test_the_past_of_a_step_is_known_although_it_is_cut(self):
        edited = accepted(self.demos((1, 1, 0, 0)), [Segment(0, 0, 2, None, 1, None)])
        rows, actions = lessons(edited.with_history(1))
        assert rows[:, 2].tolist() == [1.0, 2.0]
        assert actions.tolist() == [0, 0]


def test_the_seconds_are_those_of_the_recording(spoilt):
    times = [
        replace(e, steps={"time": 10.0 + 0.5 * np.arange(len(e))}, seed=None)
        for e in spoilt.episodes
    ]
    found = find_hurting(replace(spoilt, episodes=tuple(times)), Corridor(), **FAST)
    parts = [part for one in found.hurts for part in one.segments]
    assert parts
    assert all(part.seconds == (0.5 * part.start, 0.5 * part.stop) for part in parts)


@pytest.mark.parametrize("name", ["episodes", "judged", "most"])
def test_bad_counts_are_refused(shown, name):
    with pytest.raises(InvalidArgumentError, match=name):
        find_hurting(shown, Corridor(), **{name: 0})


def test_who_never_succeeds_is_not_worth_its_return_where_others_are_worth_successes(monkeypatch):
    """A batch without any success gave returns of 25, and the others ones and noughts."""
    games = object.__new__(hurting._Games)

    def played(tree, world, episodes, seed):
        return Evaluation(
            np.full(episodes, 25.0 if tree == "never" else 80.0), np.ones(episodes),
            np.full(episodes, "end"), None if tree == "never" else np.ones(episodes, dtype=bool),
        )  # fmt: skip

    monkeypatch.setattr(hurting, "evaluate", played)
    monkeypatch.setattr(hurting._Games, "_count", lambda self, episodes: None)
    games._seed, games.world, games.reports = 0, None, True
    assert games.best(["never", "always"], 1, 200) == (1,)
    assert not games.is_better("never", "always", 1, 0.05)
    assert games.is_better("always", "never", 1, 0.05)
