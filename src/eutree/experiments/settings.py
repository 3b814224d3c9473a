"""What the paper leaves open, decided one way, as data: the domain, who demonstrates, the reading.

The paper states the lengths of the paths, the speeds and the rewards. It does not say how long a
step is, how near a collision, how large the noise, or where opponents begin; nor by what rule its
human expert waited; nor what a leaf does before its actions were tried, what "the largest
difference" is, or how long data is gathered. A setting is one answer to all of it.
"""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

import gymnasium

from eutree.data import Demonstrations
from eutree.envs.experts import GatePolicy, wait_at_crossing
from eutree.errors import InvalidArgumentError
from eutree.interaction import record
from eutree.learners import PAPER, UTreeMethod
from eutree.splitting import KolmogorovSmirnov
from eutree.validation import check_choice

ZERO, LABEL = "zero", "label"
SPLITS = {"lowest p": "scaled", "largest D": "distance"}


@dataclass(frozen=True, kw_only=True)
class Domain:
    """What the paper leaves open about N-Evasion; the names are the environment's arguments."""

    time_step: float = 1.0
    collision_distance: float = 2.0
    noise: float = 0.02
    start: str = "anywhere"
    bounce: str = "reflect"
    agent_speed: float = 2.0

    def arguments(self) -> dict[str, Any]:
        """Return the environment's arguments."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class Demonstrator:
    """Who shows the task: the gate rule, or a person whose demonstrations were recorded.

    Attributes:
        wait_distance: The gate rule waits while the opponent is this near to the main path [m].
        folder: Recorded demonstrations; empty for the gate rule.
        digest: Of the recorded demonstrations, so that a run is named by what it was shown.
    """

    wait_distance: float = 8.5
    folder: str = ""
    digest: str = ""

    @classmethod
    def recorded(cls, folder: str | Path) -> "Demonstrator":
        """Return the demonstrator whose episodes are in a folder of the recorder."""
        return cls(folder=str(folder), digest=Demonstrations.load(folder).digest)

    def show(self, env: gymnasium.Env[Any, Any], episodes: int, seed: int) -> Demonstrations:
        """Return demonstrations: the recorded ones as they are, or the rule's in ``env``.

        Raises:
            InvalidArgumentError: The folder no longer holds what it held.
        """
        if not self.folder:
            return record(env, self.rule, episodes=episodes, seed=seed)
        shown = Demonstrations.load(self.folder)
        if shown.digest != self.digest:
            raise InvalidArgumentError(
                f"{self.folder} must hold the demonstrations of digest {self.digest}, "
                f"got {shown.digest}"
            )
        return shown

    def rule(self, env: Any) -> GatePolicy:
        """Return the gate rule for an environment."""
        return wait_at_crossing(env, distance=self.wait_distance)


@dataclass(frozen=True, kw_only=True)
class Reading:
    """What the paper leaves open about the learner.

    Attributes:
        untried: Q of an action never tried in a leaf: ``"zero"``, or none, so that a leaf keeps
            the ``"label"`` that the expert tree gave it until it knows better.
        split: "The largest difference between the two distributions": the ``"lowest p"`` or the
            ``"largest D"``.
        compare: What is compared: the transitions of all actions ``"pooled"``, or each
            ``"action"`` by itself.
        min_leaf: Fewest transitions on each side of a split.
        gathering_episodes: Episodes of a data gathering phase.
        exploration: epsilon.
        discount: gamma.
    """

    untried: str = LABEL
    split: str = "lowest p"
    compare: str = "pooled"
    min_leaf: int = 1
    gathering_episodes: int = 20
    exploration: float = 0.05
    discount: float = 0.99

    def __post_init__(self) -> None:
        check_choice("untried", self.untried, (ZERO, LABEL))
        check_choice("split", self.split, SPLITS)

    def method(self) -> UTreeMethod:
        """Return the learner of Table 1, read so."""
        return replace(
            PAPER,
            untried_value=0.0 if self.untried == ZERO else None,
            splitter=KolmogorovSmirnov(
                score=cast(Any, SPLITS[self.split]),
                compare=cast(Any, self.compare),
                min_leaf=self.min_leaf,
            ),
            gathering_episodes=self.gathering_episodes,
            exploration=self.exploration,
            discount=self.discount,
        )


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One answer to what the paper leaves open.

    Attributes:
        domain: N-Evasion's constants.
        demonstrator: Who shows the task.
        reading: The learner; None leaves it to the preset of the run.
    """

    domain: Domain = Domain()
    demonstrator: Demonstrator = Demonstrator()
    reading: Reading | None = None
