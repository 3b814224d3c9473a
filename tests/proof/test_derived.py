"""Proofs of trees that ask for derived features: these are computed in the boxes, too."""

import gymnasium
import numpy as np
import pytest

from eutree.errors import InvalidArgumentError
from eutree.proof import Effort, Intervals, plant_of, prove
from eutree.proof.intervals import Affine, Doubt
from eutree.proof.plant import CartPole, MountainCar
from eutree.proof.reach import Acting
from eutree.schema import EnvironmentSpec
from tests.proof.policies import LEFT, POSITION, RIGHT, VELOCITY, policy_of

PLANT = MountainCar(EnvironmentSpec("MountainCar-v0"))
DERIVED = 2  # the number of a feature behind position and velocity
FORMULAS = [
    "velocity + 0.003 * position",
    "velocity if position < -0.5 and velocity >= 0 or position > 0.4 else velocity + 0.001",
    "min(velocity, 2 * velocity) / max(0.5, abs(position))",
    "-(velocity - 0.01) * (position - velocity)",
    "position / velocity",
    "0.5",
]


@pytest.mark.parametrize("formula", FORMULAS)
@pytest.mark.parametrize("as_affine", [False, True])
def test_boxes_hold_the_action_of_every_state_in_them(formula: str, as_affine: bool) -> None:
    """States are drawn in boxes of all widths, and seen as the environment shows them: rounded."""
    rng = np.random.default_rng(0)
    n, inside = 300, 40
    center = np.column_stack([rng.uniform(-1.2, 0.6, n), rng.uniform(-0.07, 0.07, n)])
    center[::10, 1] = 0.0
    width = 10.0 ** rng.uniform(-12, -1, (n, 1)) * (1.0, 0.1)
    width[::7] = 0.0
    states = center + rng.uniform(-1, 1, (inside, n, 2)) * width
    policy = policy_of((DERIVED, 0.0, LEFT, RIGHT), derived=(f"d = {formula}",))
    seen = policy.derivation.rows(states.astype(np.float32).astype(np.float64))[..., DERIVED]
    threshold = float(np.median(seen))
    policy = policy_of((DERIVED, threshold, LEFT, RIGHT), derived=(f"d = {formula}",))
    boxes = [
        Intervals.between(*(center[:, j] + sign * width[:, j] for sign in (-1, 1)))
        for j in range(2)
    ]
    if as_affine:
        doubt = Doubt(np.zeros(n, dtype=np.int64), np.full(n, -1))
        slopes = np.zeros((2, 2, n))
        slopes[[0, 1], [0, 1]] = width.T
        boxes = [Affine(center[:, j], slopes[j], np.zeros(n), doubt) for j in range(2)]
    possible = Acting(policy, PLANT)(boxes)
    actions = policy.predict(states.astype(np.float32).reshape(-1, 2))[0].reshape(inside, n)
    assert ((possible >> actions) & 1).all()
    one = (possible & (possible - 1)) == 0
    assert one[width[:, 0] < 1e-9].mean() > 0.6  # not everything is possible everywhere


def test_a_feature_by_another_name_is_proven_as_the_feature_itself() -> None:
    asked = "avoids position >= 0.3 for 40 steps"
    plain = prove(policy_of((VELOCITY, 1e-5, LEFT, RIGHT)), PLANT, asked)
    unasked, same = "turn = velocity - last(velocity)", "1.0 * velocity + 0.0 * position"
    policy = policy_of((DERIVED + 1, 1e-5, LEFT, RIGHT), derived=(unasked, f"d = {same}"))
    found = prove(policy, PLANT, asked)
    assert (found.verdict, found.work) == (plain.verdict, plain.work)


def test_a_tree_of_a_sum_arrives_and_one_that_does_not_is_refuted_by_gymnasium() -> None:
    slow = "d = velocity if position < -0.5 else velocity + 0.001"
    policy = policy_of((DERIVED, 1e-5, LEFT, RIGHT), derived=(slow,))
    found = prove(policy, PLANT, effort=Effort(smallest=2.0**-11))
    assert found.proven, found.sentence
    low, high = found.bounds["steps"]
    assert low <= 143 <= 168 <= high < 200
    stuck = policy_of((DERIVED, 10.0, LEFT, RIGHT), derived=(slow,))
    found = prove(stuck, PLANT, effort=Effort(smallest=2.0**-11))
    assert found.verdict == "refuted"
    assert found.counterexample is not None
    env = gymnasium.make("MountainCar-v0")
    position = found.counterexample["position"]
    observation, _ = env.reset(options={"low": position, "high": position})
    ends = [env.step(stuck.predict(observation)[0])[2] for _ in range(200)]
    assert not any(ends)


def test_where_a_plant_has_axes_boxes_are_cut_at_their_starts_instead() -> None:
    lean = ('lean = angle + "turn rate"',)
    spec = EnvironmentSpec("CartPole-v1")
    policy = policy_of((4, 0.0, 0, 1), "CartPole-v1", derived=lean)
    asked = "stays in angle < 0.2 and angle > -0.2 for 5 steps"
    found = prove(policy, CartPole(spec), asked, effort=Effort(smallest=2.0**-6))
    assert found.proven, found.sentence


def test_derived_features_that_are_not_asked_for_change_nothing_along_axes() -> None:
    asked, plant = "stays in angle < 0.2 for 20 steps", CartPole(EnvironmentSpec("CartPole-v1"))
    plain = prove(policy_of((3, 0.0, 0, 1), "CartPole-v1"), plant, asked)
    policy = policy_of((3, 0.0, 0, 1), "CartPole-v1", derived=("twice = 2 * angle",))
    found = prove(policy, plant, asked)
    assert (found.sentence, found.work) == (plain.sentence, plain.work)


def test_derived_features_that_are_not_asked_for_change_nothing() -> None:
    asked = "avoids position >= 0.3 for 20 steps"
    nested = (VELOCITY, 1e-5, (POSITION, -0.9, RIGHT, LEFT), RIGHT)
    plain = prove(policy_of(nested), PLANT, asked)
    policy = policy_of(nested, derived=("turn = velocity - last(velocity)",))
    found = prove(policy, PLANT, asked)
    assert (found.sentence, found.work) == (plain.sentence, plain.work)


def test_what_boxes_do_not_tell_is_refused_by_name() -> None:
    policy = policy_of((DERIVED, 0.0, LEFT, RIGHT), derived=("turn = velocity - last(velocity)",))
    with pytest.raises(InvalidArgumentError, match=r"derived feature that asks for last\(\.\.\.\)"):
        prove(policy, PLANT)
    evasion = policy_of((3, 0.0, 0, 1), "eutree/Evasion2-v0", derived=("d = 2 * position",))
    plant = plant_of(EnvironmentSpec("eutree/Evasion2-v0"))
    assert plant is not None
    with pytest.raises(InvalidArgumentError, match="measured features to be proven in eutree/Evas"):
        prove(evasion, plant)
