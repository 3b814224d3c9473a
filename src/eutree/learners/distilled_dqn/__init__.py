"""Learn with a network, hand over a tree: a counted teacher, DAgger, imagined pruning, real races.

1. *Teacher.* A Double DQN learns the task, demonstrations in its replay. Its steps are counted.
   With ``learning_share`` it goes on learning from the trees' episodes in the stages that follow.
2. *DAgger* (Ross, Gordon and Bagnell 2011). Large trees act, the teacher names its own actions.
3. *Rounds*, as long as steps are left. An ensemble of networks is fitted to all transitions so far.
   CART makes trees of two and three times the leaves allowed from all labelled observations, plain
   and weighted by the cost of a wrong action (VIPER; Bastani et al. 2018), and each is pruned by
   imagined returns. They race against the policy in real episodes; the teacher labels the
   observations of the challengers, so the trees of the next round know more.
4. *Last races.* With the rest of the steps the best trees of all rounds meet again.

A race is made of ordinary episodes, in which the tree that runs decides, from starts that the
learner numbers: all entrants run from the same ones.

The policy changes only by winning a race. The network is never handed over.
"""

from dataclasses import dataclass
from typing import ClassVar

from eutree.learners.declared import Declared, give_back
from eutree.learners.distilled_dqn.learner import DistilledDQNLearner, parts_of
from eutree.learners.distilled_dqn.teaching import DistilledDQNChoices
from eutree.learners.learner import Arrays, Needs, Problem, Start
from eutree.neural.double_dqn import n_weights


@dataclass(frozen=True, kw_only=True)
class DistilledDQN(DistilledDQNChoices):
    """The method; see ``DistilledDQNChoices`` for its choices."""

    name: ClassVar[str] = "distilled-dqn"
    needs: ClassVar[Needs] = Needs(
        gathering=True, starts=("demos", "tree+demos"), asks_teacher=True
    )
    gathering_episodes: ClassVar[int] = 1

    def start(self, problem: Problem, start: Start) -> "DistilledDQNLearner":
        """Return a learner at its start."""
        return DistilledDQNLearner(self, problem, start)

    def restore(self, problem: Problem, start: Start, state: Arrays) -> "DistilledDQNLearner":
        """Return the learner whose ``state()`` this was; it goes on to the same bytes."""
        return give_back(self.start(problem, start), parts_of(start), state)

    def declared(self, problem: Problem, start: Start) -> Declared:
        """Return the declaration of a ``state()``."""
        d, n_actions, model = problem.n_features, problem.n_actions, self.world_model
        seen, outputs = d * (1 + model.memory), n_actions * self.teacher.quantiles
        return problem.declare(
            *parts_of(start),
            weights=n_weights(d, self.teacher.hidden, outputs),
            seen=seen,
            members=model.members,
            member=n_weights(seen + n_actions, model.hidden, 2 * d + 5),
            shown=sum(map(len, start.episodes)),
            n_shown=len(start.episodes),
        )


__all__ = ["DistilledDQN"]
