"""Journals of demonstrations."""

from eutree.data.journal import EpisodeJournal


def journal_of(episode, path):
    """Write the episode to a journal, step by step."""
    journal = EpisodeJournal(
        path, episode.observations[0], seed=episode.seed, extras=dict(episode.extras)
    )
    for t in range(len(episode)):
        last = t == len(episode) - 1
        journal.append(
            int(episode.actions[t]),
            float(episode.rewards[t]),
            episode.observations[t + 1],
            terminated=episode.terminated and last,
            truncated=episode.truncated and last,
            steps={name: array[t].tolist() for name, array in episode.steps.items()},
        )
    return journal
