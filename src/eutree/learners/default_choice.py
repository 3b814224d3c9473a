"""Which method learns where none is named: what was measured to be best for such a task.

Planning in model trees does much with little experience where features are few, and finds nothing
to try where they are many: imagined returns there order no trees any more. A network as teacher
needs steps, the more the fewer features there are for it to be ahead, and demonstrations that fix
its scales (docs/results/auto.md has the tasks and figures). Where both could learn the sentence
says which the other is.
"""

import logging
from dataclasses import dataclass
from functools import cache

from eutree.data import Demonstrations
from eutree.learners.learner import Method
from eutree.learners.planning import DEFAULT
from eutree.learners.registry import method
from eutree.wording import counted

# Steps that a teacher needs, by the number of features from which on; fewer features are planned.
ENOUGH_STEPS = {12: 20_000, 6: 90_000}
ENOUGH_SHOWN = 5  # demonstrations

TEACHING = "distilled-dqn"

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class ChosenMethod:
    """A method and why it was chosen.

    Attributes:
        method: The method.
        reason: One sentence; "" where a method was named.
        alternative: Name of the other method that could learn; "" where there is none.
    """

    method: Method
    reason: str
    alternative: str = ""

    def said(self) -> str:
        """Return the reason with the alternative."""
        if not self.alternative:
            return self.reason
        return f"{self.reason}; the other is method {self.alternative!r}"


@dataclass(frozen=True)
class Evidence:
    """What is known before a run.

    Attributes:
        demonstrations: What it starts from, if anything.
        steps: The run's budget of environment steps; None where it is counted otherwise.
        teacher: Whether there is a teacher to ask.
    """

    demonstrations: Demonstrations | None
    steps: int | None
    teacher: bool = False


def default_for(known: Evidence) -> ChosenMethod:
    """Return the method that learns where none is named, and why."""
    if known.teacher:
        return ChosenMethod(method(TEACHING), "distilled-dqn learns: it asks the teacher")
    shown, steps = known.demonstrations, known.steps
    if shown is None or len(shown) < ENOUGH_SHOWN:
        return _planning(f"a network as teacher would need {ENOUGH_SHOWN} demonstrations")
    features = counted(shown.schema.n_features, "feature")
    enough = next((n for k, n in ENOUGH_STEPS.items() if shown.schema.n_features >= k), None)
    if steps is None:
        few = f"{features} are few enough for it"
        return _planning(few if enough is None else "a network as teacher needs a budget of steps")
    if enough is None:
        return _planning(f"{features} are few enough for it", open_=True)
    if steps < enough:
        return _planning(
            f"of {features} a network as teacher would need {enough} steps, not {steps}", open_=True
        )
    reason = f"{features} are many for planning, and {steps} steps are enough for a teacher"
    return ChosenMethod(
        method(TEACHING), f"distilled-dqn learns: {reason} of its own", DEFAULT.name
    )


@cache
def say(sentence: str) -> None:
    """Say once in a process which method was chosen, where a plain script's user sees it."""
    logger.warning("%s", sentence)


def _planning(reason: str, *, open_: bool = False) -> ChosenMethod:
    return ChosenMethod(DEFAULT, f"planning learns: {reason}", TEACHING if open_ else "")
