"""The values of ``learn``, and the plain words that build them."""

import inspect
import pickle
from dataclasses import replace

import numpy as np
import pytest

import eutree
from eutree import Budget, Folder, Handover, Schedule, ShortForms
from eutree.errors import InvalidArgumentError, UnknownNameError
from eutree.training.listeners import Listener, Progress, StopWhen
from eutree.training.many import RunsForms
from eutree.training.values import _ALONE, _LISTENERS, _PARTS, Asked
from tests.worlds import FEW_IMAGINED

TASK = "eutree/Evasion2-v0"
SMALL = {"method": FEW_IMAGINED, "seed": 2}
WORDS = {"episodes": 12, "evaluate_every": 6, "evaluation_episodes": 3, "judge_episodes": 6}
WORDS |= {"front_steps": 0, "max_leaves": 6}
VALUES = {
    "budget": Budget(episodes=12),
    "evaluation": Schedule(every=6, episodes=3),
    "handover": Handover(episodes=6, front_steps=0, max_leaves=6),
}


def test_words_and_values_ask_for_the_same(tmp_path):
    by_words = eutree.learn(TASK, out=tmp_path / "words", **SMALL, **WORDS)
    by_values = eutree.learn(TASK, folder=Folder(tmp_path / "values"), **SMALL, **VALUES)
    assert by_words.policy == by_values.policy
    assert pickle.loads(pickle.dumps(by_words)).policy == by_words.policy  # of a worker of joblib
    one, other = ((tmp_path / name / "config.json").read_text() for name in ("words", "values"))
    assert one == other


def test_a_result_says_in_one_line_which_tree_was_learned_and_which_is_handed_over():
    result = eutree.learn(TASK, **SMALL, **VALUES)
    kept = replace(result.against_start, handed_over="start")
    policy = eutree.zoo.load("eutree/Evasion2-v0:4")
    for handed in (result, replace(result, against_start=kept, policy=policy)):
        learned = f"learned: {result.curve[-1].describe()}; "
        leaves = f"handed over: {handed.handed_over}, {handed.policy.n_leaves} lea"
        assert learned + leaves in repr(handed)
    assert "handed over: start, 4 leaves>" in repr(handed)


def test_a_path_is_a_folder_and_resumes_as_one(tmp_path):
    calls = []
    eutree.learn(TASK, folder=tmp_path / "a", **SMALL, **VALUES)
    whole = eutree.learn(
        TASK,
        folder=Folder(tmp_path / "a", resume=True),
        listeners=Progress(calls.append),
        method=FEW_IMAGINED,
        seed=2,
        evaluation=VALUES["evaluation"],
        handover=VALUES["handover"],
    )
    assert whole.episodes == 12
    assert calls == []  # it had gone as far as it was to go


class Ear(Listener):
    """Notes whatever it is told."""

    def __init__(self):
        self.heard = []

    def begins(self, run):
        self.heard.append("begins")

    def step_taken(self, step):
        self.heard.append("step")
        return True

    def advanced(self, run):
        self.heard.append(run.phase.value)

    def ends(self):
        self.heard.append("ends")

    def closes(self):
        self.heard.append("closes")


def test_listeners_are_told_in_order_and_change_nothing():
    ear, steps = Ear(), []
    followed = eutree.learn(
        TASK, listeners=[ear, lambda known, _: steps.append(known["rewards"])], **SMALL, **VALUES
    )
    assert ear.heard[0] == "begins"
    assert ear.heard[-2:] == ["ends", "closes"]
    assert ear.heard.count("step") == followed.steps == len(steps)
    assert ear.heard.count("gather") == 12
    assert followed.policy == eutree.learn(TASK, **SMALL, **VALUES).policy


def test_a_listener_ends_the_run_and_is_closed_where_it_fails():
    ear = Ear()
    asked = StopWhen(lambda: ear.heard.count("gather") == 3)
    assert eutree.learn(TASK, listeners=[ear, asked], **SMALL, **VALUES).episodes == 3

    class Fails(Ear):
        def advanced(self, run):
            raise RuntimeError("of my own")

    one = Fails()
    with pytest.raises(RuntimeError, match="of my own"):
        eutree.learn(TASK, listeners=one, **SMALL, **VALUES)
    assert one.heard[-1] == "closes"
    assert "ends" not in one.heard


def test_a_rival_plays_the_same_fresh_episodes(tmp_path):
    handover = Handover(episodes=0, against=eutree.experts.wait_at_crossing)
    values = VALUES | {"handover": handover}
    alone = eutree.learn(TASK, **SMALL, **values)
    assert alone.against.episodes == len(alone.against.other.returns)
    many = eutree.learn_runs(
        TASK, runs=1, n_jobs=1, folder=tmp_path, selection_episodes=2, judging_episodes=2,
        **SMALL, **values,
    )  # fmt: skip
    np.testing.assert_array_equal(many.against.other.returns, alone.against.other.returns)
    assert eutree.learn(TASK, **SMALL, **VALUES).against is None


def test_many_runs_take_the_same_values(tmp_path):
    options = {"runs": 2, "n_jobs": 1, "selection_episodes": 2, "judging_episodes": 2, **SMALL}
    by_words = eutree.learn_runs(TASK, out=tmp_path / "words", **options, **WORDS)
    by_values = eutree.learn_runs(TASK, folder=tmp_path / "values", **options, **VALUES)
    assert by_words.policy == by_values.policy
    for seed in (2, 3):
        one, other = (
            tmp_path / name / "runs" / str(seed) / "config.json" for name in ("words", "values")
        )
        assert one.read_bytes() == other.read_bytes()


WRONG = [
    ({"episods": 4}, UnknownNameError, "unknown argument of learn 'episods'. .*'episodes'"),
    ({"budget": 400}, InvalidArgumentError, "budget must be a Budget, got 400"),
    ({"evaluation": Budget()}, InvalidArgumentError, "evaluation must be a Schedule"),
    (
        {"budget": Budget(steps=9), "episodes": 4},
        InvalidArgumentError,
        "episodes is a part of budget, which is given: say it there",
    ),
    ({"episodes": "4"}, InvalidArgumentError, "episodes must be an integer >= 0, got '4'"),
    ({"minutes": 0}, InvalidArgumentError, "minutes must be a number in .*, got 0"),
    ({"monotone": "stop in position"}, InvalidArgumentError, "monotone must be a list, got the te"),
    ({"out": 3}, InvalidArgumentError, "out must be the path of a folder, got 3"),
    ({"listeners": 3}, InvalidArgumentError, "a listener or callback must be a Listener"),
    ({"listeners": [Progress]}, InvalidArgumentError, "must be a Listener, .*, got <class"),
    ({"on_progress": 3}, InvalidArgumentError, "on_progress must be a function, got 3"),
    ({"stop": True}, InvalidArgumentError, "stop must be a function, got True"),
    ({"resume": True}, InvalidArgumentError, r"resume needs the folder of a run \(out\), got none"),
    ({"checkpoint_seconds": 0}, InvalidArgumentError, "checkpoint_seconds needs the folder"),
    ({"prefer_proven": "", "front_steps": 0}, InvalidArgumentError, "several trees to choose"),
    ({"handover": Handover(prefer_proven="flies")}, InvalidArgumentError, "property must be"),
]


@pytest.mark.parametrize(("options", "error", "message"), WRONG)
def test_mistakes(options, error, message):
    with pytest.raises(error, match=message):
        eutree.learn(TASK, **options)


@pytest.mark.parametrize("rival", ["gate", eutree.zoo.load("CartPole-v1")])
def test_a_rival_that_cannot_play_is_refused_before_the_first_episode(rival, tmp_path):
    expected, begun = "must have (a method predict|the features and actions of)", []
    with pytest.raises(InvalidArgumentError, match=expected):
        eutree.learn(TASK, against=rival, on_progress=begun.append, **SMALL, **WORDS)
    with pytest.raises(InvalidArgumentError, match=expected):
        eutree.learn_runs(TASK, runs=1, n_jobs=1, against=rival, out=tmp_path / "a", **SMALL)
    assert begun == []
    assert not (tmp_path / "a").exists()


def test_mistakes_offline_and_of_many(tmp_path):
    shown = eutree.record(TASK, eutree.experts.wait_at_crossing, episodes=3, seed=0)
    with pytest.raises(InvalidArgumentError, match="against needs an environment"):
        eutree.learn(None, demonstrations=shown, handover=Handover(against=lambda seen: 0))
    with pytest.raises(InvalidArgumentError, match="folder must say where"):
        eutree.learn_runs(TASK, runs=2)
    with pytest.raises(InvalidArgumentError, match="listeners must be None for several runs"):
        eutree.learn_runs(TASK, runs=2, folder=tmp_path, listeners=[Ear()])
    with pytest.raises(UnknownNameError, match="'episodes'"):
        eutree.learn_runs(TASK, runs=2, folder=tmp_path, episodez=4)


def test_usual_words_beside_a_value_say_nothing():
    asked = Asked.of({"budget": Budget(steps=9)}, (), {"race_steps": 0, "episodes": None})
    assert asked.budget == Budget(steps=9)
    assert not asked.listeners


def test_every_word_has_one_home():
    """Each plain word is a part of one value, a listener, or stands alone."""
    homes = [word for parts in _PARTS.values() for word in parts]
    homes += [*_LISTENERS, *_ALONE]
    assert sorted(homes) == sorted(ShortForms.__annotations__)
    told = inspect.getdoc(ShortForms)
    assert [word for word in homes if f"{word}" not in told] == []
    named = set(inspect.signature(eutree.learn).parameters)
    assert not named & set(ShortForms.__annotations__)
    assert not set(RunsForms.__annotations__) - set(ShortForms.__annotations__) - named
