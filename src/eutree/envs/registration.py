"""Make the environments known to Gymnasium, which since 1.0 reads no entry points."""

import gymnasium

IDS = {
    "eutree/Evasion-v0": {},
    "eutree/Evasion2-v0": {"n_opponents": 2},
    "eutree/Evasion3-v0": {"n_opponents": 3},
}


def register() -> None:
    """Register every environment of eutree; a second call changes nothing."""
    for name, arguments in IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name,
                entry_point="eutree.envs.evasion:EvasionEnv",
                vector_entry_point="eutree.envs.vector:EvasionVectorEnv",
                kwargs=arguments,
            )
