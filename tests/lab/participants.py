"""People of a study, by script: on clocks of their own, with the makers of their trees beside."""

import gymnasium

from eutree.recording import SessionSettings
from eutree.schema import EnvironmentSpec
from eutree_lab.study.lead import conduct
from tests.recording.people import Person

SPEC = EnvironmentSpec("eutree/Evasion2-v0")
SHORT = """
practice = 1
episodes = 2
watched = 1
taken_over = 1
[[questions]]
text = "As I would?"
points = 5
[[questions]]
text = "In words?"
"""


class Participant:
    """A person of a study, on a clock of its own, and the makers of the tree beside."""

    def __init__(self, recorder, tree, guide):
        self.recorder, self.tree, self.guide = recorder, tree, guide
        self.pending, self.shown, self.parts = [], [], []
        self.person = Person(session=recorder.session, tick=self._tick)

    def _tick(self, now, events):
        session = self.recorder.session
        tick = self.recorder.tick(now, [*self.pending, *events])
        self.pending = self.guide.advance(now)
        wish = session.wishes.take()
        if wish:
            getattr(self.tree, wish)(self._show, lambda: False)
        if not self.parts or self.parts[-1] != self.guide.part:
            self.parts.append(self.guide.part)
        return tick

    def _show(self, view, programme=None):
        self.shown.append(view)
        if programme is not None:
            self.recorder.session.driving.offer(programme)

    def until(self, part):
        end = self.person.now + 200.0
        while self.guide.part != part:
            assert self.person.now < end, f"still {self.guide.part}, not {part}"
            self.person.wait(0.25)
        return self

    def say(self, name, place=0, text=""):
        self.guide.hear(name, place, text)
        self.person.wait(0.1)
        return self

    def drive(self):
        """Go on with whatever is to be done until the next part, holding the key of going."""
        part, held = self.guide.part, False
        end = self.person.now + 300.0
        while self.guide.part == part:
            assert self.person.now < end, part
            if self.person.view.state in ("review", "watching") and not held:
                self.person.do("start")
            if self.person.view.state == "playing" and not held:
                self.person.press("space")
                held = True
            if self.person.view.state == "review" and held:
                self.person.release("space")
                held = False
            self.person.wait(0.25)
        return self

    def play(self):
        """Play the episode that has begun, or begins now, to its end."""
        if self.person.view.state == "review":
            self.person.wait(1.0).do("start")
        self.person.until("playing").press("space").until("review").release("space")
        return self

    def show_all(self):
        self.say("agree").say("begin").drive().say("begin").drive().until("watching").drive()
        return self.say("begin").drive()


def study_of(folder, plan=SHORT):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.toml").write_text(plan)
    return folder


def made(render=True):
    return gymnasium.make(str(SPEC.id), render_mode="rgb_array" if render else None)


def taking_part(folder, **more):
    pace = SessionSettings(fps=10.0, countdown=0.2)
    return conduct(folder, SPEC, made(), pace=pace, **more)
