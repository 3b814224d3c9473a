"""Compare the exact solver with Gauss-Seidel value iteration and with quantecon.

Run: OMP_NUM_THREADS=1 python benchmarks/planning.py [--sizes 100 1000 10000] [--repeats 5]

Every method solves the same models from zero values to an error of 1e-6 in every value. A model
has 4 actions and 10 successors a pair; ``line``, ``plane`` and ``space`` lead only to near states
of a one-, two- or three-dimensional grid, as leaves of a continuous space do; ``episodic`` is a
plane that terminates with probability 0.02 a step. Printed are medians of thread CPU time over
interleaved rounds, and their ratios. quantecon's columns are empty where it is not installed.

``python benchmarks/planning.py --deviations 5`` measures something else: what single deviations
cost in the default method at two, seven and eight actions, with as many steps whatever the number
of actions (before) and with as many deviations (now), from the same seeds in turn in one process.
"""

import argparse
import importlib.util
import sys
import time
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numba
import numpy as np

import eutree
from eutree.mdp import Model, solve
from eutree.policy_search import improvement
from eutree.world_model.rollouts import PairedRollouts

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the examples

from examples import inventory, motor_currents

TOLERANCE = 1e-6
N_ACTIONS, N_SUCCESSORS = 4, 10
REACH = {"line": (1, 20), "plane": (2, 3), "space": (3, 2), "episodic": (2, 3)}


def near_successors(side: int, dimension: int, reach: int, generator: np.random.Generator):
    """Yield 10 distinct states near each state, for each of its actions."""
    places = np.stack(np.unravel_index(np.arange(side**dimension), (side,) * dimension), axis=1)
    for place in np.repeat(places, N_ACTIONS, axis=0):
        found = np.empty(0, np.int64)
        while len(found) < N_SUCCESSORS:
            steps = generator.integers(-reach, reach + 1, (4 * N_SUCCESSORS, dimension))
            near = np.clip(place + steps, 0, side - 1).T
            found = np.union1d(found, np.ravel_multi_index(near, (side,) * dimension))
        yield np.sort(generator.choice(found, N_SUCCESSORS, replace=False))


def random_model(family: str, size: int, generator: np.random.Generator) -> Model:
    """Return a model of about ``size`` states."""
    if family == "random":
        n_states = size
        successors = [
            np.sort(generator.choice(size, N_SUCCESSORS, replace=False))
            for _ in range(size * N_ACTIONS)
        ]
    else:
        dimension, reach = REACH[family]
        side = max(round(size ** (1 / dimension)), 2 * reach)
        n_states = side**dimension
        successors = list(near_successors(side, dimension, reach, generator))
    ends = 0.02 if family == "episodic" else 0.0
    shape = (n_states, N_ACTIONS)
    shares = generator.dirichlet(np.ones(N_SUCCESSORS), n_states * N_ACTIONS) * (1.0 - ends)
    return Model(
        indptr=np.arange(0, shares.size + 1, N_SUCCESSORS),
        successor=np.concatenate(successors),
        probability=shares.ravel(),
        termination=np.full(shape, ends),
        reward=generator.random(shape),
        visits=np.ones(shape, int),
    )


@numba.njit
def gauss_seidel(indptr, successor, probability, reward, discount, bound):
    n_states, n_actions = reward.shape
    values = np.zeros(n_states)
    while True:
        largest = 0.0
        for s in range(n_states):
            best = -np.inf
            for a in range(n_actions):
                p = s * n_actions + a
                total = 0.0
                for k in range(indptr[p], indptr[p + 1]):
                    total += probability[k] * values[successor[k]]
                best = max(best, reward[s, a] + discount * total)
            largest = max(largest, abs(best - values[s]))
            values[s] = best
        if largest <= bound:
            return values


def by_gauss_seidel(model: Model, discount: float) -> Callable[[], np.ndarray]:
    bound = TOLERANCE * (1.0 - discount) / discount if discount < 1 else 1e-12
    arrays = (model.indptr, model.successor, model.probability, model.reward)
    return lambda: gauss_seidel(*arrays, discount, bound)


def by_us(model: Model, discount: float) -> Callable[[], np.ndarray]:
    return lambda: solve(model, discount, tolerance=TOLERANCE).values


def by_quantecon(model: Model, discount: float, method: str) -> Callable[[], np.ndarray]:
    from quantecon.markov import DiscreteDP
    from scipy import sparse

    # An absorbing state takes what terminates: quantecon wants rows that sum to 1.
    n = model.n_states
    pair = np.repeat(np.arange(n * N_ACTIONS), np.diff(model.indptr))
    kernel = sparse.csr_matrix(
        (
            np.concatenate([model.probability, model.termination.ravel(), [1.0]]),
            (
                np.concatenate([pair, np.arange(n * N_ACTIONS), [n * N_ACTIONS]]),
                np.concatenate([model.successor, np.full(n * N_ACTIONS + 1, n)]),
            ),
        )
    )
    states = np.append(np.repeat(np.arange(n), N_ACTIONS), n)
    actions = np.append(np.tile(np.arange(N_ACTIONS), n), 0)
    problem = DiscreteDP(np.append(model.reward.ravel(), 0.0), kernel, discount, states, actions)
    return lambda: problem.solve(method=method, epsilon=TOLERANCE).v[:-1]


def methods(
    model: Model, discount: float, *, family: str, peers: bool
) -> dict[str, Callable[[], np.ndarray]]:
    chosen = {"ours": by_us(model, discount), "GS": by_gauss_seidel(model, discount)}
    if peers and discount < 1:
        chosen["MPI"] = by_quantecon(model, discount, "modified_policy_iteration")
        if model.n_states <= 2000 or family == "line":
            # Elsewhere its direct solver fills in: seconds for a plane, minutes for a space.
            chosen["PI"] = by_quantecon(model, discount, "policy_iteration")
    return chosen


def measure(
    model: Model, discount: float, repeats: int, *, family: str = "", peers: bool
) -> dict[str, float]:
    """Return the median thread CPU time of each method, rounds interleaved; check the answers."""
    chosen = methods(model, discount, family=family, peers=peers)
    answers = {name: run() for name, run in chosen.items()}  # compiles, too
    for name, answer in answers.items():
        error = np.abs(answer - answers["ours"]).max()
        assert error <= 3 * TOLERANCE, (name, error)
    times: dict[str, list[float]] = {name: [] for name in chosen}
    for _ in range(repeats):
        for name, run in chosen.items():
            start = time.thread_time()
            run()
            times[name].append(time.thread_time() - start)
    return {name: float(np.median(values)) for name, values in times.items()}


TASKS = {  # demonstrator of each task
    "CartPole-v1": eutree.experts.EXPERTS["CartPole-v1"]["fall"],
    "Inventory-v0": inventory.order_up_to,
    "MotorCurrents-v0": motor_currents.towards_the_error,
}
AS_MANY_STEPS = 7  # other actions up to which there were as many steps: in all of these tasks


def learned(task: str, seed: int) -> tuple[float, float, float]:
    """Return the CPU seconds of deviations and of a run of 60 episodes, and what its tree earns."""
    env, spent, plainly = gymnasium.make(task), [0.0], PairedRollouts.deviations

    def clocked(rollouts: PairedRollouts, steps: np.ndarray) -> np.ndarray:
        begin = time.thread_time()
        found = plainly(rollouts, steps)
        spent[0] += time.thread_time() - begin
        return found

    shown = eutree.record(env, TASKS[task], episodes=5, seed=seed)
    PairedRollouts.deviations = clocked
    begin = time.thread_time()
    try:
        result = eutree.learn(
            env, demonstrations=shown, method="planning", episodes=60, judge_episodes=0,
            evaluate_every=60, evaluation_episodes=1, seed=seed,
        )  # fmt: skip
    finally:
        PairedRollouts.deviations = plainly
    total = time.thread_time() - begin
    score = eutree.evaluate(result.learned, env, episodes=100, seed=10**6 + seed)
    return spent[0], total, score.mean_return


def deviations(runs: int) -> None:
    """Print what deviations cost before and now, and what the trees earn."""
    now = improvement.OTHERS
    print("| task | actions | deviations, s | now, s | ratio | share of the run | now |"
          " return before | now, difference of pairs |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|")
    for task in TASKS:
        learned(task, 0)  # compiles
        rows = []  # [runs, before and now, 3]
        for seed in range(2000, 2000 + runs):
            pair = []
            for improvement.OTHERS in (AS_MANY_STEPS, now):
                pair.append(learned(task, seed))
            rows.append(pair)
        before, after = np.array(rows).swapaxes(0, 1)
        spent, took = before[:, :2].sum(axis=0), after[:, :2].sum(axis=0)
        gain = after[:, 2] - before[:, 2]
        low, high = eutree.evaluation.mean_interval(gain)
        n_actions = gymnasium.make(task).action_space.n
        print(f"| {task} | {n_actions} | {spent[0] / runs:.2f} | {took[0] / runs:.2f} | "
              f"{took[0] / spent[0]:.2f} | {spent[0] / spent[1]:.0%} | {took[0] / took[1]:.0%} | "
              f"{before[:, 2].mean():.1f} | {gain.mean():+.1f} [{low:.1f}, {high:.1f}] |",
              flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[100, 1000, 10_000])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--families", nargs="+", default=[*REACH, "random"])
    parser.add_argument("--deviations", type=int, metavar="RUNS", default=0)
    options = parser.parse_args()
    if options.deviations:
        deviations(options.deviations)
        return
    peers = importlib.util.find_spec("quantecon") is not None
    print(
        "| model | states | discount | ours, ms | Gauss-Seidel, ms | quantecon PI, ms | "
        "quantecon MPI, ms | ours / Gauss-Seidel | ours / best of quantecon |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for family in options.families:
        for size in options.sizes:
            model = random_model(family, size, np.random.default_rng(size))
            for discount in (0.95, 0.99, *([1.0] if family == "episodic" else [])):
                cost = measure(model, discount, options.repeats, family=family, peers=peers)
                best = min(cost.get("PI", np.inf), cost.get("MPI", np.inf))
                shown = [f"{1e3 * cost[n]:.2f}" if n in cost else "" for n in ("PI", "MPI")]
                against = f"{cost['ours'] / best:.2f}" if best < np.inf else ""
                print(
                    f"| {family} | {model.n_states} | {discount} | {1e3 * cost['ours']:.2f} | "
                    f"{1e3 * cost['GS']:.2f} | {' | '.join(shown)} | "
                    f"{cost['ours'] / cost['GS']:.3f} | {against} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
