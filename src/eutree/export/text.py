"""Plain rules, as ``str(policy)`` shows them, with exact thresholds."""

from eutree.policies import TreePolicy
from eutree.trees.text import printable, rules


def to_text(policy: TreePolicy) -> str:
    """Return the policy as nested rules with names and units; thresholds are exact."""
    names = [printable(name) for name in policy.schema.actions]
    leaves = [names[action] for action in policy.actions]
    return rules(policy.tree, policy.schema, leaves, exact=True) + "\n"
