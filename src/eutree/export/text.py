"""Plain rules: what ``str(policy)`` shows."""

from eutree.policies import TreePolicy


def to_text(policy: TreePolicy) -> str:
    """Return the policy as nested rules with names and units; thresholds are exact."""
    return f"{policy}\n"
