"""Somebody at the recorder's page, by script."""

from dataclasses import replace

import gymnasium
import numpy as np

import eutree
from eutree.errors import InvalidArgumentError
from eutree.interaction import run_episode
from eutree.interaction.guard import GuardedEnv
from eutree.recording.scenes import Programme, Scene
from eutree.recording.tree_making import TreeView, WayView
from eutree.trees import DecisionTree
from tests.recording.serving import ENOUGH

PATIENCE = ENOUGH * 1000.0


# The page keeps all that it has shown, so that nothing passes unseen while the test is not awake.
KEEP = """
window.past = [];
new MutationObserver(() => {
  const [body, pill, coming] = ["body", "#pill", "#coming"].map((s) => document.querySelector(s));
  if (!pill) return;
  const { frame, latency, ...shown } = body.dataset;
  shown.acting = pill.hidden ? "" : document.querySelector("#acting").textContent;
  shown.coming = pill.hidden || coming.hidden ? "" : coming.textContent;
  if (JSON.stringify(shown) !== JSON.stringify(past.at(-1))) past.push(shown);
}).observe(document, { subtree: true, childList: true, attributes: true, characterData: true });
"""


REACHED = """([wanted, step]) => {
  const fits = (shown) => Object.entries(wanted).every(([name, value]) => shown[name] === value);
  const place = past.findIndex((shown) => fits(shown) && (step === null || shown.step >= step));
  past.splice(0, place);  // the next wait begins here
  return place >= 0;
}"""


class Person:
    """Somebody at the page, who remembers every key they pressed."""

    def __init__(self, chromium, served, **options) -> None:
        self.context = chromium.new_context(viewport={"width": 1180, "height": 800}, **options)
        self.context.set_default_timeout(PATIENCE)
        self.context.add_init_script(KEEP)
        self.served = served
        self.keys: list[tuple[str, bool]] = []
        self.messages: list[str] = []
        self.requests: list[str] = []
        self.open()

    def open(self) -> "Person":
        self.page = self.context.new_page()
        self.page.on("console", lambda message: self.messages.append(message.text))
        self.page.on("pageerror", lambda error: self.messages.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("websocket", lambda opened: self.requests.append(opened.url))
        self.page.goto(self.served.server.url)
        return self

    def until(self, *, step: int | None = None, **shown) -> "Person":
        """Wait until the page shows all of this at once, or has since the last wait.

        Time goes on meanwhile: ``step`` stands for that step or a later one.
        """
        wanted = {name: str(value) for name, value in shown.items()}
        self.page.wait_for_function(REACHED, arg=[wanted, step], polling=20)
        return self

    def down(self, key="Space") -> "Person":
        self.page.keyboard.down(key)
        self.keys.append((key.lower().removeprefix("arrow"), True))
        return self

    def up(self, key="Space") -> "Person":
        self.page.keyboard.up(key)
        self.keys.append((key.lower().removeprefix("arrow"), False))
        return self

    def tap(self, key) -> "Person":
        return self.down(key).up(key)

    def rest(self, seconds=0.9) -> "Person":
        self.page.wait_for_timeout(seconds * 1000.0)
        return self

    def look_on(self, screen) -> "Person":
        """Give the page another size, and wait until it is drawn."""
        (width, height), _ = SCREENS[screen]
        self.page.set_viewport_size({"width": width, "height": height})
        self.page.evaluate(DRAWN)
        return self

    def data(self, name) -> str:
        return self.page.locator("body").get_attribute(f"data-{name}")


DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
PHONE = {"has_touch": True, "is_mobile": True}
SCREENS = {
    "desk": ((1180, 800), {}),
    "phone": ((390, 844), PHONE),
    "phone on its side": ((844, 390), PHONE),
    "200 %": ((640, 430), {}),  # of 1280 x 860
}

# What is not wholly on the screen, or has something over it.
OUT_OF_SIGHT = """(selectors) => selectors.flatMap((s) => [...document.querySelectorAll(s)])
  .filter((e) => {
    const { left, top, right, bottom } = e.getBoundingClientRect();
    const inside = left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
    const seen = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
    return !(inside && right > left && bottom > top && (e === seen || e.contains(seen)));
  }).map((e) => e.id || e.textContent)"""


def person_at(chromium, served, screen, **options) -> Person:
    (width, height), own = SCREENS[screen]
    person = Person(chromium, served, **own, **options).until(state="opening")
    person.page.set_viewport_size({"width": width, "height": height})
    return person


FINDINGS = """async () => {
  const rules = { "label-content-name-mismatch": { enabled: true } };
  const found = await axe.run(document, { rules, resultTypes: ["violations"] });
  return found.violations.flatMap((v) => v.nodes.map((n) => `${v.id}: ${n.html}`));
}"""


def box(person, selector):
    """Return where an element is on the page."""
    return person.page.locator(selector).bounding_box()


def evasion():
    return gymnasium.make("eutree/Evasion2-v0", render_mode="rgb_array")


def goes_on_and_on(env, why="It never looks."):
    """Return a maker whose tree always goes: a failure is to be watched, then a success."""
    schema = GuardedEnv(env).schema
    tree = DecisionTree.single_leaf(schema.n_features).split(leaf=0, feature=0, threshold=3.0)
    policy = eutree.TreePolicy(tree=tree, actions=np.array([1, 1]), schema=schema)
    seeds = [seed for seed in range(40) if run_episode(GuardedEnv(env), policy, seed).is_success]
    fails = next(s for s in range(40) if s not in seeds)
    programme = Programme(policy, (Scene(fails, why), Scene(seeds[0])), "1 of 2 episodes failed")
    maker = ScriptedMaker(programme)
    maker.ready = replace(maker.ready, svg=eutree.export.to_svg(policy), rules=str(policy))
    return maker


DRAWING = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="80" height="20">'
    '<rect width="80" height="20"/></svg>'
)


class ScriptedMaker:
    """Says what a real one says, without learning anything."""

    def __init__(self, programme=None) -> None:
        self.calls = []
        self.programme = programme
        self.hurts = ()
        self.ready = TreeView(
            phase="ready",
            message="you 13 of 15; this tree 56 of 100",
            verdict="worse",
            may_gain=True,
            n_leaves=1,
            svg=DRAWING,
            rules="go",
            yours=13 / 15,
            commands=("eutree show demos-tree.json", "eutree evaluate demos-tree.json"),
        )

    def make(self, show, stop) -> None:
        self.calls.append("make")
        show(TreeView(phase="playing", message="The tree plays", finished=20, of=100))
        show(self.ready, self.programme)

    def missing(self):
        return Scene(4711, "Nothing was shown of the second line.")

    def choose(self, way, show) -> None:
        self.calls.append(f"choose {way}")
        show(replace(self.ready, message=f"kept {way}"))

    def look(self, show, stop) -> None:
        self.calls.append("look")
        show(replace(self.ready, phase="fitting", message="Looking", finished=20, of=100))
        show(replace(self.ready, hurts=self.hurts, was_searched=True, note="1 group of steps"))

    def make_without(self, show, stop) -> None:
        self.calls.append("make_without")
        show(replace(self.ready, message="this tree 96 of 100", asks=True))

    def settle(self, show, *, undo) -> None:
        self.calls.append("undo" if undo else "accept")
        show(replace(self.ready, note="Settled."))

    def practise(self, show, stop) -> None:
        self.calls.append("practise")
        curve = ((10, 0.5), (20, 0.9))
        show(replace(self.ready, phase="practising", curve=curve, of=100))
        if len(self.calls) > 2:
            raise InvalidArgumentError("the folder is gone")
        ways = (
            WayView(name="you", cells=("13 of 15", "35.6")),
            WayView(name="your tree", cells=("56 of 100", "33.0"), keep="Keep mine"),
            WayView(
                name="practised",
                cells=("96 of 100", "17.6"),
                keep="Keep the practised one",
                is_kept=True,
            ),
        )
        better = "you 13 of 15; this tree 96 of 100"
        show(
            replace(
                self.ready,
                message=better,
                verdict="better",
                may_gain=False,
                curve=curve,
                of=100,
                columns=("", "reaches", "steps"),
                ways=ways,
                changes=("4.0 % of your steps: more where x <= 5 m",),
            )
        )
