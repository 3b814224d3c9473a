"""A person's way through the real page, by a player who sees only what is drawn, 200 ms late."""

import re

import pytest
from benchmarks.ten_minutes import PixelPlayer, recording

from eutree.data import Demonstrations
from eutree.policies import TreePolicy
from tests.patience import ENOUGH


@pytest.mark.slow
def test_from_the_picture_to_a_tree(tmp_path, chromium) -> None:
    with recording(tmp_path, "--episodes", "4", "--fps", "2") as started:
        process, url = started
        page = chromium.new_page(viewport={"width": 1180, "height": 810})
        page.goto(url)
        page.locator("body[data-state=opening][data-frame]").wait_for(timeout=ENOUGH * 1000.0)
        player = PixelPlayer(page)
        endings = [player.play() for _ in range(4)]
        assert len(player.lines) == 2
        verdict = player.make_tree()
        player.leave()
        assert process.wait(ENOUGH) == 0
    demos = Demonstrations.load(tmp_path / "my-demos")
    wins = sum(bool(episode.is_success) for episode in demos)
    assert endings.count("Goal reached") == wins
    assert wins >= 2  # it plays at twice the speed, on a machine that may be busy
    for episode in demos:  # it reacted to what it saw, and held Space to go
        assert {0, 1} >= set(episode.actions.tolist())
        assert episode.extras["edges"]
    said = re.match(r"you (\d) of 4 \(.*%\); this tree (\d+) of 200 \(", verdict)
    assert said is not None
    assert int(said[1]) == wins
    tree = TreePolicy.load(tmp_path / "my-demos-tree.json")
    assert tree.environment.id == "eutree/Evasion2-v0"
