"""What the demo tells in which environment: what changes, how it learns, what to spend.

A demonstrator who does everything right leaves nothing to learn. So the world changes after the
demonstrations (the opponents of Evasion become faster), or the demonstrator is mediocre from the
start (the plain scripts of Gymnasium's tasks). Budgets are chosen so that the whole demo takes
about a minute on two cores for Evasion and a few minutes for the others.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from eutree.schema import EnvironmentSpec


@dataclass(frozen=True, kw_only=True)
class Story:
    """What the demo does in an environment.

    Attributes:
        change: Arguments of the environment that are others after the demonstrations.
        changed: What that means, to follow "once" in a sentence; empty if nothing changes.
        learning: Options of ``learn``: the method if it is not the default one, and budgets.
        plays: Whether compression looks for the best tree of each size by playing; else it keeps
            every recorded decision. Where episodes run side by side it takes half a minute.
        final_episodes: Fresh episodes on which every policy is judged.
    """

    change: Mapping[str, Any] = field(default_factory=dict)
    changed: str = ""
    learning: Mapping[str, Any] = field(default_factory=dict)
    plays: bool = False
    final_episodes: int = 1000


_PLANNING = {"episodes": 200, "evaluate_every": 20, "evaluation_episodes": 50}
_FASTER = Story(
    change={"opponent_speed": 4.2},
    changed="the opponents run at 4.2 instead of 3.2 m/s",
    learning=_PLANNING,
    plays=True,
)
_RACED = {"episodes": 20, "evaluate_every": 10, "evaluation_episodes": 20, "race_steps": 20_000}

_STORIES = {
    "eutree/Evasion-v0": _FASTER,
    "eutree/Evasion2-v0": _FASTER,
    "eutree/Evasion3-v0": _FASTER,
    "CartPole-v1": Story(learning=_RACED, final_episodes=100),
    "LunarLander-v3": Story(
        learning={
            "method": "distilled-dqn",
            "steps": 90_000,
            "max_leaves": 34,
            "evaluate_every": 100,
            "evaluation_episodes": 10,
        },
        final_episodes=200,
    ),
}


def story_of(environment: str) -> Story:
    """Return what the demo tells in an environment, given its id; a plain story for others."""
    name = environment.rpartition(":")[2]
    return _STORIES.get(name, Story(learning=_PLANNING, final_episodes=200))


@dataclass(frozen=True, kw_only=True)
class DemoSettings:
    """How much of everything.

    Attributes:
        environment: Where.
        story: What changes, how it learns, what it may spend; by default what ``story_of`` says.
        expert: Name of the scripted demonstrator; None takes the environment's first.
        demonstrations: Episodes to record.
        runs: Learning runs, with seeds of their own; the best is chosen.
        n_jobs: Processes, as joblib counts them.
        seed: Seed of everything.
    """

    environment: EnvironmentSpec
    story: Story = field(default_factory=Story)
    expert: str | None = None
    demonstrations: int = 15
    runs: int = 3
    n_jobs: int = -1
    seed: int = 0

    @property
    def changed(self) -> EnvironmentSpec:
        """Where it learns and is judged."""
        arguments = dict(self.environment.arguments) | dict(self.story.change)
        return EnvironmentSpec(self.environment.id, arguments)
