"""A tree that is proven before one that was merely lucky in a sample."""

from collections.abc import Iterable

from eutree.errors import InvalidArgumentError
from eutree.policies import TreePolicy
from eutree.proof import Certificate, plant_of, prove
from eutree.proof.properties import Property, parse
from eutree.schema import EnvironmentSpec


class ProvenFirst:
    """Which of several policies is proven to have a property.

    Args:
        environment: Where they act.
        question: The property (see :mod:`eutree.proof.properties`); the plant's own for ``""``.

    Raises:
        InvalidArgumentError: No plant is known for the environment, or the text is no property.
    """

    def __init__(self, environment: EnvironmentSpec, question: str) -> None:
        plant = plant_of(environment)
        if plant is None:
            raise InvalidArgumentError(
                f"prefer_proven needs a plant, which says how states move; none is known for "
                f"{environment}"
            )
        self._plant = plant
        self._asked: Property = parse(question or plant.question, plant.schema)

    def certificate(self, policy: TreePolicy) -> Certificate | None:
        """Return the proof of a policy; None where it is not proven, or cannot be."""
        if not policy.features.is_identity:
            return None
        found = prove(policy, self._plant, self._asked)
        return found if found.proven else None

    def first(self, policies: Iterable[TreePolicy]) -> tuple[int, Certificate] | None:
        """Return the number of the first policy that is proven, and its proof; None if none is."""
        for number, policy in enumerate(policies):
            found = self.certificate(policy)
            if found is not None:
                return number, found
        return None
