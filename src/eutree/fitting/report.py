"""What came of a fit."""

import math
from dataclasses import dataclass

from eutree.data import Episode
from eutree.display import Displayed
from eutree.evaluation import Evaluation
from eutree.fitting.person import Person
from eutree.policies import TreePolicy


@dataclass(frozen=True, eq=False)
class FitReport(Displayed):
    """A tree made of demonstrations, and how good it is beside them.

    Attributes:
        policy: The tree.
        person: What the demonstrator has reached.
        played: What the tree has reached in fresh episodes; None if it was not played.
        choice: How the tree was made, in words.
        warnings: What to know before relying on it, in sentences; empty if all is well.
        n_transitions: Steps that were shown.
        training_accuracy: Share of them that the tree decides as shown.
        n_candidates: Trees that were compared.
        episodes_played: Episodes played in all: to choose, to repair, to judge, to practise.
        before_practice: The report of the tree that practice began with; None without practice.
        plays: What the tree has played so far: ``eutree.fitting.practice`` goes on from it.
    """

    policy: TreePolicy
    person: Person
    played: Evaluation | None
    choice: str
    warnings: tuple[str, ...]
    n_transitions: int
    training_accuracy: float
    n_candidates: int
    episodes_played: int
    before_practice: "FitReport | None" = None
    plays: tuple[Episode, ...] = ()

    @property
    def as_good_as_shown(self) -> bool | None:
        """Whether the tree does at least as well as its demonstrator, within 3 points of success.

        None if it was not played. Where nothing is a success, within 3 % of the mean return.
        """
        return None if self.played is None else not self.person.is_above(self.played)

    def __str__(self) -> str:
        """Return the report in a few lines, without the tree."""
        lines = [
            f"{self.policy.n_leaves} leaves from {self.n_transitions} steps; "
            f"{self.training_accuracy:.1%} of the actions shown"
        ]
        if self.played is not None:
            lines.append(f"shown: {_result(self.person)}; this tree: {_reached(self.played)}")
        made = f"made by {self.choice}"
        if self.n_candidates > 1:
            made += f", the best of {self.n_candidates} trees"
        if self.episodes_played:
            made += f"; {self.episodes_played} episodes played in all"
        return "\n".join([*lines, made, *(f"WARNING: {text}" for text in self.warnings)])


def _result(person: Person) -> str:
    if not person.episodes:
        return "no finished episode"
    if person.success_rate is None and math.isnan(person.mean_return):
        return f"{person.episodes} episodes of unknown returns"
    if person.success_rate is None:
        return f"{person.mean_return:.4g} on average in {person.episodes} episodes"
    successes = round(person.success_rate * person.episodes)
    return f"{successes} of {person.episodes} episodes succeed ({person.success_rate:.1%})"


def _reached(tree: Evaluation) -> str:
    if tree.successes is None or tree.success_interval is None:
        low, high = tree.return_interval
        return f"{tree.mean_return:.4g} [{low:.4g}, {high:.4g}] in {tree.episodes} episodes"
    low, high = tree.success_interval
    return (
        f"{int(tree.successes.sum())} of {tree.episodes} ({tree.success_rate:.1%}, 95 % interval "
        f"{low:.1%} to {high:.1%})"
    )
