"""How much is played beside what is learned from: in proportion, where episodes are dear.

A run of few episodes, in an environment whose episodes run one by one, was made short because they
are dear. What its frozen trees play follows from the number of its episodes alone, so the same seed
gives the same bytes on any machine; only where minutes are the budget the clock has a say, too.
"""

USUAL = 400  # episodes of a run; in one of so many, or more, evaluation is no matter of proportion
FEW = 40  # episodes up to which half as many are played beside
EVERY, EPISODES = 20, 100  # of the frozen evaluations, where they are not dear
ENOUGH = 5  # episodes of an evaluation, where a quarter of the allowance is less
END = 0.2  # of the minutes: what is kept for evaluation at the end
ALONG = 0.2  # of the time so far, that evaluations along the way may take


def allowance(lived: float) -> int:
    """Return the most episodes that are played beside so many that are learned from.

    Half as many up to 40, and from there on as the square.

    >>> [allowance(lived) for lived in (10, 40, 100, 400)]
    [5, 20, 125, 2000]
    """
    return int(lived * max(lived, FEW) / (2 * FEW))


def is_dear(expected: float | None) -> bool:
    """Return whether a run of so many episodes, which run one by one, has to keep to proportion."""
    return expected is not None and 0 < expected < USUAL


def curve_of(
    every: int | None, episodes: int | None, expected: int | None, *, decides: bool
) -> tuple[int, int]:
    """Return the episodes between two evaluations, and those of each, as far as nobody named them.

    Args:
        every: What was named, if it was.
        episodes: What was named, if it was.
        expected: Episodes of the run, where it has to keep to proportion.
        decides: Whether evaluations along the way decide; else the first and the last do.
    """
    if expected is None or not is_dear(expected):
        return every or EVERY, episodes or EPISODES
    every = every or (EVERY if decides else USUAL)
    most, points = allowance(expected), 1 - (-expected // every)
    fair = max(most // (4 * points), min(ENOUGH, most // (2 * points)), 1)
    return every, episodes or min(fair, EPISODES)


def left(lived: float, played: int) -> int:
    """Return how many episodes may still be played at the end of a run.

    A quarter of the allowance is, whatever was played before: that was asked for by name.

    Args:
        lived: Episodes that were learned from, races included.
        played: Episodes that were played beside.
    """
    return max(allowance(lived) - played, allowance(lived) // 4, 2)


def within(seconds: float, played: int, took: float) -> int:
    """Return how many episodes, or steps, so much time is enough for, one at least.

    Args:
        seconds: The time.
        played: Those that were played already.
        took: Seconds that those took.
    """
    return max(int(seconds * played / took), 1) if played and took > 0.0 else 1
