"""The plant of a proof: how boxes of states move.

A plant repeats the step of an environment on intervals (:mod:`eutree.proof.intervals`). Whether
it does so truly is for :func:`eutree.proof.check_plant` to test: real trajectories must stay in
its boxes.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import DTypeLike

from eutree.arrays import Booleans, Floats, Integers
from eutree.envs import PLANTS
from eutree.errors import InvalidArgumentError, described, shown
from eutree.interaction import describe
from eutree.interaction.action_grid import ActionMasks
from eutree.interaction.making import make
from eutree.interaction.spaces import NO_LIMIT
from eutree.policies import TreePolicy
from eutree.proof.certificate import Certificate
from eutree.proof.intervals import Intervals, Truth, clip, cos, sin, where
from eutree.proof.properties import EpisodeProperty
from eutree.schema import EnvironmentSpec, Feature, Schema
from eutree.trees.text import derived_features
from eutree.validation import check_integer, check_kind, check_listed, check_number, check_range

State = Sequence[Intervals]  # one for each number of the state, each of N boxes
_SEEN = {"float32", "float64"}  # types of observations


class Plant:
    """An environment on intervals; one's own overrides ``step`` and any method that differs.

    Attributes:
        environment: How Gymnasium makes the environment.
        state: Names of the numbers that make up a state.
        start: Lower and upper bound of each of them when an episode begins.
        precision: Type of the environment's observations, float32 or float64; whole numbers are the
            latter.
        limit: Steps after which an episode is cut short, which are those of a property that names
            none; None for never, or where Gymnasium alone is to say so.
        reward: Reward of a step, where it is always the same; None where it is not.
        grid: Lower bound, upper bound and number of cells of each number of a state, for properties
            for ever; empty where none is asked.
        axes: Combinations of the state, [d, d], along which a step turns next to nothing, with an
            exact inverse; empty where the starts are cut instead, as they are for a plant that has
            an ``observe`` of its own.
        cells: Width of a cell along each axis: the states reached in one become one box.
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
            action: Number of the action in each of them, as a tree counts: from 0. Shape [N].
        """
        raise NotImplementedError

    def arrives(self, state: State) -> Truth:
        """Return whether states end an episode well: N statements."""
        return _never(state)

    def fails(self, state: State) -> Truth:
        """Return whether states end an episode otherwise: N statements.

        Where it may end so and this does not say it, ``step`` must leave the state as it is.
        """
        return _never(state)

    def ends(self, state: State) -> Truth:
        """Return whether states end an episode, well or otherwise."""
        return self.arrives(state) | self.fails(state)

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
            policy: Policy in question.
            asked: The property.
            refinements: How many times finer than the plant's own cells are, one after the other.
        """
        return None

    def put(self, env: gymnasium.Env[Any, Any], point: Floats) -> Any:
        """Begin an episode of the real environment in a state [d]; return its observation."""
        env.reset(seed=0)
        self.state_of(env)  # which refuses what has no such attribute
        env.unwrapped.state = point.copy()  # type: ignore[attr-defined]  # as Gymnasium's tasks
        seen = list(map(Intervals.of, self.observe([Intervals.of(x[None]) for x in point])))
        low, high = (
            np.concatenate([np.ravel(getattr(one, end)) for one in seen]).astype(self.precision)
            for end in ("low", "high")
        )
        if type(self).put is Plant.put and (low != high).any():
            raise InvalidArgumentError(
                f"{type(self).__name__} must have a method put of its own, which returns the "
                f"observation: observe says of {point.tolist()} only that it is in {seen}"
            )
        return low

    def state_of(self, env: gymnasium.Env[Any, Any]) -> Floats:
        """Return the state [d] in which the real environment is."""
        if (state := getattr(env.unwrapped, "state", None)) is None:
            raise InvalidArgumentError(
                f"{type(self).__name__} must have methods put and state_of of its own: "
                f"{self.environment} has no attribute state"
            )
        return np.array(state, dtype=np.float64)

    @property
    def schema(self) -> Schema:
        """The measures that conditions of properties are about, as features."""
        return Schema(tuple(map(Feature, self.measures or self.state)), ("act",))

    @property
    def time_limit(self) -> int | None:
        """Steps after which an episode is cut short, by the plant or by Gymnasium; None: never."""
        given, registered = self.environment.arguments, gymnasium.spec(self.environment.id)
        known = dict(given).get("max_episode_steps") or registered.max_episode_steps
        own = None if known == NO_LIMIT else known
        if self.limit is not None:
            check_integer(f"limit of {type(self).__name__}", self.limit, low=1)
        if None not in (own, self.limit) and own != self.limit:
            raise InvalidArgumentError(
                f"limit of {type(self).__name__} must be that of {self.environment}, {own} steps, "
                f"got {self.limit}"
            )
        return self.limit if own is None else own

    def make(self) -> gymnasium.Env[Any, Any]:
        """Return the real environment."""
        return make(self.environment)

    def check_fits(self, policy: TreePolicy) -> None:
        """Raise InvalidArgumentError unless the policy reads this plant's observations."""
        if missing := [one for one in ("environment", "state", "start") if not hasattr(self, one)]:
            what = f"plant must have {' and '.join(missing)}"
            raise InvalidArgumentError(f"{what}, got {type(self).__name__} without")
        if not self.by_chance and type(self).step is Plant.step:
            raise InvalidArgumentError(
                f"plant must have a step that moves boxes, got {type(self).__name__} without one"
            )
        if not check_kind("policy", policy, TreePolicy).features.is_identity:
            raise InvalidArgumentError(
                "a policy must decide by the present observation to be proven, got one that "
                f"remembers {policy.history} observations and {policy.past_actions} actions"
            )
        env = self.make()
        seen, measured = describe(env).measured, policy.schema.measured
        seen.check_same(measured, "policy", of=str(self.environment))
        self._check_derived(policy)
        if not self.by_chance:
            self._check_moves(policy.schema)
            self.check_seen(env, masked=policy.masked)
        env.close()

    def _check_derived(self, policy: TreePolicy) -> None:
        """Raise InvalidArgumentError for derived features that boxes do not tell."""
        known, asked = policy.derivation, derived_features(policy.tree, policy.schema)
        if not asked:
            return
        if any(known.formulas[j - known.n_measured].remembers for j in asked):
            raise InvalidArgumentError(
                "a policy must decide by the present observation to be proven, got one with a "
                "derived feature that asks for last(...)"
            )
        if type(self).certify is not Plant.certify:
            raise InvalidArgumentError(
                f"policy must decide by measured features to be proven in {self.environment}, "
                "whose plant has a proof of its own, got a tree that asks for derived ones"
            )

    def _check_moves(self, seen: Schema) -> None:
        """Raise InvalidArgumentError unless the starts are a box that every action moves."""
        names, kind, n = check_listed("state", self.state), type(self).__name__, seen.n_actions
        ends = [check_range(f"each start of {kind}", end) for end in self.start]
        try:
            boxes = [Intervals.between(*np.repeat([end], n, 0).T) for end in ends]
            moved, of_one = self.step(boxes, np.arange(n)), from_a_start(self, n)
            ended = {"arrives": self.arrives(moved), "fails": self.fails(moved)}
            observed, measured = self.observe(moved), self.measure(moved)
        except Exception as error:
            raise InvalidArgumentError(f"{kind} cannot move boxes: {described(error)}") from error
        if len(ends) != len(names):
            raise InvalidArgumentError(
                f"start of {kind} must have a range for each of {', '.join(names)}, got {len(ends)}"
            )
        _check_listed(f"step of {kind}", moved, names)
        if bad := [k for k, one in enumerate(moved) if np.shape(one.low) != (n,)]:
            words = f"step of {kind} must return an interval for each of {n} boxes"
            raise InvalidArgumentError(f"{words}, got {shown(moved[bad[0]])} for {names[bad[0]]}")
        _check_listed(f"observe of {kind}", observed, seen.measured.feature_names, Real, np.ndarray)
        _check_listed(f"measure of {kind}", measured, self.schema.feature_names, Real, np.ndarray)
        for name, found in ended.items():
            if not isinstance(found, Truth):
                words = f"{name} of {kind} must return a Truth of N statements"
                raise InvalidArgumentError(f"{words}, got {shown(found)}")
        if bad := [k for k, one in enumerate(of_one) if np.isnan([one.low, one.high]).any()]:
            words = f"step of {kind} must return bounds that are numbers"
            raise InvalidArgumentError(f"{words}, got nan for {names[bad[0]]}")

    def check_seen(self, env: gymnasium.Env[Any, Any], *, masked: bool = False) -> None:
        """Raise InvalidArgumentError where a tree sees or does what boxes do not tell."""
        _ = self.time_limit  # which refuses one that is not Gymnasium's
        seen, info = env.reset(seed=0)
        parts = seen.values() if isinstance(seen, dict) else seen
        kinds = [np.asarray(x).dtype for x in (parts if isinstance(seen, dict | tuple) else [seen])]
        types = {"float64" if one.kind in "biu" else one.name for one in kinds}
        asked = getattr(self.precision, "__name__", str(self.precision))
        if types != {asked} or asked not in _SEEN:
            raise InvalidArgumentError(
                f"precision of {type(self).__name__} must be the type of the observations of "
                f"{self.environment}, float32 or float64, got {shown(self.precision)} where they "
                f"are {' and '.join(sorted(types))}"
            )
        masks = ActionMasks(env)
        self.check_allowed(masks.now(info))
        env.action_space.seed(0)
        self.check_allowed(masks.now(env.step(env.action_space.sample())[4]))  # perhaps only now
        self.check_allowed(masked or None, "the policy (its file says masked)")

    def check_allowed(self, mask: Booleans | bool | None, of: str = "") -> None:
        """Raise InvalidArgumentError where a mask says which actions are allowed."""
        if mask is not None:
            words = f"all actions must be allowed everywhere for a proof; {of or self.environment}"
            raise InvalidArgumentError(f"{words} has masks")


def _never(state: State) -> Truth:
    """Return of states that what is asked is so in none of them: N statements."""
    return Truth(*[np.zeros(np.shape(Intervals.of(state[0]).low), dtype=bool)] * 2)


def from_a_start(plant: Plant, n_actions: int) -> State:
    """Return what each action makes of one start: wide intervals where a plant is disturbed."""
    point = [Intervals.of(np.full(n_actions, 0.6 * a + 0.4 * b)) for a, b in plant.start]
    return plant.step(point, np.arange(n_actions))


def _check_listed(method: str, found: Any, names: Sequence[str], *also: type) -> None:
    listed = list(found) if np.iterable(found) else []
    if len(listed) != len(names) or not all(isinstance(one, (Intervals, *also)) for one in listed):
        expected = f"{method} must return Intervals of {', '.join(names)}"
        raise InvalidArgumentError(f"{expected}, got {shown(found)}")


def own_arguments(
    spec: EnvironmentSpec, known: Mapping[str, Any], limit: int | None
) -> tuple[dict[str, Any], int | None]:
    """Return the arguments of an environment that its plant knows, and the time limit.

    As in Gymnasium, None asks for the registered ``limit``, and -1 for none.

    Raises:
        InvalidArgumentError: It has others: they may change anything.
    """
    arguments = dict(spec.arguments)
    arguments.pop("disable_env_checker", None)
    limit = arguments.pop("max_episode_steps", None) or limit
    for name in arguments:
        if name not in known:
            raise InvalidArgumentError(
                f"the plant of {spec.id} knows no argument {shown(name)}; it knows "
                f"{', '.join(known) or 'none'}"
            )
    return {**known, **arguments}, None if limit == NO_LIMIT else limit


Factory = Callable[[EnvironmentSpec], Plant]

_POLE_GRAVITY, _POLE_MASS, _TOTAL_MASS, _LENGTH = 9.8, 0.1, 0.1 + 1.0, 0.5
_POLE_MASS_LENGTH = _POLE_MASS * _LENGTH
_POLE_FORCE, _TAU = 10.0, 0.02
_EDGE, _FALL, _POLE_LIMIT = 2.4, 12 * 2 * math.pi / 360, 500
_STRUCK = 43691 / 65536  # m up the pole, nearly 2/3: there a push on the cart moves nothing


class CartPole(Plant):
    """A pole on a cart; ``gymnasium/envs/classic_control/cartpole.py``, Euler's method.

    Its axes are those of the upright pole. Along the first it falls, 8 % farther with every step,
    and along the second it comes to rest; the quarter stands for 1 / 3.97 s, for it is exact. The
    other two are the speed and the place of the point of the pole that a push on the cart does not
    move: sums of the angle over time.
    """

    state = ("position", "velocity", "angle", "angular_velocity")
    start = ((-0.05, 0.05),) * 4
    axes = (
        (0.0, 0.0, 1.0, 0.25), (0.0, 0.0, 1.0, -0.25), (0.0, 1.0, 0.0, _STRUCK),
        (1.0, 0.0, _STRUCK, 0.0),
    )  # fmt: skip
    cells = (0.004, 0.004, 0.1, 0.1)
    precision = np.float32
    question = f"stays in -{_EDGE} <= position <= {_EDGE} and -{_FALL!r} <= angle <= {_FALL!r}"

    def __init__(self, spec: EnvironmentSpec) -> None:
        _, self.limit = own_arguments(spec, {"sutton_barto_reward": False}, _POLE_LIMIT)
        self.environment = spec

    def step(self, state: State, action: Integers) -> State:
        """Push the cart to either side for a fiftieth of a second."""
        _, velocity, angle, turning = state
        force = _POLE_FORCE * (2.0 * action - 1.0)
        cosine, sine = cos(angle), sin(angle)
        push = (force + _POLE_MASS_LENGTH * turning.square() * sine) / _TOTAL_MASS
        bending = (_POLE_GRAVITY * sine - cosine * push) / (
            _LENGTH * (4.0 / 3.0 - _POLE_MASS * cosine.square() / _TOTAL_MASS)
        )
        moving = push - _POLE_MASS_LENGTH * bending * cosine / _TOTAL_MASS
        rates = (velocity, moving, turning, bending)
        return [one + _TAU * rate for one, rate in zip(state, rates, strict=True)]

    def fails(self, state: State) -> Truth:
        """Return whether the cart has left the track, or the pole has fallen."""
        place, _, angle, _ = state
        return ~((place >= -_EDGE) & (place <= _EDGE) & (angle >= -_FALL) & (angle <= _FALL))


_LEFT_END, _RIGHT_END = -1.2, 0.6
_MOST_SPEED = 0.07
_GOAL = 0.5
_CAR_FORCE, _CAR_GRAVITY = 0.001, 0.0025
_CAR_LIMIT = 200


class MountainCar(Plant):
    """A car in a valley; ``gymnasium/envs/classic_control/mountain_car.py``."""

    state = ("position", "velocity")
    start = ((-0.6, -0.4), (0.0, 0.0))
    precision = np.float32
    reward = -1.0

    def __init__(self, spec: EnvironmentSpec) -> None:
        arguments, self.limit = own_arguments(spec, {"goal_velocity": 0}, _CAR_LIMIT)
        self.environment = spec
        self._goal_velocity = check_number("goal_velocity", arguments["goal_velocity"])

    def step(self, state: State, action: Integers) -> State:
        """Push, roll, and stop at the left end."""
        position, velocity = state
        velocity = velocity + (cos(3 * position) * -_CAR_GRAVITY + (action - 1) * _CAR_FORCE)
        velocity = clip(velocity, -_MOST_SPEED, _MOST_SPEED)
        position = clip(position + velocity, _LEFT_END, _RIGHT_END)
        stops = (position <= _LEFT_END) & (velocity < 0.0)
        return position, where(stops, 0.0, velocity)

    def arrives(self, state: State) -> Truth:
        """Return whether the car is at the flag, and fast enough."""
        position, velocity = state
        return (position >= _GOAL) & (velocity >= self._goal_velocity)


_OWN: dict[str, Factory] = {"CartPole-v1": CartPole, "MountainCar-v0": MountainCar}


def register_plant(environment: str, factory: Factory) -> None:
    """Let ``eutree prove`` find the plant of an environment, by the environment's id.

    Args:
        environment: The id, such as ``"MyTank-v0"``; a namespace belongs to it, a module does not.
        factory: Returns the plant for the id and the arguments of ``gymnasium.make``.
    """
    PLANTS[environment] = factory


def plant_of(environment: EnvironmentSpec | str | None) -> Plant | None:
    """Return the plant of an environment, or of its id; None where none is known."""
    spec = EnvironmentSpec(environment) if isinstance(environment, str) else environment
    factory = None if spec is None else {**_OWN, **PLANTS}.get(spec.id.rpartition(":")[2])
    return None if spec is None or factory is None else factory(spec)
