"""Objects as pieces of HTML for notebooks: escaped, self-contained, without a script.

A piece has its own background and its own style, valid for nothing outside of it, so that it can
be read in notebooks of any theme.
"""

from collections import Counter
from collections.abc import Mapping
from functools import singledispatch
from html import escape
from typing import Any

from eutree.data import Demonstrations
from eutree.display import counted
from eutree.evaluation import Evaluation
from eutree.export import to_svg
from eutree.export.svg import STYLE
from eutree.inspection import Edited
from eutree.policies import TreePolicy
from eutree.report.chart import curve_figures, curves, front_charts, front_in_words
from eutree.report.html import asset, scrolling
from eutree.training import LearningResult

_SCOPE = ".eutree-shown"


@singledispatch
def html_of(shown: Any) -> str:
    """Return a piece of HTML; by default the object's words."""
    return _piece(type(shown).__name__, f"<pre>{escape(str(shown))}</pre>")


@html_of.register
def _(policy: TreePolicy) -> str:
    size = f"{counted(policy.n_leaves, 'leaf')}, at most {policy.tree.depth} tests"
    facts = {
        "environment": str(policy.environment or "unknown"),
        "size": size + (f", {counted(len(policy.locked), 'leaf')} locked" if policy.locked else ""),
        "actions": ", ".join(policy.schema.actions),
        "features": _features(policy),
    }
    return _piece("Tree policy", _facts(facts), _drawn(policy))


@html_of.register
def _(demonstrations: Demonstrations) -> str:
    schema, kept = demonstrations.schema, demonstrations.kept
    outcomes = [episode.is_success for episode in kept if episode.is_success is not None]
    taken = Counter(demonstrations.actions.tolist())
    actions = (f"{name} {taken[number]:,}" for number, name in enumerate(schema.actions))
    facts = {
        "environment": str(demonstrations.environment or "unknown"),
        "expert": demonstrations.expert,
        "episodes": f"{len(kept)} kept of {len(demonstrations.episodes)}",
        "successes": f"{sum(outcomes)} of {len(outcomes)}" if outcomes else "",
        "mean return": f"{sum(e.undiscounted_return for e in kept) / len(kept):.4g}"
        if kept and all(episode.has_rewards for episode in kept)
        else "",
        "transitions": f"{demonstrations.n_transitions:,}",
        "actions": ", ".join(actions),
        "features": _features(demonstrations),
    }
    return _piece("Demonstrations", _facts(facts))


@html_of.register
def _(evaluation: Evaluation) -> str:
    interval = ""
    if evaluation.episodes > 1:
        interval = ", 95 % interval {:.4g} to {:.4g}".format(*evaluation.return_interval)
    facts = {
        "episodes": f"{evaluation.episodes:,}",
        "success": "",
        "mean return": f"{evaluation.mean_return:.4g}{interval}",
        "worst": evaluation.extremes,
        "warning": evaluation.warning,
        "mean length": f"{evaluation.mean_length:.4g} steps",
        "endings": ", ".join(f"{e} {n:,}" for e, n in Counter(evaluation.endings.tolist()).items()),
        "leaves": "" if evaluation.n_leaves is None else str(evaluation.n_leaves),
    }
    if evaluation.success_rate is not None and evaluation.success_interval is not None:
        least, most = evaluation.success_interval
        facts["success"] = f"{evaluation.success_rate:.1%}, 95 % interval {least:.1%} to {most:.1%}"
    return _piece("Evaluation", _facts(facts))


@html_of.register
def _(result: LearningResult) -> str:
    facts = {
        "method": result.method.name,
        "start": result.start,
        "experience": f"{result.episodes:,} episodes, {result.steps:,} steps",
        "last evaluation": result.curve[-1].describe() if result.curve else "",
        "handed over": "" if result.against_start is None else result.against_start.verdict(),
        "smaller trees": front_in_words(result.front),
    }
    learned = curves({result.method.name: result.curve}) if result.curve else {}
    drawn = [*curve_figures(learned), *front_charts(result.front)]
    charts = f'<div class="charts">{"".join(drawn)}</div>' if drawn else ""
    return _piece("Learning result", _facts(facts), charts, _drawn(result.policy))


@html_of.register
def _(edited: Edited) -> str:
    items = [*edited.changes, *(f"Warning: {warning}" for warning in edited.warnings)]
    changes = "".join(f"<li>{escape(item)}</li>" for item in items)
    return _piece("Edited policy", f"<ul>{changes}</ul>", _drawn(edited.policy))


def framed(drawing: str) -> str:
    """Return a drawing in a frame that scrolls, with the style of a piece."""
    return f'<style>{_style()}</style><div class="eutree-shown">{scrolling("Tree", drawing)}</div>'


def _features(shown: TreePolicy | Demonstrations) -> str:
    return ", ".join(f"{f.name} [{f.unit}]" if f.unit else f.name for f in shown.schema.features)


def _drawn(policy: TreePolicy) -> str:
    return scrolling("Tree", to_svg(policy, standalone=False))


def _facts(facts: Mapping[str, str]) -> str:
    """Return a table of the known facts; empty ones are left out."""
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(words)}</td></tr>'
        for name, words in facts.items()
        if words
    )
    return f"<table>{rows}</table>"


def _piece(title: str, *parts: str) -> str:
    body = "".join(parts)
    return (
        f'<style>{_style()}</style><div class="eutree-shown">'
        f"<p><strong>{escape(title)}</strong></p>{body}</div>"
    )


def _style() -> str:
    """Return the style of a piece: all of it below the piece's own class."""
    colours = asset("colours.css").replace(":root", _SCOPE)
    return f"{colours}{_SCOPE} {{\n{asset('notebook.css')}{asset('chart.css')}}}\n{STYLE}"
