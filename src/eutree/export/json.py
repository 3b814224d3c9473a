"""The policy file itself: every number exact, nothing left out."""

from eutree.policies import TreePolicy


def to_json(policy: TreePolicy) -> str:
    """Return the document that ``TreePolicy.load`` reads, byte for byte what ``save`` writes."""
    return policy.to_bytes().decode("utf-8")
