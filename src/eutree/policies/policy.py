"""The protocol of everything that decides, as in Stable-Baselines3."""

from typing import Any, Protocol

from numpy.typing import ArrayLike


class Policy(Protocol):
    """Anything with SB3's ``predict``; every evaluator and recorder accepts it.

    It is called by keyword, with the environment's own observation. A policy that says
    ``reads_features = True`` gets the vector of the environment's features instead, as trees do:
    the same for a Box, a vector of float64 for Discrete, MultiDiscrete, Dict and Tuple spaces.
    """

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action for one observation (or a batch) and the policy's next state."""
        ...
