"""Which method learns where none is named: what was measured to be best for such a task.

Planning in model trees with little experience is good at few features, and stops learning at about
six: imagined returns there order no trees any more (docs/learning.md). A counted teacher needs a
hundred thousand steps, demonstrations that fix its scales, and gets further there
(docs/small-trees.md).
"""

from dataclasses import dataclass

from eutree.data import Demonstrations
from eutree.learners.learner import Method
from eutree.learners.planning import DEFAULT
from eutree.learners.registry import method
from eutree.wording import counted

MANY_FEATURES = 6  # Acrobot has six; five (4-Evasion) were not measured
ENOUGH_STEPS = 80_000  # 100,000 less demonstrations, as measured; fewer were not
ENOUGH_SHOWN = 5  # demonstrations


@dataclass(frozen=True)
class Choice:
    """A method and why it was chosen.

    Attributes:
        method: The method.
        reason: One sentence.
    """

    method: Method
    reason: str


@dataclass(frozen=True)
class Evidence:
    """What is known before a run.

    Attributes:
        demonstrations: What it starts from, if anything.
        steps: The run's budget of environment steps; None where it is counted otherwise.
        teacher: Whether there is somebody to ask.
    """

    demonstrations: Demonstrations | None
    steps: int | None
    teacher: bool = False


def default_for(known: Evidence) -> Choice:
    """Return the method that learns where none is named, and why."""
    if known.teacher:
        return Choice(method("distilled-dqn"), "distilled-dqn learns: it asks the teacher")
    demonstrations, steps = known.demonstrations, known.steps
    missing = _missing(demonstrations, steps)
    if not missing and demonstrations is not None:
        return Choice(
            method("distilled-dqn"),
            f"distilled-dqn learns: {counted(demonstrations.schema.n_features, 'feature')} are "
            f"many for planning, and {steps} steps are enough for a teacher of its own",
        )
    return Choice(DEFAULT, f"planning learns: {missing}")


def _missing(demonstrations: Demonstrations | None, steps: int | None) -> str:
    """Return why ``distilled-dqn`` is not for this task; "" if it is."""
    if demonstrations is None or len(demonstrations) < ENOUGH_SHOWN:
        return f"a network as teacher would need {ENOUGH_SHOWN} demonstrations"
    n_features = demonstrations.schema.n_features
    if n_features < MANY_FEATURES:
        return f"{counted(n_features, 'feature')} are few enough for it"
    if steps is None:
        return "a network as teacher would need a budget of steps"
    if steps < ENOUGH_STEPS:
        return f"a network as teacher would need {ENOUGH_STEPS} steps, not {steps}"
    return ""
