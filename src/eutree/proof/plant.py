"""What a proof is about besides the policy: how boxes of states move.

A plant repeats the step of an environment on intervals (:mod:`eutree.proof.intervals`). Whether
it does so truly is for :func:`eutree.proof.check_plant` to test: real trajectories must stay in
its boxes.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import DTypeLike

from eutree.arrays import Floats, Integers
from eutree.errors import InvalidArgumentError, shown
from eutree.interaction import describe
from eutree.interaction.making import make
from eutree.policies import TreePolicy
from eutree.proof.certificate import Certificate
from eutree.proof.intervals import Intervals, Truth
from eutree.proof.properties import EpisodeProperty
from eutree.schema import EnvironmentSpec, Feature, Schema

State = Sequence[Intervals]  # one for each number of the state, each of N boxes


class Plant:
    """An environment on intervals; one's own overrides ``step`` and what else is different.

    Attributes:
        environment: How Gymnasium makes the environment.
        state: Names of the numbers that make up a state.
        start: Lower and upper bound of each of them when an episode begins.
        precision: Type of the environment's observations: a tree sees them rounded to it.
        limit: Steps after which an episode is cut short; None for never.
        reward: What each step earns, where all earn the same; None where they do not.
        grid: Lower bound, upper bound and number of cells of each number of a state, for what is
            to hold for ever; empty where that is not asked.
        axes: Combinations of the state, [d, d], along which a step turns next to nothing, with an
            exact inverse; empty where the starts are cut instead.
        cells: Width of a cell along each axis: what is reached together in one is one box.
        measures: Names of the numbers that the conditions of properties are about; those of the
            state by default.
        question: The property that is asked for by default.
        by_chance: Whether states move by chance without bounds: then it has no ``step``, and
            ``certify`` answers.
    """

    environment: EnvironmentSpec
    state: tuple[str, ...]
    start: tuple[tuple[float, float], ...]
    precision: ClassVar[DTypeLike] = np.float64
    limit: int | None = None
    reward: float | None = None
    grid: tuple[tuple[float, float, int], ...] = ()
    axes: tuple[tuple[float, ...], ...] = ()
    cells: tuple[float, ...] = ()
    measures: tuple[str, ...] = ()
    question: str = "arrives"
    by_chance: ClassVar[bool] = False

    def step(self, state: State, action: Integers) -> State:
        """Return where all states in N boxes are one step later.

        Args:
            state: The boxes.
            action: What is done in each of them, shape [N].
        """
        raise NotImplementedError

    def arrives(self, state: State) -> Truth:
        """Return whether states end an episode well: N statements."""
        return Truth(*[np.zeros(np.shape(state[0].low), dtype=bool)] * 2)

    def observe(self, state: State) -> State:
        """Return the features that a policy sees; a number that may be anything is unbounded."""
        return state

    def measure(self, state: State) -> State:
        """Return the numbers that conditions are about."""
        return state

    def certify(
        self, policy: TreePolicy, asked: EpisodeProperty, refinements: Sequence[int]
    ) -> Certificate | None:
        """Return the plant's own answer; None where boxes are to be followed.

        Args:
            policy: The policy.
            asked: The property.
            refinements: How many times finer than the plant's own cells are, one after the other.
        """
        return None

    def put(self, env: gymnasium.Env[Any, Any], point: Floats) -> Any:
        """Begin an episode of the real environment in a state [d]; return its observation."""
        env.reset(seed=0)
        env.unwrapped.state = point.copy()  # type: ignore[attr-defined]  # as Gymnasium's tasks
        return point.astype(self.precision)

    def state_of(self, env: gymnasium.Env[Any, Any]) -> Floats:
        """Return the state [d] in which the real environment is."""
        return np.array(env.unwrapped.state, dtype=np.float64)  # type: ignore[attr-defined]  # same

    @property
    def schema(self) -> Schema:
        """What the conditions of properties are about, as features."""
        features = tuple(map(Feature, self.measures or self.state))
        return Schema(features, ("act",))

    def make(self) -> gymnasium.Env[Any, Any]:
        """Return the real environment."""
        return make(self.environment)

    def check_fits(self, policy: TreePolicy) -> None:
        """Raise InvalidArgumentError unless the policy sees what this plant shows."""
        if not self.by_chance and type(self).step is Plant.step:
            raise InvalidArgumentError(
                f"plant must have a step that moves boxes, got {type(self).__name__} without one"
            )
        if not policy.features.is_identity:
            raise InvalidArgumentError(
                "a policy must decide by the present observation to be proven, got one that "
                f"remembers {policy.history} observations and {policy.past_actions} actions"
            )
        env = self.make()
        describe(env).check_same(policy.schema, "policy", of=str(self.environment))
        env.close()


def own_arguments(
    spec: EnvironmentSpec, known: Mapping[str, Any], limit: int | None
) -> tuple[dict[str, Any], int | None]:
    """Return the arguments of an environment that its plant knows, and the time limit.

    Raises:
        InvalidArgumentError: It has others: they may change anything.
    """
    arguments = dict(spec.arguments)
    arguments.pop("disable_env_checker", None)
    limit = arguments.pop("max_episode_steps", limit)
    for name in arguments:
        if name not in known:
            raise InvalidArgumentError(
                f"the plant of {spec.id} knows no argument {shown(name)}; it knows "
                f"{', '.join(known) or 'none'}"
            )
    return {**known, **arguments}, None if limit == -1 else limit
