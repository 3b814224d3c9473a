"""What exported programs say of actions that may be masked where the policy acts."""

ASSUMPTION = (
    "Actions may be masked where it acts; this takes all to be allowed. "
    "The next best ones are in the exports to C and Python."
)
