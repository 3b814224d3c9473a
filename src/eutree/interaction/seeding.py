"""Where the seed of an episode comes from: a pure function of the run's seed and its number.

So episode k can be replayed, or a run resumed at it, without knowing anything of those before.
It has 31 bits: simulators written in C++ keep their seed in a signed integer of 32.
"""

from enum import IntEnum, unique

import numpy as np

from eutree.validation import check_integer, check_seed

MAX_EPISODE_SEED = 2**31 - 1


@unique
class Stream(IntEnum):
    """What random numbers are for: two uses never draw the same ones from one seed."""

    EPISODES = 0  # where only one use is made of a seed
    RECORDING = 1
    TRAINING = 2  # the starts of a run's episodes
    EXPLORATION = 3  # its random actions
    EXPANSION = 4  # its updates
    EVALUATION = 5
    PERSON = 6  # the starts that a person gets
    WATCHING = 7  # episodes shown in a report
    JUDGING = 8  # a run's last tree against its first
    HOLD_OUT = 9
    START = 10  # random trees to start from
    COMPRESSION = 11  # races between prunings
    FRONT = 12  # the best tree of each size at the end of a run
    GATHERING = 21  # DAgger's episodes
    VALIDATION = 22
    RACING = 31
    PROPOSING = 32  # variants of a tree
    COMPARING = 33  # starts at which a learner compares trees
    FITTING = 41  # candidates of a fit that are played
    SELECTION = 42  # the best of many runs is chosen
    WINNER = 43  # and judged
    AGAINST = 44  # a result against another policy


def episode_seed(seed: int, episode: int, stream: int = Stream.EPISODES) -> int:
    """Return the seed that ``reset`` gets for one episode of a run, from 0 to 2**31 - 1.

    Args:
        seed: Seed of the run, evaluation or recording.
        episode: Number of the episode, from 0.
        stream: What the episodes are for, so that episodes of different uses never coincide.
    """
    entropy = (check_seed(seed), check_integer("stream", stream), check_integer("episode", episode))
    return int(np.random.SeedSequence(entropy).generate_state(1)[0]) & MAX_EPISODE_SEED
