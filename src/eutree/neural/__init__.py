"""Small neural networks without a deep-learning package: they teach, trees are handed over."""

from eutree.neural.double_dqn import DoubleDQN, DoubleDQNSettings
from eutree.neural.network import Scaling

__all__ = ["DoubleDQN", "DoubleDQNSettings", "Scaling"]
