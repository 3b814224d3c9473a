"""The protocol of everything that decides, as in Stable-Baselines3."""

from typing import Any, Protocol

from numpy.typing import ArrayLike


class Policy(Protocol):
    """Anything with SB3's ``predict``; every evaluator and recorder accepts it."""

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action for one observation (or a batch) and the policy's next state."""
        ...
