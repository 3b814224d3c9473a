"""The page of the zoo: every tree has its card, its picture, and the program that decides alike."""

import re
from pathlib import Path

import numpy as np
import pytest
from benchmarks.zoo import safest
from benchmarks.zoo_page import DOCS, PLAY, card_on, compiled, main, play_program

from eutree import zoo

CARDS = [pytest.param(one, id=one.name) for one in zoo.cards()]
PAGE = (DOCS / "zoo.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("card", CARDS)
def test_the_program_of_a_tree_decides_like_it_on_every_threshold(card: zoo.Card) -> None:
    policy = zoo.load(card.name)
    play = compiled(play_program(policy))
    tests = policy.tree.leaf == policy.tree.NO_LEAF
    cuts = policy.tree.threshold[tests]
    near = np.concatenate([cuts, np.nextafter(cuts, np.inf), np.nextafter(cuts, -np.inf)])
    values = np.array([*near, -np.inf, np.inf, np.nan])
    rows = np.random.default_rng(0).choice(values, size=(4000, policy.derivation.n_measured))
    expected = policy.actions[policy.tree.leaf_index(policy.derivation.of_episode(rows))]
    assert [play(row) for row in rows.tolist()] == expected.tolist()


@pytest.mark.parametrize("card", CARDS)
def test_the_card_on_the_page_is_that_of_the_tree(card: zoo.Card) -> None:
    found = re.search(rf"### {re.escape(card.name)}\n(.*?)(?=\n### |\Z)", PAGE, re.DOTALL)
    assert found is not None, "python -m benchmarks.zoo_page makes the page"
    low, high = card.interval
    program, stem = play_program(zoo.load(card.name)), Path(card.file).stem
    assert f"| leaves | {card.leaves} |" in found[1]
    assert f"{card.mean_return} [{low}, {high}]" in found[1]
    file = f"{PLAY}/{stem}.py"
    assert f"| `play(x)` | [{len(program.encode())} bytes]({file}) |" in found[1]
    assert (DOCS / file).read_text() == program
    assert card.extra in found[1]
    assert ("| proven (proof): " in found[1]) == (card.proven is not None)
    picture = DOCS / f"images/zoo-{stem}.gif"
    assert card.module or picture.name in found[1]  # those of the examples draw nothing
    assert card.module or picture.stat().st_size < 100_000


def test_the_page_has_no_card_of_a_tree_that_is_gone() -> None:
    assert re.findall(r"^### (.*)$", PAGE, re.MULTILINE) == [one.name for one in zoo.cards()]


def test_cards_of_other_tasks_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once a page of the tasks that were named alone took the place of the page."""
    monkeypatch.setattr("sys.argv", ["zoo_page", "--docs", str(tmp_path), "--tasks", "None-v0"])
    main()
    assert (tmp_path / "zoo.md").read_text(encoding="utf-8") == PAGE
    with pytest.raises(SystemExit, match="no card of Other-v0:4"):
        card_on(PAGE, "Other-v0:4")


def test_of_trees_that_earn_the_same_the_one_with_the_best_worst_episodes_is_chosen() -> None:
    """Once a tree that earned 1.9 more took the place of one whose worst episode was far better."""
    rng = np.random.default_rng(0)
    steady = rng.normal(100.0, 10.0, 1000)
    rash = steady + 0.5
    rash[::100] -= 40.0
    assert safest([steady, rash]) == safest([steady, steady - 50.0]) == 0
    assert safest([steady, rash + 20.0]) == 1  # which earns more, so that chance is no reason
