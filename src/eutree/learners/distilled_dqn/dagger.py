"""DAgger (Ross, Gordon and Bagnell 2011): trees act, the teacher says what it would have done."""

from eutree.learners.distilled_dqn.experience import Experience
from eutree.learners.distilled_dqn.students import Students
from eutree.world_model import ActionTree

STUDENT_LEAVES = 400  # of DAgger's trees: they gather data, nobody reads them
ROUNDS = 12
LAST_OF_TEACHER = 4_000  # steps of the teacher's last episodes that it begins with, at most


class DAgger:
    """The rounds of one learner.

    Args:
        students: The teacher's labels, and trees that copy them.
        experience: What the teacher and the trees lived through.
        steps: Steps of all rounds together.
        tree: Who acts before the first round.

    Attributes:
        tree: Who acts in the present round.
        labelled_from: First row of the experience that is labelled.
        round_from: The learner's steps at the beginning of the round.
    """

    def __init__(
        self, students: Students, experience: Experience, steps: int, tree: ActionTree
    ) -> None:
        self._students = students
        self._experience = experience
        self._steps = steps
        self.tree = tree
        self.labelled_from = self.round_from = 0

    def begin(self, steps: int) -> None:
        """Begin the first round, after so many steps of the teacher's."""
        self.labelled_from = self._experience.first_of_last(min(LAST_OF_TEACHER, self._steps))
        self._students.begin(self.labelled_from)
        self._begin_round(steps)

    def round_is_over(self, steps: int) -> bool:
        """Return whether the round has had its steps; the learner has taken so many in all."""
        return steps - self.round_from >= self._steps / ROUNDS

    def next_round(self, steps: int) -> int:
        """Fit the next tree; return the number of observations that it was fitted to."""
        self._begin_round(steps)
        return self._experience.history.size - self.labelled_from

    def take_back(self, tree: ActionTree, labelled_from: int, round_from: int) -> None:
        """Go on from where these stood."""
        self.tree, self.labelled_from, self.round_from = tree, labelled_from, round_from
        self._students.begin(labelled_from)

    def _begin_round(self, steps: int) -> None:
        self.round_from = steps
        self.tree = self._students.fit(self._experience.history.observations, STUDENT_LEAVES)
