"""What every method promises from every start, each promise with a wrong learner that breaks it.

A promise is a function of a case: a method, a problem and a start. It is asked of each method from
each start that it takes, and in the end of a learner that is wrong in this respect alone.
"""

import importlib
import random
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from eutree.errors import FormatError, InvalidArgumentError
from eutree.learners import Decisions, UTreeMethod
from eutree.learners.learner import HasPolicy, Needs, check_fits
from eutree.learners.registry import METHODS, from_document, register, restored, to_document
from eutree.learners.starts import STARTS
from tests.learners.battery import FILE, Case, case_of, checked_state
from tests.worlds import Corridor, play, play_in_part


def bytes_of(learner):
    """Return all that a learner knows, as bytes by name."""
    return {name: (a.dtype.str, a.shape, a.tobytes()) for name, a in learner.state().items()}


def chance_of_the_process():
    """Return the states of the generators that everybody in a process shares."""
    _, key, position, *_ = np.random.get_state()  # noqa: NPY002 - who draws from it is looked for
    return random.getstate(), key.tobytes(), position


# The promises -----------------------------------------------------------------------------------


def it_starts_or_says_why_not(case):
    reason = case.method.needs.refusal(case.problem, case.start)
    if not reason:
        assert case.begun() is not None
        return
    with pytest.raises(InvalidArgumentError) as caught:
        check_fits(case.method, case.problem, case.start)
    assert str(caught.value) == f"method {case.method.name!r} does not fit this task: {reason}"


def the_same_seed_gives_the_same_bytes(case):
    assert bytes_of(case.lived()) == bytes_of(case.life)


def all_chance_is_handed_in(case):
    before = chance_of_the_process()
    case.lived(episodes=4)
    drawn = chance_of_the_process() != before  # compared here: pytest would explain for seconds
    assert not drawn


def looking_changes_nothing(case):
    before = bytes_of(case.life)
    case.life.decisions()
    case.life.state()
    assert bytes_of(case.life) == before


def a_discarded_episode_leaves_no_trace(case):
    learner, other = case.lived(episodes=5), case.lived(episodes=5)
    before = bytes_of(learner)
    for steps in (1, 3, 60):
        play_in_part(learner, Corridor(), seed=5, steps=steps)
        assert bytes_of(learner) == before
    for one in (learner, other):
        for number in (50, 51, 52):
            play(one, Corridor(), seed=number)
    assert bytes_of(learner) == bytes_of(other)


def what_is_restored_goes_on_to_the_same_bytes(case):
    learner = case.lived(episodes=6)
    state = {k: np.array(a) for k, a in learner.state().items()}
    again = restored(FILE, state, case.method, case.problem, case.start)
    for one in (learner, again):
        for number in (60, 61):
            play(one, Corridor(), seed=number)
        one.update(np.random.default_rng(3))
        play(one, Corridor(), seed=62)
    assert bytes_of(learner) == bytes_of(again)


def a_state_of_other_shapes_is_refused(case):
    state = case.life.state()
    checked_state(FILE, state, case.method, case.problem, case.start)
    for name, array in state.items():
        for wrong in (array[np.newaxis], array.astype(complex)):
            damaged = {**state, name: wrong}
            with pytest.raises(FormatError):
                checked_state(FILE, damaged, case.method, case.problem, case.start)


def all_that_was_lived_is_in_the_history(case):
    learner = case.begun()
    shown = learner.history.n_seen
    assert shown == sum(len(episode.actions) for episode in case.start.episodes)
    steps = 0
    for seed in (1, 2, 3):
        env = Counted(case.scale)
        play(learner, env, seed=seed)
        steps += env.n_steps
    assert learner.history.n_seen - shown == steps


def decisions_are_a_tree_whose_fidelity_is_true(case):
    learner, problem = case.life, case.problem
    decisions = learner.decisions()
    policy = decisions.policy(problem)
    assert policy.schema.features[:3] == problem.schema.features  # the past may follow
    if not isinstance(learner, HasPolicy):
        assert decisions.fidelity == 1.0
        return
    rows = learner.history.observations
    own, _ = learner.own_policy().predict(rows, episode_start=np.ones(len(rows), dtype=bool))
    same = policy.predict(rows)[0] == own
    assert same.mean() == pytest.approx(decisions.fidelity, abs=1e-12)


def numbers_shown_are_of_these_leaves_and_actions(case):
    decisions = case.life.decisions()
    if decisions.statistics is None:
        return
    shape = (decisions.tree.n_leaves, case.problem.n_actions)
    assert decisions.statistics.visits.shape == shape
    assert decisions.statistics.values.shape == shape
    assert 0 < decisions.statistics.visits.sum() <= case.life.history.n_seen


def a_constant_feature_is_never_cut(case):
    if case.start.name != "random-tree":  # which cuts what it likes
        assert 2 not in case.life.decisions().tree.feature


def units_change_nothing(case):
    if case.start.name != "demos":  # random and expert trees are made outside of the learner
        return
    one, two = case.life.decisions(), case.scaled.life.decisions()
    np.testing.assert_array_equal(one.tree.feature, two.tree.feature)
    np.testing.assert_array_equal(one.actions, two.actions)
    position = np.isin(one.tree.feature, (0, 3))  # 3: the previous one, where there is a past
    np.testing.assert_allclose(one.tree.threshold[position] * 4.0, two.tree.threshold[position])


def its_choices_are_written_and_read_back(case):
    chosen = case.method
    assert from_document(to_document(chosen)) == chosen
    with pytest.raises(InvalidArgumentError, match="has no choice 'colour'"):
        from_document(to_document(chosen) | {"colour": 1})


class Counted(Corridor):
    """A corridor that counts the steps in it."""

    n_steps = 0

    def step(self, action):
        self.n_steps += 1
        return super().step(action)


PROMISES: list[Callable[[Case], None]] = [
    it_starts_or_says_why_not,
    its_choices_are_written_and_read_back,
    the_same_seed_gives_the_same_bytes,
    all_chance_is_handed_in,
    looking_changes_nothing,
    a_discarded_episode_leaves_no_trace,
    what_is_restored_goes_on_to_the_same_bytes,
    a_state_of_other_shapes_is_refused,
    all_that_was_lived_is_in_the_history,
    decisions_are_a_tree_whose_fidelity_is_true,
    numbers_shown_are_of_these_leaves_and_actions,
    a_constant_feature_is_never_cut,
    units_change_nothing,
]


@pytest.mark.parametrize("start_name", STARTS)
@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("promise", PROMISES, ids=lambda promise: promise.__name__)
def test_every_method_from_every_start(promise, name, start_name):
    case = case_of(name, start_name)
    reason = case.method.needs.refusal(case.problem, case.start)
    if reason and promise is not it_starts_or_says_why_not:
        pytest.skip(reason)
    promise(case)


@pytest.mark.parametrize("start_name", ["tree", "tree+demos"])
@pytest.mark.parametrize("promise", PROMISES, ids=lambda promise: promise.__name__)
def test_the_method_of_the_page(promise, start_name, tmp_path, monkeypatch):
    page = (Path(__file__).parents[2] / "docs" / "your-own-method.md").read_text()
    shown = re.search(r"file: corrected_imitation.py -->\n\n```python\n(.*?)```", page, re.DOTALL)
    (tmp_path / "of_the_page.py").write_text(shown[1])
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(METHODS, "_known", {})
    kind = register(importlib.import_module("of_the_page").CorrectedImitation)
    monkeypatch.delitem(sys.modules, "of_the_page")
    promise(Case.of(kind(), start_name))


# Wrong learners ---------------------------------------------------------------------------------


class WrongMethod:
    """The Continuous U-Tree; one of its parts, or of its learners', is replaced by a wrong one."""

    def __init__(self, *, method=None, learner=None, **own) -> None:
        self._method = method or UTreeMethod(gathering_episodes=4)
        self._learner = learner or {}
        self._own = own

    def __getattr__(self, name):
        own = self.__dict__["_own"]
        return own[name] if name in own else getattr(self.__dict__["_method"], name)

    def start(self, problem, start):
        if "start" in self._own:
            return self._own["start"](problem, start)
        return self._wrong(self._method.start(problem, start))

    def restore(self, problem, start, state):
        if "restore" in self._own:
            return self._own["restore"](problem, start, state)
        return self._wrong(self._method.restore(problem, start, state))

    def _wrong(self, learner):
        for name, wrong in self._learner.items():
            own = getattr(learner, name)
            setattr(learner, name, lambda *given, o=own, w=wrong: w(learner, o, *given))
        return learner


@dataclass(frozen=True, kw_only=True)
class WithAChoiceOfItsOwn(UTreeMethod):
    """Its name is that of another method, which has no such choice."""

    patience: int = 3


def unseeded(learner, own):
    return {**own(), "noise": np.array([random.SystemRandom().random()])}


def of_the_process(learner, own):
    return own() if np.random.random() < 2.0 else 0  # noqa: NPY002 - wrong on purpose


def remembering_looks(learner, own):
    learner.history.n_seen += 1
    return own()


def kept_in_part(learner, own):
    if learner._steps:
        learner.history.n_seen += 1
    own()


def dropping(learner, own):
    seen = learner.history.n_seen
    own()
    learner.history.n_seen = seen


def boasting(learner, own):
    return replace(own(), fidelity=0.5)


def of_other_leaves(learner, own):
    found = own()
    halved = replace(found.statistics, **{n: getattr(found.statistics, n)[1:] for n in NUMBERS})
    return replace(found, statistics=halved)


NUMBERS = ("visits", "values", "deviations")


def with_a_cut(feature, threshold):
    def decisions(learner, own):
        tree = own().tree.split(0, feature, threshold)
        return Decisions(tree, np.zeros(tree.n_leaves, dtype=np.int64))

    return decisions


def begun_anew(problem, start, state):
    return UTreeMethod(gathering_episodes=4).start(problem, start)


class Names(dict):
    """Names of arrays of which nothing is declared."""

    def items(self):
        return ()


class Anything:
    """A part that takes whatever has its names."""

    optional, rule = True, None

    def __init__(self, part):
        self.arrays = Names.fromkeys(part.arrays)


def trusting(problem, start):
    """Return a declaration of which only the names say anything."""
    own = UTreeMethod(gathering_episodes=4).declared(problem, start)
    return replace(own, parts=tuple(Anything(part) for part in own.parts))


def stumbling(problem, start):
    raise IndexError("there is no episode that reached the goal")


WRONG: dict[Callable[[Case], None], WrongMethod | UTreeMethod] = {
    it_starts_or_says_why_not: WrongMethod(start=stumbling, needs=Needs()),
    its_choices_are_written_and_read_back: WithAChoiceOfItsOwn(),
    the_same_seed_gives_the_same_bytes: WrongMethod(learner={"state": unseeded}),
    all_chance_is_handed_in: WrongMethod(learner={"act": of_the_process}),
    looking_changes_nothing: WrongMethod(learner={"decisions": remembering_looks}),
    a_discarded_episode_leaves_no_trace: WrongMethod(learner={"discard_episode": kept_in_part}),
    what_is_restored_goes_on_to_the_same_bytes: WrongMethod(restore=begun_anew),
    a_state_of_other_shapes_is_refused: WrongMethod(declared=trusting),
    all_that_was_lived_is_in_the_history: WrongMethod(learner={"end_episode": dropping}),
    decisions_are_a_tree_whose_fidelity_is_true: WrongMethod(learner={"decisions": boasting}),
    numbers_shown_are_of_these_leaves_and_actions: WrongMethod(
        learner={"decisions": of_other_leaves}
    ),
    a_constant_feature_is_never_cut: WrongMethod(learner={"decisions": with_a_cut(2, 2.0)}),
    units_change_nothing: WrongMethod(learner={"decisions": with_a_cut(0, 0.3)}),
}
CAUGHT = (AssertionError, pytest.fail.Exception, IndexError, InvalidArgumentError)


@pytest.mark.parametrize("promise", PROMISES, ids=lambda promise: promise.__name__)
def test_a_wrong_learner_is_caught(promise):
    with pytest.raises(CAUGHT):
        promise(Case.of(WRONG[promise], "demos"))


@pytest.mark.parametrize("promise", PROMISES, ids=lambda promise: promise.__name__)
def test_the_same_learner_put_right_is_not(promise):
    """What is caught is the fault, not the wrapping."""
    right = UTreeMethod(gathering_episodes=4)
    written = promise is its_choices_are_written_and_read_back
    promise(Case.of(right if written else WrongMethod(), "demos"))
