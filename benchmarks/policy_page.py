"""Time opening a large policy page beside a page of the same bytes in a plain ``<pre>``.

200 leaves, 50 episodes of 24 steps with pictures: 4 MB. Both open in the same headless browser,
by turns; what counts is the ratio, because the clock of a shared machine does not.

Run: python benchmarks/policy_page.py [--times 7]
"""

import argparse
import statistics
import tempfile
import time
from html import escape
from pathlib import Path
from typing import Any

from tests.export.policies import EVASION, policy_of, tree
from tests.report.browser import browser, open_page
from tests.report.watched import PIXEL, episodes

from eutree.report import policy_page


def pages(folder: Path) -> dict[str, Path]:
    """Write both pages."""
    policy = policy_of(tree(200, 3, seed=1), EVASION, statistics=True)
    watched = episodes(policy, count=50, steps=24, frame=PIXEL + bytes(2000))
    text = policy_page(policy, episodes=watched)
    plain = f"<!doctype html><title>plain</title><pre>{escape(text)}</pre>"
    files = {"policy page": folder / "policy.html", "plain text": folder / "plain.html"}
    for name, content in zip(files, (text, plain[: len(text)]), strict=True):
        files[name].write_text(content, encoding="utf-8")
    return files


def seconds(started: Any, path: Path, ready: str) -> float:
    """Return how long a page takes until ``ready`` is there."""
    begin = time.perf_counter()
    opened = open_page(started, path)
    opened.page.wait_for_selector(ready, timeout=60_000)
    duration = time.perf_counter() - begin
    opened.page.close()
    return duration


def main() -> None:
    """Print the median time of each page and the median of the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=7)
    times = parser.parse_args().times
    with tempfile.TemporaryDirectory() as folder, browser() as started:
        files = pages(Path(folder))
        ready = {"policy page": "body[data-ready]", "plain text": "pre"}
        rows = [
            {name: seconds(started, path, ready[name]) for name, path in files.items()}
            for _ in range(times)
        ]
    for name in files:
        median = statistics.median(row[name] for row in rows)
        print(f"{name}: {median:.2f} s")
    ratios = sorted(row["policy page"] / row["plain text"] for row in rows)
    print(f"ratio: {statistics.median(ratios):.2f} ({ratios[0]:.2f} to {ratios[-1]:.2f})")


if __name__ == "__main__":
    main()
