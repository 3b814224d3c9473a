"""Words that agree with a number."""

_PLURALS = {"leaf": "leaves"}


def counted(count: int, noun: str) -> str:
    """Return a count with its noun: ``1 leaf``, ``2 leaves``, ``0 episodes``."""
    return f"{count} {noun if count == 1 else _PLURALS.get(noun, noun + 's')}"
