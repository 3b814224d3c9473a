"""Make the environments known to Gymnasium, which since 1.0 reads no entry points."""

from typing import Any

import gymnasium

# The constants in which most of what the paper says is true: docs/results/search.md. A name of its
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
    "eutree/PaperEvasion2-v0": {"n_opponents": 2, **PAPER_CONSTANTS},
    "eutree/PaperEvasion3-v0": {"n_opponents": 3, **PAPER_CONSTANTS},
}
DOMAINS: dict[str, tuple[str, dict[str, Any]]] = {
    "eutree/CarOnHill-v0": ("car_on_hill:CarOnHillEnv", {}),
    "eutree/MazeA-v0": ("maze:MazeEnv", {"maze": "a"}),
    "eutree/MazeB-v0": ("maze:MazeEnv", {"maze": "b"}),
    "eutree/MazeC-v0": ("maze:MazeEnv", {"maze": "c"}),
    "eutree/MazeD-v0": ("maze:MazeEnv", {"maze": "d"}),
    "eutree/Puck-v0": ("puck:PuckEnv", {}),
    "eutree/CheeseMaze-v0": ("cheese_maze:CheeseMazeEnv", {}),
    "eutree/Maze1D-v0": ("maze_1d:Maze1DEnv", {}),
    "eutree/Tiger-v0": ("tiger:TigerEnv", {}),
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
    for name, (entry_point, arguments) in DOMAINS.items():
        if name not in gymnasium.registry:
            gymnasium.register(id=name, entry_point=f"eutree.envs.{entry_point}", kwargs=arguments)
