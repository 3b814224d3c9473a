"""A walk on a line, and episodes of it, real and imagined."""

import numpy as np

from eutree.policy_search.improvement import Improvement
from eutree.world_model import Transitions, fit_world_models
from eutree.world_model.action_trees import nested
from eutree.world_model.rollouts import PairedRollouts
from tests import naive_world_model

STAY, GO = 0, 1


def walks(n_episodes, seed, *, pit=(5.0, 7.0), policy=None):
    """A walk to 10 past a pit that opens and closes: feature 1 swings between -1 and 1.

    Being in the pit while feature 1 is above 0 ends the walk at -50; the goal earns 100.
    """
    generator = np.random.default_rng(seed)
    rows = []
    for episode in range(n_episodes):
        at, phase = 0.0, generator.uniform(-1, 1)
        for _ in range(40):
            before = (at, phase)
            action = int(generator.random() < 0.7) if policy is None else policy(before)
            at += action * 2.0 * (1 + 0.01 * generator.standard_normal())
            phase = -phase
            fell = pit[0] < at <= pit[1] and phase > 0
            ended = fell or at >= 10
            reward = -50.0 if fell else (100.0 if at >= 10 else -2.0 * (1 - action))
            rows.append((before, action, reward, (at, phase), ended, episode))
            if ended:
                break
    columns = list(zip(*rows, strict=True))
    return Transitions(
        np.array(columns[0]),
        np.array(columns[1]),
        np.array(columns[2]),
        np.array(columns[3]),
        np.array(columns[4]),
        np.array(columns[5]),
        2,
    )


def mean_return(tree, seed=9, n_episodes=400):
    policy = nested(tree)
    data = walks(n_episodes, seed, policy=lambda o: naive_world_model.act(policy, o))
    return data.episode_returns.mean()


def model_of(data, gap=0.5):
    return fit_world_models(data, [gap])[0]


def rollouts_of(data, n_episodes=400, seed=0, gap=0.5):
    return PairedRollouts(model_of(data, gap), n_episodes, 1.0, np.random.default_rng(seed))


class Unimproved(Improvement):
    """Leaves each policy as it is, so that it can be told which one was begun from."""

    def improve(self, rollouts, policy, scale, *, begin=False):
        return policy
