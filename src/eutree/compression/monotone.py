"""Compression of a tree that keeps monotone rules, into one that keeps them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from eutree.compression.candidates import Costs
from eutree.compression.compressing import compress, report_on
from eutree.compression.report import CompressionReport
from eutree.errors import InvalidArgumentError
from eutree.inspection import keep_monotone, monotone_rules
from eutree.policies import TreePolicy
from eutree.validation import check_observations


def compress_monotone(
    policy: TreePolicy, observations: ArrayLike, monotone: Sequence[str], **options: Any
) -> tuple[TreePolicy, CompressionReport]:
    """Return what ``compress`` does, as a tree that keeps some rules, as ``policy`` does.

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
        rows = check_observations("observations", observations, n_features=policy.tree.n_features)
        changed = report_on(policy, best.policy, "monotone", Costs.of(policy, rows, "visits"))
        return best.policy, replace(changed, front=report.front, by=report.by)
    exact, merged = compress(policy, observations, mode="merge")
    if most is not None and exact.n_leaves > most:
        raise InvalidArgumentError(
            f"max_leaves must be at least {exact.n_leaves}: no smaller tree was found that keeps "
            f"{', '.join(rule.text for rule in rules)}, got {most}"
        )
    return exact, replace(merged, front=report.front, environment_steps=report.environment_steps)
