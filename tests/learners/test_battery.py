"""What every method promises from every start, each with a wrong learner that must be caught."""

import numpy as np
import pytest

from eutree.errors import InvalidArgumentError
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.learners.learner import check_fits
from eutree.learners.registry import METHODS, from_document, to_document
from eutree.learners.starts import STARTS, start_of
from eutree.neural import DoubleDQNSettings
from eutree.world_model.ensemble import EnsembleSettings
from tests.worlds import Corridor, play, play_in_part, problem_of, recorded

EPISODES = 12
SMALL = {  # methods whose default choices are too much for a toy world
    "distilled-dqn": DistilledDQN(
        max_leaves=4,
        demonstration_updates=50,
        teacher=DoubleDQNSettings(hidden=16, batch=16),
        world_model=EnsembleSettings(members=2, hidden=16, batch=32, updates=100, more_updates=50),
    )
}


def started(name, start_name, scale=1.0):
    """Return a method, its problem and its start; skip where it says that they do not fit."""
    problem = problem_of(Corridor(scale))
    chosen = SMALL.get(name) or METHODS[name]()
    start = start_of(
        start_name,
        problem,
        demonstrations=recorded(scale),
        generator=np.random.default_rng(7),
    )
    reason = chosen.needs.refusal(problem, start)
    if reason:
        with pytest.raises(InvalidArgumentError, match=f"method '{name}' does not fit this task"):
            check_fits(chosen, problem, start)
        pytest.skip(reason)
    return chosen, problem, start


def lived(chosen, problem, start, episodes=EPISODES, scale=1.0):
    """Return a learner after some episodes and the updates between them."""
    learner = chosen.start(problem, start)
    for number in range(episodes):
        play(learner, Corridor(scale), seed=100 + number)
        if (number + 1) % 4 == 0:
            learner.update(np.random.default_rng(number))
    return learner


def bytes_of(learner):
    """Return all that a learner knows, as bytes by name."""
    return {name: (a.dtype.str, a.shape, a.tobytes()) for name, a in learner.state().items()}


cases = pytest.mark.parametrize("name", METHODS)
starts = pytest.mark.parametrize("start_name", STARTS)


@cases
@starts
def test_the_same_seed_gives_the_same_bytes(name, start_name):
    case = started(name, start_name)
    assert bytes_of(lived(*case)) == bytes_of(lived(*case))


@cases
@starts
def test_a_discarded_episode_leaves_no_trace(name, start_name):
    chosen, problem, start = started(name, start_name)
    learner = lived(chosen, problem, start, episodes=5)
    before = bytes_of(learner)
    for steps in (1, 3, 60):
        play_in_part(learner, Corridor(), seed=5, steps=steps)
        assert bytes_of(learner) == before
    for number in (50, 51, 52):
        play(learner, Corridor(), seed=number)
    other = lived(chosen, problem, start, episodes=5)
    for number in (50, 51, 52):
        play(other, Corridor(), seed=number)
    assert bytes_of(learner) == bytes_of(other)


@cases
@starts
def test_what_is_restored_goes_on_to_the_same_bytes(name, start_name, tmp_path):
    chosen, problem, start = started(name, start_name)
    learner = lived(chosen, problem, start, episodes=6)
    state = {k: np.array(a) for k, a in learner.state().items()}
    chosen.check_state(tmp_path / "checkpoint.npz", state, problem)
    again = chosen.restore(problem, start, state)
    for one in (learner, again):
        for number in (60, 61):
            play(one, Corridor(), seed=number)
        one.update(np.random.default_rng(3))
        play(one, Corridor(), seed=62)
    assert bytes_of(learner) == bytes_of(again)


@cases
@starts
def test_decisions_are_a_tree_whose_fidelity_is_true(name, start_name):
    chosen, problem, start = started(name, start_name)
    learner = lived(chosen, problem, start)
    decisions = learner.decisions()
    policy = decisions.policy(problem)
    assert policy.schema.features[:3] == problem.schema.features  # the past may follow
    assert 0.0 <= decisions.fidelity <= 1.0
    if decisions.fidelity < 1.0:
        rows = learner.history.observations
        own, _ = learner.own_policy().predict(rows, episode_start=np.ones(len(rows), dtype=bool))
        same = policy.predict(rows)[0] == own
        assert same.mean() == pytest.approx(decisions.fidelity, abs=1e-12)
    if decisions.statistics is not None:
        assert decisions.statistics.visits.shape == (policy.n_leaves, problem.n_actions)


@cases
@starts
def test_a_constant_feature_is_never_cut(name, start_name):
    if start_name == "random-tree":
        pytest.skip("a random tree cuts what it likes")
    case = started(name, start_name)
    assert 2 not in lived(*case).decisions().tree.feature


@cases
def test_units_change_nothing(name):
    case = started(name, "demos")
    other = started(name, "demos", scale=4.0)
    one = lived(*case).decisions()
    two = lived(*other, scale=4.0).decisions()
    np.testing.assert_array_equal(one.tree.feature, two.tree.feature)
    np.testing.assert_array_equal(one.actions, two.actions)
    position = np.isin(one.tree.feature, (0, 3))  # 3: the previous one, where there is a past
    np.testing.assert_allclose(one.tree.threshold[position] * 4.0, two.tree.threshold[position])


@cases
def test_it_is_written_and_read_back(name):
    chosen = METHODS[name]()
    assert from_document(to_document(chosen)) == chosen
    with pytest.raises(InvalidArgumentError, match="has no choice 'colour'"):
        from_document(to_document(chosen) | {"colour": 1})


# Wrong learners, one for each promise: the battery must catch them.


class Forgetful:
    """Delegates to a learner, wrongly in one respect."""

    def __init__(self, learner, fault):
        self._learner, self._fault = learner, fault
        self._n = 0

    def __getattr__(self, name):
        return getattr(self._learner, name)

    def state(self):
        state = self._learner.state()
        if self._fault == "random":
            state["history_rewards"] = state["history_rewards"] + np.random.default_rng().random()
        return state

    def discard_episode(self):
        if self._fault == "trace":
            self._learner.history.n_seen += 1
        self._learner.discard_episode()


def test_the_battery_catches_a_learner_that_leaves_a_trace():
    chosen, problem, start = started("u-tree", "tree+demos")
    learner = Forgetful(lived(chosen, problem, start, episodes=2), "trace")
    before = bytes_of(learner)
    play_in_part(learner, Corridor(), seed=5, steps=2)
    assert bytes_of(learner) != before


def test_the_battery_catches_a_learner_of_unseeded_chance():
    case = started("u-tree", "nothing")
    one, two = (Forgetful(lived(*case), "random") for _ in range(2))
    assert bytes_of(one) != bytes_of(two)
