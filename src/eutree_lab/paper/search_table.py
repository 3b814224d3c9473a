"""What a search found, as tables: settings by numbers, and which numbers exclude which."""

from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from eutree.files import write_bytes, write_text
from eutree_lab.paper.claims import SMOKE_RUN
from eutree_lab.paper.drawing import blank, svg_and_png
from eutree_lab.paper.finals import FINAL
from eutree_lab.paper.objective import NUMBERS, Number
from eutree_lab.paper.search import Scored
from eutree_lab.paper.search_figure import draw
from eutree_lab.paper.search_space import CHOICES, STEPS, choices_of
from eutree_lab.paper.settings import Setting

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 6  # settings side by side
LISTED = 8  # settings that are named beside a number
WELL_TRIED = 20  # settings that make it unlikely that another one shows both
LEAST_TRIED = 3  # settings that must have told both numbers before they can exclude each other


def write_tables(folder: Path, scored: Sequence[Scored], *, smoke: bool = False) -> None:
    """Write ``search.csv``, a row each setting, ``search.md`` and ``search.svg``.

    Args:
        folder: Where.
        scored: The settings.
        smoke: Whether the page is to say that they are of a smoke run.
    """
    write_text(folder / "search.csv", to_csv(scored))
    said = f"**{SMOKE_RUN}**\n\n" if smoke else ""
    write_text(folder / "search.md", said + to_markdown(scored))
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
        stage = f'"{one.stage}"' if "," in one.stage else one.stage
        row += [stage, one.runs, one.final, f"{one.distance.mean:.4f}"]
        row += [one.distance.n_agreeing, len(one.distance.costs)]
        ours = one.distance.ours
        row += [f"{ours[n.name]:.4g}" if n.name in ours else "" for n in NUMBERS]
        lines.append(",".join(map(str, row)))
    return "\n".join(lines) + "\n"


def to_markdown(scored: Sequence[Scored]) -> str:
    """Return the nearest settings side by side, each number's settings, and the exclusions."""
    sections = (
        _nearest(scored[:SHOWN]),
        _numbers(scored),
        _exclusions(scored),
        _together(scored),
        _steps(scored),
        _departures(scored),
        _lengths(scored),
    )
    return "\n\n".join(sections) + "\n"


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
             f"{best.distance.ours[number.name]:.3g} (setting {place})",
             _places(scored, number) if n_agreeing else "none"]
        )  # fmt: skip
    head = ["number", "paper", "agrees if", "settings that tell", "that agree", "nearest",
            "settings under which it agrees"]  # fmt: skip
    return "## Each number\n\n" + _table(head, rows)


def _places(scored: Sequence[Scored], number: Number) -> str:
    """Return which settings agree in a number: those that learned, else those that did not."""
    agree = [
        (place, one)
        for place, one in enumerate(scored, start=1)
        if one.distance.costs.get(number.name) == 0.0
    ]
    learned = [place for place, one in agree if one.setting.reading is not None]
    places = learned or [place for place, _ in agree]
    text = ", ".join(map(str, places[:LISTED]))
    rest = len(agree) - min(len(places), LISTED)
    return f"{text} and {rest} more" if rest else text


def _exclusions(scored: Sequence[Scored]) -> str:
    found = exclusions(scored)
    rows = [[*pair, *map(str, counts)] for pair, counts in found.items()]
    head = ["number", "and", "settings that tell both", "first agrees", "second agrees"]
    text = "## Which numbers exclude which\n\n"
    if not rows:
        return text + "None: every two numbers that agree somewhere agree somewhere together."
    return text + "Each agrees under some setting, both under none.\n\n" + _table(head, rows)


def exclusions(
    scored: Sequence[Scored], least: int = LEAST_TRIED
) -> dict[tuple[str, str], tuple[int, int, int]]:
    """Return the pairs of numbers that agree under some setting each, and under none together.

    With each pair: how many settings tell both, how many agree in the first, and in the second.
    Pairs that fewer than ``least`` settings tell are left out.
    """
    found = {}
    for first, second in combinations([number.name for number in NUMBERS], 2):
        both = [one.distance.costs for one in scored
                if first in one.distance.costs and second in one.distance.costs]  # fmt: skip
        alone = [sum(costs[name] == 0.0 for costs in both) for name in (first, second)]
        together = sum(costs[first] == 0.0 == costs[second] for costs in both)
        if len(both) >= least and all(alone) and not together:
            found[first, second] = (len(both), alone[0], alone[1])
    return found


def most_together(scored: Sequence[Scored], least: int = LEAST_TRIED) -> frozenset[str]:
    """Return a largest set of numbers, each of which agrees somewhere and no two exclude another.

    No setting agrees in more numbers than it has, if what two numbers do together under the
    settings tried is all that they can do.
    """
    apart: dict[str, set[str]] = {number.name: set() for number in NUMBERS}
    for first, second in exclusions(scored, least):
        apart[first].add(second)
        apart[second].add(first)
    agree = [name for name in apart if any(one.distance.costs.get(name) == 0.0 for one in scored)]
    free = frozenset(name for name in agree if not apart[name])
    contested = [name for name in agree if apart[name]]
    return free | _largest(contested, apart)


def _largest(names: Sequence[str], apart: Mapping[str, set[str]]) -> frozenset[str]:
    """Return a largest subset of names of which no two are apart."""
    if not names:
        return frozenset()
    # Whoever has the most against it is in or out; without it fewer are left to argue.
    first = max(names, key=lambda name: len(apart[name].intersection(names)))
    rest = [name for name in names if name != first]
    if not apart[first].intersection(rest):
        return frozenset(names)
    without = _largest(rest, apart)
    within = _largest([name for name in rest if name not in apart[first]], apart) | {first}
    return max(within, without, key=len)


def _together(scored: Sequence[Scored]) -> str:
    """Return how many numbers could agree at once, by pairs, and how many did."""
    most = most_together(scored)
    sure = most_together(scored, WELL_TRIED)
    best = max(scored, key=_agreeing)
    left_out = [number.name for number in NUMBERS if number.name not in most]
    return (
        "## How many can agree at once\n\n"
        f"No two of these {len(most)} of {len(NUMBERS)} numbers exclude each other under the "
        "settings that tell both; any larger set has two that do, or one that agrees nowhere. "
        f"Left out: {'; '.join(left_out) or 'none'}. The most in which one setting agrees is "
        f"{_agreeing(best)} of {len(best.distance.costs)} (setting {scored.index(best) + 1}). "
        "Three claims are not numbers of the search: that compression loses no performance, "
        "never enlarges a tree and keeps the mapping, which are so at every setting. So the "
        f"settings tried leave room for at most {len(most) + 3} of {len(NUMBERS) + 3} claims; "
        f"for {len(sure) + 3} if only pairs count that {WELL_TRIED} settings or more tell."
    )


def _steps(scored: Sequence[Scored]) -> str:
    """Return what each change did on the way from the first domain and reading to those found."""
    by_setting = {one.setting: one for one in scored if one.stage != "expert"}
    steps = [setting for setting in STEPS if setting in by_setting]
    text = "## From the first domain and reading, one change at a time\n\n"
    if STEPS[0] not in steps:
        return text + "It was not run."
    names = ["the first domain and reading, the last policy is final"]
    found = [by_setting[STEPS[0]].under["last"]]
    names.append(f"the policy at {FINAL} is final")
    found.append(by_setting[STEPS[0]].under[FINAL])
    for before, after in pairwise(steps):
        names.append(_change(before, after, every=True))
        found.append(by_setting[after].under[FINAL])
    told = frozenset.intersection(*(frozenset(d.costs) for d in found))
    agree = [{name for name in told if d.costs[name] == 0.0} for d in found]
    rows = [[names[0], f"{len(agree[0])} of {len(told)}", "", ""]]
    for name, (old, new) in zip(names[1:], pairwise(agree), strict=True):
        moved = [[n.name for n in NUMBERS if n.name in some] for some in (new - old, old - new)]
        cells = ("; ".join(some) or "none" for some in moved)
        rows.append([name, f"{len(new)} of {len(told)}", *cells])
    return (
        f"{text}Each row has the changes of those above it. The numbers are those of 2-Evasion "
        "that every row tells.\n\n" + _table(["changed", "agree", "agrees now", "no longer"], rows)
    )


def _departures(scored: Sequence[Scored]) -> str:
    """Return what one more change does to the nearest setting, number by number told of both."""
    bases = {one.setting: one for one in scored}
    rows = []
    for one in scored:
        base = bases.get(one.changed_from) if one.changed_from is not None else None
        if base is None:
            continue
        told = one.distance.costs.keys() & base.distance.costs.keys()
        here, there = (
            {name for name in told if which.distance.costs[name] == 0.0} for which in (one, base)
        )
        names = [
            [n.name for n in NUMBERS if n.name in some] for some in (here - there, there - here)
        ]
        rows.append(
            [_change(base.setting, one.setting), str(scored.index(one) + 1),
             f"{len(here)} of {len(told)}", str(len(there)),
             *("; ".join(some) or "none" for some in names)]
        )  # fmt: skip
    text = "## One more change\n\n"
    if not rows:
        return text + "None was tried."
    base_place = next(scored.index(bases[s.changed_from]) + 1 for s in scored if s.changed_from)
    head = ["changed", "setting", "agree", "before", "agrees now", "no longer"]
    return (
        f"{text}Setting {base_place} with one choice changed, in 2-Evasion. A change of one or two "
        "numbers is within what another seed does.\n\n" + _table(head, rows)
    )


def _change(before: Setting, after: Setting, *, every: bool = False) -> str:
    """Return which choice differs; those that only come with another only if ``every`` is set."""
    if after.demonstrator.folder:
        return f"demonstrations of the person in `{after.demonstrator.folder}`"
    old, new = choices_of(before), choices_of(after)
    changed = [
        f"`{name}` {new[name]} in place of {old[name]}"
        for name in CHOICES
        if (every or name not in ("wait_distance", "margin")) and old.get(name) != new.get(name)
    ]
    return ", ".join(changed)


def _lengths(scored: Sequence[Scored]) -> str:
    """Return how many numbers agree if runs are shorter."""
    learned = [one for one in scored if one.shorter][:SHOWN]
    text = "## How long a run is\n\n"
    if not learned:
        return text + "None has learned."
    lengths = list(learned[0].shorter)
    head = ["setting", *(f"{length} episodes" for length in lengths), "the whole run"]
    rows = [
        [str(scored.index(one) + 1),
         *(f"{d.n_agreeing} of {len(d.costs)}" for d in one.shorter.values()),
         f"{one.distance.n_agreeing} of {len(one.distance.costs)}"]
        for one in learned
    ]  # fmt: skip
    return (
        f"{text}Numbers that agree when the same runs are taken to have ended earlier. The size of "
        "compressed trees is told of whole runs only.\n\n" + _table(head, rows)
    )


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
