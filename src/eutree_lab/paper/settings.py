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
from eutree.envs.experts import look_ahead, wait_at_crossing
from eutree.errors import InvalidArgumentError
from eutree.interaction import record
from eutree.learners import PAPER, UTreeMethod
from eutree.splitting import KolmogorovSmirnov
from eutree.validation import check_choice

ZERO, LABEL = "zero", "label"
GATE, LOOK_AHEAD = "gate", "look ahead"
MAIN_PATH = 30.0  # m, the paper's
# Choices that are part of a run's name only where they are not the default: they were fixed when
# the first runs were named.
LATER = {"domain": ("spacing", "shift"), "demonstrator": ("rule", "margin")}
SPLITS = {"lowest p": "scaled", "largest D": "distance"}


@dataclass(frozen=True, kw_only=True)
class Domain:
    """What the paper leaves open about N-Evasion; most names are the environment's arguments.

    Attributes:
        time_step: Seconds between two decisions.
        collision_distance: An opponent this near is a collision [m].
        noise: Standard deviation of a forward step, as a share of it.
        start: Where opponents begin.
        bounce: What they do at an end of their paths.
        agent_speed: Stated in the paper; another value is a departure from it [m/s].
        spacing: Distance of neighbouring crossings, as a share of that of equally spaced ones.
        shift: How far all crossings are moved towards the goal [m].
    """

    time_step: float = 1.0
    collision_distance: float = 2.0
    noise: float = 0.02
    start: str = "anywhere"
    bounce: str = "reflect"
    agent_speed: float = 2.0
    spacing: float = 1.0
    shift: float = 0.0

    def arguments(self, n_opponents: int) -> dict[str, Any]:
        """Return the environment's arguments for so many opponents."""
        found = asdict(self)
        if (found.pop("spacing"), found.pop("shift")) == (1.0, 0.0):
            return found
        return found | {"crossings": self.crossings(n_opponents)}

    def crossings(self, n_opponents: int) -> tuple[float, ...]:
        """Return where the opponents' paths cross the main path [m], ascending."""
        gap = self.spacing * MAIN_PATH / (n_opponents + 1)
        first = MAIN_PATH / 2.0 + self.shift - gap * (n_opponents - 1) / 2.0
        return tuple(first + gap * number for number in range(n_opponents))


@dataclass(frozen=True, kw_only=True)
class Demonstrator:
    """Who shows the task: a rule, or a person whose demonstrations were recorded.

    Attributes:
        wait_distance: The gate rule waits while the opponent is this near to the main path [m].
        folder: Recorded demonstrations; empty for a rule.
        digest: Of the recorded demonstrations, so that a run is named by what it was shown.
        rule: ``"gate"``, which uses only what the sensors show, or ``"look ahead"``, which sees
            where opponents are heading, as a person who watches does, and plans.
        margin: Distance that the look-ahead rule keeps from collisions [m].
    """

    wait_distance: float = 8.5
    folder: str = ""
    digest: str = ""
    rule: str = GATE
    margin: float = 0.75

    def __post_init__(self) -> None:
        check_choice("rule", self.rule, (GATE, LOOK_AHEAD))

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
            return record(env, self.policy, episodes=episodes, seed=seed)
        shown = Demonstrations.load(self.folder)
        if shown.digest != self.digest:
            raise InvalidArgumentError(
                f"{self.folder} must hold the demonstrations of digest {self.digest}, "
                f"got {shown.digest}"
            )
        return shown

    def policy(self, env: Any) -> Any:
        """Return the rule for an environment."""
        if self.rule == LOOK_AHEAD:
            return look_ahead(env, margin=self.margin)
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

    def decided(self) -> dict[str, Any]:
        """Return what a run is named by: every choice but ``LATER`` ones left at their defaults."""
        found = asdict(self)
        for part, names in LATER.items():
            default = asdict(getattr(Setting, part))
            for name in names:
                if found[part][name] == default[name]:
                    del found[part][name]
        return found
