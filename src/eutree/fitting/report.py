"""What came of a fit."""

from dataclasses import dataclass

from eutree.data import Episode
from eutree.display import Displayed
from eutree.evaluation import Evaluation
from eutree.fitting.person import Person
from eutree.fitting.verdict import Standing, result_in_words, verdict
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
    def verdict(self) -> Standing | None:
        """How the tree compares with its demonstrator; None if it was not played."""
        return None if self.played is None else verdict(self.person.whole, self.played)

    def __str__(self) -> str:
        """Return the report in a few lines, without the tree."""
        lines = [
            f"{self.policy.n_leaves} leaves from {self.n_transitions} steps; "
            f"{self.training_accuracy:.1%} of the actions shown"
        ]
        if self.played is not None and self.verdict is not None:
            measure = self.verdict.measure
            shown, tree = (result_in_words(s, measure) for s in (self.person.whole, self.played))
            lines.append(f"shown: {shown}; this tree: {tree}: {self.verdict.word}")
        made = f"made by {self.choice}"
        if self.n_candidates > 1:
            made += f", the best of {self.n_candidates} trees"
        if self.episodes_played:
            made += f"; {self.episodes_played} episodes played in all"
        return "\n".join([*lines, made, *(f"WARNING: {text}" for text in self.warnings)])
