"""What a search found, as tables: settings by numbers, and which numbers exclude which."""

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

from eutree.experiments.drawing import blank, svg_and_png
from eutree.experiments.objective import NUMBERS, Number
from eutree.experiments.search import CHOICES, Scored, choices_of
from eutree.experiments.search_figure import draw
from eutree.files import write_bytes, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 6  # settings side by side
LEAST_TRIED = 3  # settings that must have told both numbers before they can exclude each other


def write_tables(folder: Path, scored: Sequence[Scored]) -> None:
    """Write ``search.csv``, a row each setting, ``search.md`` and ``search.svg``."""
    write_text(folder / "search.csv", to_csv(scored))
    write_text(folder / "search.md", to_markdown(scored))
    svg, png = svg_and_png("search", lambda: _figure(scored))
    write_bytes(folder / "search.svg", svg)
    write_bytes(folder / "search.png", png)


def _figure(scored: Sequence[Scored]) -> "Figure":
    figure = blank("", (9.0, 6.4))
    draw(figure.subplots(), scored)
    return figure


def to_csv(scored: Sequence[Scored]) -> str:
    """Return every setting with its choices, its distance and its numbers as CSV text."""
    head = ["setting", *CHOICES, "stage", "runs", "final", "mean_cost", "agreeing", "told"]
    lines = [",".join([*head, *(f'"{number.name}"' for number in NUMBERS)])]
    for index, one in enumerate(scored, start=1):
        choices = choices_of(one.setting)
        row = [index, *(choices.get(name, "") for name in CHOICES)]
        row += [one.stage, one.runs, one.final, f"{one.distance.mean:.4f}"]
        row += [one.distance.n_agreeing, len(one.distance.costs)]
        ours = one.distance.ours
        row += [f"{ours[n.name]:.4g}" if n.name in ours else "" for n in NUMBERS]
        lines.append(",".join(map(str, row)))
    return "\n".join(lines) + "\n"


def to_markdown(scored: Sequence[Scored]) -> str:
    """Return the nearest settings side by side, each number's settings, and the exclusions."""
    return "\n\n".join((_nearest(scored[:SHOWN]), _numbers(scored), _exclusions(scored))) + "\n"


def _nearest(scored: Sequence[Scored]) -> str:
    head = ["", "paper", *(str(i) for i in range(1, len(scored) + 1))]
    rows = []
    for name in CHOICES:
        values = [str(choices_of(one.setting).get(name, "")) for one in scored]
        if any(values):
            rows.append([f"`{name}`", "", *values])
    rows.append(["final policy", "", *(one.final for one in scored)])
    rows.append(["runs", "", *(str(one.runs) for one in scored)])
    agreeing = (f"{s.distance.n_agreeing} of {len(s.distance.costs)}" for s in scored)
    rows.append(["**numbers that agree**", "", *agreeing])
    for number in NUMBERS:
        values = [_value(one, number) for one in scored]
        if any(values):
            rows.append([number.name, number.paper, *values])
    return "## The nearest settings\n\nA number in bold agrees with the paper's.\n\n" + _table(
        head, rows
    )


def _numbers(scored: Sequence[Scored]) -> str:
    rows = []
    for number in NUMBERS:
        told = [one for one in scored if number.name in one.distance.ours]
        if not told:
            continue
        n_agreeing = sum(one.distance.costs[number.name] == 0.0 for one in told)
        # Of those that agree, the setting that agrees in most else.
        best = min(told, key=lambda one: (one.distance.costs[number.name], -_agreeing(one)))
        place = scored.index(best) + 1
        rows.append(
            [number.name, number.paper, _range(number), str(len(told)), str(n_agreeing),
             f"{best.distance.ours[number.name]:.3g} (setting {place})"]
        )  # fmt: skip
    head = ["number", "paper", "agrees if", "settings that tell", "that agree", "nearest"]
    return "## Each number\n\n" + _table(head, rows)


def _exclusions(scored: Sequence[Scored]) -> str:
    names = [number.name for number in NUMBERS]
    rows = []
    for first, second in combinations(names, 2):
        both = [one.distance.costs for one in scored
                if first in one.distance.costs and second in one.distance.costs]  # fmt: skip
        alone = [sum(costs[name] == 0.0 for costs in both) for name in (first, second)]
        together = sum(costs[first] == 0.0 == costs[second] for costs in both)
        if len(both) >= LEAST_TRIED and all(alone) and not together:
            rows.append([first, second, str(len(both)), str(alone[0]), str(alone[1])])
    head = ["number", "and", "settings that tell both", "first agrees", "second agrees"]
    text = "## Which numbers exclude which\n\n"
    if not rows:
        return text + "None: every two numbers that agree somewhere agree somewhere together."
    return text + "Each agrees under some setting, both under none.\n\n" + _table(head, rows)


def _agreeing(one: Scored) -> int:
    return one.distance.n_agreeing


def _value(one: Scored, number: Number) -> str:
    if number.name not in one.distance.ours:
        return ""
    text = f"{one.distance.ours[number.name]:.3g}"
    return f"**{text}**" if one.distance.costs[number.name] == 0.0 else text


def _range(number: Number) -> str:
    if number.low == -float("inf"):
        return f"<= {number.high:g}"
    if number.high == float("inf"):
        return f">= {number.low:g}"
    return f"{number.low:g} to {number.high:g}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])
