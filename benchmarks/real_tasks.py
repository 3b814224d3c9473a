"""Measure the tasks of practice: two traffic lights in SUMO, stock, a motor's switches, birds.

    python benchmarks/real_tasks.py rivals [--junction Ingolstadt1-v0]
    python benchmarks/real_tasks.py trees --runs 10 [--junction Ingolstadt1-v0]
    python benchmarks/real_tasks.py ahead
    python benchmarks/real_tasks.py dqn --runs 10
    python benchmarks/real_tasks.py jams --keep trees --episodes 100
    python benchmarks/real_tasks.py stock --runs 10
    python benchmarks/real_tasks.py motor --runs 10
    python benchmarks/real_tasks.py birds --runs 10 --first 2000
    python benchmarks/real_tasks.py page

Each row is written to docs/results/real-tasks.csv as soon as it is known and none is measured
twice, so that a measurement can be stopped and gone on with; ``page`` writes real-tasks.md of all
rows. Seeds of runs are from 1000 on (in Cologne choices were made with 1000 itself, so fresh ones
are from 1001 on); episodes that judge have seeds of their own. The lights need
``pip install '.[sumo]'``, ``dqn`` Stable-Baselines3, ``birds`` flappy-bird-gymnasium.
"""

import argparse
import csv
import resource
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import eutree
from eutree.evaluation import mean_interval
from eutree.inspection import enforce
from eutree.interaction import DerivedObservation
from eutree.interaction.names import declarations

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the examples

from examples import inventory, motor_currents, traffic_light

COLUMNS = ("task", "controller", "seed", "seconds", "demand", "episodes", "return", "delay",
           "longest_wait", "worst", "jams", "leaves", "steps", "cpu", "mebibytes")  # fmt: skip
STEPS, SHOWN = 20_000, 10
CONDITIONS = ((3600, 1.0), (3600, 0.8), (3600, 1.2))  # seconds, demand
DRAWN = {"seconds": 1800, "demand": "drawn"}  # the half hours in which trees learn
HALF_HOURS = 200  # of each rival
JAM = 300.0  # seconds that a vehicle stands at a stretch
BEST_RULE = {  # of those in the table, by its rows
    "Cologne1-v0": traffic_light.max_wave,
    "Ingolstadt1-v0": traffic_light.longest_queue,
}
AHEAD = (  # least green in seconds, vehicles ahead, what one that waits counts
    (0, (5.5, 3.5), 1), (0, (2.5, 2.5), 1), (10, (0.5, 0.5), 1), (10, (2.5, 2.5), 1),
    (10, (4.5, 2.5), 1), (15, (0.5, 0.5), 1), (15, (2.5, 2.5), 1), (20, (0.5, 0.5), 1),
    (20, (2.5, 2.5), 1), (10, (2, 1), 2), (10, (4, 4), 2), (15, (3, 3), 2), (15, (5, 5), 2),
    (20, (4, 4), 2),
)  # fmt: skip
FINAL_EPISODES = 200  # of the tasks that are no lights

Row = dict[str, Any]


def none(observation: Any) -> int:
    """Decide nothing, where the light follows a programme of its own."""
    return 0


RIVALS: dict[str, tuple[str, Any]] = {
    "the plan in use": ("plan", none),
    "SUMO's actuated control": ("actuated", none),
    "fixed cycle, 10 s each": ("none", traffic_light.FixedCycle(seconds=10)),
    "fixed cycle, 20 s each": ("none", traffic_light.FixedCycle(seconds=20)),
    "longest queue": ("none", traffic_light.longest_queue),
    "max pressure (RESCO)": ("none", traffic_light.max_pressure),
    "max wave (RESCO)": ("none", traffic_light.max_wave),
}


def light(junction: str, **options: Any) -> Any:
    """Return the light of a junction, with the differences that its trees may ask for."""
    return DerivedObservation(gymnasium.make(junction, **options), traffic_light.DERIVED[junction])


def played(env: Any, controller: Any, episodes: int, seed: int) -> Iterator[Row]:
    """Play episodes with a function or a policy; yield the figures of each."""
    decide = getattr(controller, "predict", lambda observation: (controller(observation), None))
    for episode in range(episodes):
        observation, _ = env.reset(seed=seed + episode)
        total, over, info = 0.0, False, {}
        while not over:
            observation, reward, ended, over, info = env.step(int(decide(observation)[0]))
            total, over = total + reward, over or ended
        yield {"return": total, **{key: info.get(key, 0.0) for key in ("delay", "longest_wait")}}


def summary(episodes: list[Row]) -> Row:
    """Return the means of episodes, the worst of each figure and the number of jams."""
    figures = {key: np.array([each[key] for each in episodes]) for key in episodes[0]}
    return {
        "episodes": len(episodes),
        "return": round(float(figures["return"].mean()), 3),
        "delay": round(float(figures["delay"].mean()), 2),
        "longest_wait": round(float(figures["longest_wait"].max())),
        "worst": round(float(figures["return"].min()), 2),
        "jams": int((figures["longest_wait"] > JAM).sum()),
    }


def under_all_conditions(
    options: Any, name: str, controller: Any, *, program: str = "none", facts: Row
) -> None:
    """Measure a controller of a light under all conditions that are not known yet."""
    for seconds, demand in CONDITIONS:
        key = {"task": options.junction, "controller": name, "seed": facts["seed"],
               "seconds": seconds, "demand": demand}  # fmt: skip
        if is_known(options.out, key):
            continue
        env = light(options.junction, seconds=seconds, demand=demand, program=program)
        found = summary(list(played(env, controller, options.episodes, 10**6)))
        env.close()
        keep(options.out, {**facts, **key, **found})


def rivals(options: Any) -> None:
    """Measure all that needs no learning."""
    for name, (program, controller) in RIVALS.items():
        under_all_conditions(options, name, controller, program=program, facts={"seed": 0})
        key = {"task": options.junction, "controller": name, "seed": 0, **DRAWN}
        if not is_known(options.out, key):
            env = light(options.junction, program=program)
            keep(options.out, {**key, **summary(list(played(env, controller, HALF_HOURS, 10**6)))})
            env.close()


def learned(
    env: Any,
    rule: Any,
    seed: int,
    method: str,
    most_leaves: int,
    *,
    steps: int = STEPS,
) -> tuple[Any, Row]:
    """Learn a tree from a few episodes of a rule of thumb; return it, and what that took."""
    begun = time.process_time()
    shown = eutree.record(env, rule, episodes=SHOWN, seed=seed)
    result = eutree.learn(
        env,
        demonstrations=shown,
        method=method,
        seed=seed,
        max_leaves=most_leaves,
        steps=steps,
        judge_episodes=0,
        front_steps=0,
        evaluate_every=10**6,
        evaluation_episodes=1,
    )
    taken = result.environment_steps.total
    facts = {"seed": seed, "leaves": result.learned.n_leaves, "steps": taken, **cost(begun)}
    return result, facts


def trees(options: Any) -> None:
    """Learn a tree of a light for each seed, put its two rules above it, and measure that."""
    name = f"tree ({options.method})"
    for seed in seeds(options, options.junction, name):
        env = light(options.junction)
        result, facts = learned(env, BEST_RULE[options.junction], seed, options.method, 13)
        env.close()
        policy = enforce(result.learned, traffic_light.RULES[options.junction]).policy
        if options.keep is not None:
            policy.save(options.keep / f"{options.junction}-{seed}.json")
        under_all_conditions(options, name, policy, facts=facts | {"leaves": policy.n_leaves})


def dqn(options: Any) -> None:
    """Train the DQN of Stable-Baselines3 at its defaults for as many steps, and measure it."""
    import stable_baselines3

    for seed in seeds(options, options.junction, "SB3 DQN"):
        env = light(options.junction)
        begun = time.process_time()
        model = stable_baselines3.DQN("MlpPolicy", env, seed=seed)
        model.learn(STEPS)
        env.close()
        facts = {"seed": seed, "steps": STEPS, **cost(begun)}
        under_all_conditions(options, "SB3 DQN", Deterministic(model), facts=facts)


class Deterministic:
    """A model of Stable-Baselines3 that does not explore."""

    def __init__(self, model: Any) -> None:
        self._model = model

    def predict(self, observation: Any) -> Any:
        """Return the action that it values most."""
        return self._model.predict(observation, deterministic=True)


def jams(options: Any) -> None:
    """Play many half hours by each tree that was kept; count where a vehicle stands too long.

    The rule that showed the trees how plays, too, as the run 0.
    """
    env = light(options.junction)
    paths = sorted(options.keep.glob(f"{options.junction}-*.json"))
    kept = {int(path.stem.rpartition("-")[2]): eutree.TreePolicy.load(path) for path in paths}
    for seed, controller in (kept | {0: BEST_RULE[options.junction]}).items():
        key = {"task": options.junction, "controller": "half hours", "seed": seed, **DRAWN}
        if not is_known(options.out, key):
            found = summary(list(played(env, controller, options.episodes, 10**7 + 1000 * seed)))
            keep(options.out, {**key, "leaves": getattr(controller, "n_leaves", ""), **found})


class BaseStock:
    """Order up to a level every night: the best form where an order has no fee."""

    def __init__(self, level: int) -> None:
        self._level = level

    def predict(self, observation: Any) -> Any:
        """Return the order that is nearest to what is missing."""
        missing = self._level - observation[0] - observation[1]
        return int(np.clip(round(missing / 10.0), 0, len(inventory.ORDERS) - 1)), None


def stock(options: Any) -> None:
    """Learn the inventory; beside it the best of all base-stock levels, chosen on its own seeds."""
    env = gymnasium.make("Inventory-v0")
    key = {"task": "Inventory-v0", "controller": "best base-stock level", "seed": 0}
    if not is_known(options.out, key):
        levels = range(20, 205, 5)
        chosen = max(levels, key=lambda level: returns(env, BaseStock(level), 500_000))
        found = summary(list(played(env, BaseStock(chosen), FINAL_EPISODES, 10**6)))
        keep(options.out, {**key, "controller": "best base-stock level", **found})
        print(f"the best level is {chosen}", file=sys.stderr)
    others(options, env, inventory.order_up_to, 15)


def motor(options: Any) -> None:
    """Learn the motor's switching table with eight leaves; beside it C4.5's tree of the script."""
    declared = declarations(Path(motor_currents.__file__).with_suffix(".txt"))
    env = DerivedObservation(gymnasium.make("MotorCurrents-v0"), declared)
    others(options, env, motor_currents.towards_the_error, 8)


class FourNumbers(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Flappy Bird by place, height above and depth below the gap's edges, and speed; 20 pipes."""

    def __init__(self) -> None:
        super().__init__(
            gymnasium.make(
                "flappy_bird_gymnasium:FlappyBird-v0",
                use_lidar=False,
                normalize_obs=False,
                score_limit=20,
            ).unwrapped
        )
        low, high = np.array([[-60.0, -500.0, -500.0, -10.0], [400.0, 500.0, 500.0, 12.0]])
        self.observation_space = gymnasium.spaces.Box(low, high, dtype=np.float64)

    def observation(self, observation: Any) -> Any:
        """Return the four numbers of the next pipe that the bird has not passed."""
        pipe = observation[:3] if observation[0] > 5 else observation[3:6]
        height, speed = observation[9:11]
        return np.array([pipe[0], pipe[2] - height, height - pipe[1], speed])


gymnasium.register("FourNumbers-v0", FourNumbers, max_episode_steps=1000)


def flaps_low(observation: Any) -> int:
    """Flap a little too low: three pixels higher would be well."""
    return int(observation[1] <= 31)


def birds(options: Any) -> None:
    """Learn to keep a bird in the air, for 30,000 steps; an episode of the script has 600."""
    others(options, gymnasium.make("FourNumbers-v0"), flaps_low, 8, steps=30_000)


def others(options: Any, env: Any, rule: Any, most_leaves: int, *, steps: int = STEPS) -> None:
    """Measure a task's rule, its tree, and what is learned from it, for each seed."""
    fits, task = options.method == "c45", env.spec.id  # c45: nothing is learned
    name = "its tree (C4.5)" if fits else f"tree ({options.method})"
    for seed in seeds(options, task, name):
        if fits:
            shown = eutree.record(env, rule, episodes=SHOWN, seed=seed)
            expert, learnt = eutree.fit_expert_tree(shown), []
        else:
            result, facts = learned(env, rule, seed, options.method, most_leaves, steps=steps)
            expert, learnt = result.expert, [(name, result.learned, facts)]
        for label, policy, own in (
            ("rule of thumb", rule, {}),
            ("its tree (C4.5)", expert, {"leaves": expert.n_leaves}),
            *learnt,
        ):
            found = summary(list(played(env, policy, FINAL_EPISODES, 10**6 + 1000 * seed)))
            keep(options.out, {"task": task, "controller": label, "seed": seed, **own, **found})


def returns(env: Any, controller: Any, seed: int) -> float:
    """Return the mean return of episodes that choose and do not judge."""
    return float(np.mean([each["return"] for each in played(env, controller, 50, seed)]))


def seeds(options: Any, task: str, controller: str) -> list[int]:
    """Return the seeds of runs that were not measured yet."""
    wanted = range(options.first, options.first + options.runs)
    known = {int(row["seed"]) for row in rows(options.out)
             if (row["task"], row["controller"]) == (task, controller)}  # fmt: skip
    return [seed for seed in wanted if seed not in known]


def cost(begun: float) -> Row:
    """Return the CPU seconds since, and the most memory that was used."""
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"cpu": round(time.process_time() - begun, 1), "mebibytes": round(most)}


def rows(out: Path) -> list[Row]:
    """Return what was measured so far."""
    path = out / "real-tasks.csv"
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def is_known(out: Path, key: Row) -> bool:
    """Return whether there is a row of it."""
    wanted = {name: str(value) for name, value in key.items()}
    return any(all(row[name] == value for name, value in wanted.items()) for row in rows(out))


def keep(out: Path, row: Row) -> None:
    """Write a row behind the others."""
    path = out / "real-tasks.csv"
    begun = path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, restval="")
        if not begun:
            writer.writeheader()
        writer.writerow(row)
    print(row, file=sys.stderr, flush=True)


class Ahead:
    """Change to the other main direction once it is ahead, after a least green.

    Args:
        green: Least seconds of green.
        more: Vehicles by which east-west, and by which north-south has to be ahead.
        waits: What a vehicle that waits counts; one that comes counts 1.
    """

    def __init__(self, green: float, more: tuple[float, float], waits: float) -> None:
        self._green, self._more, self._waits = green, more, waits

    def predict(self, observation: Any) -> Any:
        """Return the phase that is to be green."""
        counts = self._waits * observation[0:4] + observation[4:8]
        phase = int(np.argmax(observation[8:12]))
        ahead = (counts[2] - counts[0]) * (1 if phase == 0 else -1)
        changes = observation[16] >= self._green and ahead > self._more[phase // 2]
        return 2 - phase if changes else phase, None


def ahead(options: Any) -> None:
    """Print how many vehicles stand behind rules with two numbers, in episodes that judge none."""
    for green, more, waits in AHEAD:
        found = []
        for seconds, demand in CONDITIONS:
            env = light("Cologne1-v0", seconds=seconds, demand=demand)
            found.append(-summary(list(played(env, Ahead(green, more, waits), 2, 100)))["return"])
            env.close()
        print(green, more, waits, *(f"{stand:.1f}" for stand in found), flush=True)


def light_table(known: list[Row]) -> list[str]:
    """Return a line for each controller of a light: vehicles that stand, by demand."""
    lines = [
        "| controller | runs | standing | demand -20 % | demand +20 % | half hours, demand drawn |"
        " RESCO's delay, s | longest wait, s | leaves | CPU s | MiB |",
        "|---" * 11 + "|",
    ]
    names = list(dict.fromkeys(row["controller"] for row in known if row["seconds"] == "3600"))

    def standing(name: str) -> float:
        return -np.mean([float(row["return"]) for row in of(known, name, 1.0)])

    for name in sorted(names, key=standing):
        mine = of(known, name, 1.0)
        cells = [spread(of(known, name, demand), "return", -1) for demand in (1.0, 0.8, 1.2)]
        label = "half hours" if name == "tree (auto)" else name
        drawn = [row for row in known if (row["controller"], row["demand"]) == (label, "drawn")]
        cells.append(spread(drawn, "return", -1))
        waits = max(float(row["longest_wait"]) for row in of(known, name, None))
        lines.append(
            f"| {name} | {len(mine) if mine[0]['steps'] else ''} | " + " | ".join(cells)
            + f" | {spread(mine, 'delay')} | {waits:.0f} | {spread(mine, 'leaves')} | "
            f"{spread(mine, 'cpu')} | {spread(mine, 'mebibytes')} |"
        )  # fmt: skip
    return lines


def of(known: list[Row], controller: str, demand: float | None) -> list[Row]:
    """Return the rows of a controller for whole hours."""
    return [row for row in known if row["controller"] == controller and row["seconds"] == "3600"
            and (demand is None or float(row["demand"]) == demand)]  # fmt: skip


def spread(mine: list[Row], column: str, sign: int = 1) -> str:
    """Return the mean of a column; with its 95 % interval over runs where there are some."""
    found = sign * np.array([float(row[column]) for row in mine if row[column] != ""])
    if not found.size:
        return ""
    digits = 0 if column in ("leaves", "cpu", "mebibytes") else 1
    text = f"{found.mean():.{digits}f}"
    if found.size < 3 or not digits:
        return text
    low, high = mean_interval(found)
    return f"{text} [{low:.{digits}f}, {high:.{digits}f}]"


def other_table(known: list[Row]) -> list[str]:
    """Return a line for each controller of a task that is no light."""
    lines = ["| controller | runs | return | worst episode | leaves | steps | CPU s | MiB |",
             "|---" * 8 + "|"]  # fmt: skip
    for name in dict.fromkeys(row["controller"] for row in known):
        mine = [row for row in known if row["controller"] == name]
        worst = min(float(row["worst"]) for row in mine)
        steps = max((int(row["steps"]) for row in mine if row["steps"]), default=0)
        lines.append(
            f"| {name} | {len(mine)} | {spread(mine, 'return')} | {worst:.1f} | "
            f"{spread(mine, 'leaves')} | {steps or '':} | {spread(mine, 'cpu')} | "
            f"{spread(mine, 'mebibytes')} |"
        )
    return lines


def page(options: Any) -> None:
    """Write the tables into the page, between the lines that say so."""
    known = rows(options.out)
    path = options.out / "real-tasks.md"
    text = path.read_text(encoding="utf-8")
    for task in ("Cologne1-v0", "Ingolstadt1-v0", "Inventory-v0", "MotorCurrents-v0",
                 "FourNumbers-v0"):  # fmt: skip
        mine = [row for row in known if row["task"] == task]
        if not mine:
            continue
        table = light_table(mine) if task.endswith("1-v0") else other_table(mine)
        begin, end = f"<!-- table: {task} -->\n", "<!-- end -->"
        before, _, rest = text.partition(begin)
        text = before + begin + "\n" + "\n".join(table) + "\n\n" + end + rest.partition(end)[2]
    path.write_text(text, encoding="utf-8")


def main() -> None:
    """Measure a part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parts = (rivals, trees, ahead, dqn, jams, stock, motor, birds, page)
    parser.add_argument("part", choices=[part.__name__ for part in parts])
    parser.add_argument("--junction", default="Cologne1-v0")
    parser.add_argument("--method", default="auto")
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--keep", type=Path, help="folder for the trees")
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    options = parser.parse_args()
    next(part for part in parts if part.__name__ == options.part)(options)


if __name__ == "__main__":
    main()
