"""What the phases of a run share: where it stands, what is noted, who may end it."""

from eutree.learners import Step
from eutree.training.listeners import StopWhen
from eutree.training.phases import RunState

STEP = Step(0, 0.0, [0.0], False, False, {})


class Recorder:
    """Notes what it is told; ends the run at the second step."""

    def __init__(self):
        self.told = []

    def wants_stop(self):
        return False

    def gathering_begins(self):
        self.told.append("begins")

    def step_taken(self, step):
        self.told.append("step")
        return self.told.count("step") < 2

    def gathering_ends(self):
        self.told.append("ends")


def test_steps_of_learning_of_racing_and_of_the_running_episode_count() -> None:
    state = RunState()
    state.move(steps=100, racing_steps=20, episode=7)
    state.steps_of_episode = 3
    state.note("race", {"won": 1})
    assert state.events == [{"event": "race", "episode": 7, "steps": 123, "won": 1}]


def test_a_listener_is_told_of_each_change_once_and_may_end_the_run() -> None:
    listener = Recorder()
    state = RunState([listener])
    state.gathering_ends()  # nothing was begun
    for _ in range(2):
        state.gathering_begins()
        state.step_taken(STEP)
    assert state.must_stop()
    state.gathering_ends()
    state.gathering_ends()
    assert listener.told == ["begins", "step", "step", "ends"]


def test_what_was_recorded_is_noted_once() -> None:
    state = RunState()
    state.recorded["own/x"] = 1.0
    state.note_what_was_recorded()
    state.note_what_was_recorded()
    assert [event["values"] for event in state.events] == [{"own/x": 1.0}]


def test_stop_is_asked_until_it_says_so() -> None:
    answers = iter([False, True])
    state = RunState([StopWhen(lambda: next(answers))])
    assert [state.must_stop() for _ in range(3)] == [False, True, True]
