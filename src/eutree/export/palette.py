"""Colours of actions: distinct for people with any colour vision, readable under dark text."""

# After Okabe and Ito, lightened until black text on each has a contrast of at least 7 to 1.
FILLS = (
    "#f6b26b",
    "#8ecae6",
    "#7fd1ae",
    "#f3e27a",
    "#d9a6e0",
    "#a9b8f5",
    "#f0a8a0",
    "#c9cfd6",
)


def fill(action: int) -> str:
    """Return the fill colour of an action's leaves; colours repeat after eight actions."""
    return FILLS[action % len(FILLS)]
