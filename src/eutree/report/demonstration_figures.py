"""The figures of demonstrations: as a value, for ``--json``, and in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from eutree.data import Demonstrations
from eutree.data.summary import Summary, summarize
from eutree.evaluation.expert_curve import ExpertCurve, expert_curve

_Place = tuple[int, int]


@dataclass(frozen=True, eq=False)
class DemonstrationFigures:
    """The figures of a summary.

    Attributes:
        summary: Results, coverage and groups of near-equal observations with several actions.
        curve: The learning curve of the expert tree; None with too few episodes.
    """

    summary: Summary
    curve: ExpertCurve | None

    @property
    def advice(self) -> str:
        """One or two sentences for the person who demonstrates."""
        if self.curve is None:
            return "Four episodes are needed to say whether more would help."
        return self.curve.advice


def demonstration_figures(demonstrations: Demonstrations) -> DemonstrationFigures:
    """Return all figures of a summary; the same demonstrations give the same figures."""
    return DemonstrationFigures(summarize(demonstrations), expert_curve(demonstrations))


def figures_as_values(
    demonstrations: Demonstrations, figures: DemonstrationFigures, numbers: Sequence[int]
) -> dict[str, Any]:
    """Return the figures for ``--json``; ``numbers`` are those of the episodes in their folder."""
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


def figures_in_words(
    demonstrations: Demonstrations, figures: DemonstrationFigures, values: dict[str, Any]
) -> list[str]:
    """Return the figures as lines; ``values`` are what ``figures_as_values`` says of them."""
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


def _curve(curve: ExpertCurve) -> dict[str, Any]:
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


def _said(places: list[list[int]]) -> str:
    return ", ".join(f"episode {episode} step {step}" for episode, step in places)
