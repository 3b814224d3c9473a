"""The features of a tree: the present observation, formulas of it, and some of the past.

    features of step t = o_t, o_{t-1}, ..., o_{t-H}, onehot(a_{t-1}), ..., onehot(a_{t-K})

the latest first. A direction of movement, for example, is not in one observation but in a few of
them; McCallum's U-Tree (1996) tests previous actions too. Before the first step the observations
repeat the first one, and no action was taken: all its entries are 0.

This is the one place in which the past is stacked: for the environment at the border, for recorded
episodes, and for policies, which keep a ``FeatureMap`` so that an export can name its inputs.
Policies that decide by the present features alone have their base class here.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from eutree.arrays import Booleans, Floats, Integers
from eutree.errors import InvalidArgumentError
from eutree.formulas import Formula, parse
from eutree.schema import Schema
from eutree.validation import check_integer


def threshold_between(low: float, high: float) -> float:
    """Return the midpoint of ``low < high``, or ``low`` where the midpoint rounds to an end.

    The result t satisfies ``low <= t < high`` for all finite float64, also one unit in the last
    place apart, so ``x <= t`` parts the two. Of two equal values it is that value. Kernels compile
    this same function.
    """
    middle = low / 2 + high / 2  # halves first: the sum of two large numbers would overflow
    return middle if low <= middle < high else low


def _begins(starts: ArrayLike | None, rows: Floats, state: Floats | None, size: int) -> Booleans:
    """Return whether each row [..., d] begins its episode, [..., 1]; a list may say it of one."""
    shape = rows.shape[:-1]
    begins = np.asarray(False if starts is None else starts, dtype=bool)
    told = ("state", state, [(*shape, size)]), ("episode_start", begins, [shape, shape or (1,), ()])
    for name, got, fits in told:
        if got is not None and np.shape(got) not in fits:
            raise InvalidArgumentError(f"{name} must have shape {fits[0]}, got {np.shape(got)}")
    return begins.reshape(1) if rows.ndim == 1 else begins[..., np.newaxis]


@dataclass(frozen=True)
class Derivation:
    """How the derived features of a schema are computed of those that are measured.

    Attributes:
        n_measured: Numbers that are measured at each step, m.
        formulas: One for each derived feature, in their order.
    """

    n_measured: int
    formulas: tuple[Formula, ...] = ()

    @classmethod
    def of(cls, schema: Schema) -> "Derivation":
        """Return the derivation that a schema of single observations declares."""
        names, first = schema.feature_names, schema.measured.n_features
        derived = enumerate(schema.derived, first)
        return cls(first, tuple(parse(one.formula, names[:j]) for j, one in derived))

    @property
    def remembered(self) -> tuple[int, ...]:
        """The features whose last values are asked for, in order."""
        asked = {one.index for formula in self.formulas for one in formula if one.kind == "last"}
        return tuple(sorted(asked))

    def rows(self, measured: Floats, before: Floats | None = None) -> Floats:
        """Return observations with their derived features, shape [..., d].

        Args:
            measured: The measured features, shape [..., m].
            before: The rows of one step before; None at the first step of an episode.
        """
        observed = measured[..., : self.n_measured]
        return self._with(observed, lambda now, j: now[j] if before is None else before[..., j])

    def after(self, measured: Floats, state: Floats | None, starts: ArrayLike | None) -> Floats:
        """Return observations [..., d] of the measured features, after those in a state.

        Args:
            measured: Shape [..., m].
            state: Begins with the observations of one step before; None at the first step.
            starts: Whether each observation is the first of its episode; None for none.
        """
        fresh = self.rows(measured)
        if state is None or not self.remembered:
            return fresh
        size = max((fresh.shape[-1], *np.shape(state)[-1:]))  # more may follow these rows
        begins = _begins(starts, fresh, state, size)
        return np.where(begins, fresh, self.rows(measured, state[..., : fresh.shape[-1]]))

    def of_episode(self, measured: Floats) -> Floats:
        """Return the observations of an episode [T + 1, m] with derived features, [T + 1, d]."""
        earlier = np.maximum(np.arange(len(measured)) - 1, 0)
        return self._with(measured, lambda now, j: now[j][earlier])

    def behind(self, observations: Floats) -> Floats:
        """Return observations [..., f] with the derived features that are not among them yet.

        Those may not ask for a step before. Observations of d numbers or more are complete, and of
        fewer than m nothing can be derived: they are returned as they are.
        """
        known = observations.shape[-1] - self.n_measured
        if not 0 <= known < len(self.formulas):
            return observations
        return self._with(observations, lambda now, j: now[j])

    def _with(self, known: Floats, last: Callable[[list[Floats], int], Floats]) -> Floats:
        """Return features with those not derived yet; ``last`` gives a column one step before."""
        columns = [known[..., j] for j in range(known.shape[-1])]
        for formula in self.formulas[len(columns) - self.n_measured :]:
            value = formula.compute(columns, partial(last, columns))
            columns.append(np.broadcast_to(value, known.shape[:-1]))
        return np.stack(columns, axis=-1)


def formulas_of(schema: Schema) -> dict[int, Formula]:
    """Return the formula of each derived feature by its place, behind all that it is made of.

    Those of earlier steps are of the features of these steps: so they are in the first one, too,
    which a ``FeatureMap`` repeats. What ``last`` was in the earliest step is not known.
    """
    known, names = Derivation.of(schema), schema.feature_names
    size, steps = known.n_measured + len(known.formulas), 1
    while names[steps * size :][:size] == tuple(f"{name}, {steps} ago" for name in names[:size]):
        steps += 1
    return {
        k * size + j: formula.ago(k, size, steps)
        for k in reversed(range(steps))
        for j, formula in enumerate(known.formulas, known.n_measured)
    }


def parts_of(features: Iterable[int], formulas: Mapping[int, Formula]) -> set[int]:
    """Return what some features are made of, and what these parts are made of."""
    made, parts = set(features), set[int]()
    for number in reversed(list(formulas)):
        if number in made | parts:
            parts |= {part.index for part in formulas[number] if part.kind == "feature"}
    return parts


@dataclass(frozen=True, kw_only=True)
class FeatureMap:
    """How observations and actions become the features of a tree.

    Attributes:
        n_observed: Numbers of one observation d.
        n_actions: Number of actions A.
        observations: Number of previous observations among the features, H.
        actions: Number of previous actions among the features, K.
    """

    n_observed: int
    n_actions: int
    observations: int = 0
    actions: int = 0

    def __post_init__(self) -> None:
        check_integer("observations", self.observations)
        check_integer("actions", self.actions)

    @property
    def n_features(self) -> int:
        """Number of features, d (H + 1) + A K."""
        return self.n_observed * (self.observations + 1) + self.n_actions * self.actions

    @property
    def is_identity(self) -> bool:
        """Whether the features are the observation, and nothing is remembered."""
        return not (self.observations or self.actions)

    def first(self, observation: Floats) -> Floats:
        """Return the features [..., n_features] of the first observation [..., d]."""
        none = np.zeros((*observation.shape[:-1], self.n_actions * self.actions))
        repeated = np.concatenate([observation] * (self.observations + 1), axis=-1)
        return np.concatenate([repeated, none], axis=-1)

    def next(self, features: Floats, action: int | Integers, observation: Floats) -> Floats:
        """Return the features after a step.

        Args:
            features: Those before it, shape [..., n_features].
            action: The action taken, or one for each row.
            observation: The observation that followed, shape [..., d].
        """
        seen = features[..., : self.n_observed * self.observations]
        if not self.actions:
            return np.concatenate([observation, seen], axis=-1)
        taken = features[..., self.n_observed * (self.observations + 1) :]
        latest = np.eye(self.n_actions)[action]
        taken = taken[..., : self.n_actions * (self.actions - 1)]
        return np.concatenate([observation, seen, latest, taken], axis=-1)

    def after(self, state: Floats | None, observation: Floats, starts: ArrayLike | None) -> Floats:
        """Return the features of observations [..., d], after those in a state.

        Args:
            state: The features of the step before, and the action that followed them if actions
                are remembered; None at the first step.
            observation: Shape [..., d].
            starts: Whether each observation is the first of its episode; None for none.
        """
        fresh, size = self.first(observation), self.n_features
        begins = _begins(starts, fresh, state, size + bool(self.actions))
        if state is None:
            return fresh
        action = state[..., size:].astype(np.int64).sum(axis=-1)  # none where none is remembered
        return np.where(begins, fresh, self.next(state[..., :size], action, observation))

    def of_episode(self, observations: Floats, actions: Integers) -> Floats:
        """Return the features at every observation of an episode, shape [T + 1, n_features].

        Args:
            observations: Shape [T + 1, d].
            actions: Shape [T].
        """
        moments = np.arange(len(observations))
        parts = [observations[np.maximum(moments - k, 0)] for k in range(self.observations + 1)]
        # Row -1, the last, stands for the actions before the episode.
        onehot = np.concatenate([np.eye(self.n_actions)[actions], np.zeros((1, self.n_actions))])
        parts += [onehot[np.maximum(moments - k, -1)] for k in range(1, self.actions + 1)]
        return np.concatenate(parts, axis=1)


class MemorylessPolicy(ABC):
    """SB3's ``predict`` around a decision by the present features alone."""

    reads_features = True  # it gets the vector of the environment's features, for any space

    @abstractmethod
    def decide(self, observations: Floats) -> Integers:
        """Return the actions for observations, [..., d] to [...]."""

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Integers, Any]:
        """Return the action for one observation [d], or those of a batch."""
        return self.decide(np.asarray(observation, dtype=np.float64)), state


class GreedyPolicy(MemorylessPolicy):
    """Takes the actions of the largest values."""

    @abstractmethod
    def action_values(self, observations: Floats) -> Floats:
        """Return the value of each action at observations [N, d], shape [N, A]."""

    def decide(self, observations: Floats) -> Integers:
        """Return the actions for one observation [d], or those of a batch."""
        values = self.action_values(np.atleast_2d(observations))
        actions: Integers = values.argmax(axis=1).reshape(observations.shape[:-1])
        return actions
