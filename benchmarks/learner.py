"""What learning and deciding cost: the learner's own time per step, memory, prediction, import.

    python benchmarks/learner.py [--steps 100000] [--preset default] [--offline 1000000]

The learner's own cost is the CPU time of a learning run minus that of the same environment steps
replayed without a learner, in the same process. Everything else is a ratio to scikit-learn or
Gymnasium in the same run.
"""

import argparse
import resource
import subprocess
import sys
import time
from dataclasses import replace
from statistics import median

import gymnasium
import numpy as np
from sklearn.tree import DecisionTreeClassifier

import eutree
from eutree.data import Demonstrations, Episode
from eutree.interaction import GuardedEnv, describe, episode_seed
from eutree.learning import c_u_tree, preset
from eutree.learning.presets import PRESETS
from eutree.training.run import EXPANSION_STREAM, EXPLORATION_STREAM, TRAINING_STREAM, generator_of


def learner_cost(name: str, steps: int, marks: list[int]) -> list[tuple[int, float, int]]:
    """Return (steps, microseconds a step since the last mark, leaves) at each mark."""
    env = GuardedEnv(gymnasium.make("eutree/Evasion2-v0", disable_env_checker=True))
    settings = replace(preset(name))
    learner = c_u_tree(env.schema, settings)
    rows, spent, taken, total, episode = [], 0.0, 0, 0, 0
    while total < steps:
        seed = episode_seed(0, episode, TRAINING_STREAM)
        actions = []
        start = time.thread_time()
        learner.begin_episode(env.reset(seed), generator_of(0, EXPLORATION_STREAM, episode))
        ended = False
        while not ended:
            action = learner.act()
            observation, reward, terminated, truncated, _ = env.step(action)
            learner.observe(action, reward, observation, terminated=terminated, truncated=truncated)
            actions.append(action)
            ended = terminated or truncated
        episode += 1
        if episode % settings.gathering_episodes == 0:
            learner.expand(generator_of(0, EXPANSION_STREAM, episode))
        spent += time.thread_time() - start
        start = time.thread_time()
        env.reset(seed)
        for action in actions:
            env.step(action)
        spent -= time.thread_time() - start
        total, taken = total + len(actions), taken + len(actions)
        if marks and total >= marks[0]:
            rows.append((marks.pop(0), 1e6 * spent / taken, learner.tree.n_leaves))
            spent, taken = 0.0, 0
    print(
        f"| memory per stored transition, d = 3 | {learner.history.n_bytes_per_transition:.0f} "
        "bytes | <= 120 bytes |"
    )
    return rows


def paired(ours, theirs, repeats: int = 9) -> float:
    """Return the median ratio of CPU times, the two measured in turns."""
    ratios = []
    for _ in range(repeats):
        times = []
        for function in (ours, theirs):
            start = time.thread_time()
            function()
            times.append(time.thread_time() - start)
        ratios.append(times[0] / times[1])
    return median(ratios)


def prediction() -> tuple[float, float]:
    """Return the ratios to scikit-learn of one prediction and of a million."""
    generator = np.random.default_rng(0)
    rows = generator.random((20_000, 3))
    labels = (np.sin(9 * rows[:, 0]) + rows[:, 1] > rows[:, 2]).astype(int)
    theirs = DecisionTreeClassifier(max_leaf_nodes=30, random_state=0).fit(rows, labels)
    grown = eutree.C45Classifier(min_objects=150).fit(rows, labels)
    tree, actions = grown.to_decision_tree()
    ours = eutree.TreePolicy(tree, actions, eutree.Schema.anonymous(3, 2))
    print(f"| leaves in the prediction rows: eutree, scikit-learn | {ours.n_leaves}, "
          f"{theirs.get_n_leaves()} | |")  # fmt: skip
    one, many = rows[:1], generator.random((1_000_000, 3))
    first = rows[0]
    single = paired(
        lambda: [ours.predict(first) for _ in range(2000)],
        lambda: [theirs.predict(one) for _ in range(2000)],
        repeats=5,
    )
    ours.predict(many[:10])
    return single, paired(lambda: ours.predict(many), lambda: theirs.predict(many))


def import_ratio() -> float:
    """Return the wall time of ``import eutree`` over that of ``import gymnasium``."""

    def timed(module: str) -> float:
        code = f"import time; t = time.perf_counter(); import {module}; "
        code += "print(time.perf_counter() - t)"
        out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        return float(out.stdout)

    return median(timed("eutree") / timed("gymnasium") for _ in range(7))


def many_episodes(n_transitions: int) -> Demonstrations:
    """Return recorded episodes of a careless gate rule in 2-Evasion."""
    env = gymnasium.make("eutree/Evasion2-v0")
    copies = 1000
    vector = gymnasium.make_vec(
        "eutree/Evasion2-v0", num_envs=copies, vectorization_mode="vector_entry_point"
    )
    gate = eutree.experts.wait_at_crossing(env)
    generator = np.random.default_rng(0)
    episodes: list[Episode] = []
    total, first_seed = 0, 0
    while total < n_transitions:
        observation, _ = vector.reset(seed=first_seed)
        first_seed += copies
        steps = [(observation, None, None, None, None)]
        running = np.ones(copies, dtype=bool)
        lengths = np.zeros(copies, dtype=int)
        terminal = np.zeros(copies, dtype=bool)
        while running.any():
            action = np.asarray(gate.predict(observation)[0])
            random = generator.random(copies) < 0.3
            action = np.where(random, generator.integers(0, 2, copies), action)
            observation, reward, terminated, truncated, _ = vector.step(action)
            steps.append((observation.copy(), action, reward, terminated, truncated))
            ended = running & (terminated | truncated)
            lengths[ended] = len(steps) - 1
            terminal[ended] = terminated[ended]
            running &= ~ended
        o = np.array([step[0] for step in steps])
        a = np.array([step[1] for step in steps[1:]])
        r = np.array([step[2] for step in steps[1:]])
        for i, length in enumerate(lengths):
            episodes.append(
                Episode(
                    o[: length + 1, i], a[:length, i], r[:length, i],
                    terminated=bool(terminal[i]), truncated=not terminal[i],
                )
            )  # fmt: skip
        total += int(lengths.sum())
    return Demonstrations(tuple(episodes), describe(env))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--preset", default="default", choices=sorted(PRESETS))
    parser.add_argument("--offline", type=int, default=0)
    arguments = parser.parse_args()
    print("# What learning and deciding cost\n")
    print(f"Made by `python benchmarks/learner.py --steps {arguments.steps} --preset "
          f"{arguments.preset} --offline {arguments.offline}`.\n")  # fmt: skip
    print("| what | measured | target |")
    print("|---|---|---|")
    learner_cost(arguments.preset, 3_000, [])
    marks = [mark for mark in (10_000, 30_000, 100_000, 300_000, 1_000_000)
             if mark <= arguments.steps]  # fmt: skip
    for mark, cost, leaves in learner_cost(arguments.preset, arguments.steps, marks):
        print(f"| learner's own cost a step up to {mark:,} steps, {leaves} leaves | {cost:.1f} us "
              "| <= 20 us |")  # fmt: skip
    single, many = prediction()
    print(f"| predict one observation / scikit-learn | 1/{1 / single:.0f} | <= 1/20 |")
    print(f"| predict 10^6 observations, 30 leaves / scikit-learn | {many:.2f} | <= 0.5 |")
    print(f"| import eutree / import gymnasium | {import_ratio():.2f} | <= 1.5 |")
    if arguments.offline:
        recorded = many_episodes(arguments.offline)
        start = time.thread_time()
        result = eutree.learn(
            None, demonstrations=recorded, learner="c-u-tree", preset=arguments.preset
        )
        spent = time.thread_time() - start
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        print(f"| offline learning from {recorded.n_transitions:,} transitions, "
              f"{result.policy.n_leaves} leaves | {spent:.0f} s CPU, peak {peak:.2f} GiB | "
              "<= 60 s, <= 1.5 GB |")  # fmt: skip


if __name__ == "__main__":
    main()
