import subprocess
from pathlib import Path

import pytest

from eutree.policies import TreePolicy
from eutree.report import WatchedEpisode
from tests.export.policies import EVASION, policy_of, tree
from tests.export.tools import need
from tests.patience import ENOUGH
from tests.report.browser import missing
from tests.report.watched import episodes


@pytest.fixture(scope="session")
def axe() -> str:
    """Return axe-core from the cache, installed there once by npm; it is never vendored."""
    folder = Path.home() / ".cache" / "eutree-tests"
    script = folder / "node_modules" / "axe-core" / "axe.min.js"
    if not script.exists():
        folder.mkdir(parents=True, exist_ok=True)
        command = [need("npm"), "install", "--prefix", str(folder), "--no-audit", "axe-core@4"]
        try:
            subprocess.run(command, capture_output=True, check=True, timeout=ENOUGH)
        except (subprocess.SubprocessError, OSError) as error:
            missing(f"axe-core cannot be installed: {error}")
    return script.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def policy() -> TreePolicy:
    grown = tree(1, 3)
    cuts = [(0, 0, 18.0), (0, 0, 4.0), (2, 1, -8.5), (3, 1, 8.5), (4, 2, 0.0)]
    for leaf, feature, threshold in cuts:
        grown = grown.split(leaf, feature, threshold)
    return policy_of(grown, EVASION, seed=1, statistics=True)


@pytest.fixture(scope="module")
def watched(policy: TreePolicy) -> list[WatchedEpisode]:
    return episodes(policy)
