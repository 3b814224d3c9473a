"""The expert tree: what C4.5 makes of demonstrations (the paper's first step)."""

from numpy.typing import ArrayLike

from eutree.c45 import C45Settings, grow
from eutree.data import Demonstrations
from eutree.errors import InvalidArgumentError
from eutree.policies import TreePolicy

_RELEASE_8 = C45Settings()


def fit_expert_tree(
    demonstrations: Demonstrations,
    *,
    settings: C45Settings = _RELEASE_8,
    weights: ArrayLike | None = None,
) -> TreePolicy:
    """Return the policy that C4.5 learns from demonstrations: observations to the expert's actions.

    Args:
        demonstrations: Episodes recorded under the expert, at least one step in all.
        settings: The choices of C4.5; release 8 by default.
        weights: Weight of each transition, in the order of ``demonstrations.observations``.

    Raises:
        InvalidArgumentError: If there is no transition, or weights do not fit.
    """
    if not demonstrations.n_transitions:
        raise InvalidArgumentError(
            "demonstrations must hold at least one transition, got "
            f"{len(demonstrations)} episodes without a step"
        )
    grown = grow(
        demonstrations.observations,
        demonstrations.actions,
        n_classes=demonstrations.schema.n_actions,
        weights=weights,
        settings=settings,
    )
    tree, actions = grown.to_decision_tree()
    return TreePolicy(
        tree=tree,
        actions=actions,
        schema=demonstrations.schema,
        environment=demonstrations.environment,
    )
