"""What learning and deciding cost: the learner's own time per step, memory, prediction, import.

    python benchmarks/learner.py [PART ...] [--steps 1000000] [--offline 1000000]

prints all rows of docs/results/learner-speed.md, each part in a process of its own; PART may also
be ``paper`` or ``corrected``, whole runs of these presets; ``profile-maximal``, ``profile-naive``,
``profile-paper`` or ``profile-corrected``: what the learner's own cost goes into, part by part; or
``sorting``: how much of the search of a leaf is sorting. The learner's own cost is the CPU time of
a learning run minus that of the same environment steps replayed without a learner, in the same
process, expansions included. Everything else is CPU time, or a ratio in the same run.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import partial, wraps
from statistics import median

import gymnasium
import numpy as np
from sklearn.tree import DecisionTreeClassifier

import eutree
from eutree.data import Demonstrations, Episode
from eutree.interaction import GuardedEnv, describe, episode_seed
from eutree.interaction.episode import Stream
from eutree.learners import CORRECTED, DEFAULT, PAPER, Method, Problem, Start, Step, UTree
from eutree.mdp import TabularMDP
from eutree.splitting import KolmogorovSmirnov, Maximal, Naive
from eutree.splitting._kernels import best_of_sample
from eutree.splitting._kernels_sorting import sorted_labels
from eutree.training.phases import generator_of

SPLITS = {
    "maximal": replace(CORRECTED, significance=Maximal()),
    "naive": replace(CORRECTED, significance=Naive()),
    "paper": PAPER,
    "corrected": CORRECTED,
}
MOST = {"paper": 100_000}  # steps: every expansion tests every leaf, so runs cost their square
OF = {
    "maximal": "splits without planning, maximal test",
    "naive": "splits without planning, naive test",
    "paper": "preset `paper`",
    "corrected": "preset `corrected`",
}
MARKS = (10_000, 100_000, 1_000_000)
CLOCKED = (
    (UTree, "start_episode"), (UTree, "act"), (UTree, "observe"), (UTree, "end_episode"),
    (UTree, "update"), (UTree, "_due"),
    (KolmogorovSmirnov, "best"), (Maximal, "p_value"), (Naive, "p_value"), (UTree, "_split"),
    (TabularMDP, "solve"),
)  # fmt: skip
PLANNED = 10_000  # steps with planning
EVASION, LANDER = "eutree/Evasion2-v0", "LunarLander-v3"
FIRST_SPLIT = """
import resource, numpy
from eutree.splitting import best_split
x = numpy.random.default_rng(0).random((500, 4))
assert best_split(x, 1.0 * (x[:, 1] > 0.3)).feature == 1
usage = resource.getrusage(resource.RUSAGE_SELF)
print(usage.ru_utime + usage.ru_stime)
"""


def learner_cost(
    method: Method,
    steps: int,
    marks: tuple[int, ...],
    parts: Counter[str] | None = None,
    task: str = EVASION,
) -> Iterator[tuple[int, float, int, float, Counter[str]]]:
    """Yield what learning has cost at each mark, as soon as it is reached.

    That is (steps, microseconds a step so far, leaves, bytes a transition, seconds by part).
    """
    env = GuardedEnv(gymnasium.make(task, disable_env_checker=True))
    learner = method.start(Problem(env.schema, env.spec), Start())
    spent, total, episode, left = 0.0, 0, 0, [mark for mark in marks if mark <= steps]
    while total < steps:
        seed = episode_seed(0, episode, Stream.TRAINING)
        actions = []
        start = time.thread_time()
        learner.start_episode(env.reset(seed), generator_of(0, Stream.EXPLORATION, episode))
        ended = False
        while not ended:
            action = learner.act()
            observation, reward, terminated, truncated, _ = env.step(action)
            learner.observe(Step(action, reward, observation, terminated, truncated))
            actions.append(action)
            ended = terminated or truncated
        learner.end_episode()
        episode += 1
        if episode % method.gathering_episodes == 0:
            learner.update(generator_of(0, Stream.EXPANSION, episode))
        spent += time.thread_time() - start
        start = time.thread_time()
        env.reset(seed)
        for action in actions:
            env.step(action)
        spent -= time.thread_time() - start
        total += len(actions)
        if left and total >= left[0]:
            stored = learner.history
            memory, cost = stored.columns.nbytes / stored.size, 1e6 * spent / total
            yield left.pop(0), cost, learner.tree.n_leaves, memory, Counter(parts or {})


def clocked(owner: type, name: str, seconds: Counter[str]) -> None:
    """Let every call of a method add its CPU time to its part, the calls inside it included."""
    method = getattr(owner, name)

    @wraps(method)
    def timed(*arguments, **options):
        start = time.thread_time()
        try:
            return method(*arguments, **options)
        finally:
            seconds[f"{owner.__name__}.{name}"] += time.thread_time() - start

    setattr(owner, name, timed)


def first_split() -> tuple[float, float]:
    """Return the CPU seconds of a process's first split, without and with a cache of kernels."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder}
        run = [sys.executable, "-c", FIRST_SPLIT]
        cold, warm = (
            float(subprocess.run(run, env=environment, capture_output=True, check=True).stdout)
            for _ in range(2)
        )
    return cold, warm


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
    row("leaves in the prediction rows: eutree, scikit-learn",
        f"{ours.n_leaves}, {theirs.get_n_leaves()}", "")  # fmt: skip
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


def print_splits(name: str, arguments: argparse.Namespace) -> None:
    settings, steps = SPLITS[name], min(arguments.steps, MOST.get(name, arguments.steps))
    list(learner_cost(settings, 3_000, ()))  # compiles
    for mark, cost, leaves, memory, _ in learner_cost(settings, steps, MARKS):
        what = f"learner's own cost a step, {OF[name]}, {mark:,} steps, {leaves:,} leaves"
        row(what, f"{cost:.1f} us", "<= 12 us")
        row("memory per stored transition, d = 3", f"{memory:.0f} bytes", "<= 120 bytes")


def print_profile(name: str, arguments: argparse.Namespace) -> None:
    """Print microseconds a step of each part, between a mark and the one before it."""
    settings, seconds = SPLITS[name], Counter()
    steps = min(arguments.steps, MOST.get(name, arguments.steps))
    list(learner_cost(settings, 3_000, ()))
    for owner, method in CLOCKED:
        clocked(owner, method, seconds)
    rows = list(learner_cost(settings, steps, MARKS, seconds))
    print("| part | " + " | ".join(f"to {row[0]:,}" for row in rows) + " |")
    for owner, method in CLOCKED:
        part, cells, before = f"{owner.__name__}.{method}", [], (0, Counter())
        for mark, *_, by_part in rows:
            spent = by_part[part] - before[1][part]
            cells.append(f"{1e6 * spent / (mark - before[0]):.2f}")
            before = (mark, by_part)
        print(f"| `{part}` | " + " | ".join(cells) + " |")


def print_sorting() -> None:
    """Print the share of a leaf's search that sorting its three attributes takes."""
    generator = np.random.default_rng(0)
    for n in (50, 100, 1_000, 10_000, 100_000):
        x, rows = generator.random((n, 3)), np.arange(n)
        returns, differs = x[:, 0].round(1) + generator.random(n), x[:, 0] > 0
        search = repeated(100_000 // n, best_of_sample, x, returns, rows, 10, False, 0.0, 0, 192)
        sort, call = (
            repeated(100_000 // n, sorted_labels, returns[:m], rows[:m], rows[:m].copy(),
                     rows[:m].copy(), rows[:m].copy(), differs[:m])
            for m in (n, 1)
        )  # fmt: skip
        share = 3 * (paired(sort, search) - paired(call, search))
        row(f"three sorts / search of {n:,} tuples", f"{share:.2f}", "")


def repeated(times: int, function, *arguments):
    """Return a function that calls another so many times."""
    return lambda: [function(*arguments) for _ in range(times)]


def print_planning(task: str, target: str) -> None:
    list(learner_cost(DEFAULT, 1_000, (), task=task))
    (_, cost, leaves, _, _), = learner_cost(DEFAULT, PLANNED, (PLANNED,), task=task)  # fmt: skip
    row(f"learner's own cost a step, `default` preset with planning, {task}, {PLANNED:,} steps, "
        f"{leaves} leaves", f"{cost:.0f} us", target)  # fmt: skip


def print_prediction() -> None:
    single, many = prediction()
    row("predict one observation / scikit-learn", f"1/{1 / single:.0f}", "<= 1/20")
    row("predict 10^6 observations, about 30 leaves / scikit-learn", f"{many:.2f}", "<= 0.5")


def print_first_use() -> None:
    row("import eutree / import gymnasium", f"{import_ratio():.2f}", "<= 1.5")
    cold, warm = first_split()
    row("first split of a process, kernels compiled", f"{cold:.1f} s", "<= 15 s")
    row("first split of a process, kernels cached", f"{warm:.1f} s", "<= 2 s")


def print_offline(name: str, n_transitions: int) -> None:
    recorded = many_episodes(n_transitions)
    start = time.thread_time()
    result = eutree.learn(None, demonstrations=recorded, start="demos", method=SPLITS[name])
    spent = time.thread_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    row(
        f"offline learning from {recorded.n_transitions:,} transitions, {name} test, "
        f"{result.policy.n_leaves:,} leaves",
        f"{spent:.0f} s, {peak:.2f} GB",
        "<= 60 s, <= 1.5 GB",
    )


def row(what: str, measured: str, target: str) -> None:
    print(f"| {what} | {measured} | {target} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--offline", type=int, default=1_000_000)
    parser.add_argument("parts", nargs="*", help="of: " + ", ".join(PARTS))
    arguments = parser.parse_args()
    if len(arguments.parts) == 1:
        PARTS[arguments.parts[0]](arguments)
        return
    print("| what | measured | target |\n|---|---|---|", flush=True)
    sizes = ["--steps", str(arguments.steps), "--offline", str(arguments.offline)]
    for part in arguments.parts or ROWS:
        subprocess.run([sys.executable, __file__, part, *sizes], check=True)


PARTS = {
    "sorting": lambda _: print_sorting(),
    **{f"profile-{name}": partial(print_profile, name) for name in SPLITS},
    **{name: partial(print_splits, name) for name in SPLITS},
    "planning": lambda _: print_planning(EVASION, "<= 300 us"),
    "planning-8": lambda _: print_planning(LANDER, "<= 1000 us"),
    "prediction": lambda _: print_prediction(),
    "first-use": lambda _: print_first_use(),
    "offline-maximal": lambda arguments: print_offline("maximal", arguments.offline),
    "offline-naive": lambda arguments: print_offline("naive", arguments.offline),
}
ROWS = [part for part in PARTS if part != "sorting" and not part.startswith("profile")]


if __name__ == "__main__":
    main()
