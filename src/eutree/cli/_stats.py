"""What ``eutree demos stats`` says: the figures of the summary as JSON, as text and as a page."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from eutree.cli._output import Output

if TYPE_CHECKING:
    from eutree.data import Demonstrations
    from eutree.evaluation.expert_curve import ExpertCurve
    from eutree.report import DemonstrationFigures

_Place = tuple[int, int]


def show(
    folder: Path,
    demonstrations: "Demonstrations",
    numbers: list[int],
    html: Path | None,
    json: bool,
) -> None:
    """Print the statistics of the demonstrations in ``folder``; write the page if asked for.

    ``numbers`` are those of the episodes in the folder.
    """
    from eutree.files import check_writable, write_text
    from eutree.report import demonstration_figures, demonstrations_page

    if html is not None:
        check_writable(html)
    figures = demonstration_figures(demonstrations)
    values = _values(demonstrations, figures, numbers)
    lines = _text(demonstrations, figures, values)
    if html is not None:
        title = f"Demonstrations in {folder}"
        page = demonstrations_page(demonstrations, title=title, numbers=numbers, figures=figures)
        write_text(html, page)
        values["path"] = str(html)
        lines.append(f"written to {html}")
    Output(as_json=json).result(values, "\n".join(lines))


def _values(
    demonstrations: "Demonstrations", figures: "DemonstrationFigures", numbers: list[int]
) -> dict[str, Any]:
    from eutree.fitting import Person

    schema, summary = demonstrations.schema, figures.summary
    names, actions = schema.feature_names, schema.actions
    person = Person.of(demonstrations)

    def places(pairs: tuple[_Place, ...]) -> list[list[int]]:
        return [[numbers[episode], step] for episode, step in pairs]

    return {
        "episodes": len(demonstrations),
        "discarded": len(demonstrations.episodes) - len(demonstrations),
        "n_transitions": demonstrations.n_transitions,
        "success_rate": summary.success_rate,
        "whole_episodes": person.episodes,
        "interval": person.success_interval,
        "mean_return": person.mean_return,
        "return_interval": person.return_interval,
        "coverage": [vars(entry) for entry in summary.coverage],
        "joint_cells": summary.joint_cells,
        "disagreement": summary.disagreement,
        "n_conflicts": summary.n_conflicts,
        "conflicts": [
            {
                "observation": dict(zip(names, conflict.observation, strict=True)),
                "counts": dict(zip(actions, conflict.counts, strict=True)),
                "places": places(conflict.places),
            }
            for conflict in summary.conflicts
        ],
        "learning_curve": figures.curve and _curve(figures.curve),
        "advice": figures.advice,
    }


def _curve(curve: "ExpertCurve") -> dict[str, Any]:
    return {
        "points": [
            {"episodes": p.k, "accuracy": p.accuracy, "interval": list(p.interval)}
            for p in curve.points
        ],
        "most_frequent": curve.most_frequent,
        "law": vars(curve.law),
        "more": curve.more,
        "gain": curve.gain,
        "gain_interval": list(curve.gain_interval),
    }


def _text(
    demonstrations: "Demonstrations", figures: "DemonstrationFigures", values: dict[str, Any]
) -> list[str]:
    from eutree.fitting import Person
    from eutree.fitting.report import result_in_words

    summary = figures.summary
    lines = [
        f"{values['episodes']} episodes ({values['discarded']} discarded), "
        f"{demonstrations.n_transitions} transitions",
        f"shown: {result_in_words(Person.of(demonstrations).whole)}",
        *(
            f"{entry.name}: {feature.text(entry.low)} to {feature.text(entry.high)}, "
            f"{entry.share:.0%} of its range"
            for feature, entry in zip(demonstrations.schema.features, summary.coverage, strict=True)
        ),
        f"{summary.disagreement:.1%} of the transitions disagree with near-equal ones "
        f"({summary.n_conflicts} places)",
    ]
    for conflict in values["conflicts"]:
        seen, features = conflict["observation"], demonstrations.schema.features
        where = ", ".join(f"{f.name} {f.text(seen[f.name])}" for f in features)
        counts = ", ".join(
            f"{name} ({count})" for name, count in conflict["counts"].items() if count
        )
        lines.append(f"  at {where}: {counts} ({_said(conflict['places'])})")
    return [*lines, figures.advice]


def _said(places: list[list[int]]) -> str:
    return ", ".join(f"episode {episode} step {step}" for episode, step in places)
