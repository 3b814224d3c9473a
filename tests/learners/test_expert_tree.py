"""The expert tree: C4.5 on demonstrations."""

import gymnasium
import numpy as np
import pytest

import eutree
from eutree.data import Demonstrations, Episode
from eutree.errors import InvalidArgumentError
from eutree.learners.starts import fit_expert_tree
from eutree.schema import EnvironmentSpec, Feature, Schema

SCHEMA = Schema((Feature("position", "m"), Feature("opponent", "m")), ("stop", "go"))


def demonstrations(seed: int = 0) -> Demonstrations:
    """Return one episode whose expert stops while both features are small."""
    observations = np.random.default_rng(seed).uniform(0, 10, size=(201, 2))
    stops = (observations[:-1, 0] <= 4) & (observations[:-1, 1] <= 6)
    episode = Episode(
        observations=observations,
        actions=(~stops).astype(np.int64),
        rewards=np.zeros(200),
        terminated=True,
        truncated=False,
    )
    return Demonstrations((episode,), SCHEMA, environment=EnvironmentSpec("some/Task-v0"))


def test_learns_the_expert_and_keeps_names_and_environment() -> None:
    recorded = demonstrations()
    policy = fit_expert_tree(recorded)
    assert policy.schema == SCHEMA
    assert policy.environment == recorded.environment
    assert policy.n_leaves == 3
    actions, _ = policy.predict(recorded.observations)
    assert np.array_equal(actions, recorded.actions)


def test_weights_reach_the_learner() -> None:
    recorded = demonstrations()
    only_go = recorded.actions.astype(float)
    assert fit_expert_tree(recorded, weights=only_go).n_leaves == 1


def test_demonstrations_without_a_step_are_refused() -> None:
    with pytest.raises(InvalidArgumentError, match="at least one transition, got 0 episodes"):
        fit_expert_tree(Demonstrations((), SCHEMA))


def test_the_gate_expert_becomes_about_nine_leaves() -> None:
    """The paper's Table 2 has 9 states for the expert tree of 15 demonstrations."""
    env = gymnasium.make("eutree/Evasion2-v0")
    leaves = [
        fit_expert_tree(
            eutree.record(env, eutree.experts.wait_at_crossing, episodes=15, seed=seed)
        ).n_leaves
        for seed in range(15)
    ]
    assert 7 <= np.mean(leaves) <= 13, leaves
