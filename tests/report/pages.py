"""Pages, and what is read of them."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

from eutree.report import (
    CHANGES_ID,
    Headline,
    RunReport,
    Table,
    WatchedTree,
)
from eutree.report.html import LeafChange, Pointer
from tests.export.policies import EVASION, policy_of, tree
from tests.report.watched import episodes

CURVE = [(0.0, 0.5, 0.4, 0.6), (20.0, 0.8, 0.7, 0.9), (40.0, 0.9, 0.85, 0.95)]


def report(name: str = "EU-Tree") -> RunReport:
    policy = policy_of(tree(9, 3), EVASION)
    return RunReport(
        title=f"{name}, a run",
        curves={"success rate": {name: CURVE, "C. U-Tree": CURVE[:2]}, name: {name: CURVE}},
        verdict=[name, Pointer(name, CHANGES_ID), "."],
        stages=[Headline(name, "99 %", name, name)],
        watched=WatchedTree(
            policy,
            [replace(watched, by=name) for watched in episodes(policy, count=2)],
            {3: LeafChange(0, 1.0), 4: LeafChange(1, 0.25)},
            caption=name,
        ),
        changes=[(name, 0.25), ("small", 0.01)],
        tables={
            name: Table(("learner", name), [(name, "99 %"), ("C. U-Tree", name)], f"of {name}", 1)
        },
        texts={name: name},
        trees={name: policy_of(tree(9, 3), EVASION, statistics=True)},
        files=[(name, name), ("the policy", "a folder/policy.json")],
        notes=[name],
    )


class Outline(HTMLParser):
    """Collects the tags, the attributes and the text of a page."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data: str) -> None:
        self.text += data


def page_data(content: str) -> dict:
    match = re.search(r'<script type="application/json" id="data">(.*?)</script>', content)
    assert match
    return json.loads(match[1])
