"""The page of opponent speeds says of each speed what its runs say, and no more."""

import importlib.util
from pathlib import Path

from eutree_lab.paper.claims import FAILS, HOLDS, OPEN
from eutree_lab.paper.experiment import FULL
from eutree_lab.paper.runs import Performance, RunRecord

SCRIPT = Path(__file__).parents[3] / "docs" / "pictures" / "make_speeds.py"

spec = importlib.util.spec_from_file_location("make_speeds", SCRIPT)
assert spec is not None
assert spec.loader is not None
make_speeds = importlib.util.module_from_spec(spec)
spec.loader.exec_module(make_speeds)


def runs(speed, returns):
    return [
        RunRecord(
            spec=FULL.spec("eutree/Evasion2-v0", "eu-tree", "default", run, speed),
            expert=None,
            curve=[],
            final=Performance(1.0, value, 9),
            compressed=None,
            agreement=None,
        )
        for run, value in enumerate(returns)
    ]


def test_the_share_of_the_grid_is_judged_at_each_speed():
    row = {"success": "0.98", "standard_error": "0.7", "episodes": "1000", "transitions": "1000000"}
    grid = {speed: row | {"return": "90.0"} for speed in (2.2, 3.2, 4.2)}
    speeds = {2.2: runs(2.2, [91, 92, 93]), 3.2: runs(3.2, [84, 86, 90]), 4.2: runs(4.2, [70] * 3)}
    page = make_speeds.beside_the_grid(speeds, grid)
    verdicts = [line.split("**")[1] for line in page.splitlines() if line.endswith("** |")]
    assert verdicts == [HOLDS, OPEN, FAILS]
    assert "At 1 of 3 speeds" in page
    assert "smallest ratio is 0.778, at 4.2 m/s; at 2 of" in page
