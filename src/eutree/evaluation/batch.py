"""Run many episodes of a policy side by side in a vector environment."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from eutree.arrays import Floats, Integers
from eutree.evaluation.evaluation import Evaluation
from eutree.interaction.episode import ending_of, success_of
from eutree.policies import Policy


def run_batch(policy: Policy, vector: Any, seeds: Sequence[int]) -> Evaluation | None:
    """Run one episode in each copy, seeded one by one; None if the policy decides no batches.

    The vector environment takes a list of seeds, which Gymnasium's type annotations do not know.

    A copy that has ended goes on with a next episode until the last one has; that is ignored.
    """
    copies = len(seeds)
    observations, _ = vector.reset(seed=list(seeds))
    first = _first_actions(policy, observations)
    if first is None:
        return None
    actions, state = first
    lengths = np.zeros(copies, np.int64)  # [E] 0 while the episode runs
    successes: list[Any] = [None] * copies
    endings: list[str] = [""] * copies
    rewards: list[Floats] = []  # of each step, [E]
    starts = np.zeros(copies, dtype=bool)
    while True:
        observations, reward, terminated, truncated, info = vector.step(actions)
        rewards.append(reward)
        just_ended = (terminated | truncated) & (lengths == 0)
        for copy in np.flatnonzero(just_ended).tolist():
            lengths[copy] = len(rewards)
            own = {key: _of(info, key, copy) for key in ("is_success", "ending")}
            successes[copy] = success_of(own)
            endings[copy] = ending_of(own, terminated=bool(terminated[copy]))
        if lengths.all():
            break
        actions, state = policy.predict(
            observations, state=state, episode_start=starts, deterministic=True
        )
    return Evaluation(
        returns=_sums(np.array(rewards), lengths),
        lengths=lengths,
        endings=np.array(endings),
        successes=None if None in successes else np.array(successes),
        n_leaves=getattr(policy, "n_leaves", None),
    )


def _first_actions(policy: Policy, observations: Floats) -> tuple[Integers, Any] | None:
    """Return the policy's first decisions, or None if it takes single observations only."""
    starts = np.ones(len(observations), dtype=bool)
    try:
        actions, state = policy.predict(
            observations, state=None, episode_start=starts, deterministic=True
        )
    except Exception:
        # What is really wrong with the policy, if anything, will show on a single observation.
        return None
    actions = np.asarray(actions)
    if actions.shape != (len(observations),) or actions.dtype.kind not in "iu":
        return None
    return actions, state


def _of(info: dict[str, Any], key: str, copy: int) -> Any:
    """Return the entry of one copy; None if it has none."""
    if key not in info or not info.get(f"_{key}", {copy: True})[copy]:
        return None
    return info[key][copy]


def _sums(rewards: Floats, lengths: Integers) -> Floats:
    """Return the sum over each episode; added up as for a single episode, so bit for bit."""
    by_copy = np.ascontiguousarray(rewards.T)  # [E, T]
    return np.array([row[:n].sum() for row, n in zip(by_copy, lengths.tolist(), strict=True)])
