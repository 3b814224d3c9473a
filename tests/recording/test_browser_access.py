"""The page for everybody: low screens, 200 %, screen readers, and a tree that can be seen whole."""

import time
from contextlib import contextmanager
from dataclasses import replace

import gymnasium
import pytest

from eutree.recording.tree_making import HurtView, Segment, StripView, TreeView
from tests.recording.people import Corridor
from tests.recording.serving import serving
from tests.recording.typists import (
    FINDINGS,
    OUT_OF_SIGHT,
    PATIENCE,
    SCREENS,
    Person,
    ScriptedMaker,
    box,
    evasion,
    goes_on_and_on,
    person_at,
)


class Many(Corridor):
    """Seven actions, in steps of one key, as in a grid world."""

    action_space = gymnasium.spaces.Discrete(7)
    action_names = ("north", "south", "west", "east", "pick up", "drop off", "look around")
    observation_space = gymnasium.spaces.Tuple([gymnasium.spaces.Discrete(100)] * 2)
    get_keys_to_action = None

    def _observation(self):
        return int(self.place), self.steps


@pytest.mark.parametrize(
    "screens", [("desk", "200 %"), ("phone", "phone on its side")], ids=["keys", "fingers"]
)
@pytest.mark.parametrize(
    "world",
    [
        evasion,
        pytest.param(lambda: Corridor(length=100, limit=10_000), id="Corridor"),
        pytest.param(lambda: Many(length=90, limit=90), id="Many"),  # as far as it counts
    ],
)  # long enough for a page that is drawn late
def test_what_is_held_and_said_is_in_sight(chromium, tmp_path, screens, world) -> None:
    """A phone on its side hid the button to hold, and a zoom of 200 % hid *Paused*."""
    with serving(tmp_path, world(), fps=8.0) as served:
        person = person_at(chromium, served, screens[0])

        def hidden(*more, held=False):
            """Return what is out of sight on one of the screens."""
            found = []
            for screen in screens:
                person.look_on(screen)
                pads = ["#pads button"] if held and screen != "desk" else []  # there, keys are held
                names = ["#picture", "#title", *more, *pads]
                found += [(screen, one) for one in person.page.evaluate(OUT_OF_SIGHT, names)]
            return found

        person.page.locator("body[data-frame]").wait_for(timeout=PATIENCE)
        assert hidden("#buttons .first") == []
        person.tap("Enter").until(state="playing").down("ArrowLeft").until(step=1)
        person.up("ArrowLeft")
        assert hidden(held=True) == []
        person.tap("p").until(state="paused")
        assert person.page.locator("#title").inner_text() == "Paused"
        assert hidden("#buttons .first", held=True) == []
        person.tap("e").until(state="review")
        assert hidden("#buttons .first") == []
        wide = "() => document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert [person.look_on(screen).page.evaluate(wide) for screen in screens] == [0, 0]


@pytest.mark.parametrize(
    ("screen", "schemes"),
    [("desk", ("dark", "light")), ("phone", ("dark",)), ("phone on its side", ("light",)),
     ("200 %", ("dark",))],
    ids=["desk", "phone", "phone on its side", "200 %"],
)  # fmt: skip
def test_axe_finds_nothing(chromium, tmp_path, axe, screen, schemes) -> None:
    env = evasion()
    maker = goes_on_and_on(env)
    with serving(tmp_path, env, fps=8.0, maker=maker) as served:
        person = person_at(chromium, served, screen)
        person.page.evaluate(axe)

        def findings():
            found = []
            for scheme in schemes:
                person.page.emulate_media(color_scheme=scheme)
                found += person.page.evaluate(FINDINGS)
            return found

        assert findings() == []
        person.tap("Enter").until(state="playing", step=1)
        assert findings() == []
        person.tap("p").until(state="paused")
        assert findings() == []
        person.tap("e").until(state="review")
        assert person.page.locator("#episodes").is_visible()
        served.session.wishes.express("make")
        person.until(tree="ready")
        assert person.page.locator("#episodes").is_hidden()  # folded
        person.until(state="watching", step=2)
        assert findings() == []
        person.until(seen="over 1")
        seen = ["#title", "#text", "#buttons .first"]  # the picture may have been scrolled away
        assert person.page.evaluate(OUT_OF_SIGHT, ["#picture", *seen]) == []
        assert findings() == []
        served.session.wishes.express("practise")
        person.page.locator("#ways-section").wait_for(timeout=PATIENCE)
        assert findings() == []
        person.tap("Escape").until(state="review")
        again = replace(maker.programme, refit=lambda: maker.programme.policy)
        served.session.driving.offer(replace(again, scenes=()))
        person.page.get_by_role("button", name="Correct it").click()
        person.until(state="driving", step=1)
        held = [] if screen == "desk" else ["#pads button"]
        assert person.page.evaluate(OUT_OF_SIGHT, ["#picture", "#title", *held]) == []
        assert findings() == []
        person.tap("Escape").until(state="review")
        person.rest().tap("Escape").until(state="finished")
        assert findings() == []


def hurts_of(*kinds, episode=0):
    """Return hurts of these kinds in the first episode, which has at least five steps."""
    strip = StripView(
        number=0,
        runs=((1, 2), (2, 3)),
        keys=(("right", 2, 5),),
        marks=((2, 4),),
        words="Episode 0, 5 steps. Marked: steps 3 to 4.",
    )
    segment = Segment(episode=episode, start=2, stop=4, seconds=None, action=2, becomes=0)
    return tuple(
        HurtView(
            what=what,
            title=f"{what.capitalize()} 2 steps of 1 episode",
            why="They teach right where place <= 3.",
            reached="With them 100 of 200 (43 to 57 %), without 180 of 200 (85 to 94 %).",
            segments=(segment,),
            strips=(strip,),
        )
        for what in kinds
    )


@pytest.mark.parametrize(
    ("screen", "scheme"), [("desk", "light"), ("phone", "dark"), ("phone on its side", "light")]
)
def test_seconds_that_hurt_are_found_cut_and_taken_back(
    chromium, tmp_path, axe, screen, scheme
) -> None:
    """By keyboard alone; each state is without findings and has nothing cut off."""
    maker = ScriptedMaker()
    maker.hurts = hurts_of("flip", "cut", "show again")
    with serving(tmp_path, fps=20.0, maker=maker) as served:
        person = person_at(chromium, served, screen, color_scheme=scheme)
        page = person.page
        page.evaluate(axe)
        wide = "() => document.documentElement.scrollWidth - document.documentElement.clientWidth"
        focused = "() => document.activeElement.id"

        def press(name, nth=0):
            page.get_by_role("button", name=name, exact=True).nth(nth).press("Enter")

        person.down("ArrowRight").tap("Enter").until(state="review").up("ArrowRight").rest()
        shown = served.session.episodes[0]
        assert set(shown.actions) == {2}  # held before the first step, however slow the machine is
        served.session.wishes.express("make")
        person.until(tree="ready")
        press("Which seconds hurt?")
        page.locator("#hurts-section article").nth(2).wait_for(timeout=PATIENCE)
        assert page.evaluate(focused) == "hurts-title"
        assert (
            page.get_by_role("img", name="Episode 0, 5 steps. Marked: steps 3 to 4.").count() == 3
        )
        assert page.get_by_role("button", name="Which seconds hurt?").count() == 0
        assert page.evaluate(FINDINGS) == []
        assert page.evaluate(wide) == 0
        press("Flip")
        page.get_by_role("button", name="Take it back").wait_for(timeout=PATIENCE)
        assert served.session.episodes[0].taught[2:4].tolist() == [0, 0]
        assert page.evaluate(focused) == "verdict-title"
        assert page.get_by_role("button", name="Make it again").count() == 0
        assert page.evaluate(FINDINGS) == []
        press("Take it back")
        page.get_by_text("Settled.").wait_for(timeout=PATIENCE)
        assert page.evaluate(focused) == "verdict-title"
        assert (served.session.episodes[0].taught == shown.actions).all()
        press("Which seconds hurt?")
        page.locator("#hurts-section article").nth(2).wait_for(timeout=PATIENCE)
        press("Do all of these")
        page.get_by_role("button", name="Keep what is left").wait_for(timeout=PATIENCE)
        press("Keep what is left")
        page.get_by_text("Settled.").wait_for(timeout=PATIENCE)
        press("Which seconds hurt?")
        page.locator("#hurts-section article").nth(2).wait_for(timeout=PATIENCE)
        press("Show this again", 2)
        person.until(state="countdown", step=2)
        assert maker.calls == ["make", "look", "make_without", "undo", "look", "make_without",
                               "accept", "look"]  # fmt: skip
        assert person.messages == []


# Whether the focus stays when other things change, and where it is when its part is rebuilt.
@contextmanager
def seeing_what_hurts(chromium, tmp_path, **of):
    """Let a person at a desk, who has shown an episode, see two changes that are proposed."""
    maker = ScriptedMaker()
    maker.hurts = hurts_of("flip", "cut", **of)
    with serving(tmp_path, fps=20.0, maker=maker) as served:
        person = with_an_episode(person_at(chromium, served, "desk"))
        served.session.wishes.express("hurting")
        person.page.locator("#hurts-section article").nth(1).wait_for(timeout=PATIENCE)
        yield person


MANY_VIEWS = """() => {
  const before = document.activeElement, known = view;
  for (let step = 0; step < 50; step += 1) {
    view = { ...view, step, tree: { ...view.tree, note: String(step) } };
    show();
  }
  const stays = document.activeElement === before;
  view = { ...known, state: "opening" };
  show();
  view = known;
  show();
  return [stays, document.activeElement.textContent];
}"""


def test_views_that_come_between_focus_and_press_take_no_button_away(chromium, tmp_path) -> None:
    with seeing_what_hurts(chromium, tmp_path) as person:
        page = person.page
        page.locator("#episodes-count").press("Enter")  # unfolds the list
        for name in ("Flip", "Do all of these", "Let it practise", "Discard"):
            page.get_by_role("button", name=name).last.focus()
            assert page.evaluate(MANY_VIEWS) == [True, name]


def test_steps_of_a_discarded_episode_offer_no_change(chromium, tmp_path) -> None:
    """Their buttons did nothing, and nothing said so."""
    with seeing_what_hurts(chromium, tmp_path) as person:
        page = person.page
        changes, said = page.locator("#hurts button"), page.get_by_text("You discarded an episode")
        assert changes.evaluate_all("all => all.some((one) => one.disabled)") is False
        page.locator("#episodes-count").press("Enter")  # unfolds the list
        page.get_by_role("button", name="Discard episode 0").press("Enter")
        page.locator("#episodes button:focus", has_text="Keep").wait_for(timeout=PATIENCE)
        said.nth(1).wait_for(timeout=PATIENCE)
        assert changes.evaluate_all("all => all.every((one) => one.disabled)") is True
        person.tap("Enter")
        said.nth(0).wait_for(state="detached", timeout=PATIENCE)
        assert changes.evaluate_all("all => all.some((one) => one.disabled)") is False


def test_steps_of_another_recorder_s_episode_offer_no_change(chromium, tmp_path) -> None:
    """Two recorders share a folder; each has its own episodes only."""
    with seeing_what_hurts(chromium, tmp_path, episode=7) as person:
        person.page.get_by_text("Another recorder has an episode of these").nth(1).wait_for()
        changes = person.page.locator("#hurts button")
        assert changes.evaluate_all("all => all.every((one) => one.disabled)") is True


def test_where_nothing_hurts_the_page_says_so(chromium, tmp_path) -> None:
    with serving(tmp_path, fps=20.0, maker=ScriptedMaker()) as served:
        person = person_at(chromium, served, "desk")
        person.tap("Enter").until(state="playing").down("ArrowRight").until(state="review")
        person.up("ArrowRight")
        served.session.wishes.express("hurting")
        person.page.get_by_text("none was shown to be better").wait_for(timeout=PATIENCE)


def test_axe_would_find_a_name_without_its_words(chromium, tmp_path, axe) -> None:
    """The check above must be able to fail."""
    with serving(tmp_path) as served:
        person = person_at(chromium, served, "desk")
        person.page.evaluate(axe)
        person.page.evaluate("""() => {
          document.querySelector("#buttons button").setAttribute("aria-label", "Begin to record");
        }""")
        assert "label-content-name-mismatch" in "".join(person.page.evaluate(FINDINGS))


class SlowMaker(ScriptedMaker):
    """Practises until the page is closed."""

    def practise(self, show, stop) -> None:
        self.calls.append("practise")
        for episode in range(200):
            said = f"The tree practises: {episode} of 200 episodes"
            show(TreeView(phase="practising", message=said, finished=episode, of=200))
        while not stop():
            time.sleep(0.01)


def with_an_episode(person) -> Person:
    person.tap("Enter").until(state="playing").down("ArrowRight").until(state="review")
    return person.up("ArrowRight").rest(0.8)


def test_whoever_finishes_during_practice_is_asked(chromium, tmp_path) -> None:
    """It was thrown away without a word."""
    with serving(tmp_path, maker=SlowMaker()) as served:
        person = with_an_episode(person_at(chromium, served, "desk"))
        served.session.wishes.express("practise")
        person.until(tree="practising").tap("Escape")
        title = person.page.locator("#title", has_text="Finish without your tree?")
        title.wait_for(timeout=PATIENCE)
        person.page.get_by_role("button", name="Wait for it").click()
        title.wait_for(state="detached", timeout=PATIENCE)
        assert person.data("state") == "review"
        person.tap("Escape")
        person.page.get_by_role("button", name="Finish without it").click()
        person.until(state="finished")
        assert person.page.locator("#title").inner_text() == "1 of 3 saved"
        assert person.page.locator("#verdict").inner_text() == "Given up before it was done"
        assert not person.page.locator("#work").is_visible()


def test_screen_readers_hear_the_beginning_and_the_end_of_practice(chromium, tmp_path) -> None:
    """Every episode of 200 was read out."""
    listen = """() => {
      window.heard = [];
      const hear = () => heard.push(document.getElementById("announce").textContent);
      new MutationObserver(hear).observe(document.getElementById("announce"), { childList: true });
    }"""
    with serving(tmp_path, maker=SlowMaker()) as served:
        person = with_an_episode(person_at(chromium, served, "desk"))
        live = "[role=status], [role=alert], [aria-live]"
        assert person.page.locator(live).count() == 2  # what is announced, and the banner
        person.page.evaluate(listen)
        served.session.wishes.express("practise")
        person.page.locator("#verdict", has_text="199 of 200").wait_for(timeout=PATIENCE)
        assert person.page.evaluate("() => heard") == ["Making your tree"]


def test_what_comes_after_the_last_wanted_episode_has_no_total(chromium, tmp_path) -> None:
    """It said "Episode 16 of 15"."""
    with serving(tmp_path) as served:
        person = person_at(chromium, served, "desk")
        for number in range(1, 4):
            person.tap("Enter").until(state="playing", step=1)
            assert person.page.locator("#title").inner_text() == f"Episode {number} of 3"
            person.down("ArrowRight").until(state="review").up("ArrowRight").rest(0.8)
        person.page.get_by_role("button", name="One more").click()
        person.until(state="playing")
        assert person.page.locator("#title").inner_text() == "Episode 4"


@pytest.mark.parametrize(("own", "large"), [(1800, False), (4000, True)])
def test_a_tree_is_seen_whole_or_a_button_shows_it_whole(chromium, tmp_path, own, large) -> None:
    """What did not fit was cut off at the right, and nothing said so."""
    maker = ScriptedMaker()
    drawing = maker.ready.svg.replace('width="80"', f'width="{own}"')
    maker.ready = replace(maker.ready, svg=drawing, rules="if a_long_name <= 1: go " * 9)
    cut = "() => ((d) => d.scrollWidth - d.clientWidth)(document.getElementById('drawing'))"
    with serving(tmp_path, maker=maker) as served:
        person = with_an_episode(person_at(chromium, served, "desk"))
        served.session.wishes.express("make")
        person.until(tree="ready")
        button = person.page.locator("#larger")
        button.wait_for(timeout=PATIENCE)
        assert (person.page.evaluate(cut) > 0) == large
        assert button.inner_text() == ("The whole tree" if large else "Larger")
        button.click()
        assert (person.page.evaluate(cut) > 0) != large
        assert person.page.locator("#rules").is_visible()  # what is small stands there in words


@pytest.mark.parametrize("screen", SCREENS)
def test_the_verdict_is_in_sight_when_it_is_given(chromium, tmp_path, screen) -> None:
    """It stood below the picture, off the screen."""
    maker = ScriptedMaker()
    maker.ready = replace(maker.ready, rules="if a_long_name <= 1: go " * 9)
    with serving(tmp_path, maker=maker) as served:
        person = with_an_episode(person_at(chromium, served, screen))
        served.session.wishes.express("make")
        person.until(tree="ready").rest(0.3)
        seen = ["#verdict", "#tree-buttons button"]
        assert person.page.evaluate(OUT_OF_SIGHT, seen) == []
        wide = "() => document.documentElement.scrollWidth - document.documentElement.clientWidth"
        person.page.evaluate("() => { document.getElementById('rules-details').open = true; }")
        assert person.page.evaluate(wide) == 0
        assert box(person, "#verdict-section")["y"] < box(person, "#tree-section")["y"]
