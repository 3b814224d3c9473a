"""Learn with a network, hand over a tree: a counted teacher, DAgger, imagined pruning, real races.

1. *Teacher.* A Double DQN learns the task, demonstrations in its replay. Its steps are counted.
   With ``learning_share`` it goes on learning from the trees' episodes in the stages that follow.
2. *DAgger* (Ross, Gordon and Bagnell 2011). Large trees act, the teacher names its own actions.
3. *Rounds*, as long as steps are left. An ensemble of networks is fitted to all transitions so far.
   CART makes trees of two and three times the leaves allowed, or 32, of all labelled observations,
   plain and weighted by the cost of a wrong action (VIPER; Bastani et al. 2018), and each is pruned
   by imagined returns; half of those that race climb on by random changes that pay there. They race
   against the policy in real episodes; the teacher labels the observations of the challengers, so
   the trees of the next round know more.
4. *Last races.* With the rest of the steps the best trees of all rounds meet again.

A race is made of ordinary episodes, in which the tree that runs decides, from starts that the
learner numbers: all entrants run from the same ones.

The policy changes only by winning a race. The network is never handed over.
"""

from eutree.learners.distilled_dqn.learner import DistilledDQN

__all__ = ["DistilledDQN"]
