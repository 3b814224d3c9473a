"""What notebooks show: complete, escaped, self-contained, readable in a browser."""

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.report.notebook import html_of
from eutree.schema import Feature, Schema
from tests.export.policies import EVASION, NASTY, policy_of, tree
from tests.report.browser import open_page

CANVAS = """<!doctype html><meta charset="utf-8"><body style="background:#8884;margin:1rem">
<style>{}</style><p class="quiet">outside</p><svg><rect width="9" height="9"/></svg>{}"""


@pytest.fixture(scope="module")
def shown() -> dict[str, Any]:
    """Return one object of each kind."""
    env = gymnasium.make("eutree/Evasion2-v0")
    demos = eutree.record(env, eutree.experts.wait_at_crossing, episodes=5, seed=0)
    result = eutree.learn(
        env, demonstrations=demos, episodes=20, evaluate_every=10, evaluation_episodes=10
    )
    policy = policy_of(tree(9, 3, seed=2), EVASION, statistics=True)
    classifier = eutree.C45Classifier().fit(demos.observations, demos.actions)
    edited = eutree.inspection.edit(policy, actions={2: "go"}, lock=[1])
    return {
        "policy": policy,
        "demonstrations": demos,
        "evaluation": eutree.evaluate(result.policy, env, episodes=20),
        "result": result,
        "classifier": classifier,
        "edited": edited,
        "diff": eutree.diff(policy, edited.policy),
        "verification": eutree.verify(policy, "never go when position > 3"),
        "explanation": eutree.why(policy, [1.0, 2.0, 3.0]),
    }


def words(html: str) -> str:
    without_style = re.sub(r"<style>.*?</style>", "", html, flags=re.DOTALL)
    return re.sub(r"<[^>]+>", " ", without_style)


def test_the_facts_are_there(shown: dict[str, Any]) -> None:
    assert "9 leaves" in words(shown["policy"]._repr_html_())
    assert shown["policy"]._repr_html_().count('class="eutree-leaf"') == 9
    demonstrations = words(shown["demonstrations"]._repr_html_())
    assert "5 kept of 5" in demonstrations
    assert f"{shown['demonstrations'].n_transitions:,}" in demonstrations
    evaluation = words(shown["evaluation"]._repr_html_())
    assert f"{shown['evaluation'].success_rate:.1%}" in evaluation
    result = shown["result"]._repr_html_()
    assert f"20 episodes, {shown['result'].steps:,} steps" in words(result)
    assert result.count('class="chart"') == 3 + 2  # the curves; the front, twice
    assert "locked leaves: " in words(shown["edited"]._repr_html_())
    assert str(shown["verification"]) in words(shown["verification"]._repr_html_()).replace(
        "&gt;", ">"
    )


def test_scikit_learns_own_diagram_stays(shown: dict[str, Any]) -> None:
    classifier = shown["classifier"]
    for html in (classifier._repr_html_(), classifier._repr_mimebundle_()["text/html"]):
        assert "sk-top-container" in html
        assert "<pre>x" in html
        assert "&lt;=" in html
    unfitted = eutree.C45Classifier()._repr_html_()
    assert "sk-top-container" in unfitted
    assert "eutree-shown" not in unfitted


class Tags(HTMLParser):
    """Collects what could act: elements, attributes."""

    def __init__(self) -> None:
        super().__init__()
        self.found: set[str] = set()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.found |= {tag, *(f"{tag} {name}" for name, _ in attributes)}


@pytest.mark.promise(25)
def test_any_names_are_harmless_and_nothing_comes_from_outside() -> None:
    names = [*NASTY, "</style><script>alert(1)</script>", '"><img src=x onerror=alert(1)>']
    schema = Schema(tuple(Feature(name, name) for name in names), tuple(names))
    rows = np.random.default_rng(0).normal(size=(4, len(names)))
    episode = eutree.Episode(rows, np.arange(3), np.zeros(3), False, True, 0, names[-1])
    demonstrations = eutree.Demonstrations((episode,), schema, expert=names[-1])
    evaluation = eutree.Evaluation(np.zeros(2), np.ones(2), np.array([names[-1], names[-2]]))
    policy = policy_of(tree(40, len(names), seed=3), schema)
    other = eutree.inspection.edit(policy, actions={0: names[1]}).policy
    for each in (policy, demonstrations, evaluation, eutree.diff(policy, other)):
        tags = Tags()
        tags.feed(html_of(each))
        assert not {"script", "img", "link", "iframe", "object"} & tags.found
        assert not [
            name for name in tags.found if " on" in name or name.endswith((" src", " href"))
        ]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_browser_shows_them_and_the_rest_of_the_page_stays(
    chromium: Any, tmp_path: Path, shown: dict[str, Any], scheme: str
) -> None:
    path = tmp_path / "notebook.html"
    before = open_outside(chromium, path, "", scheme)
    after = open_outside(chromium, path, "".join(o._repr_html_() for o in shown.values()), scheme)
    assert after == before


def open_outside(chromium: Any, path: Path, pieces: str, scheme: str) -> list[str]:
    """Open a page with pieces; return how what is outside of them looks."""
    path.write_text(CANVAS.format("", pieces), encoding="utf-8")
    opened = open_page(chromium, path, scheme=scheme, width=900)
    looks = opened.page.evaluate(
        """["p.quiet", "body > svg rect"].map((name) => {
            const style = getComputedStyle(document.querySelector(name));
            return [style.color, style.fill, style.stroke, style.font].join();
        })"""
    )
    if pieces:
        contrast = opened.page.evaluate(
            """[...document.querySelectorAll(".eutree-shown")].map((piece) => {
                const style = getComputedStyle(piece);
                return style.color !== style.backgroundColor
                    && style.backgroundColor !== "rgba(0, 0, 0, 0)";
            })"""
        )
        assert contrast == [True] * len(contrast)
        assert len(contrast) == 9
        opened.page.screenshot(path=str(path.with_suffix(".png")), full_page=True)
    opened.assert_quiet()
    opened.page.close()
    return looks
