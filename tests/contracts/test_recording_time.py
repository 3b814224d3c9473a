"""How long recording takes is said once, and the same everywhere."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SENTENCE = re.compile(r"(?:[Ff]ifteen|15) (?:good )?(?:episodes|demonstrations)[^.;]*?minutes")


def test_every_page_says_the_same() -> None:
    said = {
        path.name: " ".join(match.split()).lower()
        for path in PAGES
        for match in SENTENCE.findall(path.read_text())
    }
    assert set(said) >= {"README.md", "recording.md", "tutorial.md", "for-teachers.md"}
    assert set(said.values()) == {"fifteen episodes take about seven minutes"}
