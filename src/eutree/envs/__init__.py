"""The N-Evasion domain of the paper, and scripted experts for it and for Gymnasium's tasks."""

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any

import gymnasium

from eutree.errors import warn

# Those of other distributions, of ``eutree_lab`` too, are registered by a function that its
# metadata names in the group ``eutree.environments``.
GROUP = "eutree.environments"
# The constants under which most claims of the paper hold: docs/results/search.md. A name of its
# own, as Gymnasium would call Evasion2-v0 out of date if there were an Evasion2-v1.
PAPER_CONSTANTS: dict[str, Any] = {
    "time_step": 1.0,
    "collision_distance": 1.0,
    "noise": 0.05,
    "start": "either end",
}
IDS: dict[str, dict[str, Any]] = {
    "eutree/Evasion-v0": {},
    "eutree/Evasion2-v0": {"n_opponents": 2},
    "eutree/Evasion3-v0": {"n_opponents": 3},
    "eutree/Evasion4-v0": {"n_opponents": 4},
    "eutree/PaperEvasion2-v0": {"n_opponents": 2, **PAPER_CONSTANTS},
    "eutree/PaperEvasion3-v0": {"n_opponents": 3, **PAPER_CONSTANTS},
}

# Who makes the model of an environment that ``eutree.proof`` follows, by the environment's id.
PLANTS: dict[str, Callable[[Any], Any]] = {}


def register() -> None:
    """Register every environment of eutree and of others; a second call changes nothing."""
    for name, arguments in IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name,
                entry_point="eutree.envs.evasion:EvasionEnv",
                vector_entry_point="eutree.envs.vector:EvasionVectorEnv",
                kwargs=arguments,
            )
    for point in entry_points(group=GROUP):
        try:
            point.load()()
        except (Exception, SystemExit) as error:  # a package of another author may raise anything
            warn(f"environments {point.name!r}, {point.value}, cannot be registered: {error}")
