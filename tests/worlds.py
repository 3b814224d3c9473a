"""Small worlds that learners live in, without an environment."""

import numpy as np

from eutree.learners import Problem, Start, Step
from eutree.schema import Schema


class Walk:
    """A walk of ten steps to a goal; action 1 goes on, action 0 stays and costs 2."""

    problem = Problem(Schema.anonymous(2, 2))

    def __init__(self, generator):
        self.generator = generator

    def run(self, learner, generator, steps=40):
        """Let a learner live through an episode of at most so many steps."""
        at = 0.0
        learner.start_episode(np.array([at, self.generator.random()]), generator)
        for step in range(steps):
            action = learner.act()
            at += action * (0.9 + 0.2 * self.generator.random())
            done = at >= 10
            reward = 100.0 if done else -2.0 * (1 - action)
            observation = np.array([at, self.generator.random()])
            cut = step == steps - 1 and not done
            learner.observe(Step(action, reward, observation, terminated=done, truncated=cut))
            if done or cut:
                learner.end_episode()
                return


def learned_to_walk(method, seed=0, phases=3, episodes=8):
    """Return a learner after so many phases of so many walks."""
    learner = method.start(Walk.problem, Start())
    world = Walk(np.random.default_rng(seed))
    generator = np.random.default_rng(seed + 1)
    for _ in range(phases):
        for _ in range(episodes):
            world.run(learner, generator)
        learner.update(generator)
    return learner


def take(learner, *steps):
    """Let a learner observe steps of (action, reward, observation, terminated, truncated)."""
    for action, reward, observation, terminated, truncated in steps:
        learner.observe(Step(action, reward, np.array(observation), terminated, truncated))
        if terminated or truncated:
            learner.end_episode()
