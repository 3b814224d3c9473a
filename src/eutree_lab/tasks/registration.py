"""Make the tasks known to Gymnasium, and Evasion's plant; ``import eutree`` calls it."""

from typing import Any

import gymnasium

from eutree.envs import PLANTS

TASKS: dict[str, tuple[str, dict[str, Any]]] = {
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

EVASION = tuple(f"eutree/Evasion{n}-v0" for n in ("", 2, 3, 4))


def register() -> None:
    """Register every task and plant; a second call changes nothing."""
    for name, (entry_point, arguments) in TASKS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name, entry_point=f"eutree_lab.tasks.{entry_point}", kwargs=arguments
            )
    PLANTS.update(dict.fromkeys(EVASION, _evasion_plant))


def _evasion_plant(spec: Any) -> Any:
    from eutree_lab.plants.evasion import Evasion

    return Evasion(spec)
