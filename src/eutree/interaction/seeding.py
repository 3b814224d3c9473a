"""Where the seed of an episode comes from: a pure function of the run's seed and its number.

So episode k can be replayed, or a run resumed at it, without knowing anything of those before.
"""

import numpy as np

from eutree.validation import check_integer, check_seed


def episode_seed(seed: int, episode: int, stream: int = 0) -> int:
    """Return the seed that ``reset`` gets for one episode of a run.

    Args:
        seed: Seed of the run, evaluation or recording.
        episode: Number of the episode, from 0.
        stream: What the episodes are for, so that episodes of different uses never coincide.
    """
    entropy = (check_seed(seed), check_integer("stream", stream), check_integer("episode", episode))
    return int(np.random.SeedSequence(entropy).generate_state(1)[0])
