"""The paper's tree compression by C4.5, checked and with an exact fallback.

The paper relabels the recorded observations with the policy's own actions, lets unpruned C4.5 fit
them and says that this "at worst maintains the same number of states". C4.5 as published keeps
neither promise: the result can be larger and can change recorded actions. So every tree is
checked, the exact merge of sibling leaves is always among them, and the smallest that keeps the
demanded fidelity wins. Who can give something up gets less: a share of the recorded decisions
(``max_disagreement``), or a margin of the return (``env`` and ``margin``).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Floats
from eutree.c45 import C45Settings
from eutree.compression.episodes import (
    Comparison,
    CompressionReport,
    Demand,
    FrontEntry,
    RealEpisodes,
    ground_of,
    meet,
    met_by,
    play_rounded,
    returns_of,
)
from eutree.compression.playing import Ground
from eutree.compression.smaller_trees import (
    WEIGHTS,
    Costs,
    Ladder,
    OrderLadder,
    Rounding,
    by_c45,
    lossless,
    merged,
    rounded,
    steps_of,
    with_locks,
)
from eutree.contests.betting import episodes_needed
from eutree.contests.smallest import ATTEMPTS
from eutree.errors import InvalidArgumentError
from eutree.interaction.making import Environment
from eutree.policies import TreePolicy
from eutree.schema import Schema
from eutree.trees.boxes import disagreement
from eutree.validation import (
    check_choice,
    check_integer,
    check_kind,
    check_number,
    check_observations,
    check_seed,
)

if TYPE_CHECKING:
    from eutree.compression.imagined import ImaginedEpisodes, Pruned

IMAGINED_STREAM = 41
ASKED = 60  # episodes of each tree that a world model is held against
_ASKED_BLOCK = 2_000_000

MODES = ("auto", "merge", "paper", "lossless")

_Scores = tuple[float, float]


def compress(
    policy: TreePolicy,
    observations: ArrayLike,
    *,
    mode: str = "auto",
    max_disagreement: float | None = None,
    max_leaves: int | None = None,
    imagined: "ImaginedEpisodes | None" = None,
    env: RealEpisodes | Environment | None = None,
    weights: str = "visits",
    round_thresholds: Rounding = False,
    seed: int = 0,
) -> tuple[TreePolicy, CompressionReport]:
    """Return a policy with fewer leaves that decides the same, and a report of the changes.

    Locked leaves stay in every mode: their boxes, their actions, and their locks.

    Args:
        policy: The policy to compress.
        observations: Recorded observations, shape [N, d], in the features of the policy's tree.
        mode: ``"merge"`` joins sibling leaves only and drops tests that the kinds of features
            answer: the same decision on every observation that can be (of a one-hot group exactly
            one feature is 1). ``"lossless"`` and ``"auto"`` keep the decision on every recorded
            observation; ``"auto"`` takes the smallest of all ways. ``"paper"`` is unpruned C4.5,
            which may change some decisions.
        max_disagreement: Give the smallest tree that costs at most this share instead. Under masks
            a decision is the order in which a leaf prefers all actions.
        max_leaves: Give a tree of at most so many leaves instead, at any cost.
        imagined: With ``max_leaves`` nodes are cut where that costs least in these episodes, which
            is worth it from some ten thousand varied transitions on; without them, where labels
            change least. With ``env`` a world model is refused that orders the trees that it was
            asked about no better than chance.
        env: Where trees play: an environment, its id or how to make it. Then the best tree of each
            size is looked for by playing, and the smallest within a standard error of the best is
            returned, or with ``max_leaves`` the best of at most so many; the report has the
            ``front``. ``RealEpisodes`` says more of it: a margin that the result keeps, say.
        weights: The cost of a changed decision: ``"visits"``, 1 each; ``"q-gap"``, its loss by the
            values of the policy's leaves.
        round_thresholds: Write each threshold with the fewest significant digits that leave
            every recorded observation in its leaf of the result; or a step (0.1), or a step for
            each named feature: thresholds become multiples of it, which may change decisions.
        seed: Seed of the episodes.

    Returns:
        The compressed policy, never larger than the exact merge (``mode="merge"``), and a report.
    """
    check_kind("policy", policy, TreePolicy)
    check_choice("mode", mode, MODES)
    check_choice("weights", weights, WEIGHTS)
    check_seed(seed)
    real = env if env is None or isinstance(env, RealEpisodes) else RealEpisodes(env, searches=True)
    margin = None if real is None else real.margin
    _check_demands(policy, mode, max_disagreement, margin, max_leaves, imagined)
    rows = check_observations("observations", observations, names=policy.schema.feature_names)
    steps = steps_of(round_thresholds, policy.schema)
    shortened = round_thresholds is not False

    def by_labels(costs: Costs, ground: Ground | None) -> tuple[TreePolicy, str, _Scores | None]:
        if max_leaves is not None:
            imagine = None
            if imagined is not None:
                generator = np.random.default_rng((seed, IMAGINED_STREAM))
                known = imagined.transitions(policy)
                imagine = partial(imagined.pruned, known, generator=generator)
            return _of_size(policy, costs, max_leaves, imagine, ground)
        if max_disagreement is not None:
            return *_within(policy, costs, max_disagreement), None
        return *_smallest(policy, rows, mode), None

    if real is None:
        costs = Costs.of(policy, rows, weights)
        result, method, scores = by_labels(costs, None)
        result = rounded(result, rows, steps) if shortened else result
        by = "labels" if scores is None else "model"
        return result, report_on(policy, result, method, costs, imagined=scores, by=by)
    ground = ground_of(real.env, policy, seed, real.n_jobs)
    demand = real.demand(ground.env, max_leaves)
    searches = (real.searches or margin is not None) and mode == "auto"
    searches &= max_disagreement is None and imagined is None
    rows = met_by(policy, ground) if searches and not rows.size else rows
    costs = Costs.of(policy, rows, weights)
    verdict = scores = played = too_few = None
    front: tuple[FrontEntry, ...] = ()
    if searches:
        found = _by_playing(policy, costs, ground, demand, steps if shortened else None)
        result, method, verdict, front = found
    else:
        result, method, scores = by_labels(costs, ground)
    if shortened and verdict is None:
        exact, result = result, rounded(result, rows, steps)
        played = play_rounded(exact, result, ground, demand.episodes, margin)
        result = result if played.kept else exact
    if real.evaluates and verdict is None:
        verdict = meet(policy, result, ground, demand)
        if margin:
            low, high = verdict.return_range
            needed = episodes_needed(margin, low - high, ATTEMPTS[0] * demand.error)
            too_few = needed if needed > demand.episodes else None
    if not isinstance(real.env, gymnasium.Env):
        ground.env.close()
    return result, report_on(
        policy, result, method, costs, verdict,
        environment_steps=ground.steps,
        episodes_needed=too_few,
        imagined=scores,
        rounding=played,
        by="episodes" if searches and method != "budget" else "model" if scores else "labels",
        front=front,
    )  # fmt: skip


def observation_box(schema: Schema, rows: Floats) -> tuple[Floats, Floats]:
    """Return the bounds of the features; where they are infinite, those of the rows."""
    low = np.array([feature.low for feature in schema.features])
    high = np.array([feature.high for feature in schema.features])
    least = rows.min(axis=0) if rows.size else np.zeros(low.size)
    most = rows.max(axis=0) if rows.size else np.zeros(low.size)
    low, high = np.where(np.isfinite(low), low, least), np.where(np.isfinite(high), high, most)
    return low, np.maximum(low, high)


def _smallest(policy: TreePolicy, rows: Floats, mode: str) -> tuple[TreePolicy, str]:
    """Return the smallest tree of a mode that keeps its promise, and which way made it."""
    if policy.masked:  # the others do not keep what leaves fall back on
        return merged(policy), "merge"
    trees = {"merge": merged(policy)}
    if rows.size and mode in ("auto", "lossless"):
        trees = lossless(policy, rows)
    if rows.size and mode in ("auto", "paper"):
        trees["paper"] = by_c45(policy, rows, C45Settings.unpruned())
    trees = {name: with_locks(tree, policy) for name, tree in trees.items()}
    same = [one for one in trees if mode == "paper" or _agreement(trees[one], rows, policy) == 1.0]
    best = min(["merge", *same], key=lambda name: trees[name].n_leaves)
    return trees[best], best


def _within(policy: TreePolicy, costs: Costs, share: float) -> tuple[TreePolicy, str]:
    """Return the smallest tree that costs at most a share of the worst."""
    exact = with_locks(merged(policy), policy)
    if not costs.rows.size:
        return exact, "merge"
    found = with_locks(_ladder(policy, costs).within(share), policy)
    return (found, "budget") if found.n_leaves <= exact.n_leaves else (exact, "merge")


def _of_size(
    policy: TreePolicy,
    costs: Costs,
    max_leaves: int,
    imagine: "Callable[..., Pruned] | None",
    ground: Ground | None,
) -> tuple[TreePolicy, str, _Scores | None]:
    """Return a tree of at most so many leaves, its method, and its score with the input's."""
    exact = merged(policy)
    if exact.n_leaves <= max_leaves or not costs.rows.size:
        if exact.n_leaves > max_leaves:
            raise InvalidArgumentError(
                "observations must hold at least one, to choose what max_leaves gives up"
            )
        return exact, "merge", None
    if imagine is None:
        return _ladder(policy, costs).of_size(max_leaves), "budget", None
    found = imagine(policy, costs, max_leaves)
    if ground is not None:  # where trees can play, a model is believed only if it can tell them
        means = [returns_of(one, ground, _ASKED_BLOCK, ASKED).mean() for one in found.asked]
        found.check_order(np.array(means))
    return found.policy, found.method, (found.before, found.after)


def _ladder(policy: TreePolicy, costs: Costs) -> Ladder:
    return OrderLadder(policy, costs) if policy.masked else Ladder(policy, costs)


def _check_demands(
    policy: TreePolicy,
    mode: str,
    max_disagreement: float | None,
    margin: float | None,
    max_leaves: int | None,
    imagined: "ImaginedEpisodes | None",
) -> None:
    """Raise InvalidArgumentError unless the demands can be met together."""
    if max_disagreement is not None:
        check_number("max_disagreement", max_disagreement, low=0, high=1)
    if max_disagreement is not None and margin is not None:
        raise InvalidArgumentError("give either max_disagreement or margin, got both")
    gives_up = max_disagreement is not None or margin is not None
    if mode != "auto" and gives_up:
        raise InvalidArgumentError(
            f'mode must be "auto" with max_disagreement or margin, got {mode!r}'
        )
    if max_leaves is None:
        if imagined is not None:
            raise InvalidArgumentError("imagined needs max_leaves, to prune a tree to")
        return
    check_integer("max_leaves", max_leaves, low=2)
    if mode != "auto" or gives_up:
        raise InvalidArgumentError(
            'max_leaves needs mode="auto", and neither max_disagreement nor margin'
        )
    if policy.locked:
        raise InvalidArgumentError(
            "max_leaves must be None for a policy with locked leaves, which all stay"
        )


def _by_playing(
    policy: TreePolicy,
    costs: Costs,
    ground: Ground,
    demand: Demand,
    steps: Mapping[int, float] | None,
) -> tuple[TreePolicy, str, Comparison | None, tuple[FrontEntry, ...]]:
    """Return the pick of the front, the way that made it, its verdict, and the front.

    Where no smaller tree deserves it that is the exact merge, without a verdict; where the steps
    end before one that is small enough is found, the tree whose labels cost least. Trees are
    rounded (unless ``steps`` is None) before one is chosen, so the tree that is returned has run.
    """

    def finish(tree: TreePolicy) -> TreePolicy:
        tree = with_locks(merged(tree), policy)
        return tree if steps is None else rounded(tree, costs.rows, steps)

    from eutree.compression.front import front_of

    exact, most = with_locks(merged(policy), policy), demand.max_leaves
    known = [exact]
    if most is not None and exact.n_leaves > most:
        known.append(Ladder(policy, costs).of_size(most))
    front = front_of(policy, known, ground, demand, finish)
    if front.picked is None:
        return known[-1], "budget" if len(known) > 1 else "merge", None, front.entries
    return front.picked, "return", front.verdict, front.entries


def report_on(
    policy: TreePolicy,
    result: TreePolicy,
    method: str,
    costs: Costs,
    verdict: Comparison | None = None,
    **more: Any,
) -> CompressionReport:
    """Return the changes from a policy to a smaller one; ``more`` are fields of the report."""
    rows, schema = costs.rows, policy.schema
    both = policy.tree, policy.actions, result.tree, result.actions
    return CompressionReport(
        n_leaves_before=policy.n_leaves,
        n_leaves_after=result.n_leaves,
        agreement=_agreement(result, rows, policy),
        disagreement_volume=disagreement(*both, observation_box(schema, rows), schema),
        method=method,
        weighted_disagreement=costs.share(result.tree, result.actions),
        **({} if verdict is None else vars(verdict)),
        **more,
    )


def _agreement(changed: TreePolicy, rows: Floats, policy: TreePolicy) -> float:
    """Return the share of rows [N, d] decided as before, whatever is masked; 1 of none."""
    if not rows.size:
        return 1.0
    mine, theirs = (
        (one.orders if policy.masked else one.actions)[one.tree.leaf_index(rows)]
        for one in (changed, policy)
    )
    return float(np.equal(mine, theirs).reshape(len(rows), -1).all(axis=1).mean())


# Compression of a tree that keeps monotone rules, into one that keeps them.


def compress_monotone(
    policy: TreePolicy, observations: ArrayLike, monotone: Sequence[str], **options: Any
) -> tuple[TreePolicy, CompressionReport]:
    """Return the result of ``compress``, as a tree that keeps some rules, as ``policy`` does.

    Where the tree that ``compress`` chooses breaks a rule, the best one of its front that keeps
    them all takes its place, or else the exact merge, which decides the same everywhere.

    Args:
        policy: The policy to compress.
        observations: Recorded observations, shape [N, d].
        monotone: Rules such as ``"stop in distance"``.
        **options: The other arguments of ``compress``.

    Raises:
        InvalidArgumentError: The policy itself breaks a rule, or no tree of ``max_leaves`` that
            was found keeps them.
        UnknownNameError: A rule names no feature or action.
    """
    from eutree.inspection import keep_monotone, monotone_rules

    rules = monotone_rules(monotone, policy.schema)
    for rule in rules:
        if keep_monotone(policy, [rule]) is not policy:
            raise InvalidArgumentError(
                f"policy must keep {rule.text!r} to be compressed so; fit --monotone and "
                "learn --monotone make a tree that does"
            )
    small, report = compress(policy, observations, **options)
    if keep_monotone(small, rules) is small:
        return small, report
    most = options.get("max_leaves")
    kept = [
        one
        for one in report.front
        if (most is None or one.policy.n_leaves <= most)
        and keep_monotone(one.policy, rules) is one.policy
    ]
    if kept:
        best = max(kept, key=lambda one: (one.mean_return, -one.policy.n_leaves))
        rows = check_observations("observations", observations, names=policy.schema.feature_names)
        costs = Costs.of(policy, rows, "visits")
        return best.policy, report_on(
            policy, best.policy, "monotone", costs, front=report.front, by=report.by
        )
    exact, merged = compress(policy, observations, mode="merge")
    if most is not None and exact.n_leaves > most:
        raise InvalidArgumentError(
            f"max_leaves must be at least {exact.n_leaves}: no smaller tree was found that keeps "
            f"{', '.join(rule.text for rule in rules)}, got {most}"
        )
    return exact, replace(merged, front=report.front, environment_steps=report.environment_steps)
