"""The button *Make my tree*: what it fits, plays and practises, without a page."""

import re
import shlex
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from benchmarks.people import folder as recorded_by

import eutree
from eutree.cli.main import run
from eutree.data import DemonstrationFolder
from eutree.errors import InvalidArgumentError
from eutree.fitting import page_tree
from eutree.fitting.page_tree import PageTree
from eutree.interaction import GuardedEnv, run_episode
from eutree.policies import TreePolicy
from tests.little_search import little_search
from tests.recording.people import Corridor


@pytest.fixture(autouse=True)
def few_episodes(monkeypatch):
    """Let fewer episodes choose and judge the tree that is fitted."""
    monkeypatch.setattr(page_tree, "FITTED", 40)


class Views(list):
    """What the page was shown; ``programmes`` is what there was to watch."""

    def __init__(self) -> None:
        super().__init__()
        self.programmes = []

    def show(self, view, programme=None) -> None:
        self.append(view)
        if programme is not None:
            self.programmes.append(programme)


def made(folder, *, episodes, make=lambda: gymnasium.make("eutree/Evasion2-v0")):
    views = Views()
    maker = PageTree(folder, make)
    maker.make(views.show, lambda: False)
    return maker, views


def wins_of(view) -> int:
    return int(re.search(r"this tree (\d+) of 200", view.message)[1])


@pytest.fixture
def folder(tmp_path):
    env = gymnasium.make("eutree/Evasion2-v0")
    demos = eutree.record(env, eutree.experts.wait_at_crossing, episodes=3, seed=5)
    demos.save(tmp_path / "demos")
    return tmp_path / "demos"


def test_a_tree_is_fitted_and_plays_and_its_verdict_is_true(folder) -> None:
    _, views = made(folder, episodes=3)
    phases = [view.phase for view in views]
    assert phases[0] == "fitting"
    assert phases[-1] == "ready"
    played = [view.finished for view in views if view.phase == "playing"]
    assert played == [20 * block for block in range(10)]
    tree = eutree.TreePolicy.load(folder.with_name("demos-tree.json"))
    blocks = [eutree.evaluate(tree, "eutree/Evasion2-v0", episodes=20, seed=k) for k in range(10)]
    wins = sum(int(block.successes.sum()) for block in blocks)
    assert views[-1].message.startswith("you 3 of 3 (43 to 100 %); this tree ")
    assert f" {wins} of 200 (" in views[-1].message
    assert views[-1].message.endswith(f": {views[-1].verdict}")
    assert views[-1].may_gain == (wins < 194)
    assert views[-1].n_leaves == tree.n_leaves
    assert views[-1].rules == str(tree)
    assert views[-1].svg.startswith("<svg")
    assert views[-1].commands[0] == f"eutree show {folder}-tree.json"
    # What is to be watched are the failures that were counted, if there are any.
    (programme,) = views.programmes
    world = GuardedEnv(gymnasium.make("eutree/Evasion2-v0"))
    seen = [run_episode(world, tree, scene.seed).is_success for scene in programme.scenes]
    assert seen.count(False) == min(200 - wins, 6)
    assert seen == sorted(seen)
    assert [bool(scene.why) for scene in programme.scenes] == [not success for success in seen]
    # Learning goes on from the tree on the page, and not from another one of the demonstrations.
    assert f"eutree learn --demos {folder} --expert {folder}-tree.json" in views[-1].commands[2]


def test_what_is_corrected_is_fitted_at_once_and_shown(folder) -> None:
    _, views = made(folder, episodes=3)
    before = eutree.Demonstrations.load(folder)
    stops = before.episodes[0]
    driven = replace(
        stops,
        actions=np.zeros(len(stops), dtype=np.int64),
        steps={"by_hand": np.ones(len(stops), dtype=bool)},
    )
    place = DemonstrationFolder(folder)
    place.write(7, driven)
    tree = views.programmes[0].refit()
    assert tree == eutree.fit_expert_tree(eutree.Demonstrations.load(folder))
    assert tree != eutree.fit_expert_tree(before)
    assert views[-1].message == "Fitted to 3 episodes of yours and 1 that a tree drove"
    assert eutree.TreePolicy.load(folder.with_name("demos-driving.json")) == tree


def test_where_all_is_discarded_the_tree_that_was_given_drives_on(folder) -> None:
    """The recorder ended where the first driven episode was discarded."""
    views, tree = Views(), eutree.fit_expert_tree(eutree.Demonstrations.load(folder))
    place = DemonstrationFolder(folder)
    for number, episode in place.read_all().items():
        place.write(number, replace(episode, kept=False))
    maker = PageTree(folder, lambda: gymnasium.make("eutree/Evasion2-v0"))
    assert maker.driving(tree, views.show).refit() == tree
    assert views[-1].message.startswith("Nothing is left to imitate")


def test_what_is_missing_is_found_in_the_folder(folder) -> None:
    maker = PageTree(folder, lambda: gymnasium.make("eutree/Evasion2-v0"))
    found = maker.missing()
    tree = eutree.fit_expert_tree(eutree.Demonstrations.load(folder))
    world = GuardedEnv(gymnasium.make("eutree/Evasion2-v0"))
    assert not run_episode(world, tree, found.seed).is_success
    assert "the end would have been 'goal'" in found.why
    cart = eutree.record("CartPole-v1", lambda o: int(o[2] > 0), episodes=2, seed=0)
    cart.save(folder.with_name("cart"))
    of_cart = PageTree(folder.with_name("cart"),
                       lambda: gymnasium.make("CartPole-v1"))  # fmt: skip
    assert of_cart.missing() is None  # nothing says what failed


def test_a_tree_of_another_task_is_not_let_drive(folder, tmp_path, capsys) -> None:
    made(folder, episodes=3)
    tree, out = folder.with_name("demos-tree.json"), tmp_path / "other"
    line = ["record", "CartPole-v1", "--web", "--drive", str(tree), "--out", str(out)]
    assert run(line) == 2
    said = capsys.readouterr().err
    assert f"--drive {tree} must have the features and actions of the environment" in said


def test_practice_keeps_the_better_tree_and_shows_its_curve(folder, monkeypatch) -> None:
    monkeypatch.setattr(page_tree, "FITTED", 200)
    monkeypatch.setattr(page_tree, "PRACTICE", 20)
    maker, views = made(folder, episodes=3)
    fitted = wins_of(views[-1])
    with little_search():
        maker.practise(views.show, lambda: False)
    last = views[-1]
    assert [episode for episode, _ in last.curve] == [10, 20]
    assert last.yours == 1.0
    assert wins_of(last) >= fitted
    assert [way.keep for way in last.ways][:2] == ["", "Keep mine"]
    assert last.columns == ("", "reaches", "steps", "waits", "worst 5 %")
    assert all(len(way.cells) == 4 for way in last.ways)
    you, mine, *between, after = last.ways
    assert (you.name, mine.name, after.name) == ("you", "your tree", "practised")
    assert [way.is_kept for way in last.ways].index(True) == len(last.ways) - 1
    sizes = [int(re.search(r"(\d+) lea", way.name)[1]) for way in between]
    assert sizes == sorted(sizes)
    assert all(size < last.n_leaves for size in sizes)
    shown = eutree.Demonstrations.load(folder)
    waited = np.mean(shown.actions == 0)
    assert you.cells[:3] == ("3 of 3 (43 to 100 %)", f"{shown.n_transitions / 3:.1f}",
                             f"{100 * waited:.0f} %")  # fmt: skip
    assert re.match(r"\d+\.\d % of your steps: \w+ became \w+ where ", last.changes[0])
    practised = folder.with_name("demos-practised.json")
    maker.choose(1, views.show)  # mine
    assert views[-1].note.startswith("Kept: your tree.")
    assert wins_of(views[-1]) == fitted
    assert [way.is_kept for way in views[-1].ways].index(True) == 1
    assert views.programmes[-1].policy == eutree.TreePolicy.load(f"{folder}-tree.json")
    with pytest.raises(InvalidArgumentError, match="way must be in"):
        maker.choose(len(last.ways), views.show)
    assert practised.exists() == (str(practised) in last.commands[0])


def test_practice_is_offered_to_a_tree_that_is_as_good_as_a_poor_person(folder) -> None:
    demos = eutree.Demonstrations.load(folder)
    lost = [replace(e, is_success=False, ending="collision") for e in demos.episodes[:2]]
    poor = folder.with_name("poor")
    replace(demos, episodes=(*lost, demos.episodes[2])).save(poor)
    _, views = made(poor, episodes=3)
    last = views[-1]
    assert last.message.startswith("you 1 of 3 (")
    assert last.verdict != "worse"
    wins = wins_of(last)
    assert 80 < wins < 194  # what three episodes make of it: no longer a matter of the person
    assert last.may_gain
    assert "Practice may make it better" in last.note


def test_the_next_commands_go_on_from_the_tree_that_is_shown(folder, capsys) -> None:
    """Learning went on from the tree of release 8, and a blank in a path broke every line."""
    spaced = folder.rename(folder.with_name("my demos"))
    show, evaluate, learn, export = made(spaced, episodes=3)[1][-1].commands
    tree = str(folder.with_name("my demos-tree.json"))
    words = shlex.split(learn)
    assert words[words.index("--expert") + 1] == tree
    for line, less in (
        (show, []),
        (evaluate, []),
        (learn, ["--episodes", "1", "--evaluation-episodes", "1"]),
        (export, []),
    ):
        assert run([*shlex.split(line)[1:], *less]) == 0, line
    assert folder.with_name("my demos-tree.c").exists()


def test_whoever_leaves_stops_it(folder) -> None:
    maker, views = made(folder, episodes=3)
    count = len(views)
    maker.practise(views.show, lambda: True)
    assert views[-1].phase == "practising"
    assert len(views) - count <= 2


def test_without_successes_returns_are_compared(tmp_path) -> None:
    class Plain(Corridor):
        def step(self, action):
            *rest, _ = super().step(action)
            return (*rest, {})

    class Right:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return 2, state

    eutree.record(Plain(), Right(), episodes=3).save(tmp_path / "demos")
    _, views = made(tmp_path / "demos", episodes=3, make=Plain)
    assert views[-1].message == (
        "you 1 on average (1 to 1) in 3 episodes; "
        "this tree 1 on average (1 to 1) in 200 episodes: as good"
    )
    assert views[-1].verdict == "as good"
    assert "single leaf: it always takes right" in views[-1].note


def test_an_episode_ended_by_hand_is_no_result_of_the_person(folder) -> None:
    """Three steps, then E: that was "you -2.0 on average; this tree 58 of 100: as good as you"."""
    demos = eutree.Demonstrations.load(folder)
    whole = demos.episodes[0]
    short = replace(
        whole,
        observations=whole.observations[:4],
        actions=whole.actions[:3],
        rewards=whole.rewards[:3],
        steps={name: values[:3] for name, values in whole.steps.items()},
        terminated=False,
        is_success=None,
        ending="stopped",
    )
    alone, beside = folder.with_name("alone"), folder.with_name("beside")
    replace(demos, episodes=(short,)).save(alone)
    replace(demos, episodes=(short, *demos.episodes[1:])).save(beside)
    last = made(alone, episodes=1)[1][-1]
    assert last.message.startswith("you no episode played alone to its end; this tree ")
    assert last.verdict == "not comparable"
    assert last.yours is None
    assert made(beside, episodes=3)[1][-1].message.startswith("you 2 of 2 (34 to 100 %);")


TEACHES_WORSE = 4  # a folder whose tree succeeds in half of the episodes, and in 4 of 5 without it


@pytest.fixture(scope="module")
def misleading(tmp_path_factory):
    path = tmp_path_factory.mktemp("people") / "demos"
    recorded_by("evasion", TEACHES_WORSE).save(path)
    (path / "episode-00014.npz").rename(path / "episode-00020.npz")
    for number in range(14)[::-1]:  # numbers are no places where some are missing
        (path / f"episode-{number:05d}.npz").rename(path / f"episode-{number + 3:05d}.npz")
    return path


def test_seconds_that_hurt_are_shown_as_strips_and_both_trees_stand_beside_each_other(
    misleading,
) -> None:
    maker, views = made(misleading, episodes=15)
    before = wins_of(views[-1])
    file = misleading.with_name("demos-tree.json")
    first = file.read_bytes()
    maker.look(views.show, lambda: False)
    assert {"fitting", "ready"} <= {view.phase for view in views}
    found = [one for one in views[-1].hurts if one.what != "show again"]
    assert views[-1].was_searched
    assert found
    folder = DemonstrationFolder(misleading)
    for one in found:
        for strip in one.strips:
            episode = folder.read(strip.number)
            assert [a for action, n in strip.runs for a in n * [action]] == episode.actions.tolist()
            assert strip.words.startswith(f"Episode {strip.number}, {len(episode)} steps: ")
        for part in one.segments:
            episode = folder.read(part.episode)
            assert set(episode.actions[part.start : part.stop].tolist()) == {part.action}
            taught = episode.taught.copy()
            taught[part.start : part.stop] = -1 if part.becomes is None else part.becomes
            folder.write(part.episode, episode.teaching(taught))
    maker.make_without(views.show, lambda: False)
    assert views[-1].asks
    assert [way.name for way in views[-1].ways] == ["you", "with them", "without them"]
    assert not any(way.keep for way in views[-1].ways)
    assert wins_of(views[-1]) > before
    less = file.read_bytes()
    assert less != first
    maker.settle(views.show, undo=True)
    assert file.read_bytes() == first
    assert wins_of(views[-1]) == before
    with pytest.raises(InvalidArgumentError, match="a change to settle"):
        maker.settle(views.show, undo=False)
    maker.make_without(views.show, lambda: False)
    maker.settle(views.show, undo=False)
    assert file.read_bytes() == less
    assert not views[-1].asks
    assert views.programmes[-1].policy.to_bytes() == TreePolicy.load(file).to_bytes()


def test_who_leaves_while_seconds_are_looked_for_gets_no_answer(misleading) -> None:
    maker, views = made(misleading, episodes=15)
    count = len(views)
    maker.look(views.show, lambda: True)
    assert len(views) == count


def test_where_all_was_cut_it_is_said_and_can_be_taken_back(folder) -> None:
    maker, views = made(folder, episodes=3)
    before = views[-1]
    stored = DemonstrationFolder(folder)
    for number, episode in stored.read_all().items():
        stored.write(number, episode.teaching(np.full(len(episode), -1)))
    maker.make_without(views.show, lambda: False)
    assert "cut altogether" in views[-1].note
    assert views[-1].asks
    maker.settle(views.show, undo=True)
    assert views[-1].message == before.message
