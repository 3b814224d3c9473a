"""A whole study in the real page: what a person sees in each part, on each screen, by ear."""

import re
from contextlib import ExitStack, contextmanager

import gymnasium
import pytest

from eutree.fitting import page_tree
from eutree.recording import SessionSettings
from eutree.schema import EnvironmentSpec
from eutree_lab.study.archive import unpack
from eutree_lab.study.lead import conduct
from eutree_lab.study.plan import QUESTIONS
from tests.recording.serving import in_a_thread
from tests.recording.typists import FINDINGS, OUT_OF_SIGHT, PATIENCE, person_at

SPEC = EnvironmentSpec("eutree/Evasion2-v0")
PLAN = """
practice = 1
episodes = 2
watched = 1
taken_over = 1
[[questions]]
text = "The tree drives as I would."
low = "not at all"
high = "exactly"
points = 7
[[questions]]
text = "Who drives better?"
choices = ["the tree", "I"]
[[questions]]
text = "Anything else?"
"""
HEAR = """() => {
  window.heard = [];
  const said = document.getElementById("announce");
  new MutationObserver(() => heard.push(said.textContent)).observe(said, { childList: true });
}"""
TEXT = """# Consent
This line says that we publish *everything*.
And **this** one, too: 2 * 3.

## Who
Text:
- a
- b
  goes on
+ c

1. first
2. second

  of it
Last.

- one

- two

After a list.
3) third
3) fourth
6) sixth, 5*, see *note

0. nought
"""
SHOWN = [
    "<h2>Consent</h2>",
    "<p>This line says that we publish <em>everything</em>. And <em>this</em> one, too: 2 * 3.</p>",
    "<h2>Who</h2>",
    "<p>Text:</p>",
    "<ul><li>a</li><li>b goes on</li><li>c</li></ul>",
    "<ol><li>first</li><li>second of it</li></ol>",
    "<p>Last.</p>",
    "<ul><li>one</li><li>two</li></ul>",
    "<p>After a list.</p>",
    '<ol><li value="3">third</li><li>fourth</li><li value="6">sixth, 5*, see *note</li></ol>',
    '<ol><li value="0">nought</li></ol>',
]


@contextmanager
def studying(folder, monkeypatch, *, fps=10.0):
    """Serve a study in a thread until it is over, or the block ends."""
    for name, number in (("FITTED", 20), ("PLAYED", 20), ("PRACTICE", 4), ("PER_POINT", 2)):
        monkeypatch.setattr(page_tree, name, number)
    folder.mkdir(exist_ok=True)
    (folder / "study.toml").write_text(PLAN)
    env = gymnasium.make(SPEC.id, render_mode="rgb_array")
    pace = SessionSettings(fps=fps, countdown=0.2)
    with (
        conduct(folder, SPEC, env, pace=pace) as (recorder, tree, guide),
        in_a_thread(recorder, maker=tree, guide=guide) as served,
    ):
        yield served, guide


def go(person) -> None:
    """Play the episode that has begun, to its end."""
    person.until(state="playing").down().until(state="review").up()


def press(person, name) -> None:
    person.page.get_by_role("button", name=name, exact=True).click()


@pytest.mark.slow
@pytest.mark.parametrize("screen", ["desk", "phone", "phone on its side"])
def test_a_person_takes_part_in_a_study(chromium, tmp_path, monkeypatch, axe, screen) -> None:
    study = tmp_path / "study"
    with studying(study, monkeypatch) as (served, _):
        person = person_at(chromium, served, screen)
        person.page.evaluate(axe)
        person.page.evaluate(HEAR)

        def looked_at(*more):
            assert person.page.evaluate(FINDINGS) == []
            wide = "() => document.documentElement.scrollWidth - innerWidth"
            assert person.page.evaluate(wide) <= 0
            assert person.page.evaluate(OUT_OF_SIGHT, list(more)) == []

        person.until(part="consent", study="card")
        assert person.page.locator("#picture").is_hidden()
        looked_at()
        press(person, "I agree")
        person.until(part="practice", study="card")
        looked_at("#study-buttons .first")
        assert "Bring the blue disc" in person.page.locator("#study-text").inner_text()
        press(person, "Begin")
        person.until(part="practice", study="on", state="playing")
        held = [] if screen == "desk" else ["#pads button"]
        looked_at("#picture", "#title", *held)
        assert person.page.locator("#title").inner_text() == "Practice 1 of 1"
        assert person.page.locator("#speed").is_hidden()
        person.down().until(state="review").up()

        person.until(part="showing", study="card")
        press(person, "Begin")
        person.until(state="playing")
        press(person, "Delete what I did")
        person.until(part="asked", state="paused")
        looked_at("#study-buttons .first")
        press(person, "Go on")
        person.until(part="showing", study="on").tap("Enter")
        person.page.reload()  # in the middle of an episode
        person.page.evaluate(axe)
        person.page.evaluate(HEAR)
        person.until(part="showing", state="paused").tap("Enter")
        go(person)
        assert person.page.get_by_role("button", name="Discard").count() == 0
        person.rest().tap("Enter")
        go(person)

        person.until(part="making", study="card")
        looked_at()
        person.until(part="watching", state="watching", step=1)
        looked_at("#picture", "#title")
        assert person.page.locator("#tree-buttons button").count() == 0
        if person.page.evaluate("() => document.body.dataset.part") == "watching":
            person.tap("e")
        person.until(part="correcting", study="card")
        looked_at("#study-buttons .first")
        press(person, "Begin")
        person.until(state="driving", step=1).down().rest(0.3)
        looked_at("#picture", "#title", *held)
        person.up()

        person.until(part="questions", study="card")
        looked_at()
        person.page.get_by_role("radio", name=re.compile(r"7\s*: exactly")).check()
        person.page.get_by_role("radio", name="the tree", exact=True).check()
        person.page.get_by_label("Anything else?").last.fill("no")
        person.page.reload()
        person.page.evaluate(axe)
        person.page.evaluate(HEAR)
        person.until(part="questions")
        person.page.locator("input:checked").nth(1).wait_for(timeout=PATIENCE)
        looked_at()
        press(person, "Send")
        person.until(part="thanks")
        looked_at("#study-buttons .first")
        code = served.recorder.folder.path.parent.name
        assert code in person.page.locator("#study-text").inner_text()
        assert any(said.startswith("Thank you") for said in person.page.evaluate("() => heard"))
        press(person, "Finish")
        person.page.get_by_text("You can close this page.", exact=True).wait_for(timeout=PATIENCE)
        assert person.page.locator("#withdraw").is_hidden()
    found = unpack(study / f"{code}.zip", tmp_path / "out")
    assert found.answers == ["7", "the tree", "no"]


def test_each_part_is_announced_and_keys_alone_do(chromium, tmp_path, monkeypatch) -> None:
    with studying(tmp_path / "study", monkeypatch, fps=40.0) as (served, _):
        person = person_at(chromium, served, "desk")
        person.page.evaluate(HEAR)
        person.until(part="consent")
        for name in ("I agree", "Begin"):
            for _ in range(20):
                focused = "() => document.activeElement.textContent"
                if person.page.evaluate(focused) == name:
                    break
                person.page.keyboard.press("Tab")
            person.page.keyboard.press("Enter")
            person.until(part="practice")
        person.until(study="on")
        go(person)
        person.until(part="showing", study="card")
        heard = person.page.evaluate("() => heard")
        told = [said.split(".")[0] for said in heard]
        parts = ["Get to know the keys", "Now show how it is done"]
        assert [said for said in told if said in parts] == parts
        assert told[-2].endswith("\u2014 practice")  # how it ended, and then the next part
        assert told[-1] == "Now show how it is done"
        assert person.page.evaluate("() => document.activeElement.id") == "study"


def test_whoever_deletes_is_told_so_and_nothing_is_left(chromium, tmp_path, monkeypatch) -> None:
    study = tmp_path / "study"
    with studying(study, monkeypatch) as (served, guide):
        person = person_at(chromium, served, "phone")
        person.until(part="consent")
        press(person, "I agree")
        person.until(part="practice")
        press(person, "Begin")
        person.until(state="playing", step=2)
        press(person, "Delete what I did")
        person.until(part="asked")
        press(person, "Delete all of it")
        person.page.locator("#study-text", has_text="Nothing of what you did").wait_for(
            timeout=PATIENCE
        )
        assert guide.is_withdrawn
    assert sorted(path.name for path in study.iterdir()) == ["consent.md", "study.toml"]


@pytest.fixture
def told(chromium, tmp_path, monkeypatch):
    """Return a person who reads a text, at a phone."""

    def tell(text):
        study = tmp_path / "study"
        study.mkdir()
        (study / "consent.md").write_text(text)
        served, _ = stack.enter_context(studying(study, monkeypatch))
        person = person_at(chromium, served, "phone").until(part="consent", study="card")
        return person.page

    with ExitStack() as stack:
        yield tell


def test_no_word_of_the_text_is_left_out(told) -> None:
    page = told(TEXT)
    shown = "() => [...document.getElementById('study-text').children].map((e) => e.outerHTML)"
    assert page.evaluate(shown) == SHOWN
    words = re.findall(r"[A-Za-z]+", page.locator("#study-text").inner_text())
    assert words == re.findall(r"[A-Za-z]+", TEXT)


def test_a_long_word_stays_on_its_card(told) -> None:
    page = told(f"# Who\n\nSee https://example.org/{'a' * 90}.html\n")
    wide = (
        "(id) => document.getElementById(id).scrollWidth - document.getElementById(id).clientWidth"
    )
    assert page.evaluate(wide, "study") <= 0
    assert page.evaluate("() => document.documentElement.scrollWidth - innerWidth") <= 0


@contextmanager
def asked(chromium, folder, monkeypatch):
    """Yield a person before the questions, and the guide."""
    with studying(folder, monkeypatch) as (served, guide):
        guide.part = QUESTIONS
        person = person_at(chromium, served, "desk")
        person.until(part="questions", role="acting")
        yield person, guide


def test_keys_of_the_task_are_letters_and_arrows_in_a_question(
    chromium, tmp_path, monkeypatch
) -> None:
    """Of what was typed e, m, p, r, x, - and Space were missing, and no key chose on a scale."""
    said = "He pressed e, r, m: x - +. 2"
    with asked(chromium, tmp_path / "study", monkeypatch) as (person, guide):
        page = person.page
        page.get_by_label("Anything else?").last.click()
        page.keyboard.type(said)
        page.get_by_role("radio", name=re.compile(r"1\s*: not at all")).focus()
        for key in ("Space", "ArrowRight", "ArrowDown"):
            page.keyboard.press(key)
        page.locator("input:checked[value='3']").wait_for()
        page.wait_for_function("() => view.study.answers[0] === '3'")
        assert guide.answers == ["3", "", said]


def test_answers_of_a_broken_connection_are_told_again(chromium, tmp_path, monkeypatch) -> None:
    with asked(chromium, tmp_path / "study", monkeypatch) as (person, guide):
        page = person.page
        page.get_by_role("radio", name="the tree", exact=True).check()
        page.evaluate("() => { window.before = connect; connect = () => {}; socket.close(); }")
        page.wait_for_function("() => document.body.dataset.connection === 'lost'")
        page.get_by_role("radio", name="I", exact=True).check()
        page.get_by_label("Anything else?").last.fill("said meanwhile")
        page.evaluate("() => { connect = before; connect(); }")
        page.wait_for_function("() => view.study.answers[2] === 'said meanwhile'")
        assert guide.answers == ["", "I", "said meanwhile"]


def test_a_page_that_watches_shows_the_answers_as_they_are(chromium, tmp_path, monkeypatch) -> None:
    """Its fields were free, what was chosen there went nowhere, and stayed after taking over."""
    with asked(chromium, tmp_path / "study", monkeypatch) as (person, _):
        first = person.page
        second = person.open().page
        person.until(part="questions", role="watching")
        assert second.locator("#questions :enabled:not(fieldset)").count() == 0
        first.get_by_role("radio", name="the tree", exact=True).check()
        second.locator("input:checked[value='the tree']").wait_for()
        second.get_by_role("button", name="Take over").click()
        second.get_by_role("radio", name="I", exact=True).check()
        first.locator("input:checked[value='I']:disabled").wait_for()
