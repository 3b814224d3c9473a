"""What a step of learning costs with each method, beside the Continuous U-Tree in the same process.

Run: python benchmarks/methods_cost.py [--methods NAME ...] [--out docs/results]

Each method learns from the expert tree and the demonstrations, with its default choices, for 60
episodes or, where they are long, 20; every method from the same demonstrations. Counted is the CPU
time that the learner itself takes, the environment's not: *acting* is choosing actions and taking
what came of them, *updating* what happens between episodes, per environment step of all; *deciding*
is one observation by its own policy. Two episodes and an update go before, to compile.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.data import Demonstrations
from eutree.envs.experts import experts_for
from eutree.interaction import GuardedEnv, episode_seed
from eutree.interaction.episode import Stream
from eutree.learners import METHODS, Problem, Step, start_of
from eutree.learners.learner import HasPolicy, Learner
from eutree.training.phases import generator_of

PEER = "u-tree"
TASKS = {"2-Evasion": ("eutree/Evasion2-v0", 60), "MountainCar": ("MountainCar-v0", 20)}
LEFT_OUT = "distilled-dqn"  # it trains a network before its first step
DECISIONS = 200


@dataclass(frozen=True)
class Cost:
    """CPU microseconds: of acting and updating a step, and of one decision; leaves at the end."""

    acting: float
    updating: float
    deciding: float
    n_leaves: int

    @property
    def total(self) -> float:
        """Of a step, updates included."""
        return self.acting + self.updating


def cost(name: str, env: GuardedEnv, demonstrations: Demonstrations, episodes: int) -> Cost:
    """Return what a method costs, over so many episodes of learning and the updates between."""
    problem = Problem(env.schema, env.spec)
    start = start_of(
        "tree+demos",
        problem,
        demonstrations=demonstrations,
        generator=np.random.default_rng(0),
    )
    method = METHODS[name]()
    learner = method.start(problem, start)
    acting = updating = 0.0
    taken = 0
    for episode in range(episodes):
        spent, length = _episode(learner, env, episode)
        acting, taken = acting + spent, taken + length
        if (episode + 1) % method.gathering_episodes == 0 or episode + 1 == episodes:
            begin = time.thread_time()
            learner.update(generator_of(0, Stream.EXPANSION, episode))
            updating += time.thread_time() - begin
    decisions = learner.decisions()
    policy: Any = decisions.policy(problem)
    if isinstance(learner, HasPolicy):
        policy = learner.own_policy()
    return Cost(
        acting=1e6 * acting / taken,
        updating=1e6 * updating / taken,
        deciding=_deciding(policy, demonstrations.observations),
        n_leaves=decisions.tree.n_leaves,
    )


def _episode(learner: Learner, env: GuardedEnv, episode: int) -> tuple[float, int]:
    """Live through an episode; return the learner's CPU seconds and the steps."""
    observation = env.reset(episode_seed(0, episode, Stream.TRAINING))
    begin = time.thread_time()
    learner.start_episode(observation, generator_of(0, Stream.EXPLORATION, episode))
    spent, length, ended = time.thread_time() - begin, 0, False
    while not ended:
        begin = time.thread_time()
        action = learner.act()
        spent += time.thread_time() - begin
        observation, reward, terminated, truncated, info = env.step(action)
        step, ended = (
            Step(action, reward, observation, terminated, truncated, info),
            terminated or truncated,
        )
        begin = time.thread_time()
        learner.observe(step)
        if ended:
            learner.end_episode()
        spent += time.thread_time() - begin
        length += 1
    return spent, length


def _deciding(policy: Any, observations: Any) -> float:
    """Return the CPU microseconds of one decision, one observation at a time."""
    state, first = None, np.ones(1, dtype=bool)
    begin = time.thread_time()
    for row in range(DECISIONS):
        observation = observations[row % len(observations)]
        _, state = policy.predict(observation, state=state, episode_start=first[0])
        first[0] = False
    return 1e6 * (time.thread_time() - begin) / DECISIONS


def table(task: str, methods: list[str]) -> list[str]:
    """Return the rows of one task."""
    name_of_env, episodes = TASKS[task]
    env = GuardedEnv(gymnasium.make(name_of_env))
    expert = next(iter(experts_for(name_of_env).values()))
    demonstrations = eutree.record(gymnasium.make(name_of_env), expert, episodes=15, seed=0)
    found = {}
    for name in [PEER, *(m for m in methods if m != PEER)]:
        cost(name, env, demonstrations, 2)
        found[name] = cost(name, env, demonstrations, episodes)
    peer = found[PEER]
    return [
        f"| {task} | `{name}` | {c.acting:,.0f} | {c.updating:,.0f} | {c.total / peer.total:.2g} "
        f"| {c.deciding:,.0f} | {c.deciding / peer.deciding:.2g} | {c.n_leaves} |"
        for name, c in found.items()
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    known = [name for name in METHODS if name != LEFT_OUT]
    parser.add_argument("--methods", nargs="+", choices=known, default=known)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows = [row for task in TASKS for row in table(task, options.methods)]
    text = f"""# What a step costs with each method

Made by `python benchmarks/methods_cost.py --out docs/results`: 60 episodes of 2-Evasion and 20 of MountainCar from the expert tree and 15
demonstrations, default choices, an update every 20 episodes, one process. CPU microseconds of the learner itself, the environment's step not counted: *acting* is
choosing actions and taking what came of them, *updating* what happens between episodes, both per environment step; *deciding* is
one observation by the method's own policy. Ratios are to `{PEER}`, the paper's method, in the same process; a busy machine changes
the microseconds more than the ratios.

| task | method | acting | updating | both / `{PEER}` | deciding | deciding / `{PEER}` | leaves |
|---|---|---|---|---|---|---|---|
{chr(10).join(rows)}

* `planning` and `vrd` plan in a world model at every update, whatever the number of steps since the last one.
* `vrd`, `parti-game` and `vqql` decide by something that is no tree; the tree that C4.5 makes of them, which is what is exported,
  decides as fast as that of `{PEER}`.
* `{LEFT_OUT}` is left out: it trains a network before its first step ([its page](../distillation.md)).
"""  # noqa: E501 - lines of a page
    print(text)
    if options.out is not None:
        (options.out / "methods-cost.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
