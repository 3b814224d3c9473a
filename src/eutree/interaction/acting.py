"""A policy acting in one environment, step by step, in any form of answers.

Trees and scripted experts read the environment's features (``GuardedEnv.schema``). Any other
policy, for example a model of Stable-Baselines3, was made for the environment's own observation
and gets that: the integer of a Discrete space, the dict of a Dict space, a Box in its own dtype.
Its ``predict`` may take the observation alone, and return the action alone.
"""

import inspect
from collections.abc import Callable
from copy import deepcopy
from typing import Any, cast

import gymnasium
import numpy as np

from eutree.arrays import Booleans, Floats
from eutree.errors import EutreeError, InvalidArgumentError, described, noted, shown
from eutree.interaction.guard import GuardedEnv
from eutree.interaction.spaces import derived_around
from eutree.policies import Policy
from eutree.schema import Schema
from eutree.validation import check_function

# The actor: a policy, a function that makes one for an environment, or a function from an
# observation to an action.
Controller = Policy | Callable[[Any], Any]
_KEYWORDS = ("state", "episode_start", "deterministic", "action_masks")
_OF_SB3 = frozenset(_KEYWORDS[:3])  # the keywords of its every policy


class Actor:
    """Decides at each step of an episode, and carries the policy's state from one to the next.

    The policy's ``predict`` is called by keyword, as Stable-Baselines3 does, with those of its
    keywords that it takes.
    """

    def __init__(self, policy: Policy, env: GuardedEnv) -> None:
        self._given, self._policy = policy, FullPolicy(policy)
        self._own = not getattr(policy, "reads_features", False)
        self._env = env
        schema = getattr(policy, "schema", None)
        derives = isinstance(schema, Schema) and bool(schema.derived)
        self._size = None if derives or not env.schema.derived else env.own_size
        self.start()

    def start(self) -> None:
        """Begin an episode: the next observation is its first."""
        self._state: Any = None
        self._first = True

    @property
    def remembers(self) -> bool:
        """Whether the policy carries something from one step to the next."""
        return self._state is not None

    def act(self, observation: Floats, allowed: Booleans | None = None) -> int:
        """Return the action at an observation as ``GuardedEnv`` gives it, shape [d].

        Where it is not allowed, and the policy knows of no masks, the one of the highest value if
        it has ``action_values``, else the first.

        Raises:
            InvalidArgumentError: The policy's answer means no action.
        """
        seen, masks = observation[: self._size], allowed
        if self._own:
            seen, masks = self._env.own_observation(observation), self._env.masks.own(allowed)
        chosen, self._state = self._policy.predict(
            seen, self._state, np.array(self._first), action_masks=masks
        )
        self._first = False
        number = self._env.number_of(chosen, "the answer of policy.predict", own=self._own)
        if allowed is None or allowed[number]:
            return number
        values = values_of(self._given, allowed.size, finite=False)  # of what is forbidden, -inf
        places = np.flatnonzero(allowed)
        found = np.zeros(allowed.size) if values is None else values(observation[np.newaxis])[0]
        return int(places[found[places].argmax()])


class FullPolicy:
    """A policy that takes all arguments of SB3's ``predict``, and answers with a pair as that does.

    Its own ``predict`` may take fewer, and return the action alone.
    """

    def __init__(self, policy: Policy) -> None:
        self.reads_features = bool(getattr(policy, "reads_features", False))
        self._policy = policy
        self._keywords = _taken(policy.predict)

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
        action_masks: Booleans | None = None,
    ) -> tuple[Any, Any]:
        """Return the action, and the policy's state for the next step."""
        known = zip(_KEYWORDS, (state, episode_start, deterministic, action_masks), strict=True)
        keywords = self._keywords & _OF_SB3 if action_masks is None else self._keywords
        taken = {key: value for key, value in known if key in keywords}
        try:
            chosen: Any = self._policy.predict(observation, **taken)
        except Exception:
            of: Any = getattr(self._policy, "_function", self._policy)
            of = of if inspect.isfunction(of) or inspect.ismethod(of) else type(of)
            with noted(of, f"the controller {of.__module__}:{of.__qualname__}"):
                raise
        return chosen if isinstance(chosen, tuple) and len(chosen) == 2 else (chosen, state)


def values_of(
    policy: object,
    n_actions: int,
    given: Callable[[Floats], Any] | None = None,
    *,
    finite: bool = True,
) -> Callable[..., Floats] | None:
    """Return a policy's method ``action_values``, or the one ``given``, with its answers checked.

    It is from features [N, d] to the value of each action [N, A]; None where there is none. Only
    values of what is ``allowed`` there, [N, A], if that is given too, must be finite.
    """
    name = "action_values" if given is not None else f"action_values of {type(policy).__name__}"
    values = getattr(policy, "action_values", None) if given is None else given
    if values is None:
        return None
    check_function(f"{name}, from observations [N, d] to values [N, A],", values)

    def checked(observations: Floats, allowed: Booleans | None = None) -> Floats:
        shape, cause = (len(observations), n_actions), None
        try:
            table: Floats = np.asarray(values(observations), dtype=np.float64)
            if table.shape == shape:
                known = table if allowed is None else table[allowed]
                if not finite or np.isfinite(known).all():
                    return table
            got = "one that is not finite" if table.shape == shape else f"shape {table.shape}"
        except Exception as error:  # of another author's function
            got, cause = described(error), error
        raise InvalidArgumentError(
            f"{name} must return for observations of shape {observations.shape}, measured features "
            f"first, finite numbers of shape {shape}, got {got}"
        ) from cause

    return checked


class FunctionPolicy:
    """A function from the environment's own observation to an action, as a policy.

    A doubt is the error that it raised when it was taken for a function of an environment.
    """

    def __init__(self, function: Callable[[Any], Any], doubt: str = "") -> None:
        self._function = function
        self._doubt = doubt

    def predict(self, observation: Any) -> tuple[Any, Any]:
        """Return its action for one observation.

        Raises:
            InvalidArgumentError: It takes neither an environment nor an observation.
        """
        try:
            answer = self._function(observation)
        except Exception as error:
            if not self._doubt:
                raise
            raise InvalidArgumentError(
                "a controller that is a function must take an environment and return a policy, or "
                f"take an observation and return an action: for the environment it raised "
                f"{self._doubt}, for an observation {type(error).__name__}: {error}"
            ) from error
        self._doubt = ""
        return answer if isinstance(answer, tuple) and answer[1:] == (None,) else (answer, None)


def as_policy(controller: Controller, env: gymnasium.Env[Any, Any] | None) -> Policy:
    """Return the policy: the controller itself, the one it makes for ``env``, or its answers.

    Raises:
        InvalidArgumentError: It is no controller.
    """
    if hasattr(controller, "predict") and not isinstance(controller, type):
        return controller
    if isinstance(controller, gymnasium.Env) or not callable(controller):
        raise InvalidArgumentError(
            "a controller must have a method predict, be a function that makes such a thing for "
            f"an environment, or one from an observation to an action, got {shown(controller)}"
        )
    derived = None if env is None else derived_around(env)
    env = env if derived is None else derived.env
    try:
        of_nothing = isinstance(controller, type) and not _wants_something(controller)
        policy = controller(*(() if of_nothing else (env,)))
    except EutreeError:
        if isinstance(controller, type) or not _takes_observations(controller, env):
            raise
        return cast(Policy, FunctionPolicy(controller))
    except Exception as error:  # a function of an observation may do anything with an environment
        if isinstance(controller, type):
            raise InvalidArgumentError(
                "a controller that is a class must be made of an environment or of nothing: "
                f"{controller.__name__} raised {type(error).__name__}: {error}"
            ) from error
        return cast(Policy, FunctionPolicy(controller, f"{type(error).__name__}: {error}"))
    if hasattr(policy, "predict"):
        return cast(Policy, policy)
    if _is_answer(policy):
        return cast(Policy, FunctionPolicy(controller))
    if callable(policy):
        return cast(Policy, FunctionPolicy(policy))
    raise InvalidArgumentError(
        f"{getattr(controller, '__name__', 'controller')}(env) must have a method predict "
        f"(RulePolicy(rule) makes one) or be a function of an observation, got {shown(policy)}"
    )


def trained_steps(controller: object) -> int | None:
    """Return the environment steps of a controller's training, if it counts them, as SB3 does."""
    own = getattr(controller, "num_timesteps", None)
    return own if isinstance(own, int) and own >= 0 else None


def _takes_observations(function: Callable[..., Any], env: gymnasium.Env[Any, Any] | None) -> bool:
    """Return whether a function has an action for an observation that could be."""
    space = deepcopy(env and env.observation_space)
    try:
        return _is_answer(function(space.sample()))  # type: ignore[union-attr]  # None: it does not
    except Exception:
        return False


def _is_answer(value: Any) -> bool:
    """Return whether a value could be an action: numbers, or a pair of that and None."""
    if isinstance(value, tuple) and value[1:] == (None,):
        value = value[0]
    return isinstance(value, int | float | np.generic | np.ndarray | list | tuple)


def _wants_something(kind: type) -> bool:
    """Return whether a class is made of an argument, as far as its signature says."""
    parameters = _parameters(kind)
    named_only = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.VAR_KEYWORD)
    return parameters is None or any(one.kind not in named_only for one in parameters)


def _taken(predict: Callable[..., Any]) -> frozenset[str]:
    """Return which of SB3's keywords a method takes; all where that cannot be known."""
    parameters = _parameters(predict)
    if parameters is None or any(one.kind is one.VAR_KEYWORD for one in parameters):
        return _OF_SB3
    return frozenset(_KEYWORDS) & {one.name for one in parameters}


def _parameters(called: Callable[..., Any]) -> list[inspect.Parameter] | None:
    try:
        return list(inspect.signature(called).parameters.values())
    except (TypeError, ValueError):
        return None
