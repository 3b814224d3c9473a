"""Climb in a world model: many small random changes of a policy tree, each kept if it earns more.

:mod:`eutree.policy_search.improvement` leaves thresholds that have to move together, or by less
than its few places allow, and trees that no single change improves. Thousands of changes cost no
step. Annealed first, changes that cost something are kept too, fewer and fewer of them
(Kirkpatrick, Gelatt and Vecchi 1983).
"""

from eutree.policy_search.variation import Variation
from eutree.world_model import ActionTree
from eutree.world_model.action_trees import n_leaves
from eutree.world_model.rollouts import Rollouts

TRIES = 1000
DRAWN = 4  # times that all chance of the rollouts is drawn again: one may be climbed on too long
ANNEALED = 4000  # changes tried
HOT = 0.02  # share of a typical return that a change may cost at first, about


def climbed(
    rollouts: Rollouts, policy: ActionTree, variation: Variation, *, price: float
) -> ActionTree:
    """Return a policy after many random changes, of which those stay that pay.

    Args:
        rollouts: Where to run rollouts.
        policy: The policy to start from.
        variation: Makes the changes.
        price: Return that a leaf must earn.
    """
    for _ in range(DRAWN):
        rollouts.redraw()
        rollouts.run(policy)
        for _ in range(TRIES // DRAWN):
            _try(rollouts, variation, price, 0.0)
        policy = rollouts.policy
    return policy


def annealed(
    rollouts: Rollouts, policy: ActionTree, variation: Variation, *, price: float, scale: float
) -> ActionTree:
    """Return the best of the policies that annealing comes by; few rollouts are enough.

    Arguments are those of ``climbed``; ``scale`` is a typical size of returns.
    """
    rollouts.redraw()
    rollouts.run(policy)
    best, worth, most = policy, 0.0, 0.0
    for k in range(ANNEALED):
        temperature = HOT * scale * (1.0 - k / ANNEALED) ** 3
        gain = _try(rollouts, variation, price, temperature)
        worth += gain
        if gain and worth > most:
            best, most = rollouts.policy, worth
    return best


def _try(rollouts: Rollouts, variation: Variation, price: float, temperature: float) -> float:
    """Change the policy of the rollouts if that pays or luck allows; return its gain."""
    challenger = variation.of(rollouts.policy, rollouts.observations)
    if challenger is None:
        return 0.0
    needed = price * (n_leaves(challenger) - n_leaves(rollouts.policy))
    allowed = needed - temperature * rollouts.generator.exponential()
    gain = rollouts.gain(challenger, hopeless=allowed)
    if not gain.complete or gain.mean <= allowed:
        return 0.0
    rollouts.run(challenger)
    return gain.mean - needed
