"""A learner asks at the real page: a person shows a stretch, declines, and closes the tab."""

import threading
import time

import gymnasium
import pytest

import eutree
from eutree.interaction.browser import AskInBrowser
from eutree.interaction.requests import ScriptedController
from eutree.interaction.settings import SessionSettings
from eutree.training import Asking
from tests.interaction.asking import Asked
from tests.interaction.serving import ENOUGH
from tests.interaction.typists import PATIENCE, Person


def learned(env, ask):
    return eutree.learn(
        env,
        method="paper",
        episodes=4,
        evaluation_episodes=2,
        ask=ask,
        asking=Asking(max_requests=3, max_steps=4, alone=0),
    )


@pytest.fixture(scope="module", autouse=True)
def nothing_is_left_to_compile():
    """Compiling holds up the page's server, which is in this process: for half a minute in CI."""
    env = gymnasium.make("eutree/Evasion2-v0")
    learned(env, ScriptedController(eutree.experts.wait_at_crossing(env)))


class Run:
    """A learner in a thread; whoever it asks is at a page."""

    def __init__(self, **options):
        env = gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array")
        settings = SessionSettings(countdown=3.0, fps=10.0)  # time to press a key in
        self.page = AskInBrowser(env, settings=settings, port=0, **options)
        self.server = self.page.server  # what a person opens
        self.result = None
        self._env = env
        self.thread = threading.Thread(target=self._learn, daemon=True)

    def _learn(self):
        self.result = learned(self._env, self.page)

    def finish(self):
        self.thread.join(ENOUGH)
        self.page.close()
        assert self.result is not None
        return self.result


def test_a_person_shows_declines_and_leaves(chromium):
    run = Run(patience=60.0)
    person = Person(chromium, run).until(state="waiting", role="acting")
    assert "practises" in person.page.locator("#title").inner_text()
    run.thread.start()
    person.until(state="asked")
    shown = person.page.locator("#text").inner_text()
    assert "The tree has seen few situations like this. It would take " in shown
    assert ". Please answer within" in shown
    assert person.page.title().startswith("Please show")
    assert person.page.locator("#saved").inner_text() == "request 1 of 3"
    assert person.page.locator("#episodes-section").is_hidden()
    person.page.locator("#buttons button", has_text="Show it").click()
    person.until(state="countdown").down().until(state="playing")
    person.page.locator("#title", has_text="Request 1 of 3").wait_for(timeout=PATIENCE)
    person.page.locator("#saved", has_text="2 of 3").wait_for(timeout=PATIENCE)
    person.up().until(state="asked").tap("Escape")
    person.page.locator("#saved", has_text="3 of 3").wait_for(timeout=PATIENCE)
    person.page.close()  # in the middle of the third
    assert person.messages == []
    history = run.finish().history
    assert history.demonstrated.sum() == 4
    assert history.actions[history.demonstrated].tolist() == [1, 1, 1, 1]  # Space: go


def test_the_page_says_goodbye(chromium):
    run = Run(patience=60.0)
    person = Person(chromium, run).until(state="waiting", role="acting")
    run.page.close()
    person.until(state="finished")
    assert person.page.locator("#title").inner_text() == "Learning has ended"
    assert person.page.locator("#banner").is_hidden()


def test_a_page_that_was_never_opened_is_not_awaited(monkeypatch):
    """Three requests took three times the patience."""
    monkeypatch.setattr("eutree.interaction.ask_session.GRACE_SECONDS", 0.1)
    run = Run(patience=1e6)
    time.sleep(0.1)
    run.thread.start()
    assert run.finish().history.demonstrated.sum() == 0


def test_nobody_at_the_page():
    run = Run(patience=0.3)
    run.thread.start()
    assert run.finish().history.demonstrated.sum() == 0


def test_an_interruption_and_a_taken_port():
    asked = Asked()
    page = AskInBrowser(asked.env.env, port=0, stop=lambda: True)
    with pytest.raises(KeyboardInterrupt):
        page.show(asked.request, asked.stretch)
    with pytest.raises(eutree.InvalidArgumentError, match="choose another --port"):
        AskInBrowser(asked.env.env, port=page.server.port)
    page.close()
