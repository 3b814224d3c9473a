"""``distilled-dqn``: a network learns, and the best small tree that copies it acts."""

from eutree.learners.distilled_dqn.method import DistilledDQN

__all__ = ["DistilledDQN"]
