"""Scripted experts: each is a function that makes a policy for an environment.

A policy has SB3's ``predict``; ``eutree.record`` takes the expert itself:
``eutree.record(env, eutree.experts.wait_at_crossing, episodes=15, seed=0)``.
"""

from collections.abc import Mapping
from importlib.metadata import entry_points

from eutree.envs._classic_experts import (
    balance,
    brake_upright,
    follow_the_fall,
    push_along,
    rock,
    steer_home,
    swing_both,
    swing_elbow,
    swing_upright,
)
from eutree.envs._evasion_experts import (
    GatePolicy,
    LookAheadPolicy,
    look_ahead,
    wait_at_crossing,
    wait_for_the_end,
)
from eutree.envs._imperfect import CarelessPolicy, Expert, LatePolicy, careless, late
from eutree.envs._scripted import RulePolicy
from eutree.errors import InvalidArgumentError, UnknownNameError

__all__ = [
    "EXPERTS",
    "CarelessPolicy",
    "Expert",
    "GatePolicy",
    "LatePolicy",
    "LookAheadPolicy",
    "RulePolicy",
    "all_experts",
    "balance",
    "brake_upright",
    "careless",
    "experts_for",
    "follow_the_fall",
    "known_experts",
    "late",
    "look_ahead",
    "push_along",
    "rock",
    "steer_home",
    "swing_both",
    "swing_elbow",
    "swing_upright",
    "wait_at_crossing",
    "wait_for_the_end",
]

GROUP = "eutree.experts"  # entry points of other distributions: mappings like EXPERTS

_EVASION: Mapping[str, Expert] = {"gate": wait_at_crossing, "look-ahead": look_ahead}
_PAPER_EVASION: Mapping[str, Expert] = {"gate": wait_for_the_end, "look-ahead": look_ahead}

EXPERTS: Mapping[str, Mapping[str, Expert]] = {
    "eutree/Evasion-v0": _EVASION,
    "eutree/Evasion2-v0": _EVASION,
    "eutree/Evasion3-v0": _EVASION,
    "eutree/PaperEvasion2-v0": _PAPER_EVASION,
    "eutree/PaperEvasion3-v0": _PAPER_EVASION,
    "CartPole-v1": {"fall": follow_the_fall, "balance": balance},
    "MountainCar-v0": {"push": push_along, "rock": rock},
    "Acrobot-v1": {"both": swing_both, "elbow": swing_elbow},
    "Pendulum-v1": {"swing": swing_upright},
    "LunarLander-v3": {"brake": brake_upright, "steer": steer_home},
}


def experts_for(environment: str) -> Mapping[str, Expert]:
    """Return the scripted experts of an environment by name; the first is the default one.

    Args:
        environment: Its id, with or without the module to import (``"eutree:..."``).
    """
    found = known_experts(environment)
    if not found:
        name = environment.rpartition(":")[2]
        raise UnknownNameError("environment with a scripted expert", name, all_experts())
    return found


def known_experts(environment: str) -> Mapping[str, Expert]:
    """Return ``experts_for`` an environment; nothing if it has none."""
    name = environment.rpartition(":")[2]
    return EXPERTS[name] if name in EXPERTS else all_experts().get(name, {})


def all_experts() -> Mapping[str, Mapping[str, Expert]]:
    """Return the scripted experts of every environment, with those of other distributions.

    Raises:
        InvalidArgumentError: Those of one cannot be imported.
    """
    every = dict(EXPERTS)
    for point in entry_points(group=GROUP):
        try:
            every = {**point.load(), **every}
        except Exception as error:  # whatever a package's author lets happen
            raise InvalidArgumentError(
                f"experts {point.name!r}, {point.value}, cannot be imported: {error}"
            ) from error
    return every
