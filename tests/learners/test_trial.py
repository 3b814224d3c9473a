"""A challenger takes the incumbent's place only when real episodes speak for it."""

from dataclasses import replace

import numpy as np
import pytest

from eutree.errors import FormatError
from eutree.learners import Start
from eutree.learners.restoring import checked_state
from eutree.learners.trial import FEWEST, MOST, Trial
from eutree.learners.vector_quantization import VectorQuantizationMethod
from eutree.trees import DecisionTree
from tests.learners.battery import case_of

ONE, TWO = DecisionTree.single_leaf(1), DecisionTree.single_leaf(1).split(0, 0, 0.5)


def trial_of():
    """Return a trial with a challenger, in which returns from -50 to 100 have been seen."""
    trial = Trial(ONE, np.array([0]))
    for earned in (-50.0, 100.0):
        trial.episode_over(earned)
    assert trial.challenge(TWO, np.array([0, 1]))
    return trial


def run(trial, gain, pairs=MOST):
    """Let both act from common starts until the trial is over; return how many pairs it took."""
    for pair in range(pairs):
        for _ in range(4):
            acting = trial.acting()
            earned = 50.0
            if acting is not None and acting is trial.challenger:
                earned += gain(pair)
            trial.episode_over(earned)
            if trial.challenger is None:
                return pair + 1
    return pairs


def test_every_second_episode_is_one_of_a_pair_from_a_common_start():
    trial = trial_of()
    turns = []
    for _ in range(8):
        acting = trial.acting()
        who = "own" if acting is None else "new" if acting is trial.challenger else "old"
        turns.append((who, trial.next_start()))
        trial.episode_over(60.0 if who == "new" else 50.0)
    own = ("own", None)
    assert turns == [own, ("new", 0), own, ("old", 0), own, ("new", 1), own, ("old", 1)]
    assert trial.gains == [10.0, 10.0]


def test_one_that_is_clearly_better_wins():
    trial = trial_of()
    took = run(trial, lambda pair: 40.0)
    assert FEWEST < took < 40
    assert trial.adopted == 1
    tree, actions = trial.decided(1)
    assert tree.leaf_of([0.2]) != tree.leaf_of([0.9])
    assert actions.tolist() == [0, 1]


@pytest.mark.parametrize("gain", [0.0, -3.0])
def test_one_that_is_no_better_is_dropped(gain):
    trial = trial_of()
    assert run(trial, lambda pair: gain) == FEWEST
    assert trial.adopted == 0
    assert trial.decided(1)[0].n_leaves == 1
    assert trial.challenge(TWO, np.array([1, 0]))  # there is room for another


def test_one_that_gains_too_little_to_be_sure_is_dropped_in_the_end():
    trial = trial_of()
    assert run(trial, lambda pair: 0.2) == MOST
    assert trial.adopted == 0


def test_a_rare_loss_that_was_not_seen_yet_is_reckoned_with():
    taken = 0
    for seed in range(60):  # faster by 10, and a crash in ten: worse on the whole
        generator = np.random.default_rng(seed)
        trial = trial_of()
        run(trial, lambda pair, g=generator: -100.0 if g.random() < 0.1 else 10.0)
        taken += trial.adopted
    assert taken <= 6  # 5 % of 60 and two standard errors


def test_the_incumbent_does_not_challenge_itself():
    trial = Trial(TWO, np.array([0, 1]))
    assert not trial.challenge(TWO, np.array([0, 1]))
    assert trial.challenge(TWO, np.array([1, 1]))
    assert not trial.challenge(TWO, np.array([1, 0]))  # one at a time


def test_restored_it_goes_on():
    trial = trial_of()
    for earned in (50.0, 70.0, 50.0, 40.0, 50.0, 75.0):
        trial.episode_over(earned)
    twin = Trial.from_state({name: array.copy() for name, array in trial.state().items()})
    for one in (trial, twin):
        run(one, lambda pair: 40.0)
    assert twin.adopted == trial.adopted == 1
    for name, array in trial.state().items():
        assert twin.state()[name].tobytes() == array.tobytes()


def test_vqql_keeps_an_expert_that_it_does_not_beat_and_only_then():
    case = case_of("vqql", "tree+demos")
    learner, expert = case.lived(episodes=8), case.start.expert
    assert learner.trial is not None
    decisions = learner.decisions()
    assert decisions.tree.n_leaves == expert.tree.n_leaves
    assert (decisions.actions == expert.actions).all()
    published = replace(case, method=VectorQuantizationMethod(trial=False)).lived(episodes=8)
    assert published.trial is None
    for other in ("nothing", "demos", "random-tree"):
        assert case_of("vqql", other).lived(episodes=4).trial is None


def test_vqql_gives_a_bad_expert_up():
    case = case_of("vqql", "tree+demos")
    expert = case.start.expert
    waits = type(expert)(tree=expert.tree, actions=expert.actions * 0, schema=expert.schema)
    learner = replace(case, start=Start(waits, case.start.episodes)).lived(episodes=120)
    assert learner.trial.adopted >= 1
    assert learner.decisions().actions.max() == 1


def test_a_state_from_a_file_is_not_trusted(tmp_path):
    case = case_of("vqql", "tree+demos")
    state = case.lived(episodes=9).state()
    checked_state(tmp_path / "x", state, case.method, case.problem, case.start)
    for name, array in (
        ("trial_incumbent_action", state["trial_incumbent_action"] + 9),
        ("trial_incumbent_left", state["trial_incumbent_left"] + 1000),
        ("trial_counts", np.array([0, 0])),
        ("trial_counts", np.array([0, 0, -1])),
        ("trial_gains", np.array([np.nan])),
    ):
        damaged = state | {name: array}
        with pytest.raises(FormatError):
            checked_state(tmp_path / "x", damaged, case.method, case.problem, case.start)
