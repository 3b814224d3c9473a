"""Small neural networks without a deep-learning package: they teach, trees are handed over."""

from eutree.neural._kernels import Network, adam_step, backward, forward, room
from eutree.neural.double_dqn import DoubleDQN, DoubleDQNSettings, Scaling

__all__ = [
    "DoubleDQN", "DoubleDQNSettings", "Network", "Scaling", "adam_step", "backward", "forward",
    "room",
]  # fmt: skip
