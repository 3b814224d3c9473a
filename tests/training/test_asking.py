"""Confident Execution: budget, stretches, marks; resumed to the same bytes; answers never lost."""

import json

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.errors import FormatError, InvalidArgumentError
from eutree.interaction.requests import DECLINED, HANDED_BACK, ScriptedController
from eutree.training import Asking
from eutree.training.asking import ANSWERS, LONG_ENOUGH, Answer, Answers

ASKING = Asking(max_requests=6, max_steps=5, alone=2)


@pytest.fixture(scope="module")
def env():
    return gymnasium.make("eutree/Evasion2-v0")


@pytest.fixture
def gate(env):
    return eutree.experts.wait_at_crossing(env)


def learn(env, out=None, **options):
    defaults = {
        "method": "paper",
        "episodes": 24,
        "evaluate_every": 12,
        "evaluation_episodes": 5,
        "seed": 7,
        "asking": ASKING,
        "checkpoint_seconds": 0.0,
    }
    return eutree.learn(env, out=out, **{**defaults, **options})


def requests_in(folder):
    lines = (folder / "events.jsonl").read_text().splitlines()
    return [event for event in map(json.loads, lines) if event["event"] == "request"]


def bytes_of(folder):
    names = ("policy.json", "checkpoint.npz", "events.jsonl", "curve.csv")
    return {name: (folder / name).read_bytes() for name in names}


class Tired:
    """Shows what a controller shows, and is interrupted after some steps in all."""

    def __init__(self, policy, patience=10**9):
        self.controller, self.left, self.asked = ScriptedController(policy), patience, 0

    def show(self, request, stretch):
        self.asked += 1
        step = stretch.step

        def counted(action):
            if self.left == 0:
                raise KeyboardInterrupt
            self.left -= 1
            return step(action)

        stretch.step = counted
        return self.controller.show(request, stretch)

    def close(self):
        pass


class Brief:
    """Shows the first steps of each stretch, then hands back."""

    def __init__(self, steps):
        self.steps, self.requests = steps, []

    def show(self, request, stretch):
        self.requests.append(request)
        for _ in range(self.steps):
            stretch.step(1)
        return HANDED_BACK

    def close(self):
        pass


def test_budget_stretches_and_marks(env, gate, tmp_path):
    result = learn(env, tmp_path / "run", ask=gate)
    events = requests_in(tmp_path / "run")
    assert len(events) == ASKING.max_requests
    assert len({event["episode"] for event in events}) == len(events)  # one an episode
    assert all(0 < event["n_shown"] <= ASKING.max_steps for event in events)
    assert {event["outcome"] for event in events} <= {
        LONG_ENOUGH,
        "confident again",
        "episode over",
    }
    history = result.history
    assert history.demonstrated.sum() == sum(event["n_shown"] for event in events)
    for event in events:
        rows = np.flatnonzero(history.episodes == event["episode"])
        marked = history.demonstrated[rows]
        first, last = event["step"], event["step"] + event["n_shown"]
        assert marked[first:last].all()
        assert marked.sum() == event["n_shown"]
        chosen = gate.predict(history.observations[rows[first:last]])[0]
        assert np.array_equal(history.actions[rows[first:last]], chosen)


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_nobody_is_asked_before_something_was_tried(env, preset):
    """Else the first requests come at step 0 of the first episodes, like a recording."""
    brief = Brief(1)
    learn(env, method=preset, ask=brief, asking=Asking(max_requests=2, alone=4), episodes=10)
    assert [request.episode for request in brief.requests] == [4, 5]
    learn(env, ask=brief, asking=Asking(max_requests=1, alone=0), episodes=1)
    assert (brief.requests[-1].episode, brief.requests[-1].step) == (0, 0)


def test_a_request_says_what_the_tree_would_do(env, gate):
    demos = eutree.record(env, gate, episodes=3, seed=0)
    expert = eutree.fit_expert_tree(demos)
    brief = Brief(1)
    asking = Asking(max_requests=1, alone=0)
    learn(env, demonstrations=demos, expert=expert, ask=brief, asking=asking, episodes=1)
    (request,) = brief.requests
    action = int(expert.predict(request.observations[-1])[0])
    assert request.intended == ("stop", "go")[action]
    assert request.text == f"{request.reason} It would take {request.intended}."


def test_who_is_asked_learns_faster(env, gate):
    """Fifteen stretches in the first phase; C. U-Tree alone needs far more for as much."""
    asking = Asking(max_requests=15)
    alone = [learn(env, seed=s, evaluation_episodes=60).curve[-1].mean_return for s in (1, 2, 3)]
    asked = [
        learn(env, seed=s, ask=gate, asking=asking, evaluation_episodes=60).curve[-1].mean_return
        for s in (1, 2, 3)
    ]
    assert np.mean(asked) > np.mean(alone) + 5


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_resumed_run_ends_with_the_same_bytes(env, gate, tmp_path, preset):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    learn(env, whole, ask=gate, method=preset)
    steps = iter(range(10**9))
    learn(env, parts, ask=gate, method=preset, stop=lambda: next(steps) > 60)
    assert bytes_of(parts)["events.jsonl"] != bytes_of(whole)["events.jsonl"]
    learn(env, parts, ask=gate, method=preset, resume=True)
    assert bytes_of(parts) == bytes_of(whole)


def test_an_answer_is_never_asked_for_twice(env, gate, tmp_path):
    """Interrupted in the middle of a stretch: what was shown is there, the rest is asked for."""
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    learn(env, whole, ask=gate)
    shown = [event["n_shown"] for event in requests_in(whole)]
    patience = sum(shown[:2]) + 2
    with pytest.raises(KeyboardInterrupt):
        learn(env, parts, ask=Tired(gate, patience))
    assert len((parts / ANSWERS).read_text().splitlines()) >= patience
    (parts / "checkpoint.npz").unlink()  # as if all had been lost but the answers
    second = Tired(gate)
    learn(env, parts, ask=second, resume=True)
    assert second.asked == len(shown) - 2  # the third one goes on where it was
    assert bytes_of(parts) == bytes_of(whole)


@pytest.mark.parametrize("steps", [0, 2])
def test_declined_and_handed_back(env, tmp_path, steps):
    brief = Brief(steps)
    result = learn(env, tmp_path / "run", ask=brief, episodes=12)
    events = requests_in(tmp_path / "run")
    assert len(events) >= 3
    assert [r.number for r in brief.requests] == list(range(1, len(events) + 1))
    assert {event["outcome"] for event in events} == {HANDED_BACK if steps else DECLINED}
    assert result.history.demonstrated.sum() == steps * len(events)
    first = brief.requests[0]
    assert len(first.observations) == first.step + 1
    again = Brief(9)
    (tmp_path / "run" / "checkpoint.npz").unlink()
    learn(env, tmp_path / "run", ask=again, episodes=12, resume=True)
    assert again.requests == []  # a refusal is an answer, too


def test_a_callback_ends_the_run_within_a_stretch(env, gate, tmp_path):
    steps = iter(range(100))
    result = learn(env, tmp_path / "run", ask=gate, callback=lambda *_: next(steps) < 2)
    assert (result.episodes, result.history.size) == (0, 0)
    assert requests_in(tmp_path / "run") == []
    learn(env, tmp_path / "run", ask=gate, resume=True)
    learn(env, tmp_path / "whole", ask=gate)
    assert bytes_of(tmp_path / "run") == bytes_of(tmp_path / "whole")


def test_answers_survive_a_torn_line_and_refuse_a_damaged_one(tmp_path):
    path = tmp_path / ANSWERS
    answers = Answers(path)
    answers.add(Answer(3, 17, 1))
    answers.add(Answer(3, 18, end=HANDED_BACK))
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"episode":3,"st')
    again = Answers(path)
    assert again.find(3, 17) == Answer(3, 17, 1)
    assert again.find(3, 18).end == HANDED_BACK
    assert again.find(3, 19) is None
    assert path.read_bytes() == whole
    path.write_bytes(b"nonsense\n" + whole)
    with pytest.raises(FormatError, match="line 1"):
        Answers(path).find(0, 0)


def test_a_run_is_resumed_as_it_was_started(env, gate, tmp_path):
    learn(env, tmp_path / "run", ask=gate, episodes=2)
    with pytest.raises(eutree.RunFolderError, match="asking"):
        learn(env, tmp_path / "run", ask=gate, episodes=3, resume=True, asking=Asking())


def test_who_can_be_asked(env):
    with pytest.raises(InvalidArgumentError, match="a policy or a controller, got 3"):
        learn(env, ask=3)
    with pytest.raises(InvalidArgumentError, match="without an environment"):
        learn(None, ask=Brief(1))
