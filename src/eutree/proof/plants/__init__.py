"""The plants that are known, by the ids of their environments."""

from collections.abc import Callable

from eutree.proof.plant import Plant
from eutree.proof.plants.cart_pole import CartPole
from eutree.proof.plants.evasion import Evasion
from eutree.proof.plants.mountain_car import MountainCar
from eutree.proof.plants.two_tanks import TwoTanks
from eutree.schema import EnvironmentSpec

Factory = Callable[[EnvironmentSpec], Plant]

_PLANTS: dict[str, Factory] = {
    "CartPole-v1": CartPole,
    "MountainCar-v0": MountainCar,
    "TwoTanks-v0": TwoTanks,
    "eutree/Evasion-v0": Evasion,
    "eutree/Evasion2-v0": Evasion,
    "eutree/Evasion3-v0": Evasion,
}


def register_plant(environment: str, factory: Factory) -> None:
    """Let ``eutree prove`` find the plant of an environment, by the environment's id.

    Args:
        environment: The id, such as ``"MyTank-v0"``; a namespace belongs to it, a module does not.
        factory: Returns the plant for the id and the arguments of ``gymnasium.make``.
    """
    _PLANTS[environment] = factory


def plant_of(spec: EnvironmentSpec | None) -> Plant | None:
    """Return the plant of an environment, or None where none is known."""
    factory = None if spec is None else _PLANTS.get(spec.id.rpartition(":")[2])
    return None if spec is None or factory is None else factory(spec)
