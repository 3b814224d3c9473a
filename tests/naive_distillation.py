"""DAgger as plainly as it can be written: the twin of ``eutree.distillation``."""

import numpy as np

from eutree.c45 import grow
from eutree.interaction import episode_seed
from eutree.interaction.episode import Stream


def play(env, decide, seed):
    """Return the observations, the actions and the return of one episode."""
    observation, _ = env.reset(seed=seed)
    observations, actions, total = [], [], 0.0
    while True:
        action = decide(observation)
        observations.append(observation.astype(float))
        actions.append(action)
        observation, reward, terminated, truncated, _ = env.step(action)
        total += float(reward)
        if terminated or truncated:
            return observations, actions, total


def naive_dagger(rule, env, *, iterations, episodes, validation_episodes, seed):
    """Return the rows [N] of each round, and the mean returns of the validations."""
    rows, labels, sizes, returns = [], [], [], []
    decide = rule
    for k in range(episodes):
        observations, actions, _ = play(env, rule, episode_seed(seed, k, Stream.RECORDING))
        rows += observations
        labels += actions
    for number in range(iterations):
        if number:
            for k in range(episodes):
                at = number * episodes + k
                visited, _, _ = play(env, decide, episode_seed(seed, at, Stream.GATHERING))
                rows += visited
                labels += [rule(observation) for observation in visited]
        tree, chosen = grow(np.array(rows), labels, n_classes=2).to_decision_tree()

        def act(observation, tree=tree, chosen=chosen):
            return int(chosen[tree.leaf_of(observation.astype(float).tolist())])

        validation = episode_seed(seed, 0, Stream.VALIDATION)
        decide = act
        found = [
            play(env, decide, episode_seed(validation, k))[2] for k in range(validation_episodes)
        ]
        sizes.append(len(rows))
        returns.append(float(np.mean(found)))
    return sizes, returns
