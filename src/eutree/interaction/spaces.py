"""The spaces that a tree can act in, and the meaning of their numbers.

Observations become vectors of float64: a Box is taken as it is, a Discrete value n becomes the
number n (an ordered attribute, split like a continuous one; see ``decoding`` for codes that mean
several things), MultiDiscrete and MultiBinary become
their entries, Dict and Tuple are laid end to end with names such as ``"lidar.front"``.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces, wrappers
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from eutree.arrays import Floats
from eutree.controls import Control
from eutree.errors import InvalidArgumentError, UnsupportedSpaceError, shown
from eutree.files.schema_document import plain_json
from eutree.interaction.action_grid import (
    ACTION_GRID,
    GriddedAction,
    bounds_of,
    grid_around,
    name_of,
    numbered,
    plain_grid,
    wrappers_of,
)
from eutree.interaction.decoding import DECODE, ONE_HOT, DecodedObservation, one_hot_around
from eutree.schema import (
    MAX_ACTIONS,
    MAX_FEATURES,
    EnvironmentSpec,
    Feature,
    Schema,
    combined_actions,
    numbered_actions,
)

MOST_SYMBOLS = 1024  # squares of a grid; a picture has more
NO_LIMIT = -1  # the value of ``gymnasium.make`` for no time limit

Encoder = Callable[[Any], Floats]
Decoder = Callable[[Floats], Any]

# Names and units of the observations of Gymnasium's own tasks, which do not say them themselves.
_KNOWN_FEATURES = {
    "CartPole": "position [m], velocity [m/s], angle [rad], turn rate [rad/s]",
    "MountainCar": "position, velocity",
    "Acrobot": "cos angle 1, sin angle 1, cos angle 2, sin angle 2, "
    "turn rate 1 [rad/s], turn rate 2 [rad/s]",
    "Pendulum": "cos angle, sin angle, turn rate [rad/s]",
    "Taxi": "row, column, passenger, destination",  # decoded
    "FrozenLake": "square",
    "FrozenLake8x8": "square",
    "CliffWalking": "square",
    "LunarLander": "x, y, x velocity, y velocity, angle [rad], turn rate, "
    "left leg down, right leg down",
}
_KNOWN_FLAGS = ("left leg down", "right leg down")
_KNOWN_ACTIONS: dict[str, tuple[str, ...]] = {
    "CartPole": ("left", "right"),
    "MountainCar": ("left", "coast", "right"),
    "Acrobot": ("clockwise", "none", "counterclockwise"),
    "Taxi": ("south", "north", "east", "west", "pick up", "drop off"),
    "FrozenLake": ("left", "down", "right", "up"),
    "FrozenLake8x8": ("left", "down", "right", "up"),
    "CliffWalking": ("up", "right", "down", "left"),
    "Blackjack": ("stick", "hit"),
    "LunarLander": ("nothing", "left engine", "main engine", "right engine"),
}


def describe(env: gymnasium.Env[Any, Any]) -> Schema:
    """Return names, units and bounds of the observations and names of the actions of ``env``.

    Names come from the environment's ``feature_names``, ``feature_units`` and ``action_names`` if
    it has them, from a small table for Gymnasium's own tasks, else they are ``x0, x1, ...`` and
    ``action_0, action_1, ...``: such as can be typed without quotes. Where a wrapper changes how
    many numbers are observed or their bounds, it alone may name them. Actions of a grid
    (``GriddedAction``), of a ``MultiDiscrete`` or ``MultiBinary`` are named by their levels;
    ``action_names`` may name the combinations, or the numbers that they are combined of. Whole
    numbers are known by the dtype of the space, flags by their bounds, 0 and 1; ``feature_kinds``
    tells the rest (``Schema.with_kinds``).

    Raises:
        UnsupportedSpaceError: The observations are not flat, or the actions cannot be numbered.
        InvalidArgumentError: The environment's own names or units are too few or too many.
    """
    env = numbered(env)
    derived, family = derived_around(env), name_of(env).split("/")[-1].split("-v")[0]
    namer, grid = namer_of(env), grid_around(env)
    of_task = family if namer is env.unwrapped else ""
    features = _features(env, namer, of_task) if derived is None else derived.schema.features
    controls = () if grid is None else grid.controls
    schema = Schema(features, _action_names(env, family, controls), controls)
    if derived is not None:
        return schema
    known = schema.feature_names if of_task in _KNOWN_FEATURES else ()
    flags = {name: "flag" for name in _KNOWN_FLAGS if name in known}
    return schema.with_kinds(getattr(namer, "feature_kinds", flags))


def namer_of(env: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any]:
    """Return whose names hold: the outermost wrapper that names or changes what is seen, or env."""
    namers = (one for one in wrappers_of(env) if hasattr(one, "feature_names") or _changes(one))
    return next(namers, env.unwrapped)


def _changes(wrapper: gymnasium.Wrapper[Any, Any, Any, Any]) -> bool:
    """Return whether a wrapper of others changes how many numbers are seen, or their bounds."""
    if isinstance(wrapper, DecodedObservation | wrappers.FlattenObservation):
        return False
    mine, theirs = (bounds_of(one.observation_space) for one in (wrapper, wrapper.env))
    if mine is None or theirs is None:
        return bool(wrapper.observation_space != wrapper.env.observation_space)
    same = np.shape(mine) == np.shape(theirs) and np.allclose(mine, theirs, rtol=1e-6, atol=0)
    return not same or isinstance(wrapper, wrappers.NormalizeObservation)


def _features(env: gymnasium.Env[Any, Any], namer: object, family: str) -> tuple[Feature, ...]:
    """Return the features that the environment observes itself."""
    flat, name = one_hot_around(env), name_of(env)
    if flat is None:
        features = _entries(env.observation_space, name)
    else:
        features = list(_one_hot(flat.env.observation_space, "", name))
    if not 1 <= len(features) <= MAX_FEATURES:
        raise UnsupportedSpaceError(
            f"{name} must observe from 1 to {MAX_FEATURES:,} numbers, got {len(features):,}"
        )
    known = [Feature.from_label(label) for label in _KNOWN_FEATURES.get(family, "").split(", ")]
    usual = known if len(known) == len(features) and known[0].name else features
    names = _given(env, namer, "feature_names", len(features))
    units = _given(env, namer, "feature_units", len(features))
    return tuple(
        replace(
            feature,
            name=like.name if names is None else str(names[k]),
            unit=like.unit if units is None else str(units[k]),
        )
        for k, (feature, like) in enumerate(zip(features, usual, strict=True))
    )


def _given(env: gymnasium.Env[Any, Any], namer: object, what: str, n: int) -> Sequence[Any] | None:
    """Return what ``namer`` calls n things; None where a wrapper made others of a space."""
    given: Sequence[Any] | None = getattr(namer, what, None)
    if given is None or len(given) == n:
        return given
    space = "action_space" if what == "action_names" else "observation_space"
    if getattr(env, space) is getattr(namer, space):
        raise InvalidArgumentError(f"{name_of(env)}: {what} must be {n} texts, got {shown(given)}")
    return None


def _one_hot(space: spaces.Space[Any], prefix: str, name: str) -> Iterator[Feature]:
    """Yield the features of a space that Gymnasium flattens: a group for each ``Discrete``."""
    if isinstance(space, spaces.Dict | spaces.Tuple):
        for key, part in _parts(space):
            yield from _one_hot(part, f"{prefix}.{key}" if prefix else key, name)
        return
    if isinstance(space, spaces.MultiDiscrete):
        space = spaces.MultiDiscrete(space.nvec.ravel(), start=space.start.ravel())
    is_choice = isinstance(space, spaces.Discrete | spaces.MultiDiscrete)
    entries = _entries(space if is_choice else spaces.utils.flatten_space(space), name)
    for entry in entries:
        own = prefix if prefix and len(entries) == 1 else f"{prefix}.{entry.name}".lstrip(".")
        if is_choice:
            for code in range(int(entry.low), int(entry.high) + 1):
                yield Feature(f"{own} is {code}", "", 0.0, 1.0, is_integer=True, group=own)
        else:
            yield replace(entry, name=own)


def derived_around(env: gymnasium.Env[Any, Any]) -> Any:
    """Return the ``DerivedObservation`` that the observations are of; None if there is none."""
    derived = next((one for one in wrappers_of(env) if "_derivation" in vars(one)), None)
    is_seen = derived is not None and derived.observation_space is env.observation_space
    return derived if is_seen else None


def spec_of(env: gymnasium.Env[Any, Any]) -> EnvironmentSpec | None:
    """Return how to make ``env`` again.

    With it go the arguments of ``gymnasium.make`` itself that differ from the environment's
    registration: its time limit, also where a ``TimeLimit`` was put around it by hand, and
    whether it is checked; whether its observations are decoded; and the grid of its actions, unless
    the registered environment itself sees to these two. None if it was not made by
    ``gymnasium.make``, or with arguments that no file holds, or if a wrapper around it makes the
    task another one: what was learned there means nothing without the wrapper.
    """
    spec = env.spec
    if spec is None:
        return None
    arguments = {key: value for key, value in spec.kwargs.items() if key != "render_mode"}
    usual = gymnasium.registry.get(spec.id)
    limiting = [one for one in wrappers_of(env) if isinstance(one, TimeLimit)]
    # Gymnasium has no public name for it.
    limit = min((int(one._max_episode_steps) for one in limiting), default=None)
    if limit != (None if usual is None else usual.max_episode_steps):
        arguments["max_episode_steps"] = NO_LIMIT if limit is None else limit
    if usual is not None and spec.disable_env_checker != usual.disable_env_checker:
        arguments["disable_env_checker"] = spec.disable_env_checker
    registered = {one.name for one in getattr(usual, "additional_wrappers", ())}
    for wrapper in wrappers_of(env):
        if isinstance(wrapper, OrderEnforcing | PassiveEnvChecker):
            break  # ``gymnasium.make`` puts these and all within around its environments
        if isinstance(wrapper, DecodedObservation):
            arguments[DECODE] = True
        elif wrapper is one_hot_around(env):
            arguments[ONE_HOT] = True
        elif isinstance(wrapper, GriddedAction) and wrapper is grid_around(env):
            arguments[ACTION_GRID] = plain_grid(wrapper.controls)
        elif _changes_meanings(wrapper) and type(wrapper).__name__ not in registered:
            return None
    try:
        return EnvironmentSpec(spec.id, plain_json(arguments, f"arguments of {spec.id}"))
    except InvalidArgumentError:
        return None


_HANDING_ON = (
    gymnasium.Wrapper, gymnasium.ActionWrapper, gymnasium.ObservationWrapper,
    wrappers.FrameStackObservation, wrappers.HumanRendering, wrappers.OrderEnforcing,
    wrappers.PassiveEnvChecker, wrappers.RecordEpisodeStatistics, wrappers.RecordVideo,
    wrappers.RenderCollection, wrappers.TimeAwareObservation, wrappers.TimeLimit,
)  # fmt: skip
# The ways to step that hand on the reward of each step of the environment inside, and no other, and
# those to begin that leave its start.
LEAVE_REWARDS = frozenset(kind.step for kind in _HANDING_ON)
_LEAVE_STARTS = frozenset(kind.reset for kind in _HANDING_ON)


def _changes_meanings(wrapper: gymnasium.Wrapper[Any, Any, Any, Any]) -> bool:
    """Return whether a wrapper makes a task another one, but for what a schema derives.

    It may change observations, actions, which of them are allowed, where episodes start, or what a
    step is. One that rewards in another way does not: who is to be told more of what to aim at is
    judged by the task's own rewards. Nor does one that begins elsewhere for the task's own sake.
    """
    kind, rewards = type(wrapper), isinstance(wrapper, gymnasium.RewardWrapper)
    same = rewards or getattr(kind, "same_task", False)
    listens = kind.__module__ == "stable_baselines3.common.monitor"
    return "_derivation" not in vars(wrapper) and (
        isinstance(wrapper, gymnasium.ObservationWrapper | gymnasium.ActionWrapper)
        or hasattr(wrapper, "action_masks")
        or wrapper.observation_space is not wrapper.env.observation_space
        or wrapper.action_space is not wrapper.env.action_space
        or not (listens or kind.step in LEAVE_REWARDS | {gymnasium.RewardWrapper.step})
        or not (listens or same or kind.reset in _LEAVE_STARTS)
    )


def is_matrix(space: spaces.Space[Any]) -> bool:
    """Return whether a space is a matrix of numbers, and no picture."""
    is_one = isinstance(space, spaces.Box | spaces.MultiBinary) and len(space.shape) > 1
    return is_one and not _is_picture(space)


def _is_picture(space: spaces.Space[Any]) -> bool:
    height, width = (*(space.shape or ()), 1, 1)[:2]
    return space.dtype == np.uint8 and height * width > MOST_SYMBOLS


def encoder(space: spaces.Space[Any]) -> Encoder:
    """Return the function that turns an observation of ``space`` into a float64 vector."""
    if isinstance(space, spaces.Dict):
        parts = [(key, encoder(part)) for key, part in space.spaces.items()]
        return lambda observation: np.concatenate([enc(observation[key]) for key, enc in parts])
    if isinstance(space, spaces.Tuple):
        encoders = [encoder(part) for part in space.spaces]
        return lambda observation: np.concatenate(
            [enc(part) for enc, part in zip(encoders, observation, strict=True)]
        )
    if space.shape == ():
        return lambda observation: _vector(observation)[np.newaxis]
    return _vector


def decoder(space: spaces.Space[Any]) -> Decoder:
    """Return the inverse of :func:`encoder`: from a float64 vector to an observation of ``space``.

    Encoded values come back in the dtypes of the space; integers beyond 2**53 are rounded.
    """
    if isinstance(space, spaces.Dict):
        keys, parts = list(space.spaces), spaces.Tuple(space.spaces.values())
        entries = decoder(parts)
        return lambda vector: dict(zip(keys, entries(vector), strict=True))
    if isinstance(space, spaces.Tuple):
        decoders = [decoder(part) for part in space.spaces]
        ends = np.cumsum([len(_entries(part, "")) for part in space.spaces])[:-1]
        return lambda vector: tuple(
            decode(piece) for decode, piece in zip(decoders, np.split(vector, ends), strict=True)
        )
    if isinstance(space, spaces.Discrete):
        return lambda vector: np.int64(vector[0])
    return lambda vector: vector.astype(space.dtype).reshape(space.shape)


def _vector(observation: Any) -> Floats:
    """Return the observation as a new array of real numbers."""
    array = np.asanyarray(observation)
    if array.dtype.kind == "c" or isinstance(array, np.ma.MaskedArray):
        raise TypeError("complex and masked arrays are no observations")
    if array.dtype.kind not in "biufO":  # NumPy would read numbers out of texts and dates
        raise TypeError(f"{array.dtype} is no kind of number")
    if array.dtype.kind == "O" and any(isinstance(item, str | bytes) for item in array.flat):
        raise TypeError("texts are no numbers")
    return np.array(array, dtype=np.float64)


def _action_names(
    env: gymnasium.Env[Any, Any], family: str, controls: tuple[Control, ...]
) -> tuple[str, ...]:
    """Return the names of actions that are numbers from 0."""
    n_actions = int(env.action_space.n)  # type: ignore[attr-defined]  # a Discrete
    if n_actions > MAX_ACTIONS:
        raise UnsupportedSpaceError(
            f"{name_of(env)} must have at most {MAX_ACTIONS:,} actions, got {n_actions:,}"
        )
    own = _given(env, env.unwrapped, "action_names", n_actions)
    for names in (own, _KNOWN_ACTIONS.get(family)):
        if names is not None and len(names) == n_actions:
            return tuple(str(name) for name in names)
    return combined_actions(controls) if controls else numbered_actions(n_actions)


# The annotation is text: `spaces.Tuple` is not generic in the oldest Gymnasium that is allowed.
def _parts(space: "spaces.Dict | spaces.Tuple[Any]") -> list[tuple[str, spaces.Space[Any]]]:
    items = space.spaces.items() if isinstance(space, spaces.Dict) else enumerate(space.spaces)
    return [(key if isinstance(key, str) else f"x{key}", part) for key, part in items]


def _entries(space: spaces.Space[Any], name: str) -> list[Feature]:
    """Return a feature without a unit for each entry of the encoded space."""
    if isinstance(space, spaces.Dict | spaces.Tuple):
        parts = _parts(space)
        # A part that must be left out is said before one that can be wrapped.
        texts_first = sorted(parts, key=lambda part: isinstance(part[1], spaces.Box))
        found = {key: _entries(part, name) for key, part in texts_first}
        return [
            replace(entry, name=key if len(found[key]) == 1 else f"{key}.{entry.name}")
            for key, _ in parts
            for entry in found[key]
        ]
    bounds = bounds_of(space)
    if bounds is None or len(space.shape or ()) > 1:
        raise UnsupportedSpaceError(
            f"{name} must have a flat Box, Discrete, MultiDiscrete or MultiBinary observation "
            f"space, got {shown(space)}: {_what_helps(space)}"
        )
    low, high = (bound.astype(np.float64).tolist() for bound in bounds)
    ends, whole = zip(low, high, strict=True), not np.issubdtype(space.dtype, np.floating)
    return [Feature(f"x{i}", "", *both, whole) for i, both in enumerate(ends)]


def _what_helps(space: spaces.Space[Any]) -> str:
    """Return a remedy for a space that holds pixels, symbols, a matrix or texts."""
    if not isinstance(space, spaces.Box | spaces.MultiDiscrete | spaces.MultiBinary):
        return "leave it out; of a Dict by gymnasium.wrappers.FilterObservation(env, OTHER_KEYS)"
    wrap = "wrap it with gymnasium.wrappers.FlattenObservation"
    if space.dtype != np.uint8:
        return wrap
    if not _is_picture(space):
        return f"{wrap}, if these are symbols, as MiniGrid's are, and no picture"
    return "a tree cannot learn from pixels: let the environment observe quantities instead"
