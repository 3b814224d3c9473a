"""What is frozen beside the presets: the other methods, and what makes trees without learning.

Each case is a function of a seed that returns plain numbers; all of them take some seconds. What a
method or a command chooses by itself is left as it is, but for how long it takes.
"""

import eutree
from eutree.c45 import C45Settings
from eutree.compression import RealEpisodes
from eutree.distillation import DistillationSettings
from eutree.envs.experts import experts_for
from eutree.learners import METHODS
from eutree.learners.distilled_dqn import DistilledDQN
from eutree.neural import DoubleDQNSettings
from eutree.world_model.ensemble import EnsembleSettings
from tests.golden.behaviour.cases import (
    TASKS,
    column,
    decided,
    demonstrations,
    environment,
    learned,
)

OTHER_SEEDS = range(2)
SMALL_DQN = DistilledDQN(
    max_leaves=4,
    demonstration_updates=20,
    teacher=DoubleDQNSettings(hidden=8, batch=8),
    world_model=EnsembleSettings(members=2, hidden=8, batch=8, updates=30, more_updates=10),
)
# The other methods, each where its goals and boxes have a meaning.
METHOD_TASKS = {
    "adaptive-q": "cart-pole",
    "density-tree": "cart-pole",
    "history-u-tree": "evasion",
    "parti-game": "mountain-car",
    "vqql": "evasion",
    "vrd": "mountain-car",
}


def by_method(method, task, seed, **options):
    """Learn from demonstrations with a method."""
    result = eutree.learn(
        environment(TASKS[task]),
        demonstrations=demonstrations(task),
        start="tree+demos",
        method=method,
        evaluate_every=10,
        evaluation_episodes=5,
        seed=seed,
        **options,
    )
    return learned(result, task)


def shown_carelessly(share, *, episodes, seed):
    """Record a demonstrator of 2-Evasion who acts at random now and then."""
    careless = eutree.experts.careless(eutree.experts.wait_at_crossing, share, seed=seed)
    return eutree.record(environment(TASKS["evasion"]), careless, episodes=episodes, seed=seed)


def offline(seed):
    """Learn from the log of a careless demonstrator, and from nothing else."""
    log = shown_carelessly(0.2, episodes=30, seed=seed)
    result = eutree.learn(None, demonstrations=log, episodes=5, seed=seed)
    return decided(result.learned, "evasion")


def fit(seed):
    """Fit a tree to poor demonstrations, and play the candidates."""
    env, shown = environment(TASKS["evasion"]), shown_carelessly(0.1, episodes=10, seed=seed)
    report = eutree.fit(shown, env, episodes=40, seed=seed)
    return decided(report.policy, "evasion") | {
        "choice": report.choice,
        "candidates": report.n_candidates,
        "episodes_played": report.episodes_played,
        "played": column(report.played.returns),
    }


def distill(seed):
    """Make a tree of a scripted policy, by DAgger."""
    env = environment(TASKS["cart-pole"])
    settings = DistillationSettings(iterations=4, episodes=3, validation_episodes=8, max_leaves=8)
    teacher = experts_for("CartPole-v1")["balance"](env)
    policy, report = eutree.distill(teacher, env, settings, seed=seed)
    rounds = [round_.mean_return for round_ in report.rounds]
    return decided(policy, "cart-pole") | {"rounds": rounds, "steps": report.environment_steps}


def compress(seed):
    """Prune a tree by what it answers, round it, and prune it by what it earns in episodes."""
    shown = shown_carelessly(0.1, episodes=10, seed=seed)
    tree = eutree.fit_expert_tree(shown, settings=C45Settings(prune=False))
    played = RealEpisodes(environment(TASKS["evasion"]), margin=10.0, episodes=60)
    asked = {
        "labels": {"max_leaves": 4},
        "rounded": {"round_thresholds": True},
        "played": {"env": played},
    }
    found = {}
    for name, options in asked.items():
        small, report = eutree.compress(tree, shown.observations, seed=seed, **options)
        facts = {"method": report.method, "steps": report.environment_steps}
        found[name] = decided(small, "evasion") | facts
    return found


OTHERS = {
    "corrected.evasion": lambda seed: by_method("corrected", "evasion", seed, episodes=20),
    "distilled-dqn.cart-pole": lambda seed: by_method(SMALL_DQN, "cart-pole", seed, steps=2_000),
    **{
        f"{name}.{task}": lambda seed, name=name, task=task: by_method(
            METHODS[name](), task, seed, episodes=20
        )
        for name, task in METHOD_TASKS.items()
    },
    "offline.evasion": offline,
    "fit.evasion": fit,
    "distill.cart-pole": distill,
    "compress.evasion": compress,
}


def other_behaviour(name, seed):
    """Return what is frozen of a case, for one seed."""
    return {"seed": seed} | OTHERS[name](seed)
