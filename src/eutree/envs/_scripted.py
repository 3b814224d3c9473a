"""Policies that decide by the present observation alone, by a rule somebody wrote."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats, Integers

Rule = Callable[[Floats], Integers]  # [..., d] -> [...]


class ScriptedPolicy(ABC):
    """SB3's ``predict`` around a decision that needs no memory.

    Attributes:
        reads_features: It gets the vector of the environment's features, whatever its space.
    """

    reads_features = True

    @abstractmethod
    def decide(self, observations: Floats) -> Integers:
        """Return the actions for observations, [..., d] to [...]."""

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action for one observation, or those of a batch."""
        return self.decide(np.asarray(observation, dtype=np.float64)), state


class RulePolicy(ScriptedPolicy):
    """Acts by a written rule.

    Args:
        rule: The rule, from observations [..., d] to actions [...].
    """

    def __init__(self, rule: Rule) -> None:
        self._rule = rule

    def decide(self, observations: Floats) -> Integers:
        """Return what the rule says."""
        return self._rule(observations)
